"""What is to be said of a start before a run begins: what keeps it from beginning, and what a reader should know."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..constraints import ImageConstraint
from ..errors import ConfigurationError
from .occluders import LinesOfSight

if TYPE_CHECKING:
    from .setup import Setup


WIDEST = 150.0
"""Field of view beyond which a focal length is suspected of being in another unit [deg]; fisheye lenses reach 130°."""

CENTRED = 0.2
"""Distance of a principal point from the image's centre, relative to half its sides, within which real cameras lie."""

FARTHEST = 3.0
"""Distance of a camera from the tip that carries it, or between markers, beyond which millimetres are suspected [m]."""


def remarks_at_start(setup: Setup) -> list[str]:
    """See :meth:`vsconstraints.simulation.Setup.check_start`, which says more of what is raised."""
    camera = setup.scene.camera
    state = setup.scene.evaluate(0.0, setup.q0, setup.qd0)
    pixels = state.pixels.position
    unseen = [
        f"marker {i + 1} at ({u:.0f}, {v:.0f}) px" for i, (u, v) in enumerate(pixels) if not camera.sees(pixels[i])
    ]
    if unseen:
        raise ConfigurationError(
            f"at the start, outside the image of {camera.size[0]:g} × {camera.size[1]:g} px: {', '.join(unseen)} "
            "from its centre"
        )
    remarks = implausible(setup) + _check_sight(setup)
    rows, sigma = setup.constraints.rows(state)
    first = 0
    for constraint, count, _ in setup.constraints.blocks():
        own = slice(first, first := first + count)
        refusal = constraint.refusal(sigma[own], rows.labels[own])
        if refusal:
            raise ConfigurationError(refusal)
    violated = [f"{rows.labels[i]} is violated at the start: σ = {sigma[i]:.3g}" for i in np.flatnonzero(sigma > 0.0)]
    return remarks + violated + _forbidden_goals(setup) + setup.separated


def implausible(setup: Setup) -> list[str]:
    """Numbers of a setup that suggest another unit than the one documented, or swapped sides; one sentence each."""
    camera, scene, gains = setup.scene.camera, setup.scene, setup.task.gains
    found = []
    view = 2.0 * np.degrees(np.arctan(0.5 * np.asarray(camera.size) / np.asarray(camera.focal)))
    if view.max() > WIDEST:
        focal = " and ".join(dict.fromkeys(f"{F:.4g}" for F in camera.focal))
        found.append(f"the camera's field of view is {view.max():.0f}°: is the focal length {focal} in mm, not px?")
    width, height = camera.size
    if camera.principal_point is not None and width != height:
        u, v = camera.principal_point
        as_given, swapped = (
            np.hypot(2.0 * u / w - 1.0, 2.0 * v / h - 1.0) for w, h in ((width, height), (height, width))
        )
        if swapped < CENTRED < as_given:
            found.append(
                f"the principal point ({u:.0f}, {v:.0f}) px is the centre of {height:g} × {width:g} px, not of "
                f"{width:g} × {height:g} px: are width and height swapped?"
            )
    damping = gains.damping * np.sqrt(gains.Kp0) * setup.Ts
    if damping > 2.0:
        found.append(
            f"K_v T_s is {damping:.3g}, and beyond 2 sampled tracking is unstable: is the sampling time {setup.Ts:g} "
            "in ms, not s?"
        )
    offset = 0.0 if camera.fixed is not None else float(np.linalg.norm(camera.mount.t))
    extent = float(np.ptp(scene.markers, axis=0).max())
    for what, length in (("the camera is mounted", offset), ("the target's markers are", extent)):
        if length > FARTHEST:
            where = "from the arm's tip" if length is offset else "apart"
            found.append(f"{what} {length:.3g} m {where}: are its coordinates in mm, not m?")
    return found


def _check_sight(setup: Setup) -> list[str]:
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError as error:
        return [f"lines of sight are not checked: {error}"]
    hidden = [f"marker {number} by {link}" for number, link in lines.hidden(setup.q0, 0.0)]
    if hidden and setup.on_hidden_markers == "refuse":
        raise ConfigurationError(
            f"at the start the robot itself hides markers from the camera: {', '.join(hidden)}; "
            'on_hidden_markers = "continue" runs it all the same'
        )
    return [f"at the start the robot itself hides markers: {', '.join(hidden)}"] if hidden else []


def _forbidden_goals(setup: Setup) -> list[str]:
    remarks = []
    for number, goal in enumerate(setup.task.goals, start=1):
        for constraint in setup.constraints.constraints:
            # what moves may be elsewhere by then
            if isinstance(constraint, ImageConstraint) and constraint.motion is None:
                forbidden = constraint.sigma(constraint.of_markers(goal.pixels)) > 0.0
                labels = constraint.labels(setup.scene)
                remarks += [f"goal {number} is forbidden by {labels[i]}" for i in np.flatnonzero(forbidden)]
    return remarks
