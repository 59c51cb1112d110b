"""From a state to a command in one call: the step, and then a law, each found by its address."""

from __future__ import annotations

from ..rows import Array
from .compiler import IN_PLACE, compiled
from .laws import apply_law, load_answer
from .parts import address, call_int_pointer, load_step
from .step import evaluate_step
from .structures import NEEDS_PYTHON

EVALUATE = address(evaluate_step)
"""Where the function begins that evaluates a step."""

REFUSED = -1
"""The step cannot be evaluated: the definition says why."""


@compiled("int64(int64, int64, int64, int64, float64, float64[::1], float64[::1])", IN_PLACE)
def command_by(evaluate: int, step: int, law: int, answer: int, t: float, q: Array, qd: Array) -> int:
    """Evaluate a step at time t [s], q and q̇ (n,), and carry out a law; returns the law's code, or ``REFUSED``.

    The first argument is ``EVALUATE``. What it writes is the :class:`.Answer` at that address.
    """
    if call_int_pointer(evaluate, (step, t, q, qd)) != 0:
        return REFUSED
    now, given = load_step(step), load_answer(answer)
    code: int = apply_law(law, now.rows, now.task, given)
    if code != NEEDS_PYTHON:
        for j in range(len(now.limits.acceleration)):
            now.last_command[j] = given.qdd[j]
    return code
