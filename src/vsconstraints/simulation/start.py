"""Checks of a start before a run: hidden markers, and goals that are unreachable or ambiguous."""

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
"""Sides of the squares that fill the image [px].

Small squares are used only if large ones show no connection. Passages narrower than the small ones
are not detected.
"""

FORBIDDEN = 0  #: Number of the part of the image that constraints forbid.
#: Size of the filled area relative to the image, if no field of view bounds it.
AROUND = 2.0
#: End of the sentence about a marker that constraints separate from a goal.
UNSOLVABLE = "no law can bring the marker there without a violation"

#: Smallest singular value, relative to the largest, of a direction that counts as determined by an
#: image. Markers seen under an angle α determine the weakest direction by about α²: this value
#: corresponds to a thousandth of a radian.
DETERMINED = 1e-6


def hidden_at_start(scene: Scene, q0: Array, refused: bool) -> list[str]:
    """Return a remark on the markers that the robot's own links hide at q0 (n,).

    Raises ConfigurationError if hidden markers are ``refused``.
    """
    try:
        lines = LinesOfSight(scene)
    except ConfigurationError as error:
        return [f"lines of sight are not checked: {error}"]
    (hidden_by,) = lines.hidden(q0[None], [0.0])
    hidden = [f"marker {number} by {link}" for number, link in hidden_by]
    if hidden and refused:
        raise ConfigurationError(
            f"at the start the robot itself hides markers from the camera: {', '.join(hidden)}; "
            'on_hidden_markers = "continue" runs it all the same'
        )
    return [f"at the start the robot itself hides markers: {', '.join(hidden)}"] if hidden else []


def _in_the_image(constraints: ConstraintSet) -> list[ImageConstraint]:
    """Return the image constraints that do not move."""
    return [
        each
        for each in constraints.constraints
        if isinstance(each, ImageConstraint) and each.motion is None
    ]


def forbidden_goals(scene: Scene, constraints: ConstraintSet, task: VisualTask) -> list[str]:
    """Return remarks on goals that place markers in a forbidden area.

    Only constraints that do not move are considered.
    """
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
    """Return remarks on goals at which the markers' image does not determine the camera's pose.

    There is one sentence per goal. At such a goal L J_c, the interaction matrix of the markers in
    the image times the Jacobian of the camera's twist, has a lower rank than J_c. Examples are one
    marker, markers that coincide or lie on a line, and a circle through the camera's centre. A task
    of the camera's pose is concerned only if the pose is ``estimated`` from images.
    """
    by_image = isinstance(task.feature, ImagePoints) and task.feature.markers is None
    by_estimated_pose = estimated and isinstance(task.feature, CameraPose)
    if not (by_image or by_estimated_pose):
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
        # lengths are scaled by the distance of the markers, so that angles and translations count
        # alike
        size = float(Z.mean())
        units = np.array([size, size, size, 1.0, 1.0, 1.0])
        L = interaction_matrix(goal.normalised, Z).reshape(-1, 6) * units
        J = now.camera_J / units[:, None]
        LJ = L @ J
        are_finite = all(np.isfinite(A).all() for A in (L, J, LJ))
        if not are_finite:
            continue
        determined = int(np.linalg.matrix_rank(LJ, rtol=DETERMINED))
        free = int(np.linalg.matrix_rank(J, rtol=DETERMINED))
        seen = f"{count} markers" if count > 1 else "one marker"
        if determined < free:
            remarks.append(
                f"at goal {number} the image of {seen} determines {determined} of the {free} "
                f"directions in which the camera moves, so that it may end elsewhere: at least "
                f"four markers that are not on a line determine its pose"
            )
        elif count == 3 and free == 6:
            remarks.append(
                f"at goal {number} up to four poses of the camera show three markers at the same "
                f"pixels, so that it may end elsewhere: four markers determine its pose"
            )
    return remarks


def separated_markers(
    scene: Scene, constraints: ConstraintSet, task: VisualTask, start: Array
) -> list[str]:
    """Return remarks on markers whose start and goal lie in separate parts of the allowed area.

    There is one sentence per marker and goal. The path of a marker in the image is continuous,
    whatever moves. No law can therefore solve such a scene without violating a constraint. Moving
    constraints are disregarded, as are starts and goals that are themselves forbidden. An empty
    result proves nothing, because markers do not move independently. ``start`` (M, 2) are the
    initial pixels.
    """
    remarks = []
    image = np.asarray(scene.camera.size)
    for i in range(len(start)):
        concerned = [
            each
            for each in _in_the_image(constraints)
            if each.markers is None or i + 1 in each.markers
        ]
        # a field of view alone is convex and separates nothing
        if all(isinstance(each, FieldOfView) for each in concerned):
            continue
        places = np.array([start[i], *(goal.pixels[i] for goal in task.goals)])
        part, size = _parts(concerned, places, image, COARSE)
        are_connected = (part == part[0]).all() and part[0] != FORBIDDEN
        if not are_connected:
            part, size = _parts(concerned, places, image, FINE)
        of_start, *of_goals = part
        if of_start == FORBIDDEN:
            continue
        for number, of_goal in enumerate(of_goals, start=1):
            if of_goal not in (FORBIDDEN, of_start):
                remarks.append(
                    f"marker {i + 1} starts in a part of the image of {size:.0f} px² that its "
                    f"constraints close off from goal {number}: {UNSOLVABLE}"
                )
    return remarks


def _parts(
    constraints: Sequence[ImageConstraint], places: Array, image: Array, cell: float
) -> tuple[IntArray, float]:
    """Return the connected part of each place (p, 2), and the area of the first one's part [px²].

    The part is :data:`FORBIDDEN` for a forbidden place.
    """
    is_bounded = any(isinstance(each, FieldOfView) for each in constraints)
    searched = 1.0 if is_bounded else AROUND
    half = 0.5 * searched * image + 2.0 * cell
    half_width, half_height = half
    u = np.arange(-half_width, half_width + cell, cell)
    v = np.arange(-half_height, half_height + cell, cell)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    allowed_by_each = [each.sigma(grid) <= 0.0 for each in constraints]
    allowed = np.all(allowed_by_each, axis=0)
    around = np.ones((3, 3))
    if cell > FINE:
        # a large square may span a thin obstacle: it counts only if all squares around it are
        # allowed
        allowed = ndimage.binary_erosion(allowed, around)
    parts, _ = ndimage.label(allowed, around)
    cells = np.rint((places + half) / cell)
    column, row = cells.astype(int).T
    nearest_column = column.clip(0, len(u) - 1)
    nearest_row = row.clip(0, len(v) - 1)
    is_inside = (column == nearest_column) & (row == nearest_row)
    part = np.where(is_inside, parts[nearest_row, nearest_column], FORBIDDEN)
    cells_of_first = np.count_nonzero(parts == part[0])
    return part, cell**2 * cells_of_first
