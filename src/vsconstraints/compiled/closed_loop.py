"""Closed loop, compiled as a whole: step, law, unconstrained baseline, robot and records."""

from __future__ import annotations

import math

from ..rows import IntArray
from . import samples
from .codes import TOLERANCE
from .compiler import IN_PLACE, compiled, in_place, register_formulas
from .laws import apply_law, is_answer, load_law
from .memory import zeros
from .parts import call_int_pointer, checked, monotonic, struct_loader
from .samples import ALONE, LAW, STEP, Loop
from .signatures import INT, signature
from .workspace import Answer

register_formulas()


load_loop = struct_loader(zeros(Loop))


@in_place
def now(clock: IntArray) -> float:
    """Return the time of a monotonic clock [s], or 0 if no time is requested.

    ``clock`` is scratch of shape (2,), or (0,) if no time is requested.
    """
    return monotonic(clock) if clock.size else 0.0


@in_place
def law_solved(law_address: int, loop: Loop, answer: Answer) -> bool:
    """Run a law. Return False if Python has to run it.

    If the law commands joint speeds, the answer is replaced by the q̈ that reaches them.
    """
    code = apply_law(law_address, loop.rows, loop.task, answer)
    if not is_answer(code):
        return False
    commanded = load_law(law_address).speeds
    samples.go_to_speeds(loop.plant, commanded, loop.Ts[0], answer.qdd)
    return True


@checked(Loop)
@compiled(signature((INT, INT), INT, INT, INT, INT), IN_PLACE)
def run(loop_address: int, k: int, end: int, stage: int) -> tuple[int, int]:
    """Continue with sample k from the given stage until sample ``end``.

    Returns
    -------
    tuple
        The sample and its stage that Python has to execute; ``end`` and ``STEP`` if all is done.
    """
    loop = load_loop(loop_address)
    parts = loop.parts[0]
    evaluate = parts.evaluate
    believed = parts.believed
    true = parts.true
    q = loop.plant.x[0]
    qd = loop.plant.x[1]
    kept = loop.kept
    while k < end:
        at = k % len(kept.rows_time)
        if stage == STEP:
            t = k * loop.Ts[0]
            if evaluate == 0:
                return k, STEP
            if true != believed and call_int_pointer(evaluate, (true, t, q, qd)) != 0:
                return k, STEP
            # the simulated world precedes; the controller's time starts here
            sample = parts.sensing, true, believed, t, k
            if parts.observe != 0 and call_int_pointer(parts.observe, sample) != 0:
                return k, STEP
            started = now(loop.clock)
            if call_int_pointer(evaluate, (believed, t, q, qd)) != 0:
                return k, STEP
            kept.rows_time[at] = now(loop.clock) - started
            stage = LAW
        if stage == LAW:
            loop.alone[0] = math.nan
            started = now(loop.clock)
            if parts.law == 0 or not law_solved(parts.law, loop, loop.answer):
                return k, LAW
            kept.step_time[at] = now(loop.clock) - started
            stage = ALONE
        # the law may already have computed the baseline
        if stage == ALONE and math.isnan(loop.alone[0]):
            tracking = load_law(parts.baseline)
            task = loop.task
            tolerance = tracking.options[TOLERANCE]
            arguments = tracking.scratch, task.J, task.b, tolerance, task.rest, loop.alone
            call_int_pointer(tracking.track, arguments)
        samples.finish(loop, k)
        k = k + 1
        stage = STEP
        # Python reports an unbounded motion
        if parts.move != 0:
            code = call_int_pointer(parts.move, (parts.plant, loop.plant.x))
            if code != 0:
                return k, STEP
    return k, STEP
