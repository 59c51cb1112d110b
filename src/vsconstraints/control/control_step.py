"""The control step with a controller: from the state of the joints to a command."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compiled import load
from ..robots.geometry import Pose
from ..rows import Array, Command
from ..vision.camera import Camera
from .evaluator import Evaluation, Evaluator
from .model import Model

if TYPE_CHECKING:
    from ..controllers.base import Controller

FLOAT = np.dtype(np.float64)

#: From time [s], q and q̇ (n,), and ``pixels``, ``depth``, ``taken`` and ``camera`` if measured, to a command.
StateToCommand = Callable[..., tuple[Evaluation, Command]]


class ControlStep(Evaluator):
    """An :class:`Evaluator`, which says what it takes, and controllers on what it gives."""

    _controller: Controller | None = None
    _options: dict[str, Any] | None = None

    def model(self, estimate: Any = None, gradient_error: Any = None) -> Model:
        """Rows and task at predicted states: see :class:`~vsconstraints.control.model.Model`."""
        return Model(self, estimate, gradient_error)

    def command(
        self, controller: Controller, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        """From state to command: as :meth:`evaluate` and then ``controller.command``, errors too.

        ``measured`` are ``pixels``, ``depth``, ``taken`` and ``camera`` of :meth:`evaluate`.
        """
        options = self._options
        try:
            changed = options is not None and _options_of(controller) != options
        except ValueError:
            # arrays of its own do not compare
            changed = True
        if changed or controller is not self._controller:
            self.bind(controller)
        return self._to_command(t, q, qd, **measured)

    def bind(self, controller: Controller) -> StateToCommand:
        """Make a function for loops that does as :meth:`command`, for this controller with its present options.

        Where step and law are compiled, they run on arrays that stay where they are, and only results are copied. A law
        that uses a model is given one, by a reset; it belongs to this step from then on.
        """
        if "model" in controller.uses and controller is not self._controller:
            reset: Callable[..., None] = controller.reset
            reset(model=self.model())
        in_one = self._in_one_call(controller)
        self._controller, self._to_command = controller, in_one or partial(self._in_two_calls, controller)
        # only a law that is bound has options that were read beforehand
        self._options = None if in_one is None else _options_of(controller)
        return self._to_command

    def _in_two_calls(
        self, controller: Controller, t: float, q: Array, qd: Array, **measured: Any
    ) -> tuple[Evaluation, Command]:
        evaluation = self.evaluate(t, q, qd, **measured)
        command = controller.command(evaluation.rows, evaluation.task)
        self.commanded(command.qdd)
        return evaluation, self._with_doubts(evaluation, command)

    def _with_doubts(self, evaluation: Evaluation, command: Command) -> Command:
        doubts = self.doubts(evaluation)
        return replace(command, remark="; ".join(filter(None, (command.remark, doubts)))) if doubts else command

    def _in_one_call(self, controller: Controller) -> StateToCommand | None:
        """Step and law in one compiled call; None where either runs in NumPy.

        What the compiled functions refuse is left to :meth:`_in_two_calls`.
        """
        step = self.bound()
        if step is None:
            return None
        size, law = step.packed.size, step.bind(controller)
        if law is None:
            return None
        kernels, packed, measure, innovation = load("from_state"), step.packed, step.measure, self.innovation
        both = kernels.command_by.bind(packed.workspace, law.workspace, law.answer)
        refused, answer, copied, constraints = kernels.REFUSED, law.command, step.out.copy, self.constraints
        undistort, unknown = undistortion(self.scene.camera, size.M), np.full(size.M, np.nan)
        in_two, with_doubts = partial(self._in_two_calls, controller), self._with_doubts

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
                # compiled functions take type and dimension for granted, look at the rest by themselves, and would
                # make a number of a string
                plain = q.dtype is FLOAT and qd.dtype is FLOAT and q.ndim == 1 and qd.ndim == 1 and camera is None
                if pixels is None:
                    plain = plain and depth is None and taken is None
                elif plain:
                    Z, at = unknown if depth is None else depth, t if taken is None else taken
                    plain = pixels.dtype is FLOAT and Z.dtype is FLOAT and pixels.ndim == 2 and Z.ndim == 1
                    seen = pixels if undistort is None or not plain else undistort(pixels)
                    plain = plain and seen is not None and not measure(seen, Z, at + 0.0, t + 0.0)
                if plain:
                    code = both(t + 0.0, q, qd)
            except (AttributeError, TypeError):
                # not arrays
                pass
            if code == refused:
                return in_two(t, q, qd, pixels=pixels, depth=depth, taken=taken, camera=camera)
            evaluation = Evaluation(packed, constraints, copied())
            command = answer(code)
            if command is None:
                command = controller.command(evaluation.rows, evaluation.task)
                self.commanded(command.qdd)
            return evaluation, with_doubts(evaluation, command) if innovation[6] > 1.0 else command

        return in_one


def _options_of(controller: Controller) -> dict[str, Any]:
    """Its attributes, and those of the law that it asks, if there is one."""
    return {**vars(vars(controller).get("law", controller)), **vars(controller)}


def undistortion(camera: Camera, markers: int) -> Callable[[Array], Array | None] | None:
    """Ideal pixels (M, 2) of distorted ones, or None where they cannot be undistorted; None without distortion."""
    if camera.distortion is None:
        return None
    through, eye = load("lenses").through(camera.distortion.model), np.array(camera.eye)
    ideal = np.empty((markers, 2))

    def undistort(pixels: Array) -> Array | None:
        return None if pixels.shape != ideal.shape or through(eye, pixels, ideal, True) else ideal

    return undistort
