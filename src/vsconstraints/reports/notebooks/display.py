"""What a session shows: figures, data frames, small tables as HTML, and how far a comparison is."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from ...comparisons.metrics import Score
from ...errors import ConfigurationError, unknown_name
from ...plugins.extras import demand
from ...simulation import Trajectory
from ..figures import FIGURES, View
from ..selection import Weights, active_rows, relevant_rows

if TYPE_CHECKING:
    import pandas as pd

# --- figures ---


@dataclass(frozen=True)
class Plots:
    """What can be drawn of runs of one scenario, each a figure of matplotlib.

    Attributes
    ----------
    view
        The runs.
    """

    view: View

    def tracks(self) -> Any:
        """The markers' tracks in the image, with the boundaries of constraints in it."""
        return self._drawn("tracks", self.view)

    def rows(self, *labels: str) -> Any:
        """φ of rows over time, relative to one switching step T_s u⁺, and when rows hold the arm back.

        Parameters
        ----------
        labels
            Of the rows; those that are challenged or violated if none is given.

        Raises
        ------
        ConfigurationError
            if there is no row of that label, or none that held the arm back.
        """
        known = dict.fromkeys(label for run in self.view.runs.values() for label in run.trajectory.labels)
        for label in labels:
            if label not in known:
                raise unknown_name("row", label, known)
        view = replace(self.view, phi_rows=labels, lane_rows=labels) if labels else self.view
        return self._drawn("phi", view)

    def errors(self) -> Any:
        """Errors of the camera's pose or of the markers over time."""
        return self._drawn("errors", self.view)

    def command(self) -> Any:
        """Commanded joint accelerations over time, their means and ranges in short windows."""
        return self._drawn("acceleration", self.view)

    def _drawn(self, name: str, view: View) -> Any:
        if not view.runs:
            raise ConfigurationError("there is nothing to draw: no run left a trajectory")
        (figure,) = (one for one in FIGURES if one.name == name)
        drawn = figure.drawn(view)
        if drawn is None:
            raise ConfigurationError(f"there is nothing to draw of {figure.title}: no row is challenged or acts")
        return drawn

    def __repr__(self) -> str:
        return f"<Plots of {', '.join(self.view.shown) or 'no run'}: tracks(), rows(), errors(), command()>"


def rows_shown(score: Score) -> dict[str, tuple[str, ...]]:
    """Which rows figures of one run show, as a view takes them."""
    weights: Weights = {
        str(line["constraint"]): (bool(line["challenged"]) or line["violation_depth"] > 0.0, line["active_time_s"])
        for line in score.constraints
    }
    return {"phi_rows": relevant_rows(weights), "lane_rows": active_rows(weights)}


# --- data frames ---

OF_JOINTS = ("q", "qd", "qdd_command")
OF_ROWS = ("phi", "sigma", "clearance", "active")
SINGLE = ("feature_error_px", "saturated", "rows_time", "step_time")
"""Fields of a trajectory, by what their second axis counts."""


def frame_of(trajectory: Trajectory) -> pd.DataFrame:
    """A trajectory as a data frame with one line per sample, by its time [s]; units are those of the trajectory.

    Columns have two levels: what, and of what. ``frame["phi"]["fov[marker 2]"]`` is a row's φ, ``frame["q"]`` has
    columns ``joint 1``, ``joint 2``, …; what there is one of in a sample has an empty second level.

    Raises
    ------
    ConfigurationError
        if pandas is not installed.
    """
    demand("pandas")
    import pandas as pd

    columns: dict[tuple[str, str], Any] = {}

    def put(what: str, names: list[str], values: Any) -> None:
        columns.update({(what, name): values[:, i] for i, name in enumerate(names)})

    def numbered(name: str, values: Any) -> list[str]:
        return [f"{name} {i + 1}" for i in range(np.shape(values)[1])]

    for what in OF_JOINTS:
        put(what, numbered("joint", getattr(trajectory, what)), getattr(trajectory, what))
    put("error", numbered("feature", trajectory.error), trajectory.error)
    put("camera_error", ["distance [m]", "angle [rad]"], trajectory.camera_error)
    put("camera_position", ["x", "y", "z"], trajectory.camera_position)
    for axis, what in enumerate(("u_px", "v_px")):
        put(what, numbered("marker", trajectory.features_px), trajectory.features_px[:, :, axis])
    for what in OF_ROWS:
        put(what, list(trajectory.labels), getattr(trajectory, what))
    columns |= {(what, ""): getattr(trajectory, what) for what in SINGLE}
    frame = pd.DataFrame(columns, index=pd.Index(trajectory.t, name="t"))
    frame.columns = pd.MultiIndex.from_tuples(columns)
    return frame


def table_of(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Lines of a table as a data frame; raises ConfigurationError if pandas is not installed."""
    demand("pandas")
    import pandas as pd

    return pd.DataFrame(lines)


# --- HTML ---

PICTURE_DPI = 75
"""Of small pictures: they are as wide as a notebook's column, and take some 50 kB."""


def table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table of texts."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in line)}</tr>" for line in lines)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def paragraph(text: str) -> str:
    """A text by itself."""
    return f"<p>{escape(text)}</p>"


def picture(figure: Any, alternative: str) -> str:
    """A figure of matplotlib in the text, with a text for where it cannot be seen."""
    file = BytesIO()
    figure.savefig(file, format="png", dpi=PICTURE_DPI)
    data = base64.b64encode(file.getvalue()).decode()
    return f'<img alt="{escape(alternative)}" src="data:image/png;base64,{data}">'


def page_within(page: str, height: int = 640) -> str:
    """A whole page of its own within another one."""
    return f'<iframe srcdoc="{escape(page)}" style="width:100%;height:{height}px;border:0"></iframe>'


# --- progress ---

UPDATE = 0.2
"""Between two updates of a notebook's line [s]."""


@contextmanager
def progress(total: int, console: Console | None = None) -> Iterator[Callable[[], None]]:
    """Show how many of ``total`` runs are done, in a terminal or a notebook; the function that it gives counts them.

    ``console`` is where, the standard error stream if not given.
    """
    console = console or Console(stderr=True)
    if console.is_jupyter:
        yield from _line(total)
    elif console.is_terminal:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=console) as bars:
            bar = bars.add_task("comparing", total=total)
            yield lambda: bars.advance(bar)
    else:
        yield lambda: None


def _line(total: int) -> Iterator[Callable[[], None]]:
    """A line below a cell, updated as runs are done."""
    from IPython import display

    begun = updated = time.monotonic()
    done = 0

    def text() -> dict[str, str]:
        return {"text/plain": f"comparing: {done} of {total} runs, {time.monotonic() - begun:.0f} s"}

    show: Any = display.display
    line = show(text(), raw=True, display_id=True)

    def advance() -> None:
        nonlocal done, updated
        done += 1
        if time.monotonic() - updated > UPDATE:
            updated = time.monotonic()
            line.update(text(), raw=True)

    yield advance
    line.update(text(), raw=True)
