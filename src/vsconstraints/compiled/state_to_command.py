"""From a state to a command: a control step and a law as one function for loops, compiled where both are."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..robots.geometry import Pose
from ..rows import Array, Command
from ..vision.camera import Camera
from . import entry, load
from .evaluation import CompiledEvaluation, Evaluation

if TYPE_CHECKING:
    from ..controllers import Controller
    from .control_step import ControlStep

FLOAT = np.dtype(np.float64)

StateToCommand = Callable[..., tuple[Evaluation, Command]]
"""From time [s], q and q̇ (n,), and ``pixels``, ``depth``, ``taken`` and ``camera`` if measured, to a command."""


def in_two_calls(control: ControlStep, controller: Controller) -> StateToCommand:
    """The step and then the law, each by its public call."""

    def in_two(t: float, q: Array, qd: Array, **measured: Any) -> tuple[Evaluation, Command]:
        evaluation = control.evaluate(t, q, qd, **measured)
        command = controller.command(evaluation.rows, evaluation.task)
        control.commanded(command.qdd)
        return evaluation, control.doubted(evaluation, command)

    return in_two


def in_one_call(control: ControlStep, controller: Controller) -> StateToCommand | None:
    """Step and law in one compiled call, with the options that the law has now; None where either runs in NumPy.

    What the compiled functions refuse is asked for by :func:`in_two_calls`.
    """
    step = control.bound()
    if step is None:
        return None
    size = step.packed.size
    law = controller.bind(step.now.rows, step.now.task, np.empty(size.m, dtype=np.bool_), np.empty(size.n))
    if law is None:
        return None
    kernels, packed, measure = load("from_state"), step.packed, step.measure
    both = partial(entry(kernels.command_by), kernels.EVALUATE, packed.address, law.address, law.answer)
    refused, answer, copied = kernels.REFUSED, law.command, step.out.copy
    constraints, unknown = control.constraints, np.full(size.M, np.nan)
    innovation, doubted = control.innovation, control.doubted
    undistort, in_two = undistortion(control.scene.camera, size.M), in_two_calls(control, controller)

    def in_one(
        t: float,
        q: Array,
        qd: Array,
        *,
        pixels: Array | None = None,
        depth: Array | None = None,
        taken: float | None = None,
        camera: Pose | None = None,
    ) -> tuple[Evaluation, Command]:
        code = refused
        try:
            # the compiled functions take type and dimension for granted, look at the rest by themselves, and would
            # make a number of a string
            plain = q.dtype is FLOAT and qd.dtype is FLOAT and q.ndim == 1 and qd.ndim == 1 and camera is None
            if pixels is None:
                plain = plain and depth is None and taken is None
            elif plain:
                Z, at = unknown if depth is None else depth, t if taken is None else taken
                plain = pixels.dtype is FLOAT and Z.dtype is FLOAT and pixels.ndim == 2 and Z.ndim == 1
                seen = pixels if undistort is None or not plain else undistort(pixels)
                plain = plain and seen is not None and not measure(seen, Z, at + 0.0, t + 0.0)
            # what is not so is asked for, and looked at, in Python
            if plain:
                code = both(t + 0.0, q, qd)
        except (AttributeError, TypeError):
            # not arrays
            pass
        if code == refused:
            return in_two(t, q, qd, pixels=pixels, depth=depth, taken=taken, camera=camera)
        evaluation = CompiledEvaluation(packed, constraints, copied())
        command = answer(code)
        if command is None:
            command = controller.command(evaluation.rows, evaluation.task)
            control.commanded(command.qdd)
        return evaluation, doubted(evaluation, command) if innovation[6] > 1.0 else command

    return in_one


def undistortion(camera: Camera, markers: int) -> Callable[[Array], Array | None] | None:
    """What gives ideal pixels (M, 2), or None where they cannot be undistorted; None without distortion."""
    if camera.distortion is None:
        return None
    through, eye = load("lenses").through(camera.distortion.model), np.array(camera.eye)
    ideal = np.empty((markers, 2))

    def undistort(pixels: Array) -> Array | None:
        return None if pixels.shape != ideal.shape or through(eye, pixels, ideal, True) else ideal

    return undistort
