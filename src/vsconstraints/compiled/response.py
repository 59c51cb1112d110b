"""How tracking answers to a reference that stands still.

A pair with :mod:`vsconstraints.controllers.response`: ``test_responses_alike_in_both_forms`` compares them.
"""

from __future__ import annotations

from ..formulas.tracking import gains, held_gains, held_rest, retargeted
from ..rows import Array, IntArray
from .compiler import IN_PLACE, compiled
from .parts import address, call_int_pointer, load_step
from .step import EVALUATE
from .task_priority import track
from .workspace import Scratch

__all__ = ["EVALUATE", "TRACK", "respond"]

TRACK = address(track)  #: Where the function begins that tracks.


@compiled(
    "int64(int64[::1], float64[::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], float64[::1])", IN_PLACE
)
def respond(
    parts: IntArray, numbers: Array, state: Array, reference: Array, work: Array, periods: Array, least: Array
) -> int:
    """Write the least −σ of each row by its scale to ``least`` (m,), and leave the step as it is at rest.

    ``parts`` (4,) are addresses of the functions that evaluate a step and that track, and of the step; and 0.
    ``numbers`` (4,) are the time now, the time at which it stands still [s], the rank tolerance, and how many steps of
    Newton end at rest. ``state`` (3, n) has q and q̇ now, and scratch for q̈. ``reference`` (k,) is s_ref less the
    feature's value at the goal, ``work`` scratch: of tracking, and k more. ``periods`` (N,) says how long each
    acceleration lasts [s]. Returns 0, or 1 where a state cannot be evaluated.
    """
    step, b, scratch = load_step(parts[2]), work[: len(reference)], Scratch(work[len(reference) :], parts[3:])
    options, rows, task = step.options[0], step.rows, step.task
    q, qd, qdd, t = state[0], state[1], state[2], numbers[0]
    N, last = len(periods), len(periods) + int(numbers[3])
    for k in range(last + 1):
        if call_int_pointer(parts[0], (parts[2], t, q, qd)) != 0:
            return 1
        if 0 < k <= N or k == last:
            for i in range(len(least)):
                least[i] = min(least[i], -rows.sigma[i] / rows.scale[i])
        if k == last:
            break
        far = near = 0.0
        for i in range(len(b)):
            far += task.error[i] * task.error[i]
            near += (task.error[i] - reference[i]) * (task.error[i] - reference[i])
        h = periods[min(k, N - 1)]
        now = gains(far, options.Kp0, options.slope, options.damping)
        Kp, Kv = gains(near, options.Kp0, options.slope, options.damping)
        then = held_gains(Kp, Kv, h)
        for i in range(len(b)):
            b[i] = reference[i] - task.error[i]
            if k < N:
                b[i] = retargeted(task.b[i], task.error[i], task.error_rate[i], reference[i], now, then)
        rest = task.rest[: len(task.rest) if k < N else 0]
        for j in range(len(rest)):
            rest[j] = held_rest(rest[j], qd[j], options.rest_damping, options.rest_stiffness, h)
        call_int_pointer(parts[1], (scratch, task.J, b, numbers[2], rest, qdd))
        for j in range(len(q)):
            if k < N:
                q[j] += h * (qd[j] + 0.5 * h * qdd[j])
                qd[j] += h * qdd[j]
            else:
                q[j] += qdd[j]
                qd[j] = 0.0
        if k < N:
            t = min(t + h, numbers[1])
    return 0
