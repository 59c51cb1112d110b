"""Commands, rows and tasks computed from given states, in one call."""

from __future__ import annotations

from ..rows import Array
from .codes import NEEDS_PYTHON
from .compiler import IN_PLACE, compiled, in_place
from .laws import apply_law, load_answer
from .linear import copy_vector
from .parts import call_int_pointer, checked, load_step
from .signatures import FLOAT, INT, MATRIX, VECTOR, signature
from .workspace import Answer, LawArrays, Step

REFUSED = -1  #: The step cannot be evaluated; the NumPy version reports the reason.


@in_place
def start_from(loop: int, predicting: int, now: Array) -> None:
    """Write the loop's current state to ``now``, and copy its memory to the predicting step.

    ``now`` (1 + 2n,) receives t, q and q̇. ``loop`` and ``predicting`` are addresses of steps.
    """
    source = load_step(loop)
    target = load_step(predicting)
    n = now.size // 2
    now[0] = source.time[0]
    for j in range(n):
        now[1 + j] = source.q[j]
        now[1 + n + j] = source.qd[j]
    target.last[0].goal = source.last[0].goal
    target.last[0].time = source.last[0].time
    copy_vector(target.last_error, source.last_error)
    copy_vector(target.last_partial, source.last_partial)
    copy_vector(target.last_command, source.last_command)
    copy_rows(target.last_J, source.last_J)
    copy_rows(target.correction, source.correction)


@in_place
def copy_rows(target: Array, source: Array) -> None:
    """Copy a matrix to another one of the same shape."""
    for i in range(source.shape[0]):
        copy_vector(target[i], source[i])


@checked(Step, LawArrays, Answer)
@compiled(signature(INT, INT, INT, INT, FLOAT, VECTOR, VECTOR), IN_PLACE)
def command_by(
    step_address: int, law: int, answer_address: int, t: float, q: Array, qd: Array
) -> int:
    """Evaluate a step at time t [s], q and q̇ (n,), and write the answer of a law.

    Return the law's code, or ``REFUSED``.
    """
    step = load_step(step_address)
    answer = load_answer(answer_address)
    if call_int_pointer(step.evaluate, (step_address, t, q, qd)) != 0:
        return REFUSED
    code: int = apply_law(law, step.rows, step.task, answer)
    if code != NEEDS_PYTHON:
        for j in range(len(step.limits.acceleration)):
            step.last_command[j] = answer.qdd[j]
    return code


@checked(Step)
@compiled(signature(INT, INT, VECTOR, MATRIX, MATRIX, VECTOR, MATRIX), IN_PLACE)
def predict(step_address: int, t: Array, q: Array, qd: Array, now: Array, out: Array) -> int:
    """Write a step's outputs at N states to ``out`` (N, s).

    The states are times t (N,) [s], q and q̇ (N, n). ``now`` (s,) is the step's output. Return the
    number of states before the first that cannot be evaluated.
    """
    evaluate = load_step(step_address).evaluate
    for k in range(len(t)):
        if call_int_pointer(evaluate, (step_address, t[k], q[k], qd[k])) != 0:
            return k
        for i in range(len(now)):
            out[k, i] = now[i]
    return len(t)
