"""Checks of a start before a run begins: suspicious numbers, hidden markers, goals that no law can reach."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ..constraints import ConstraintSet, FieldOfView, ImageConstraint
from ..errors import ConfigurationError
from ..rows import Array, IntArray
from ..vision.scene import Scene
from ..vision.tracking import VisualTask
from .occluders import LinesOfSight

#: Field of view beyond which a focal length is suspected of being in another unit [deg]; fisheye lenses reach 130°.
MAX_VIEW = 150.0
#: Distance of a principal point from the image's centre, relative to half its sides, within which real cameras lie.
CENTRED = 0.2
#: Distance of a camera from the tip that carries it, or between markers, beyond which millimetres are suspected [m].
MAX_LENGTH = 3.0

COARSE, FINE = 4.0, 1.0
"""Sides of the squares by which the image is filled [px]: by small ones only where large ones show no connection.

Passages narrower than the last are not seen.
"""

AROUND = 2.0  #: Factor by which the filled area is larger than the image where no field of view bounds it.
#: How the sentence about a marker that is closed off from a goal ends.
UNSOLVABLE = "no law can bring it there without violating one"


def implausible(scene: Scene, task: VisualTask, Ts: float) -> list[str]:
    """Numbers that suggest another unit than the one documented, or swapped sides; one sentence each."""
    camera, gains, doubts = scene.camera, task.gains, []
    view = 2.0 * np.degrees(np.arctan(0.5 * np.asarray(camera.size) / np.asarray(camera.focal)))
    if view.max() > MAX_VIEW:
        focal = " and ".join(dict.fromkeys(f"{F:.4g}" for F in camera.focal))
        doubts.append(f"the camera's field of view is {view.max():.0f}°: is the focal length {focal} in mm, not px?")
    doubts += camera.doubts
    width, height = camera.size
    if camera.principal_point_px is not None and width != height:
        u, v = camera.principal_point_px
        as_given, swapped = (
            np.hypot(2.0 * u / w - 1.0, 2.0 * v / h - 1.0) for w, h in ((width, height), (height, width))
        )
        if swapped < CENTRED < as_given:
            doubts.append(
                f"the principal point ({u:.0f}, {v:.0f}) px is the centre of {height:g} × {width:g} px, not of "
                f"{width:g} × {height:g} px: are width and height swapped?"
            )
    damping = gains.damping * np.sqrt(gains.Kp0) * Ts
    if damping > 2.0:
        doubts.append(
            f"K_v T_s is {damping:.3g}, and beyond 2 sampled tracking is unstable: is the sampling time {Ts:g} in ms, "
            "not s?"
        )
    offset = 0.0 if camera.fixed is not None else float(np.linalg.norm(camera.mount.t))
    extent = float(np.ptp(scene.markers, axis=0).max())
    if offset > MAX_LENGTH:
        doubts.append(f"the camera is mounted {offset:.3g} m from the arm's tip: are its coordinates in mm, not m?")
    if extent > MAX_LENGTH:
        doubts.append(f"the target's markers are {extent:.3g} m apart: are its coordinates in mm, not m?")
    return doubts


def hidden_at_start(scene: Scene, q0: Array, refused: bool) -> list[str]:
    """Which markers the robot's own links hide at q0 (n,); raises ConfigurationError if that is ``refused``."""
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
    return [each for each in constraints.constraints if isinstance(each, ImageConstraint) and each.motion is None]


def forbidden_goals(scene: Scene, constraints: ConstraintSet, task: VisualTask) -> list[str]:
    """Which goals put markers where a constraint that does not move forbids them."""
    remarks = []
    for number, goal in enumerate(task.goals, start=1):
        for constraint in _in_the_image(constraints):
            forbidden = constraint.sigma(constraint.of_markers(goal.pixels)) > 0.0
            labels = constraint.labels(scene)
            remarks += [f"goal {number} is forbidden by {labels[i]}" for i in np.flatnonzero(forbidden)]
    return remarks


def separated_markers(scene: Scene, constraints: ConstraintSet, task: VisualTask, start: Array) -> list[str]:
    """One sentence for each marker whose pixels at the start and at a goal are in different parts of the allowed area.

    A marker's path in the image is continuous, whatever moves, so that no law can solve such a scene without violating
    a constraint. Constraints that move are left out, and so are starts and goals that are themselves forbidden. That
    nothing is separated proves nothing: markers do not move independently. ``start`` (M, 2) are the first pixels.
    """
    remarks, image = [], np.asarray(scene.camera.size)
    for i in range(len(start)):
        concerned = [each for each in _in_the_image(constraints) if each.markers is None or i + 1 in each.markers]
        # a field of view alone is convex
        if all(isinstance(each, FieldOfView) for each in concerned):
            continue
        places = np.array([start[i], *(goal.pixels[i] for goal in task.goals)])
        part, size = _parts(concerned, places, image, COARSE)
        if not part.all() or (part != part[0]).any():
            part, size = _parts(concerned, places, image, FINE)
        closed = [number for number in range(1, len(part)) if part[0] and part[number] not in (0, part[0])]
        remarks += [
            f"marker {i + 1} starts in a part of the image of {size:.0f} px² that its constraints close off from "
            f"goal {number}: {UNSOLVABLE}"
            for number in closed
        ]
    return remarks


def _parts(constraints: Sequence[ImageConstraint], places: Array, image: Array, cell: float) -> tuple[IntArray, float]:
    """The connected part in which each place (p, 2) lies, 0 where it is forbidden, and the area of the first [px²]."""
    bounded = any(isinstance(each, FieldOfView) for each in constraints)
    half = 0.5 * (1.0 if bounded else AROUND) * image + 2.0 * cell
    u, v = (np.arange(-side, side + cell, cell) for side in half)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    allowed, around = np.all([each.sigma(grid) <= 0.0 for each in constraints], axis=0), np.ones((3, 3))
    # large squares may lie on both sides of a thin obstacle: only those count that are allowed all around
    parts, _ = ndimage.label(ndimage.binary_erosion(allowed, around) if cell > FINE else allowed, around)
    column, row = np.rint((places + half) / cell).astype(int).T
    inside = (column >= 0) & (column < len(u)) & (row >= 0) & (row < len(v))
    part = np.where(inside, parts[row.clip(0, len(v) - 1), column.clip(0, len(u) - 1)], 0)
    return part, cell**2 * np.count_nonzero(parts == part[0])
