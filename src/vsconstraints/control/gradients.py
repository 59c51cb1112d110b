"""Check of gradients and interaction matrices against difference quotients, before their use."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..constraints import Constraint, ConstraintSet, ImageConstraint, PointConstraint
from ..errors import ConfigurationError
from ..rows import Array, IntArray
from ..vision.features import View, ViewFeature
from ..vision.scene import Scene, State
from ..vision.tracking import VisualTask
from .evaluator import Evaluator

#: Steps of difference quotients [rad, m or rad/s]. A wrong gradient must fail with both.
STEPS = (1e-6, 1e-4)
PIXELS = 1e3  #: Factor of steps in the image [px].
#: Tolerance of the quotients, relative to the greatest entry of a row.
TOLERANCE = 1e-3
SMALLEST = 1e-9  #: Entries below this count as 0, relative to σ over the step.

#: Coordinates of the camera's twist in its own frame.
TWIST = ("v_x", "v_y", "v_z", "ω_x", "ω_y", "ω_z")

Function = Callable[[Array], Array]


def own_constraints(constraints: ConstraintSet) -> list[Constraint]:
    """Return the constraints of classes outside this package."""
    return [each for each in constraints.constraints if _is_custom(each)]


def _is_custom(part: object) -> bool:
    package = __name__.partition(".")[0]
    return type(part).__module__.partition(".")[0] != package


def require_gradients(
    scene: Scene,
    constraints: ConstraintSet,
    task: VisualTask,
    state: tuple[float, Array, Array],
    only: Sequence[Constraint] | None = None,
) -> None:
    """Raise ConfigurationError if the gradient of a constraint is not the derivative of its σ.

    ``state`` is the time [s], q and q̇ (n,) of the check. ``only`` are the constraints to check,
    the custom ones if None. The error names the row, the coordinate, the given derivative and the
    difference quotient. Quotients are taken to both sides: where σ has a kink, any slope between
    the two is valid. Where σ cannot be evaluated, nothing is raised: the run will report the
    reason.
    """
    checked = own_constraints(constraints) if only is None else only
    if not checked:
        return
    evaluator = Evaluator(scene, constraints, task, known=True)
    for wrong in _wrong(evaluator, checked, *state):
        raise ConfigurationError(wrong)


def require_interaction(task: VisualTask, state: State) -> None:
    """Raise ConfigurationError if a custom feature's matrix is not the derivative of its value.

    The error names the feature, the component, the coordinate of the camera's twist, the given
    derivative and the difference quotient. Raises ConfigurationError, too, if no component of the
    task changes with the camera's motion, because such a task would count as done.
    """
    goal = task.goals[task.goal_at(state.t)]
    constant = []
    for feature in task.feature.parts:
        if isinstance(feature, ViewFeature) and _is_custom(feature):
            view = feature.seen(View.of_state(state))
            wanted = feature.seen(View.of_goal(goal))
            if not feature.derived:
                _require_matrix(feature, view, wanted)
            if not np.any(feature.interaction_matrix(view, wanted)):
                constant.append(feature)
    if len(constant) == len(task.feature.parts):
        raise ConfigurationError(
            f"the interaction matrix of the feature {task.feature.name} is zero at the start: its "
            "value does not change as the camera moves, so that no motion reaches a goal. Let the "
            "value depend on the view, or start elsewhere"
        )


def _require_matrix(feature: ViewFeature, view: View, goal: View) -> None:
    given = np.asarray(feature.interaction_matrix(view, goal), dtype=np.float64)
    for column, twist in enumerate(np.eye(6)):
        quotients = _quotients(feature.along(view, goal, twist))
        for row in _differing(given, column, quotients):
            right = quotients[0].mean[row]
            wrong = given[row, column]
            sign = _wrong_sign(wrong, right)
            raise ConfigurationError(
                f"the interaction matrix of the feature {feature.name} is not the derivative of "
                f"its value at the start: component {row + 1} by {TWIST[column]} is {right:.4g} by "
                f"differences, but {wrong:.4g} as given{sign}"
            )


def _wrong(
    evaluator: Evaluator, checked: Sequence[Constraint], t: float, q: Array, qd: Array
) -> Iterator[str]:
    constraints = evaluator.constraints
    with np.errstate(all="ignore"):
        first = 0
        for constraint, count, points in constraints.blocks():
            rows = slice(first, first + count)
            first += count
            # by identity: == of custom dataclasses with arrays is ambiguous
            if not any(constraint is each for each in checked):
                continue
            try:
                yield from _of_coordinates(evaluator, constraint, rows, points, (t, q, qd))
                yield from _of_joints(evaluator, constraint, rows, (t, q, qd))
            except Exception:  # custom code may raise anything; the run reports it
                continue


def _of_coordinates(
    evaluator: Evaluator,
    constraint: Constraint,
    rows: slice,
    points: slice,
    state: tuple[float, Array, Array],
) -> Iterator[str]:
    """Yield a message for each wrong derivative of σ by pixels or point coordinates.

    Custom classes give these derivatives.
    """
    t, q, qd = state
    if isinstance(constraint, ImageConstraint):
        y = constraint.of_markers(evaluator.evaluate(t, q, qd).pixels)
        names = "uv"
        unit = PIXELS
    elif isinstance(constraint, PointConstraint):
        y = evaluator.scene.kinematics(q, qd).points[points]
        names = "xyz"
        unit = 1.0
    else:
        return
    y = constraint.displaced(y[None], np.array([t]))[0]
    gradient = np.asarray(constraint.gradient(y), dtype=np.float64)
    if gradient.shape != y.shape:
        yield (
            f"{type(constraint).__name__}.gradient must return the shape {y.shape} for "
            f"coordinates of that shape, not {gradient.shape}"
        )
        return
    labels = evaluator.constraints.labels[rows]
    unit_vectors = np.eye(len(names))
    for coordinate, name in enumerate(names):
        direction = unit * unit_vectors[coordinate]

        def sigma(away: float, along: Array = direction) -> Array:
            return constraint.sigma(y + away * along)

        quotients = _quotients(sigma)
        for row in _differing(gradient * unit, coordinate, quotients):
            right = quotients[0].mean[row] / unit
            given = gradient[row, coordinate]
            yield _sentence(constraint, labels[row], f"∂σ/∂{name}", given, right)


def _of_joints(
    evaluator: Evaluator, constraint: Constraint, rows: slice, state: tuple[float, Array, Array]
) -> Iterator[str]:
    """Yield a message for each wrong derivative of σ by joint coordinates.

    For rows on φ itself, derivatives of φ by joint speeds are checked.
    """
    t, q, qd = state
    constraints = evaluator.constraints
    robot = evaluator.scene.robot
    approach_time = constraints.approach_time[rows]
    by_speed = not approach_time.any()
    Lg = evaluator.evaluate(t, q, qd).rows.Lg[rows]
    gradient = Lg if by_speed else Lg / approach_time[:, None]
    labels = constraints.labels[rows]
    unit_vectors = np.eye(robot.n)
    for joint in range(robot.n):
        direction = unit_vectors[joint]

        def value(away: float, along: Array = direction) -> Array:
            step = away * along
            if by_speed:
                faster = evaluator.evaluate(t, q, qd + step)
                phi: Array = faster.rows.phi[rows]
                return phi
            moved = evaluator.evaluate(t, q + step, qd)
            sigma: Array = moved.sigma[rows]
            return sigma

        quotients = _quotients(value)
        for row in _differing(gradient, joint, quotients):
            right = quotients[0].mean[row]
            derivative = "∂φ/∂q̇" if by_speed else "∂σ/∂q"
            by = f"{derivative} of joint {joint + 1} ({robot.joint_names[joint]})"
            yield _sentence(constraint, labels[row], by, gradient[row, joint], right)


class Quotients(NamedTuple):
    """Difference quotients (r,) of r values to both sides, and their rounding error."""

    ahead: Array
    behind: Array
    rounding: Array

    @property
    def mean(self) -> Array:
        """Mean (r,) of both sides."""
        return 0.5 * (self.ahead + self.behind)


def _quotients(value: Callable[[float], Array]) -> list[Quotients]:
    """Return the difference quotients of (r,) values, for each step."""
    here = np.asarray(value(0.0), dtype=np.float64)
    found = []
    for step in STEPS:
        ahead = np.asarray(value(step), dtype=np.float64)
        behind = np.asarray(value(-step), dtype=np.float64)
        quotients = Quotients(
            ahead=(ahead - here) / step,
            behind=(here - behind) / step,
            rounding=SMALLEST * np.abs(here) / step,
        )
        found.append(quotients)
    return found


def _differing(gradient: Array, coordinate: int, quotients: Sequence[Quotients]) -> IntArray:
    """Return the rows whose gradient (r, d) contradicts the quotients along a coordinate.

    It does if it is outside the quotients of both sides, for each of the steps.
    """
    given = gradient[:, coordinate]
    greatest = np.abs(gradient).max(axis=1, initial=0.0)
    is_finite = np.isfinite(given)
    is_wrong = np.ones(len(given), dtype=np.bool_)
    for each in quotients:
        low = np.minimum(each.ahead, each.behind)
        high = np.maximum(each.ahead, each.behind)
        steepest = np.maximum(np.abs(low), np.abs(high))
        size = np.maximum(greatest, steepest)
        # near a kink or a curve, the slope may differ from either side by their difference
        room = TOLERANCE * size + (high - low) + each.rounding
        is_too_low = given < low - room
        is_too_high = given > high + room
        is_wrong &= is_too_low | is_too_high | ~is_finite
    return np.flatnonzero(is_wrong)


def _sentence(constraint: Constraint, label: str, by: str, given: float, right: float) -> str:
    """Say which derivative of a row is given, and which one is right by differences."""
    sign = _wrong_sign(given, right)
    return (
        f"{label}: the gradient of {type(constraint).__name__} is not the derivative of its σ at "
        f"the start: {by} is {right:.4g} by differences, but {given:.4g} as given{sign}"
    )


def _wrong_sign(given: float, right: float) -> str:
    opposite = right != 0.0 and np.isclose(given, -right, rtol=1e-2)
    return "; its sign is wrong" if opposite else ""
