"""From where runs are looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...rows import Array
from ..preview.moments import Moment
from ..preview.space import Places, Viewpoint, axes_of, viewpoint_of
from .run import ReplayRun

MOMENTS = 9
"""Of each run, in which all that is there is in view."""

ASPECT = 1.25
"""Width of pictures of arms over their height."""

FIELD_OF_VIEW = 0.7
"""From the top to the bottom of a browser's page [rad]."""

NARROWEST = 0.72
"""Width of the part of a browser's page that shows the arm over its height."""

MARGIN = 0.15
"""Around what is in view, relative to half the side of its cube: bars have a thickness."""


def moments_of(runs: Sequence[ReplayRun]) -> list[Moment]:
    """Configurations from the starts of runs to their ends."""
    nothing = np.empty(0)
    return [
        Moment("", float(run.trajectory.t[k]), run.trajectory.q[k], nothing, nothing, nothing, nothing, ())
        for run in runs
        for k in np.linspace(0, len(run.trajectory.t) - 1, MOMENTS).astype(int)
    ]


def common_viewpoint(runs: Sequence[ReplayRun]) -> Viewpoint:
    """A viewpoint in which the motions of all runs are."""
    return viewpoint_of(runs[0].setup, moments_of(runs), ASPECT)


def standpoint(runs: Sequence[ReplayRun], viewpoint: Viewpoint) -> Array:
    """(3,) where an eye with :data:`FIELD_OF_VIEW` stands that sees the motions of all runs.

    An eye at a distance d from the centre sees what is x to the right of it, y above it and z nearer if neither x nor y
    is farther from zero than w (d − z) and h (d − z): it stands at the least d for which that is so.
    """
    axes, setup = axes_of(viewpoint.elevation, viewpoint.azimuth), runs[0].setup
    points = np.concatenate([Places.of(setup, moment).points for moment in moments_of(runs)])
    across, up, towards = ((points - viewpoint.centre) @ axes).T
    h = np.tan(0.5 * FIELD_OF_VIEW)
    room = MARGIN * viewpoint.half
    distance = np.max(towards + (np.maximum(np.abs(across) / NARROWEST, np.abs(up)) + room) / h)
    eye: Array = viewpoint.centre + distance * axes[:, 2]
    return eye
