"""The page of a replay: arm and image side by side, one file that needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from string import Template
from typing import Any

from ... import __version__
from ...comparisons.runs.files import replaced
from ...plugins.extras import demand
from ..plots.mesh import Mesh
from ..preview.moments import moment_at
from ..preview.space import drawn
from .frames import Frames
from .image import image_data
from .run import ReplayRun, demand_seen_together
from .space import space_of
from .viewpoint import common_viewpoint

HERE = Path(__file__).parent

PICTURE = (6.4, 4.8)
"""Of the arm, for browsers that cannot draw it [in]."""


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
    demand_seen_together(runs)
    frames = Frames.of(runs)
    html, remarks = _page(runs, frames, title)
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        part.write_text(html, encoding="utf-8")
    return remarks


def replay_html(runs: Sequence[ReplayRun], title: str = "") -> str:
    """One HTML file in which runs of one scene are seen in motion, in any browser and without network.

    Arms stand in one space, the first opaque and others as glass; image planes with the rows that are lit stand
    beside each other. ``#t=3.2`` behind the file's address opens it at that time.

    Parameters
    ----------
    runs
        Up to :data:`~vsconstraints.reports.replay.run.MOST_RUNS`, of one robot, camera and target.
    title
        Above the page; that of the scenario if not given.

    Raises
    ------
    ConfigurationError
        if the extra ``replay`` is not installed, or the runs cannot be shown together.
    """
    demand("replay")
    demand_seen_together(runs)
    return _page(runs, Frames.of(runs), title)[0]


def _page(runs: Sequence[ReplayRun], frames: Frames, title: str) -> tuple[str, list[str]]:
    space = space_of(runs, frames)
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
        data=_in_html(image_data(runs, frames)),
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
    viewpoint, k = common_viewpoint(runs), len(run.trajectory.t) // 2
    moment = moment_at(run.setup, "", float(run.trajectory.t[k]), run.trajectory.q[k], run.trajectory.qd[k])
    mesh: Mesh = drawn(run.setup, moment, viewpoint.half)
    figure = Figure(figsize=PICTURE, dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
    mesh.draw(ax, viewpoint.centre.tolist(), viewpoint.half, viewpoint.elevation, viewpoint.azimuth, whole=True)
    file = BytesIO()
    canvas.print_png(file)
    return file.getvalue()
