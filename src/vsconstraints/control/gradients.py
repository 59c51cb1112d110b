"""Gradients of constraints against difference quotients, once, before anything relies on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ..constraints import Constraint, ConstraintSet, ImageConstraint, PointConstraint
from ..errors import ConfigurationError
from ..rows import Array, IntArray
from ..vision.scene import Scene
from ..vision.tracking import VisualTask
from .evaluator import Evaluator

#: Steps of difference quotients [rad, m or rad/s]; a gradient is wrong if it is by both.
STEPS = (1e-6, 1e-4)
PIXELS = 1e3  #: Steps in the image are that many times as long [px].
#: Difference from the quotients, relative to the greatest entry of a row, that is rounding.
TOLERANCE = 1e-3
SMALLEST = 1e-9  #: Entry below which it counts as 0, relative to σ over the step.

Function = Callable[[Array], Array]


def own_constraints(constraints: ConstraintSet) -> list[Constraint]:
    """Constraints of classes that are not this package's."""
    package = __name__.partition(".")[0]
    return [
        each
        for each in constraints.constraints
        if type(each).__module__.partition(".")[0] != package
    ]


def demand_gradients(
    scene: Scene,
    constraints: ConstraintSet,
    task: VisualTask,
    state: tuple[float, Array, Array],
    only: Sequence[Constraint] | None = None,
) -> None:
    """Raise ConfigurationError if the gradient of a constraint is not the derivative of its σ at a
    state.

    ``state`` is the time [s], q and q̇ (n,); ``only`` are the constraints that are checked, own
    ones if None. The error names the row, the coordinate, and the derivative as it is given and as
    differences of σ have it. Quotients are taken to both sides, so that any slope between the two
    is right where σ has a kink. Where σ cannot be evaluated, nothing is said: the run will say why.
    """
    checked = own_constraints(constraints) if only is None else only
    if not checked:
        return
    evaluator = Evaluator(scene, constraints, task, known=True)
    for wrong in _wrong(evaluator, checked, *state):
        raise ConfigurationError(wrong)


def _wrong(
    evaluator: Evaluator, checked: Sequence[Constraint], t: float, q: Array, qd: Array
) -> Iterator[str]:
    constraints = evaluator.constraints
    with np.errstate(all="ignore"):
        first = 0
        for constraint, count, points in constraints.blocks():
            rows = slice(first, first := first + count)
            if constraint not in checked:
                continue
            try:
                yield from _of_coordinates(evaluator, constraint, rows, points, (t, q, qd))
                yield from _of_joints(evaluator, constraint, rows, (t, q, qd))
            except Exception:  # own constraints may raise anything, which the run will say
                continue


def _of_coordinates(
    evaluator: Evaluator,
    constraint: Constraint,
    rows: slice,
    points: slice,
    state: tuple[float, Array, Array],
) -> Iterator[str]:
    """Sentences on derivatives of σ by pixels or by coordinates of points, as own classes give
    them.
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
            f"coordinates of that shape, not "
            f"{gradient.shape}"
        )
        return
    labels = evaluator.constraints.labels[rows]
    for coordinate, name in enumerate(names):
        direction = unit * np.eye(len(names))[coordinate]
        quotients = _quotients(lambda away, along=direction: constraint.sigma(y + away * along))  # type: ignore[misc]
        for row in _differing(gradient * unit, coordinate, quotients):
            expected = [slope[row] / unit for slope in quotients[0]]
            yield _sentence(
                constraint, labels[row], f"∂σ/∂{name}", gradient[row, coordinate], expected
            )


def _of_joints(
    evaluator: Evaluator, constraint: Constraint, rows: slice, state: tuple[float, Array, Array]
) -> Iterator[str]:
    """Sentences on derivatives of σ by joint coordinates, or of φ by joint speeds where rows are
    about those.
    """
    t, q, qd = state
    constraints = evaluator.constraints
    robot = evaluator.scene.robot
    approach_time = constraints.approach_time[rows]
    by_speed = not approach_time.any()
    Lg = evaluator.evaluate(t, q, qd).rows.Lg[rows]
    gradient = Lg if by_speed else Lg / approach_time[:, None]
    labels = constraints.labels[rows]
    for joint in range(robot.n):
        direction = np.eye(robot.n)[joint]

        def value(away: float, along: Array = direction) -> Array:
            if by_speed:
                phi: Array = evaluator.evaluate(t, q, qd + away * along).rows.phi[rows]
                return phi
            sigma: Array = evaluator.evaluate(t, q + away * along, qd).sigma[rows]
            return sigma

        quotients = _quotients(value)
        for row in _differing(gradient, joint, quotients):
            expected = [slope[row] for slope in quotients[0]]
            by = (
                f"{'∂φ/∂q̇' if by_speed else '∂σ/∂q'} of joint {joint + 1} "
                f"({robot.joint_names[joint]})"
            )
            yield _sentence(constraint, labels[row], by, gradient[row, joint], expected)


Sides = tuple[Array, Array, Array]  #: (r,) quotients to both sides, and what of them is rounding.


def _quotients(value: Callable[[float], Array]) -> list[Sides]:
    """Quotients of (r,) values, for each step."""
    here = np.asarray(value(0.0), dtype=np.float64)
    found: list[Sides] = []
    for step in STEPS:
        ahead, behind = (np.asarray(value(away), dtype=np.float64) for away in (step, -step))
        found.append(
            ((ahead - here) / step, (here - behind) / step, SMALLEST * np.abs(here) / step)
        )
    return found


def _differing(gradient: Array, coordinate: int, quotients: Sequence[Sides]) -> IntArray:
    """Rows whose gradient (r, d) is outside both sides' quotients along a coordinate, by each of
    the steps.
    """
    given = gradient[:, coordinate]
    greatest = np.abs(gradient).max(axis=1, initial=0.0)
    wrong = np.ones(len(given), dtype=np.bool_)
    for ahead, behind, rounding in quotients:
        low = np.minimum(ahead, behind)
        high = np.maximum(ahead, behind)
        size = np.maximum(greatest, np.maximum(np.abs(low), np.abs(high)))
        # beside a kink or a curve, the sides differ by about what the slope may differ from either
        room = TOLERANCE * size + (high - low) + rounding
        wrong &= (given < low - room) | (given > high + room) | ~np.isfinite(given)
    return np.flatnonzero(wrong)


def _sentence(
    constraint: Constraint, label: str, by: str, given: float, expected: Sequence[float]
) -> str:
    right = 0.5 * (expected[0] + expected[1])
    sign = "; its sign is wrong" if np.isclose(given, -right, rtol=1e-2) and right != 0.0 else ""
    return (
        f"{label}: the gradient of {type(constraint).__name__} is not the derivative of its σ at "
        f"the start: {by} is "
        f"{right:.4g} by differences, but {given:.4g} as given{sign}"
    )
