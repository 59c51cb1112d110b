"""The compiled step at states one after the other: see :class:`vsconstraints.control.model.Model`."""

from __future__ import annotations

from ..rows import Array
from .compiler import IN_PLACE, compiled
from .parts import address, call_int_pointer
from .step import evaluate_step
from .structures import Step, demand_packed

EVALUATE = address(evaluate_step)
"""Where the function begins that evaluates a step."""


@compiled(
    "int64(int64, int64, float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1])", IN_PLACE
)
def predict_by(evaluate: int, step: int, t: Array, q: Array, qd: Array, now: Array, out: Array) -> int:
    """Copy what a step comes to, ``now`` (s,), at times t (N,) [s], q and q̇ (N, n) to ``out`` (N, s).

    Returns how many states there are before the first that cannot be evaluated.
    """
    for k in range(len(t)):
        if call_int_pointer(evaluate, (step, t[k], q[k], qd[k])) != 0:
            return k
        for i in range(len(now)):
            out[k, i] = now[i]
    return len(t)


def predict(step: int, t: Array, q: Array, qd: Array, now: Array, out: Array) -> int:
    """As :func:`predict_by`, for the step at an address."""
    demand_packed(step, Step)
    N: int = predict_by(EVALUATE, step, t, q, qd, now, out)
    return N
