"""One control step up to the controller: rows and task from time, coordinates and speeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .constraints import Constraint, ConstraintSet, RowBlock
from .errors import InvalidInput, SceneError
from .evaluation import Bound, CompiledEvaluation, DefinedEvaluation, Evaluation
from .kernels import load
from .rows import Array, BoolArray, Command
from .scene import Scene, State
from .tracking import VisualTask

if TYPE_CHECKING:
    from .controllers import Controller
    from .kernels.packing import Packed

FLOAT = np.dtype(np.float64)

StateToCommand = Callable[[float, Array, Array], tuple[Evaluation, Command]]
"""From time [s], q and q̇ (n,) to what they come to."""


class ControlStep:
    """Evaluates a scene, its constraints and its task together: at compiled speed where all of them have that form.

    The NumPy form, ``scene.evaluate``, ``constraints.rows`` and ``task.evaluate``, is the definition. It runs where
    there is no compiler, where the scene or the task has no compiled form, and where the compiled form cannot answer:
    then it says why. Constraints without a compiled form (own ones, for example) give their rows in NumPy beside the
    compiled ones of the others.

    Constraints and task are compiled with the options that they have when a step is made. A step keeps scratch: threads
    need one each.

    Parameters
    ----------
    scene, constraints, task
        What is evaluated.
    told
        Whether motions that controllers are not told of (section 5.4) count as known. If not, such an object is where
        it is, but its velocity is taken for zero.

    Attributes
    ----------
    not_compiled
        Why the NumPy form runs for all; empty if the compiled one does.
    """

    def __init__(self, scene: Scene, constraints: ConstraintSet, task: VisualTask, *, told: bool = False) -> None:
        self.scene, self.constraints, self.visual_task = scene, constraints, task
        self.not_compiled = ""
        self._believes = not told and has_unknown_motion(scene, constraints)
        self._packed: Packed | None = None
        self._controller: Controller | None = None
        self._options: dict[str, Any] | None = None
        packing, step = load("packing"), load("step")
        if packing is None or step is None:
            self.not_compiled = "there is no compiler"
            return
        self._evaluate, self._look = step.evaluate_step, getattr(load("look"), "look", None)
        try:
            packed = packing.Packed(scene, constraints, task, told)
        except packing.NotCompiled as reason:
            self.not_compiled = str(reason)
            return
        after = [load(name) for name in packed.after]
        if None in after:
            self.not_compiled = "there is no compiler"
            return
        self._packed, self._after = packed, tuple(module.add_rows for module in after)

    def __getstate__(self) -> dict[str, Any]:
        """All but the function of the last controller, which is made again when it is needed."""
        return {**self.__dict__, "_controller": None, "_options": None, "_to_command": None}

    def reset(self) -> None:
        """Forget the last sample."""
        self.visual_task.reset()
        if self._packed is not None:
            self._packed.reset()

    def evaluate(self, t: float, q: Array, qd: Array) -> Evaluation:
        """Rows and task at time ``t`` [s], ``q`` and ``qd`` (n,).

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        InvalidInput
            if t is not finite, or q or qd are not (n,) finite numbers.
        """
        packed = self._packed
        if packed is None:
            return self.define(self._state(t, q, qd))
        out = np.empty(packed.size)
        before = packed.memory.copy() if packed.others else packed.memory
        try:
            refused = self._evaluate(*packed.arguments, out, t, q, qd)
        except TypeError:
            t, q, qd = self._checked(t, q, qd)
            refused = self._evaluate(*packed.arguments, out, t, q, qd)
        if refused:
            # what cannot be evaluated is told by the definition
            return self.define(self._state(t, q, qd))
        for add_rows in self._after:
            add_rows(*packed.arguments, out, t, q, qd)
        if packed.others:
            try:
                state = self._state(t, q, qd)
                for constraint, rows, points in packed.others:
                    self._insert(out, rows, constraint, constraint.rows(state, points))
            except BaseException:
                # a sample without rows is not remembered
                packed.memory[:] = before
                raise
        return CompiledEvaluation(packed, self.constraints, out)

    def _state(self, t: float, q: Array, qd: Array) -> State:
        state = self.scene.evaluate(*self._checked(t, q, qd))
        return self.scene.believed(state) if self._believes else state

    def _checked(self, t: float, q: Array, qd: Array) -> tuple[float, Array, Array]:
        robot = self.scene.robot
        if not math.isfinite(t):
            raise InvalidInput(f"the time must be a finite number of seconds, not {t}")
        return float(t), robot.configuration(q), robot.configuration(qd, "qd")

    def command(self, controller: Controller, t: float, q: Array, qd: Array) -> tuple[Evaluation, Command]:
        """From state to command: what :meth:`evaluate` and then ``controller.command`` give.

        Raises
        ------
        SceneError
            if a marker is not in front of the camera.
        InvalidInput
            as both of them do.
        """
        options = self._options
        try:
            changed = options is not None and controller.__dict__ != options
        except ValueError:
            # arrays of its own do not compare
            changed = True
        if changed or controller is not self._controller:
            self.bind(controller)
        return self._to_command(t, q, qd)

    def bind(self, controller: Controller) -> StateToCommand:
        """Make a function for loops that does as :meth:`command`, for this controller with the options that it has now.

        Where step and law are compiled, they run on arrays that stay where they are, and only what they come to is
        copied.
        """

        def in_two(t: float, q: Array, qd: Array) -> tuple[Evaluation, Command]:
            evaluation = self.evaluate(t, q, qd)
            return evaluation, controller.command(evaluation.rows, evaluation.task)

        self._controller, self._options, self._to_command = controller, None, in_two
        step, law = self.bound(), None
        if step is not None:
            now, acted, qdd = step.now, np.empty(step.packed.m, dtype=np.bool_), np.empty(step.packed.n)
            law = controller._bind(now.rows, now.task, acted, qdd)
        if step is None or law is None:
            return in_two
        evaluate, solve, command, out, packed = step.evaluate, law.solve, law.command, step.out, step.packed
        constraints = self.constraints

        def in_one(t: float, q: Array, qd: Array) -> tuple[Evaluation, Command]:
            try:
                # the compiled function takes type and dimension for granted, looks at the rest by itself, and would
                # make a number of a string
                if (
                    q.dtype is not FLOAT
                    or qd.dtype is not FLOAT
                    or q.ndim != 1
                    or qd.ndim != 1
                    or evaluate(t + 0.0, q, qd)
                ):
                    return in_two(t, q, qd)
            except (AttributeError, TypeError):
                # not arrays
                return in_two(t, q, qd)
            asks = solve()
            evaluation = CompiledEvaluation(packed, constraints, out.copy())
            return evaluation, controller.command(evaluation.rows, evaluation.task) if asks else command()

        # only a law that is bound has options that were read beforehand
        self._options, self._to_command = dict(vars(controller)), in_one
        return in_one

    def bound(self) -> Bound | None:
        """The compiled step on arrays that stay where they are; None where anything runs in NumPy."""
        packed = self._packed
        if packed is None or packed.others:
            return None
        return Bound(packed, self.constraints, (self._evaluate, *self._after))

    def _insert(self, out: Array, rows: slice, constraint: Constraint, block: RowBlock) -> None:
        """Write the rows of a constraint in NumPy between the compiled ones."""
        packed = self._packed
        assert packed is not None
        n, r = packed.n, rows.stop - rows.start
        shapes = [part.shape for part in (block.sigma, block.phi, block.Lg, block.Lf)]
        if shapes != [(r,), (r,), (r, n), (r,)]:
            raise InvalidInput(
                f"rows (σ, φ, L_gφ, L_fφ) of the wrong shape: {constraint.kind} has {r} labels for {n} joints, but the "
                f"shapes {shapes}"
            )
        out[packed.phi][rows], out[packed.sigma][rows], out[packed.Lf][rows] = block.phi, block.sigma, block.Lf
        out[packed.Lg].reshape(packed.m, n)[rows] = block.Lg

    def look(self, t: Array, q: Array) -> tuple[Array, Array, BoolArray]:
        """What can be seen at many instants, without its motion.

        Parameters
        ----------
        t, q
            (N,) times [s] and (N, n) coordinates.

        Returns
        -------
        tuple
            (N, M, 2) pixels of the markers, (N, p, 3) robot points in the base frame [m], and (N,) whether all markers
            are in front of the camera; where they are not, the pixels do not count.
        """
        scene, N = self.scene, len(t)
        pixels, points = np.zeros((N, len(scene.markers), 2)), np.zeros((N, len(scene.points), 3))
        seen = np.ones(N, dtype=np.bool_)
        if self._packed is not None and self._look is not None:
            packed, t, q = self._packed, np.ascontiguousarray(t), np.ascontiguousarray(q)
            self._look(t, q, packed.I, packed.F, *packed.moving, pixels, points, seen)
            return pixels, points, seen
        for k in range(N):
            try:
                pixels[k], points[k] = scene.glance(q[k], float(t[k]))
            except SceneError:
                seen[k] = False
        return pixels, points, seen

    def define(self, state: State) -> Evaluation:
        """The NumPy form, from a state, which may be a believed one."""
        rows, sigma = self.constraints.rows(state)
        task, error = self.visual_task.evaluate(state)
        camera = state.camera
        return DefinedEvaluation(
            rows, task, error, sigma, state.pixels.position, state.robot.points, camera.R, camera.t
        )


def has_unknown_motion(scene: Scene, constraints: ConstraintSet) -> bool:
    """Whether the target or something forbidden moves without controllers' being told."""
    motions = [scene.motion, *(getattr(constraint, "motion", None) for constraint in constraints.constraints)]
    return any(motion is not None and not motion.known for motion in motions)
