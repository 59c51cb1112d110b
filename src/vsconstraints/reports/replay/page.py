"""The page of a replay: arm and image side by side, one file that needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from itertools import groupby, pairwise
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from contourpy import FillType, contour_generator

from ... import __version__
from ...comparisons.runs.files import replaced
from ...constraints import ImageConstraint
from ...plugins.extras import demand
from ...rows import Array
from ...simulation import Setup
from ..plots.image import Plane
from ..scene3d import draw_setup
from .constraint_highlights import Frames, things_of
from .runs import ReplayRun, check_same_scene, looks_of
from .space import common_viewpoint, space_of

HERE = Path(__file__).parent

PICTURE = (6.4, 4.8)
"""Of the arm, for browsers that cannot draw it [in]."""

GRID = 4.0
"""Of the grid on which the forbidden side is found [px]."""

MAX_ROWS = 14
"""Rows that are listed for a run: those that are highlighted longest."""

PLAYED = ("period", "frames", "half", "moving", "goals", "runs")
"""Of the data, what the page's script needs."""


def write_replay(runs: Sequence[ReplayRun], path: Path | str, title: str = "") -> list[str]:
    """Write the page of :func:`replay_html` to a file; returns what a reader should know, sentence by sentence.

    Raises
    ------
    ConfigurationError
        if the extra ``replay`` is not installed, or the runs cannot be shown together.
    OSError
        if the file cannot be written.
    """
    demand("replay")
    check_same_scene(runs)
    frames = Frames.of(runs)
    html, remarks = _page(runs, frames, title)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        part.write_text(html, encoding="utf-8")
    return remarks


def replay_html(runs: Sequence[ReplayRun], title: str = "") -> str:
    """One HTML file in which runs of one scene are seen in motion, in any browser and without network.

    Arms stand in one space, the first opaque and others transparent; image planes with the constraints that are
    highlighted stand beside each other. ``#t=3.2`` behind the file's address opens it at that time.

    Parameters
    ----------
    runs
        Up to :data:`~vsconstraints.reports.replay.runs.MAX_RUNS`, of one robot, camera and target.
    title
        Above the page; that of the scenario if not given.

    Raises
    ------
    ConfigurationError
        if the extra ``replay`` is not installed, or the runs cannot be shown together.
    """
    demand("replay")
    check_same_scene(runs)
    return _page(runs, Frames.of(runs), title)[0]


def _page(runs: Sequence[ReplayRun], frames: Frames, title: str) -> tuple[str, list[str]]:
    space, data = space_of(runs, frames), image_data(runs, frames)
    ends = [f"{run.law}: {run.trajectory.status}, {run.trajectory.reason}." for run in runs if run.trajectory.reason]
    remarks = [text for text in (*ends, *space.remarks, frames.remark(runs)) if text]
    template = Template((HERE / "page.html").read_text(encoding="utf-8"))
    text = template.substitute(
        title=escape(title or runs[0].title or "Replay"),
        laws=escape(", ".join(run.law for run in runs)),
        version=__version__,
        style=(HERE / "page.css").read_text(encoding="utf-8"),
        script=(HERE / "page.js").read_text(encoding="utf-8"),
        remarks=escape(" ".join(remarks)),
        picture=base64.b64encode(picture_of(runs)).decode(),
        panels="".join(panel_html(data, run) for run in data["runs"]),
        data=_in_html({name: value for name, value in data.items() if name in PLAYED}),
        space=_in_html(space.html),
    )
    return text, remarks


