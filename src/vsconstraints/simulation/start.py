"""Checks of a start before a run begins: hidden markers, goals that no law can reach or that are no
pose.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ..constraints import ConstraintSet, FieldOfView, ImageConstraint
from ..errors import ConfigurationError, SceneError
from ..rows import Array, IntArray
from ..vision.features import CameraPose, ImagePoints
from ..vision.scene import Scene, interaction_matrix
from ..vision.tracking import VisualTask
from .occluders import LinesOfSight

COARSE = 4.0
FINE = 1.0
"""Sides of the squares by which the image is filled [px]: by small ones only where large ones show
no connection.

Passages narrower than the last are not seen.
"""

#: Factor by which the filled area is larger than the image where no field of view bounds it.
AROUND = 2.0
#: How the sentence about a marker that is closed off from a goal ends.
UNSOLVABLE = "no law can bring it there without violating one"

#: Least singular value, relative to the greatest, of what counts as a direction that an image
#: determines. Markers that are seen under an angle α determine the weakest one by about α²: this is
#: a thousandth of a radian.
DETERMINED = 1e-6


def hidden_at_start(scene: Scene, q0: Array, refused: bool) -> list[str]:
    """Which markers the robot's own links hide at q0 (n,); raises ConfigurationError if that is
    ``refused``.
    """
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError as error:
        return [f"lines of sight are not checked: {error}"]
    hidden = [f"marker {number} by {link}" for number, link in lines.hidden(q0[None], [0.0])[0]]
    if hidden and refused:
        raise ConfigurationError(
            f"at the start the robot itself hides markers from the camera: {', '.join(hidden)}; "
            'on_hidden_markers = "continue" runs it all the same'
        )
    return [f"at the start the robot itself hides markers: {', '.join(hidden)}"] if hidden else []


def _in_the_image(constraints: ConstraintSet) -> list[ImageConstraint]:
    """Those that do not move."""
    return [
        each
        for each in constraints.constraints
        if isinstance(each, ImageConstraint) and each.motion is None
    ]


def forbidden_goals(scene: Scene, constraints: ConstraintSet, task: VisualTask) -> list[str]:
    """Which goals put markers where a constraint that does not move forbids them."""
    remarks = []
    for number, goal in enumerate(task.goals, start=1):
        for constraint in _in_the_image(constraints):
            forbidden = constraint.sigma(constraint.of_markers(goal.pixels)) > 0.0
            labels = constraint.labels(scene)
            remarks += [
                f"goal {number} is forbidden by {labels[i]}" for i in np.flatnonzero(forbidden)
            ]
    return remarks


def undetermined_goals(scene: Scene, task: VisualTask, q0: Array, estimated: bool) -> list[str]:
    """One sentence for each goal at which the image of the markers does not determine the camera's
    pose.

    There L J_c, the interaction matrix of the markers in the image times the Jacobian of the
    camera's twist, has a lower rank than J_c: one marker, markers that coincide or lie on a line, a
    circle through the camera's centre. A task of the camera's pose is concerned only if the pose is
    ``estimated`` from images.
    """
    by_image = isinstance(task.feature, ImagePoints)
    if not by_image and not (estimated and isinstance(task.feature, CameraPose)):
        return []
    remarks = []
    count = len(scene.markers)
    still = np.zeros(scene.robot.n)
    for number, goal in enumerate(task.goals, start=1):
        try:
            now = scene.evaluate(0.0, q0 if goal.q is None else goal.q, still)
        except SceneError:
            continue
        Z = now.depth if goal.depth is None else goal.depth
        # lengths by the distance of the markers: angles and translations then count alike
        size = float(Z.mean())
        L = interaction_matrix(goal.normalised, Z).reshape(-1, 6) * ([size] * 3 + [1.0] * 3)
        J = now.camera_J / np.array([[size]] * 3 + [[1.0]] * 3)
        if not (np.isfinite(L).all() and np.isfinite(J).all() and np.isfinite(L @ J).all()):
            continue
        determined, free = (
            int(np.linalg.matrix_rank(each, rtol=DETERMINED)) for each in (L @ J, J)
        )
        seen = f"{count} markers" if count > 1 else "one marker"
        if determined < free:
            remarks.append(
                f"at goal {number} the image of {seen} determines {determined} of the {free} "
                f"directions in which the "
                "camera moves, so that it may end elsewhere: at least four markers that are not "
                "on a line determine "
                "its pose"
            )
        elif count == 3 and free == 6:
            remarks.append(
                f"at goal {number} up to four poses of the camera show three markers at the same "
                f"pixels, so that it "
                "may end elsewhere: four markers determine its pose"
            )
    return remarks


def separated_markers(
    scene: Scene, constraints: ConstraintSet, task: VisualTask, start: Array
) -> list[str]:
    """One sentence for each marker whose pixels at the start and at a goal are in different parts
    of the allowed area.

    A marker's path in the image is continuous, whatever moves, so that no law can solve such a
    scene without violating a constraint. Constraints that move are left out, and so are starts and
    goals that are themselves forbidden. That nothing is separated proves nothing: markers do not
    move independently. ``start`` (M, 2) are the first pixels.
    """
    remarks = []
    image = np.asarray(scene.camera.size)
    for i in range(len(start)):
        concerned = [
            each
            for each in _in_the_image(constraints)
            if each.markers is None or i + 1 in each.markers
        ]
        # a field of view alone is convex
        if all(isinstance(each, FieldOfView) for each in concerned):
            continue
        places = np.array([start[i], *(goal.pixels[i] for goal in task.goals)])
        part, size = _parts(concerned, places, image, COARSE)
        if not part.all() or (part != part[0]).any():
            part, size = _parts(concerned, places, image, FINE)
        closed = [
            number for number in range(1, len(part)) if part[0] and part[number] not in (0, part[0])
        ]
        remarks += [
            f"marker {i + 1} starts in a part of the image of {size:.0f} px² that its constraints "
            f"close off from "
            f"goal {number}: {UNSOLVABLE}"
            for number in closed
        ]
    return remarks


def _parts(
    constraints: Sequence[ImageConstraint], places: Array, image: Array, cell: float
) -> tuple[IntArray, float]:
    """The connected part in which each place (p, 2) lies, 0 where it is forbidden, and the area of
    the first [px²].
    """
    bounded = any(isinstance(each, FieldOfView) for each in constraints)
    half = 0.5 * (1.0 if bounded else AROUND) * image + 2.0 * cell
    u, v = (np.arange(-side, side + cell, cell) for side in half)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    allowed = np.all([each.sigma(grid) <= 0.0 for each in constraints], axis=0)
    around = np.ones((3, 3))
    # large squares may lie on both sides of a thin obstacle: only those count that are allowed all
    # around
    parts, _ = ndimage.label(
        ndimage.binary_erosion(allowed, around) if cell > FINE else allowed, around
    )
    column, row = np.rint((places + half) / cell).astype(int).T
    inside = (column >= 0) & (column < len(u)) & (row >= 0) & (row < len(v))
    part = np.where(inside, parts[row.clip(0, len(v) - 1), column.clip(0, len(u) - 1)], 0)
    return part, cell**2 * np.count_nonzero(parts == part[0])
