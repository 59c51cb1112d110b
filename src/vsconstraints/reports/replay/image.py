"""The image planes of runs, their rows and their lamps, as data that a page draws."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from contourpy import FillType, contour_generator

from ...constraints import ImageConstraint
from ...rows import Array
from ...simulation import Setup
from ..plots.image import Plane
from .frames import Frames
from .lamps import things_of
from .run import ReplayRun, looks_of

GRID = 4.0
"""Of the grid on which the forbidden side is found [px]."""

MOST_ROWS = 14
"""Rows that are listed for a run: those that are lit longest."""


def image_data(runs: Sequence[ReplayRun], frames: Frames) -> dict[str, Any]:
    """Everything that is drawn beside the arm, in pixels from the image's centre and one entry per frame."""
    setup, colours = runs[0].setup, looks_of(runs)
    plane = Plane.of(setup)
    return {
        "period": round(frames.period, 6),
        "frames": len(frames.t),
        "size": list(plane.size),
        "half": _rounded(plane.half),
        "outline": None if plane.outline is None else _rounded(plane.outline),
        "forbidden": _forbidden(plane),
        "lines": [_rounded(line) for line in plane.lines],
        "moving": _moving(setup, frames),
        "goals": [{"from": goal.from_time, "pixels": _rounded(goal.pixels)} for goal in setup.task.goals],
        "runs": [_run(run, frames, colours[run.law].colour) for run in runs],
    }


def _run(run: ReplayRun, frames: Frames, colour: str) -> dict[str, Any]:
    trajectory, samples, lights = run.trajectory, frames.samples(run), frames.lights(run)
    things = things_of(run)
    of_markers = [thing[1] if thing is not None and thing[0] == "marker" else 0 for thing in things]
    lit = [int(i) for i in np.argsort(-(lights > 0).sum(axis=0), kind="stable") if lights[:, i].any()]
    listed = sorted(lit[:MOST_ROWS])
    return {
        "law": run.law,
        "colour": colour,
        "status": trajectory.status,
        "reason": trajectory.reason,
        "end": float(trajectory.t[-1]),
        "pixels": _rounded(trajectory.features_px[samples].reshape(len(samples), -1)),
        "error": _rounded(trajectory.feature_error_px[samples]),
        "markers": [
            "".join(map(str, _worst(lights, of_markers, i + 1))) for i in range(trajectory.features_px.shape[1])
        ],
        "rows": [{"label": trajectory.labels[i], "lights": "".join(map(str, lights[:, i]))} for i in listed],
        "more": len(lit) - len(listed),
        "quiet": len(trajectory.labels) - len(lit),
    }


def _worst(lights: Any, of_markers: Sequence[int], marker: int) -> Any:
    """(F,) the brightest lamp of a marker's rows."""
    own = [i for i, one in enumerate(of_markers) if one == marker]
    return lights[:, own].max(axis=1, initial=0)


def _forbidden(plane: Plane) -> list[list[Any]]:
    """Polygons of what is forbidden to markers and stands still, each an outline with its holes."""
    if not plane.constraints:
        return []
    u, v = (np.arange(-half, half + GRID, GRID) for half in plane.half)
    return _filled(u, v, plane.depth(u, v))


def _filled(u: Array, v: Array, depth: Array) -> list[list[Any]]:
    """Where a depth (b, a) on a grid of u (a,) and v (b,) is above zero."""
    generator = contour_generator(u, v, depth, fill_type=FillType.OuterOffset)
    polygons = []
    for points, offsets in zip(*generator.filled(0.0, np.inf), strict=True):
        ends = np.asarray(offsets, dtype=np.int64)
        polygons.append([_rounded(points[a:b]) for a, b in pairwise(ends)])
    return polygons


def _moving(setup: Setup, frames: Frames) -> list[dict[str, Any]]:
    """Boundaries that move: as they are at the start, what of them is forbidden, and by how much they have moved."""
    size = Plane.of(setup).size
    found = []
    for constraint in setup.constraints.constraints:
        if not isinstance(constraint, ImageConstraint) or constraint.motion is None:
            continue
        lines = constraint.boundary(size, frames.t)
        if lines:
            every = np.concatenate(lines)
            u, v = (
                np.linspace(low - 1.0, high + 1.0, 100) for low, high in zip(every.min(0), every.max(0), strict=True)
            )
            depth = np.clip(constraint.sigma(np.stack(np.meshgrid(u, v), axis=-1)), -0.1, 0.1)
            moved = np.array([constraint.motion.displacement(float(t)) for t in frames.t])
            found.append(
                {
                    "lines": [_rounded(line) for line in lines],
                    "forbidden": _filled(u, v, depth),
                    "moved": _rounded(moved),
                }
            )
    return found


def _rounded(values: Array) -> Any:
    """Numbers to a tenth, None for what is not finite."""
    finite = np.where(np.isfinite(values), np.round(values, 1) + 0.0, np.nan).astype(object)
    finite[finite != finite] = None
    return finite.tolist()