def _in_html(data: Any) -> str:
    """Data as JSON that may stand within a script of HTML."""
    return json.dumps(data, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")


def picture_of(runs: Sequence[ReplayRun]) -> bytes:
    """A PNG of the first arm in the middle of its run."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    run = runs[0]
    k = len(run.trajectory.t) // 2
    figure = Figure(figsize=PICTURE, dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    draw_setup(ax, run.setup, run.trajectory.q[k], float(run.trajectory.t[k]), common_viewpoint(runs))
    file = BytesIO()
    canvas.print_png(file)
    return file.getvalue()


# --- image planes ---


def image_data(runs: Sequence[ReplayRun], frames: Frames) -> dict[str, Any]:
    """Everything that is drawn beside the arm, in pixels from the image's centre and one entry per frame."""
    setup, looks = runs[0].setup, looks_of(runs)
    plane = Plane.of(setup)
    w, h = 0.5 * plane.size[0], 0.5 * plane.size[1]
    return {
        "period": round(frames.period, 6),
        "frames": len(frames.t),
        "half": _rounded(plane.half),
        "outline": [[-w, -h], [w, -h], [w, h], [-w, h]] if plane.outline is None else _rounded(plane.outline),
        "forbidden": _forbidden(plane),
        "lines": [_rounded(line) for line in plane.lines],
        "moving": _moving(setup, frames),
        "goals": [{"from": goal.from_time, "pixels": _rounded(goal.pixels)} for goal in setup.task.goals],
        "runs": [_run(run, frames, looks[run.law].colour) for run in runs],
    }


def _run(run: ReplayRun, frames: Frames, colour: str) -> dict[str, Any]:
    trajectory, samples, states = run.trajectory, frames.samples(run), frames.states(run)
    things = things_of(run)
    markers = []
    for i in range(trajectory.features_px.shape[1]):
        own = [r for r, thing in enumerate(things) if thing == ("marker", i + 1)]
        markers.append("".join(map(str, states[:, own].max(axis=1, initial=0))))
    shown = [int(i) for i in np.argsort(-(states > 0).sum(axis=0), kind="stable") if states[:, i].any()]
    listed = sorted(shown[:MAX_ROWS])
    return {
        "law": run.law,
        "colour": colour,
        "status": trajectory.status,
        "reason": trajectory.reason,
        "end": float(trajectory.t[-1]),
        "pixels": _rounded(trajectory.features_px[samples].reshape(len(samples), -1)),
        "error": _rounded(trajectory.feature_error_px[samples]),
        "markers": markers,
        "rows": [{"label": trajectory.labels[i], "states": "".join(map(str, states[:, i]))} for i in listed],
        "more": len(shown) - len(listed),
        "quiet": len(trajectory.labels) - len(shown),
    }


def _forbidden(plane: Plane) -> list[Any]:
    """Outlines of what is forbidden to markers and stands still, holes among them."""
    if not plane.constraints:
        return []
    u, v = (np.arange(-half, half + GRID, GRID) for half in plane.half)
    return _filled(u, v, plane.depth(u, v))


def _filled(u: Array, v: Array, depth: Array) -> list[Any]:
    """Outlines of where a depth (b, a) on a grid of u (a,) and v (b,) is above zero."""
    generator = contour_generator(u, v, depth, fill_type=FillType.OuterOffset)
    every = zip(*generator.filled(0.0, np.inf), strict=True)
    return [_rounded(points[a:b]) for points, ends in every for a, b in pairwise(np.asarray(ends, dtype=np.int64))]


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
            ends = zip(every.min(axis=0), every.max(axis=0), strict=True)
            u, v = (np.linspace(low - 1.0, high + 1.0, 100) for low, high in ends)
            depth = np.clip(constraint.sigma(np.stack(np.meshgrid(u, v), axis=-1)), -0.1, 0.1)
            moved = np.array([constraint.motion.displacement(float(t)) for t in frames.t])
            own = {"lines": [_rounded(line) for line in lines], "forbidden": _filled(u, v, depth)}
            found.append({**own, "moved": _rounded(moved)})
    return found


def _rounded(values: Array) -> Any:
    """Numbers to a tenth, None for what is not finite."""
    finite = np.where(np.isfinite(values), np.round(values, 1) + 0.0, np.nan).astype(object)
    finite[finite != finite] = None
    return finite.tolist()


# --- as SVG ---


def panel_html(data: dict[str, Any], run: dict[str, Any]) -> str:
    """A run's image plane and its list of constraints; the script moves what is in it."""
    u, v = data["half"]
    still = [_path(data["forbidden"], "forbidden", close=True), _path(data["lines"], "boundary")]
    still.append(_path([data["outline"]], "sensor", close=True))
    pixels = np.array(run["pixels"], dtype=np.float64).reshape(len(run["pixels"]), -1, 2)
    still += [_path([track.tolist()], "ahead") for track in np.moveaxis(pixels, 1, 0)]
    for one in data["moving"]:
        areas, lines = _path(one["forbidden"], "forbidden", close=True), _path(one["lines"], "boundary")
        still.append(f'<g class="moving">{areas}{lines}</g>')
    for goal in data["goals"]:
        stars = "".join(f'<text class="goal" x="{a}" y="{b}">★</text>' for a, b in goal["pixels"])
        still.append(f'<g class="goals">{stars}</g>')
    tracks = "".join('<path class="track" vector-effect="non-scaling-stroke"/>' for _ in run["markers"])
    starts = "".join(f'<circle class="start" cx="{a}" cy="{b}"/>' for a, b in pixels[0])
    disc = '<circle class="highlight"/><circle class="disc"/>'
    markers = "".join(f'<g class="marker">{disc}<text>{i + 1}</text></g>' for i in range(len(run["markers"])))
    rest = [f"{run['more']} more that are active"] if run["more"] else []
    if run["quiet"]:
        rest.append("1 row that is never active" if run["quiet"] == 1 else f"{run['quiet']} rows that are never active")
    others = f'<li class="rest">and {", ".join(rest)}</li>' if rest else ""
    colour = f'style="--law: {run["colour"]}"'
    return (
        f'<article {colour}><h2>{escape(run["law"])}<span title="{escape(run["reason"])}"></span></h2>'
        f'<svg class="plane" viewBox="{-u} {-v} {2 * u} {2 * v}">{"".join(still)}{tracks}{starts}{markers}</svg>'
        f"<ul>{''.join(_row_html(row, data['frames']) for row in run['rows'])}{others}</ul></article>"
    )


def _row_html(row: dict[str, Any], count: int) -> str:
    head, bracket, rest = row["label"].partition("[")
    bars, at = [], 0
    for state, run in groupby(row["states"]):
        width = len(list(run))
        if state != "0":
            bars.append(f'<rect class="s{state}" x="{at}" width="{width}" height="1"/>')
        at += width
    # a long name goes on in the next line before its bracket
    name = f'<code title="{escape(row["label"])}">{escape(head)}<wbr>{escape(bracket + rest)}</code>'
    lane = f'<svg class="lane" viewBox="0 0 {count} 1" preserveAspectRatio="none">{"".join(bars)}'
    return f'<li><span class="state"></span>{name}{lane}<line class="now" y2="1"/></svg></li>'


def _path(lines: Iterable[Any], kind: str, close: bool = False) -> str:
    """Polylines (p, 2) as one path; points that are not finite are left out."""
    texts = []
    for line in lines:
        points = [f"{u:g},{v:g}" for u, v in line if u is not None and u == u]
        if points:
            texts.append(f"M{'L'.join(points)}{'Z' if close else ''}")
    return f'<path class="{kind}" vector-effect="non-scaling-stroke" d="{"".join(texts)}"/>'
