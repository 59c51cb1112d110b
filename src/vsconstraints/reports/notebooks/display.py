"""What a session shows: figures, data frames, small tables as HTML, and how far a comparison is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ...comparisons.metrics import Score
from ...errors import ConfigurationError, unknown_name
from ...plugins.extras import demand
from ...simulation import Trajectory
from ..figures import ACCELERATION, ERRORS, PHI, TRACKS, View
from ..plots import Figure
from ..selection import Weights, active_rows, relevant_rows

if TYPE_CHECKING:
    import pandas as pd

UPDATE = 0.2
"""Between two updates of a notebook's line [s]."""


@dataclass(frozen=True)
class Plots:
    """What can be drawn of runs of one scenario, each a figure of matplotlib.

    All raise ConfigurationError if there is nothing to draw.
    """

    view: View

    def tracks(self) -> Any:
        """The markers' tracks in the image, with the boundaries of constraints in it."""
        return _drawn(TRACKS, self.view)

    def rows(self, *labels: str) -> Any:
        """φ of rows over time, relative to one switching step T_s u⁺, and when rows hold the arm back.

        Of the rows of these labels, or those that are challenged or violated; ConfigurationError for unknown ones.
        """
        known = dict.fromkeys(label for run in self.view.runs.values() for label in run.trajectory.labels)
        for label in labels:
            if label not in known:
                raise unknown_name("row", label, known)
        return _drawn(PHI, replace(self.view, phi_rows=labels, lane_rows=labels) if labels else self.view)

    def errors(self) -> Any:
        """Errors of the camera's pose or of the markers over time."""
        return _drawn(ERRORS, self.view)

    def command(self) -> Any:
        """Commanded joint accelerations over time, their means and ranges in short windows."""
        return _drawn(ACCELERATION, self.view)

    def __repr__(self) -> str:
        return f"<Plots of {', '.join(self.view.shown) or 'no run'}: tracks(), rows(), errors(), command()>"


def _drawn(figure: Figure, view: View) -> Any:
    if not view.runs:
        raise ConfigurationError("there is nothing to draw: no run left a trajectory")
    drawn = figure.drawn(view)
    if drawn is None:
        raise ConfigurationError(f"there is nothing to draw of {figure.title}: no row is challenged or acts")
    return drawn


def rows_shown(score: Score) -> dict[str, tuple[str, ...]]:
    """Which rows figures of one run show, as a view takes them."""
    weights: Weights = {
        str(line["constraint"]): (bool(line["challenged"]) or line["violation_depth"] > 0.0, line["active_time_s"])
        for line in score.constraints
    }
    return {"phi_rows": relevant_rows(weights), "lane_rows": active_rows(weights)}


# --- data frames ---


def frame_of(trajectory: Trajectory) -> pd.DataFrame:
    """A trajectory as a data frame with one line per sample, by its time [s]; units are those of the trajectory.

    Columns have two levels: what, and of what. ``frame["phi"]["fov[marker 2]"]`` is a row's φ, ``frame["q"]`` has
    columns ``joint 1``, ``joint 2``, …; what there is one of in a sample has an empty second level. Raises
    ConfigurationError if pandas is not installed.
    """
    demand("pandas")
    import pandas as pd

    def numbered(name: str, values: Any) -> list[str]:
        return [f"{name} {i + 1}" for i in range(values.shape[1])]

    one, parts = trajectory, []
    parts += [(what, numbered("joint", one.q), getattr(one, what)) for what in ("q", "qd", "qdd_command")]
    parts.append(("error", numbered("feature", one.error), one.error))
    parts.append(("camera_error", ["distance [m]", "angle [rad]"], one.camera_error))
    parts.append(("camera_position", ["x", "y", "z"], one.camera_position))
    pixels = zip(("u_px", "v_px"), (one.features_px[:, :, 0], one.features_px[:, :, 1]), strict=True)
    parts += [(what, numbered("marker", values), values) for what, values in pixels]
    parts += [(what, list(one.labels), getattr(one, what)) for what in ("phi", "sigma", "clearance", "active")]
    columns = {(what, name): values[:, i] for what, names, values in parts for i, name in enumerate(names)}
    columns |= {(what, ""): getattr(one, what) for what in ("feature_error_px", "saturated", "rows_time", "step_time")}
    frame = pd.DataFrame(columns, index=pd.Index(one.t, name="t"))
    frame.columns = pd.MultiIndex.from_tuples(columns)
    return frame


def table_of(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Lines of a table as a data frame; raises ConfigurationError if pandas is not installed."""
    demand("pandas")
    import pandas as pd

    return pd.DataFrame(lines)


def table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table of texts as HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in line)}</tr>" for line in lines)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


# --- progress ---


@contextmanager
def progress(total: int) -> Iterator[Callable[[], None]]:
    """Show how many of ``total`` runs are done, in a terminal or a notebook; the function that it gives counts them."""
    console = Console(stderr=True)
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
