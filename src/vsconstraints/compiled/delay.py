"""Compiled delay compensation: a law applied to the state in which its command begins to act."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..rows import Array
from .codes import NEEDS_PYTHON
from .compiler import IN_PLACE, compiled, in_place
from .from_state import start_from
from .laws import RESOLVER, answer_without_baseline, apply_law, is_answer, load_law, within
from .memory import zeros
from .parts import call_int_pointer, load_step, set_fields, struct_loader
from .workspace import Answer, RowArrays, TaskArrays


class DelayArrays(NamedTuple):
    """Pending commands of n joints, and the law that computes new ones."""

    #: Addresses of the law, of the step in the loop, and of the predicting step; 0 if Python
    #: predicts.
    law: int
    loop: int
    step: int
    frozen: int  #: 1 if everything is predicted at the current time.
    speeds: int  #: 1 if the law commands joint speeds.
    #: 1 if the joints have commanded speeds as soon as they act; 0 if the arm takes accelerations,
    #: and reaches them within a period.
    at_once: int
    #: T_s, delay of commands, and remaining duration of the first pending command [s].
    period: float
    delay: float
    first: float
    #: Pending commands, in the order in which they act: q̈; or, if ``at_once``, q̇ with NaN where
    #: there was no command.
    sent: Annotated[Array, "commands n"]
    now: Annotated[Array, "2n+1"]  #: t, q, q̇.
    #: Predicted rows with the current limits of q̈, and the answer to them.
    ahead: RowArrays
    answer: Answer

    @classmethod
    def of(
        cls,
        n: int,
        addresses: tuple[int, int, int],
        frozen: bool,
        period: float,
        delay: tuple[int, float],
        speeds: bool = False,
        at_once: bool = False,
    ) -> DelayArrays:
        """Return arrays whose pending commands leave the speeds of the joints as they are.

        ``delay`` is a number of whole periods and the rest [s]. ``speeds`` and ``at_once`` are the
        fields of these names.
        """
        law, loop, step = addresses
        whole, rest = delay
        under_way = whole
        first = period
        if rest > 0.0 or whole == 0:
            under_way = whole + 1
            first = rest
        known = {
            "law": law,
            "loop": loop,
            "step": step,
            "frozen": int(frozen),
            "speeds": int(speeds),
            "at_once": int(at_once),
            "period": period,
            "delay": whole * period + rest,
            "first": first,
            "sent": np.full((under_way, n), math.nan if at_once else 0.0),
            # their arrays are set in each sample
            "ahead": zeros(RowArrays),
            "answer": zeros(Answer),
        }
        arrays: DelayArrays = zeros(cls, {"2n+1": 2 * n + 1}, known)
        return arrays


load_delay = struct_loader(zeros(DelayArrays))


@in_place
def foresee(own: DelayArrays) -> None:
    """Advance the state ``own.now`` to the time at which a command issued now begins to act."""
    commands, n = own.sent.shape
    if own.frozen == 0:
        own.now[0] += own.delay
    for k in range(commands):
        T = own.period if k > 0 else own.first
        for j in range(n):
            command = own.sent[k, j]
            qd = own.now[1 + n + j]
            if own.at_once == 1:
                qd = qd if math.isnan(command) else command
                own.now[1 + j] += T * qd
            else:
                own.now[1 + j] += T * (qd + 0.5 * T * command)
                qd += T * command
            own.now[1 + n + j] = qd


@in_place
def pending_command(own: DelayArrays, rows: RowArrays, j: int, command: float) -> float:
    """Return the entry of ``own.sent`` for a command q̈ or q̇ of joint j.

    An arm that takes accelerations goes to a commanded q̇ from the one that it has then, which is
    that of ``own.now``.
    """
    if own.at_once == 1:
        return command
    if own.speeds == 0:
        return within(rows, j, command)
    # without a command, the speed stays as it is
    change = 0.0
    if not math.isnan(command):
        change = command - own.now[1 + own.sent.shape[1] + j]
    return within(rows, j, change / own.period)


@in_place
def send(own: DelayArrays, rows: RowArrays, command: Array) -> None:
    """Append a command, q̈ or q̇ (n,), to the pending ones.

    ``own.now`` is the state in which it begins to act, as after :func:`foresee`.
    """
    commands, n = own.sent.shape
    for j in range(n):
        for k in range(1, commands):
            own.sent[k - 1, j] = own.sent[k, j]
        own.sent[commands - 1, j] = pending_command(own, rows, j, command[j])


@compiled(RESOLVER, IN_PLACE, from_python=False)
def compensate(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.DelayCompensated`."""
    own = load_delay(load_law(address).demand)
    n = answer.qdd.size
    start_from(own.loop, own.step, own.now)
    foresee(own)
    step = load_step(own.step)
    q = own.now[1 : 1 + n]
    qd = own.now[1 + n :]
    if call_int_pointer(step.evaluate, (own.step, own.now[0], q, qd)) != 0:
        return NEEDS_PYTHON
    then = step.rows
    set_fields(
        own.ahead,
        (
            then.phi,
            then.Lg,
            then.Lf,
            then.sigma,
            then.sigma_dot,
            then.K,
            then.switching_gain,
            then.scale,
            rows.qdd_min,
            rows.qdd_max,
        ),
    )
    # the baseline of the predicted state is not that of the current one: do not report it
    answer_without_baseline(own.answer, answer)
    code = apply_law(own.law, own.ahead, step.task, own.answer)
    if is_answer(code):
        command = answer.qdd
        if own.speeds == 1:
            command = load_law(own.law).speeds
        send(own, rows, command)
    return code
