"""From states to commands, and to rows and task at many states, in one call."""

from __future__ import annotations

from ..rows import Array
from .compiler import IN_PLACE, compiled
from .laws import apply_law, load_answer
from .parts import call_int_pointer, checked, load_step
from .workspace import NEEDS_PYTHON, Answer, LawArrays, Step

REFUSED = -1  #: The step cannot be evaluated: the NumPy form says why.


@checked(Step, LawArrays, Answer)
@compiled("int64(int64, int64, int64, float64, float64[::1], float64[::1])", IN_PLACE)
def command_by(step_address: int, law: int, answer_address: int, t: float, q: Array, qd: Array) -> int:
    """Evaluate a step at time t [s], q and q̇ (n,), and write the answer of a law; returns its code, or ``REFUSED``."""
    step, answer = load_step(step_address), load_answer(answer_address)
    if call_int_pointer(step.evaluate, (step_address, t, q, qd)) != 0:
        return REFUSED
    code: int = apply_law(law, step.rows, step.task, answer)
    if code != NEEDS_PYTHON:
        for j in range(len(step.limits.acceleration)):
            step.last_command[j] = answer.qdd[j]
    return code


@checked(Step)
@compiled("int64(int64, float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1])", IN_PLACE)
def predict(step_address: int, t: Array, q: Array, qd: Array, now: Array, out: Array) -> int:
    """Copy a step's output ``now`` (s,) at times t (N,) [s], q and q̇ (N, n) to ``out`` (N, s).

    Returns how many states there are before the first that cannot be evaluated.
    """
    evaluate = load_step(step_address).evaluate
    for k in range(len(t)):
        if call_int_pointer(evaluate, (step_address, t[k], q[k], qd[k])) != 0:
            return k
        for i in range(len(now)):
            out[k, i] = now[i]
    return len(t)
