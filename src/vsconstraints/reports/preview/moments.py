"""One instant of a preview: where robot and markers are, how far rows are from their boundary, and what is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...constraints import ImageConstraint
from ...errors import ConfigurationError, VsconstraintsError, described
from ...rows import Array, BoolArray
from ...simulation import Setup
from ...simulation.occluders import LinesOfSight
from ...vision.scene import MINIMUM_DEPTH

ROUNDING = 1e-9
"""Of σ relative to the row's scale, that counts as none."""


@dataclass(frozen=True)
class Moment:
    """The start, or a goal.

    Attributes
    ----------
    name
        ``"start"``, ``"goal"`` or ``"goal 2"``.
    t
        When [s].
    q
        (n,) where the robot is; None if no configuration was found.
    pixels
        (M, 2) of the markers, from the image's centre [px]; NaN for those that are not in front of the camera.
    phi, clearance
        (m,) of each row, the latter in its natural unit; NaN where they cannot be said.
    limits
        (2n,) distance to the robot's own lower and upper joint limits [rad or m]; infinite where there is none.
    problems
        What is wrong, one sentence each.
    """

    name: str
    t: float
    q: Array | None
    pixels: Array
    phi: Array
    clearance: Array
    limits: Array
    problems: tuple[str, ...]


def moment_at(setup: Setup, name: str, t: float, q: Array, qd: Array) -> Moment:
    """The robot at ``q`` and ``qd`` (n,) at time ``t`` [s]."""
    scene = setup.scene
    robot, camera = scene.robot, scene.camera
    P = scene.camera_pose(q, t).inverse.act(scene.markers)
    seen = P[:, 2] >= MINIMUM_DEPTH
    pixels = np.full((len(P), 2), np.nan)
    pixels[seen] = camera.pixels(P[seen, :2] / P[seen, 2:])
    problems = robot.outside_ranges(q)
    problems += [f"marker {i + 1} is behind the camera (depth {P[i, 2]:.3g} m)" for i in np.flatnonzero(~seen)]
    problems += [
        f"marker {i + 1} is outside the image, at ({u:.0f}, {v:.0f}) px from its centre"
        for i, (u, v) in enumerate(pixels)
        if seen[i] and not camera.sees(pixels[i])
    ]
    problems += hidden(setup, q, t) if seen.all() else []
    phi, clearance, wrong = _rows(setup, t, q, qd, seen)
    limits = np.concatenate((q - robot.q_min, robot.q_max - q))
    return Moment(name, t, q, pixels, phi, clearance, limits, (*problems, *wrong))


def nowhere(setup: Setup, name: str, t: float, pixels: Array, problem: str) -> Moment:
    """A goal of which no more is known than its image (M, 2) [px]."""
    m, n = len(setup.constraints.labels), setup.scene.robot.n
    unknown = np.full(m, np.nan)
    forbidden = []
    for constraint in setup.constraints.constraints:
        if isinstance(constraint, ImageConstraint) and constraint.motion is None:
            outside = constraint.sigma(constraint.of_markers(pixels)) > 0.0
            forbidden += [constraint.labels(setup.scene)[i] for i in np.flatnonzero(outside)]
    problems = (problem, *(f"{label} is violated" for label in forbidden))
    return Moment(name, t, None, pixels, unknown, unknown, np.full(2 * n, np.nan), problems)


def hidden(setup: Setup, q: Array, t: float) -> list[str]:
    """Which markers the robot's own links hide; or why nobody knows."""
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError as error:
        return [f"lines of sight are not checked: {error}"]
    return [f"marker {number} is hidden by the robot's own {link}" for number, link in lines.hidden(q, t)]


def _rows(setup: Setup, t: float, q: Array, qd: Array, seen: BoolArray) -> tuple[Array, Array, list[str]]:
    """φ and the clearance of each row, and which are violated; NaN where a marker is behind the camera."""
    unknown = np.full(len(setup.constraints.labels), np.nan)
    if not seen.all():
        return unknown, unknown, []
    try:
        state = setup.scene.evaluate(t, q, qd)
        rows, sigma = setup.constraints.rows(state)
        pixels, points = state.pixels.position[None], state.robot.points[None]
        clearance = setup.clearance(np.array([t]), q[None], qd[None], pixels, points)[0]
    except VsconstraintsError as error:
        return unknown, unknown, [f"its rows cannot be evaluated: {error}"]
    except Exception as error:  # own constraints may raise anything
        return unknown, unknown, [f"its rows cannot be evaluated: {described(error)}"]
    units = setup.constraints.units
    violated = np.flatnonzero(sigma > ROUNDING * rows.scale)
    return (
        rows.phi,
        clearance,
        [f"{rows.labels[i]} is violated: {abs(clearance[i]):.4g} {units[i]} outside" for i in violated],
    )
