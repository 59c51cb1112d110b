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
from .runs import (
    INACTIVE,
    Frames,
    ReplayRun,
    States,
    Thing,
    check_same_scene,
    coloured,
    things_of,
)
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
    """Return the page of runs, and remarks for the reader."""
    demand("replay")
    check_same_scene(runs)
    frames = Frames.of(runs)
    space, simplified = space_of(runs, frames)
    data = image_data(runs, frames)
    remarks = []
    for run in runs:
        if run.trajectory.reason:
            remarks.append(f"{run.law}: {run.trajectory.status}, {run.trajectory.reason}.")
    for remark in (simplified, frames.remark(runs)):
        if remark:
            remarks.append(remark)
    text = _template().render(
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


def _template() -> jinja2.Template:
    """Return the template of the page."""
    pages = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    pages.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "ensure_ascii": False}
    pages.filters |= {"path": _path, "bars": _bars, "tracks": _tracks}
    return pages.get_template("page.html")


def picture_of(runs: Sequence[ReplayRun]) -> bytes:
    """Return a PNG of the first arm in the middle of its run."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    trajectory = runs[0].trajectory
    middle = len(trajectory.t) // 2
    q = trajectory.q[middle]
    t = float(trajectory.t[middle])
    figure = Figure(figsize=PICTURE, dpi=100, facecolor="white")
    whole_figure = (0.0, 0.0, 1.0, 1.0)
    ax = figure.add_axes(whole_figure, projection="3d", computed_zorder=False)
    draw_setup(ax, runs[0].setup, q, t, common_viewpoint(runs))
    file = BytesIO()
    FigureCanvasAgg(figure).print_png(file)
    return file.getvalue()


def image_data(runs: Sequence[ReplayRun], frames: Frames) -> dict[str, Any]:
    """Return all data drawn in the image, in pixels from its centre, with one entry per frame."""
    setup = runs[0].setup
    plane = Plane.of(setup)
    goals = []
    for goal in setup.task.goals:
        goals.append({"from": goal.from_time, "pixels": _rounded(goal.pixels)})
    return {
        "period": round(frames.period, 6),
        "frames": len(frames.t),
        "half": _rounded(plane.half),
        "outline": [_rounded(plane.edge)],
        "forbidden": _all_rounded(plane.forbidden),
        "lines": _all_rounded(plane.lines),
        "moving": _moving(plane, frames),
        "goals": goals,
        "runs": [_run_data(run, frames, colour) for run, colour in coloured(runs)],
    }


def _moving(plane: Plane, frames: Frames) -> list[dict[str, Any]]:
    """Return lines and forbidden area of each moving boundary, and its displacement by frame."""
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
                "lines": _all_rounded(lines),
                "forbidden": _all_rounded(area),
                "moved": _rounded(motion.displacement(frames.t)),
            }
        )
    return moving


def _run_data(run: ReplayRun, frames: Frames, colour: str) -> dict[str, Any]:
    """Return the data of one run: its markers' pixels, and states of markers and rows."""
    trajectory = run.trajectory
    samples = frames.samples(run)
    pixels = trajectory.features_px[samples]
    frame_count, marker_count, _ = pixels.shape
    states = frames.states(run)
    things = things_of(run)
    marker_states = []
    for number in range(1, marker_count + 1):
        applies = [thing == Thing("marker", number) for thing in things]
        of_marker = states[:, applies].max(axis=1, initial=INACTIVE)
        marker_states.append(_digits(of_marker))
    highlighted_frames = (states != INACTIVE).sum(axis=0)
    longest_first = np.argsort(-highlighted_frames, kind="stable")
    highlighted_count = int(np.count_nonzero(highlighted_frames))
    listed = longest_first[: min(highlighted_count, MAX_ROWS)]
    rows = []
    for i in sorted(listed):
        row_states = _digits(states[:, i])
        rows.append({"label": trajectory.labels[i], "states": row_states})
    return {
        "law": run.law,
        "colour": colour,
        "status": trajectory.status,
        "reason": trajectory.reason,
        "end": float(trajectory.t[-1]),
        "pixels": _rounded(pixels.reshape(frame_count, -1)),
        "error": _rounded(trajectory.feature_error_px[samples]),
        "markers": marker_states,
        "rows": rows,
        "more": highlighted_count - len(rows),
        "quiet": len(trajectory.labels) - highlighted_count,
    }


def _digits(states: States) -> str:
    """Return the states of all frames as one text with a digit each."""
    return "".join(map(str, states))


def _rounded(values: Array) -> list[Any]:
    """Return numbers rounded to a tenth as lists, None for those that are not finite."""
    without_minus_zero = np.round(values, 1) + 0.0
    rounded = without_minus_zero.astype(object)
    rounded[~np.isfinite(values)] = None
    lists: list[Any] = rounded.tolist()
    return lists


def _all_rounded(arrays: Iterable[Array]) -> list[list[Any]]:
    """Return several arrays as :func:`_rounded`."""
    return [_rounded(array) for array in arrays]


def _path(lines: Iterable[Any], close: bool = False) -> str:
    """Return polylines (p, 2) as the data of one SVG path; unknown points are left out."""
    end = "Z" if close else ""
    path = ""
    for line in lines:
        points = [f"{u:g},{v:g}" for u, v in line if u is not None]
        if points:
            path += f"M{'L'.join(points)}{end}"
    return path


def _tracks(pixels: Sequence[Sequence[Any]]) -> list[list[tuple[Any, Any]]]:
    """Return the track of each marker from pixels (F, 2M)."""
    tracks = []
    columns = list(zip(*pixels, strict=True))
    for marker in range(len(columns) // 2):
        u = columns[2 * marker]
        v = columns[2 * marker + 1]
        tracks.append(list(zip(u, v, strict=True)))
    return tracks


def _bars(states: str) -> list[tuple[str, int, int]]:
    """Return state, first frame and length of each span in which a row is not inactive."""
    inactive = str(INACTIVE)
    bars = []
    first = 0
    for state, span in groupby(states):
        length = len(list(span))
        if state != inactive:
            bars.append((state, first, length))
        first += length
    return bars
