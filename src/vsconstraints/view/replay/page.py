"""Page of a replay: arm and image side by side, in one file that needs no network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from io import BytesIO
from itertools import groupby
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from ...comparisons.runs.files import replaced
from ...comparisons.runs.machine import VERSION
from ...plugins.extras import demand
from ...reports.plots.image import Plane
from ...rows import Array
from ..setup_scene import draw_setup
from .runs import Frames, ReplayRun, States, check_same_scene, colours_of, things_of
from .space import common_viewpoint, space_of

PICTURE = (6.4, 4.8)  # of the arm, for browsers that cannot render it [in]
MAX_ROWS = 14  # rows that are listed for a run: those highlighted longest
# Parts of the data that the script of the page needs.
PLAYED = ("period", "frames", "half", "moving", "goals", "runs")


def write_replay(runs: Sequence[ReplayRun], path: Path | str, title: str = "") -> list[str]:
    """Write the page of :func:`replay_html` to a file; return remarks for the reader."""
    html, remarks = _page(runs, title)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        part.write_text(html, encoding="utf-8")
    return remarks


def replay_html(runs: Sequence[ReplayRun], title: str = "") -> str:
    """Return one HTML file that plays up to four runs of one scene in any browser.

    It needs no network. ``#t=3.2`` after the file's address opens it at that time. The title is
    that of the scenario if none is given. Raises ConfigurationError if the extra ``replay`` is not
    installed, or if the runs cannot be shown together.
    """
    return _page(runs, title)[0]


def _page(runs: Sequence[ReplayRun], title: str) -> tuple[str, list[str]]:
    demand("replay")
    check_same_scene(runs)
    frames = Frames.of(runs)
    space, bars = space_of(runs, frames)
    data = image_data(runs, frames)
    remarks = []
    for run in runs:
        if run.trajectory.reason:
            remarks.append(f"{run.law}: {run.trajectory.status}, {run.trajectory.reason}.")
    remarks += filter(None, (bars, frames.remark(runs)))
    folder = jinja2.FileSystemLoader(Path(__file__).parent)
    pages = jinja2.Environment(
        loader=folder, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    pages.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "ensure_ascii": False}
    pages.filters |= {"path": _path, "bars": _bars, "tracks": _tracks}
    text = pages.get_template("page.html").render(
        title=title or runs[0].title or "Replay",
        laws=", ".join(run.law for run in runs),
        version=VERSION,
        remarks=" ".join(remarks),
        picture=base64.b64encode(picture_of(runs)).decode(),
        data=data,
        played={name: data[name] for name in PLAYED},
        space=space,
    )
    return text, remarks


def picture_of(runs: Sequence[ReplayRun]) -> bytes:
    """Return a PNG of the first arm in the middle of its run."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    run = runs[0].trajectory
    figure = Figure(figsize=PICTURE, dpi=100, facecolor="white")
    file = BytesIO()
    k = len(run.t) // 2
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    draw_setup(ax, runs[0].setup, run.q[k], float(run.t[k]), common_viewpoint(runs))
    FigureCanvasAgg(figure).print_png(file)
    return file.getvalue()


def image_data(runs: Sequence[ReplayRun], frames: Frames) -> dict[str, Any]:
    """Return all data drawn in the image, in pixels from its centre, with one entry per frame."""
    setup = runs[0].setup
    plane = Plane.of(setup)
    moving = []
    for constraint, motion, _ in plane.drifting:
        lines = constraint.boundary(plane.size, frames.t)
        if not lines:
            continue
        points = np.concatenate(lines)
        low = points.min(axis=0) - 1.0
        high = points.max(axis=0) + 1.0
        alone = Plane(plane.size, (constraint,))
        area = alone.forbidden_within(0.5 * (low + high), 0.5 * (high - low))
        moving.append(
            {
                "lines": list(map(_rounded, lines)),
                "forbidden": list(map(_rounded, area)),
                "moved": _rounded(motion.displacement(frames.t)),
            }
        )
    goals = []
    for goal in setup.task.goals:
        goals.append({"from": goal.from_time, "pixels": _rounded(goal.pixels)})
    colours = colours_of(runs)
    return {
        "period": round(frames.period, 6),
        "frames": len(frames.t),
        "half": _rounded(plane.half),
        "outline": [_rounded(plane.edge)],
        "forbidden": list(map(_rounded, plane.forbidden)),
        "lines": list(map(_rounded, plane.lines)),
        "moving": moving,
        "goals": goals,
        "runs": [_run(run, frames, colour) for run, colour in zip(runs, colours, strict=True)],
    }


def _run(run: ReplayRun, frames: Frames, colour: str) -> dict[str, Any]:
    trajectory = run.trajectory
    samples = frames.samples(run)
    states = frames.states(run)
    things = things_of(run)
    markers = []
    for i in range(trajectory.features_px.shape[1]):
        applies = [thing == ("marker", i + 1) for thing in things]
        markers.append(_digits(states[:, applies].max(axis=1, initial=0)))
    highlighted_frames = (states > 0).sum(axis=0)
    order = np.argsort(-highlighted_frames, kind="stable")
    highlighted = [int(i) for i in order if highlighted_frames[i]]
    rows = []
    for i in sorted(highlighted[:MAX_ROWS]):
        rows.append({"label": trajectory.labels[i], "states": _digits(states[:, i])})
    return {
        "law": run.law,
        "colour": colour,
        "status": trajectory.status,
        "reason": trajectory.reason,
        "end": float(trajectory.t[-1]),
        "pixels": _rounded(trajectory.features_px[samples].reshape(len(samples), -1)),
        "error": _rounded(trajectory.feature_error_px[samples]),
        "markers": markers,
        "rows": rows,
        "more": max(len(highlighted) - MAX_ROWS, 0),
        "quiet": len(trajectory.labels) - len(highlighted),
    }


def _digits(states: States) -> str:
    """Return the states of all frames as one text with a digit each."""
    return "".join(map(str, states))


def _rounded(values: Array) -> list[Any]:
    """Return numbers rounded to a tenth as lists, None for those that are not finite."""
    rounded = (np.round(values, 1) + 0.0).astype(object)
    rounded[~np.isfinite(values)] = None
    lists: list[Any] = rounded.tolist()
    return lists


def _path(lines: Iterable[Any], close: bool = False) -> str:
    """Return polylines (p, 2) as the data of one SVG path; unknown points are left out."""
    path = ""
    for line in lines:
        points = [f"{u:g},{v:g}" for u, v in line if u is not None]
        if points:
            path += f"M{'L'.join(points)}{'Z' if close else ''}"
    return path


def _tracks(pixels: Sequence[Sequence[Any]]) -> list[list[tuple[Any, Any]]]:
    """Return the track of each marker from pixels (F, 2M)."""
    columns = list(zip(*pixels, strict=True))
    tracks = []
    for u, v in zip(columns[::2], columns[1::2], strict=True):
        tracks.append(list(zip(u, v, strict=True)))
    return tracks


def _bars(states: str) -> list[tuple[str, int, int]]:
    """Return state, first frame and length of each span in which a row is not inactive."""
    bars = []
    first = 0
    for state, span in groupby(states):
        length = len(list(span))
        if state != "0":
            bars.append((state, first, length))
        first += length
    return bars
