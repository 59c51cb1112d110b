"""The closed loop, compiled whole: step, law, tracking alone beside it, robot, and what is kept of
a run.
"""

from __future__ import annotations

import math

from ..rows import IntArray
from . import samples
from .compiler import IN_PLACE, compiled, in_place, register_formulas
from .laws import apply_law, load_law
from .parts import call_int_pointer, checked, monotonic, struct_loader
from .samples import ALONE, LAW, STEP, Loop
from .workspace import RELAXED_ROWS, SOLVED, Answer, zeros

for name in (
    "put", "hold", "saturate", "judge_contact", "mark_acting", "camera_error", "feature_error", "fastest", "score",
    "finish",
):  # fmt: skip
    in_place(getattr(samples, name))
register_formulas()


load_loop = struct_loader(zeros(Loop))


@in_place
def now(clock: IntArray) -> float:
    """Time of a clock that only goes forward [s], or 0 where nobody asks; ``clock`` (2,) or (0,) is
    scratch.
    """
    return monotonic(clock) if clock.size else 0.0


@in_place
def law_solved(law_address: int, loop: Loop, answer: Answer) -> bool:
    """Run a law; False if Python has to run it."""
    code = apply_law(law_address, loop.rows, loop.task, answer)
    return code == SOLVED or code >= RELAXED_ROWS


@checked(Loop)
@compiled("UniTuple(int64, 2)(int64, int64, int64, int64)", IN_PLACE)
def run(loop_address: int, k: int, end: int, stage: int) -> tuple[int, int]:
    """Go on with sample k, from that stage, until sample ``end``.

    Returns
    -------
    tuple
        The sample, and its stage that Python has to do; ``end`` and ``STEP`` if all is done.
    """
    loop = load_loop(loop_address)
    evaluate, believed, true, law, alone, observe, sensing, move, moved = loop.parts
    q = loop.plant.x[0]
    qd = loop.plant.x[1]
    kept = loop.kept
    while k < end:
        at = k % len(kept.rows_time)
        if stage == STEP:
            t = k * loop.Ts[0]
            if evaluate == 0 or (
                true != believed and call_int_pointer(evaluate, (true, t, q, qd)) != 0
            ):
                return k, STEP
            # what comes before is the world's part, not the control's
            if observe != 0 and call_int_pointer(observe, (sensing, true, believed, t, k)) != 0:
                return k, STEP
            started = now(loop.clock)
            if call_int_pointer(evaluate, (believed, t, q, qd)) != 0:
                return k, STEP
            kept.rows_time[at] = now(loop.clock) - started
            stage = LAW
        if stage == LAW:
            loop.alone[0] = math.nan
            started = now(loop.clock)
            if law == 0 or not law_solved(law, loop, loop.answer):
                return k, LAW
            kept.step_time[at] = now(loop.clock) - started
            stage = ALONE
        # unless the law has found it on its way
        if stage == ALONE and math.isnan(loop.alone[0]):
            tracking = load_law(alone)
            task = loop.task
            call_int_pointer(
                tracking.track,
                (tracking.scratch, task.J, task.b, tracking.options[0], task.rest, loop.alone),
            )
        samples.finish(loop, k)
        k = k + 1
        stage = STEP
        # an unbounded motion is for Python to report
        if move != 0 and call_int_pointer(move, (moved, loop.plant.x)) != 0:
            return k, STEP
    return k, STEP
