"""One run, made in a line and looked at in another."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from contextlib import chdir
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...comparisons import RunRecord, RunSpec, score
from ...comparisons.metrics import METRICS, Score
from ...comparisons.run import Run, perform
from ...comparisons.runs.spec import BASELINE
from ...controllers import Controller, Tracking
from ...errors import ConfigurationError, unknown_name
from ...plugins.classes import beside
from ...plugins.extras import demand
from ...rows.readable import amount, counted, in_one_line
from ...simulation import Trajectory, simulate
from ..figures import ACCELERATION, ERRORS, PHI, TRACKS, View
from ..numbers import DASH, FORMATS
from ..page import render_html
from ..plots import Figure
from ..results import RowsShown, shown
from .inputs import AnyLaw, AnyScenario, instance_of, own_spec, scenarios_of, spec_of

if TYPE_CHECKING:
    import pandas as pd

SHOWN = ("outcome", "task", "chattering")  # groups of metrics that a run shows of itself
#: Of a small picture, as wide as a notebook's column with some 50 kB; and height of a page within
#: another one [px].
PICTURE_DPI = 75
PAGE_HEIGHT = 640


@dataclass(frozen=True)
class Plots:
    """What can be drawn of runs of one scenario, each a figure of matplotlib.

    All raise ConfigurationError if there is nothing to draw.
    """

    view: View

    def tracks(self) -> Any:
        """The markers' tracks in the image, with the boundaries of constraints in it."""
        return self._drawn(TRACKS)

    def rows(self, *labels: str) -> Any:
        """φ of rows over time, relative to one switching step T_s u⁺, and when rows hold the arm
        back.

        Of the rows of these labels, or those that are challenged or violated; ConfigurationError
        for unknown ones.
        """
        known = dict.fromkeys(
            label for run in self.view.runs.values() for label in run.trajectory.labels
        )
        for label in labels:
            if label not in known:
                raise unknown_name("row", label, known)
        view = replace(self.view, phi_rows=labels, lane_rows=labels) if labels else self.view
        return self._drawn(PHI, view)

    def errors(self) -> Any:
        """Errors of the camera's pose or of the markers over time."""
        return self._drawn(ERRORS)

    def command(self) -> Any:
        """Commanded joint accelerations over time, their means and ranges in short windows."""
        return self._drawn(ACCELERATION)

    def _drawn(self, figure: Figure, view: View | None = None) -> Any:
        if not self.view.runs:
            raise ConfigurationError("there is nothing to draw: no run left a trajectory")
        drawn = figure.drawn(view or self.view)
        if drawn is None:
            raise ConfigurationError(
                f"there is nothing to draw of {figure.title}: no row is challenged or acts"
            )
        return drawn

    def __repr__(self) -> str:
        return (
            f"<Plots of {', '.join(self.view.shown) or 'no run'}: tracks(), rows(), errors(), "
            f"command()>"
        )


@dataclass(frozen=True, repr=False)
class NotebookRun(Run):
    """A run that draws, scores and replays itself.

    ``setup`` and ``record`` are what was run and what it left; ``law`` and ``scenario`` what
    figures and tables call them; ``folder`` is where own parts of the scenario lie, if that is
    known; ``stored_baseline`` is tracking alone, where it has been run already.
    """

    law: str = ""
    scenario: str = ""
    title: str = ""
    folder: Path | None = None
    stored_baseline: RunRecord | None = None

    @cached_property
    def baseline(self) -> RunRecord:
        """Tracking alone in the same setup, which tells what is challenged; run when first asked
        for.
        """
        if self.law == BASELINE:
            return self.record
        if self.stored_baseline is not None:
            return self.stored_baseline
        with chdir("."), beside(self.folder):  # own parts may do as they like
            return RunRecord.of(
                self.setup, simulate(self.setup, Tracking(), by_public_call=True), ""
            )

    @cached_property
    def score(self) -> Score:
        """Its scores, as a comparison has them: its line of results.csv, and those of its rows in
        constraints.csv.
        """
        return score(self.record, self.baseline)

    def scores(self) -> dict[str, Any]:
        """Its line of results.csv by the names of the columns, defined in the documentation of
        metrics.
        """
        values = self.score.result.items()
        return {
            name: value.item() if isinstance(value, np.generic) else value for name, value in values
        }

    def row_scores(self) -> pd.DataFrame:
        """The lines of its rows in constraints.csv, by their labels; needs pandas."""
        return table_of(self.score.constraints).set_index("constraint")

    def to_dataframe(self) -> pd.DataFrame:
        """Its samples, one line each, by their time."""
        return frame_of(self.trajectory)

    @property
    def plot(self) -> Plots:
        """Its figures: ``run.plot.tracks()``, ``.rows()``, ``.errors()`` and ``.command()``."""
        known = {BASELINE: self.baseline, self.law: self.record}
        runs = {name: record for name, record in known.items() if len(record.trajectory.t) > 1}
        rows = RowsShown.of(self.score.constraints)
        return Plots(View(self.setup, runs, tuple(known), rows.phi, rows.lanes))

    def replay(self, *others: NotebookRun, path: str | Path | None = None) -> ReplayPage | Path:
        """The run in motion, with others of the same scene: shown in a notebook or, with a path,
        written to a file.

        Raises ConfigurationError if the extra ``replay`` is not installed, or the runs are not of
        the same scene.
        """
        from ..replay import ReplayRun, replay_html, write_replay

        runs = [ReplayRun(one.law, one.setup, one.trajectory, one.title) for one in (self, *others)]
        if path is None:
            return ReplayPage(replay_html(runs))
        write_replay(runs, path)
        return Path(path)

    @in_one_line
    def __repr__(self) -> str:
        # what is said here needs no baseline
        t = self.t
        result = score(self.record, None).result
        lasts = f"{amount(t[-1])} s in {counted(len(t), 'sample')}, " if len(t) else ""
        reason = f" ({result['reason']})" if result["reason"] else ""
        where = f"{self.law or 'a law'} on {self.scenario or 'a setup'}"
        return (
            f"<Run of {where}: {result['status']}{reason}, {lasts}violated rows: "
            f"{result['violated'] or 'none'}>"
        )

    def _repr_html_(self) -> str:
        """What a notebook shows: a picture of the tracks, and the scores."""
        result = self.score.result
        file = BytesIO()
        if len(self.t) > 1 and self.trajectory.features_px.size:
            self.plot.tracks().savefig(file, format="png", dpi=PICTURE_DPI)
        metrics = [one for one in METRICS if one.header and one.group in SHOWN]
        cells = [(one.header, FORMATS[one.style](shown(one, result))) for one in metrics]
        picture = base64.b64encode(file.getvalue()).decode()
        lines = [cell for cell in cells if cell[1] != DASH]
        return render_html("notebook.html", run=self, result=result, picture=picture, lines=lines)


@dataclass(frozen=True)
class ReplayPage:
    """A replay as a page of its own, which needs no network."""

    html: str

    def __repr__(self) -> str:
        return f"<Replay: a page of {len(self.html) / 1e6:.1f} MB; write it with .save(path)>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the page itself."""
        return (
            f'<iframe srcdoc="{escape(self.html)}" '
            f'style="width:100%;height:{PAGE_HEIGHT}px;border:0"></iframe>'
        )

    def save(self, path: str | Path) -> Path:
        """Write it to a file for any browser."""
        Path(path).write_text(self.html, encoding="utf-8")
        return Path(path)


def run(scenario: AnyScenario, law: AnyLaw, *, trial: int = 0, seed: int = 0) -> NotebookRun:
    """Simulate a law on a scenario, in this process.

    ``scenario`` is the name of a shipped one, a path, a :class:`.Scenario`, or a :class:`.Setup`
    made in Python; ``law`` an instance, a class, a registered name, or ``module:Class``; ``trial``
    and ``seed`` say where it starts, see :meth:`.Scenario.setup`, which a setup says itself. Raises
    ConfigurationError if there is no such scenario or law, or the robot cannot start. A law that
    fails ends the run, whose status is then ``failed``.
    """
    if not isinstance(law, str):
        law = instance_of(law)
    spec, _ = spec_of(law)
    if isinstance(law, Controller):
        spec = own_spec(law, spec.name)
    (loaded,) = scenarios_of([scenario])
    finished = perform(
        RunSpec(loaded, spec, trial=trial, seed=seed), by_public_call=True, to_the_goal=True
    )
    return NotebookRun(
        finished.setup, finished.record, spec.name, loaded.name, loaded.title, loaded.folder
    )


# --- data frames and tables ---


def frame_of(trajectory: Trajectory) -> pd.DataFrame:
    """A trajectory as a data frame with one line per sample, by its time [s]; units are those of
    the trajectory.

    Columns have two levels: what, and of what. ``frame["phi"]["fov[marker 2]"]`` is a row's φ,
    ``frame["q"]`` has columns ``joint 1``, ``joint 2``, …; what there is one of in a sample has an
    empty second level. Raises ConfigurationError if pandas is not installed.
    """
    demand("pandas")
    import pandas as pd

    def numbered(name: str, *values: Any) -> list[tuple[list[str], Any]]:
        return [([f"{name} {i + 1}" for i in range(one.shape[1])], one) for one in values]

    one = trajectory
    u = one.features_px[:, :, 0]
    v = one.features_px[:, :, 1]
    parts = {
        **dict(
            zip(
                ("q", "qd", "qdd_command"),
                numbered("joint", one.q, one.qd, one.qdd_command),
                strict=True,
            )
        ),
        "error": numbered("feature", one.error)[0],
        "camera_error": (["distance [m]", "angle [rad]"], one.camera_error),
        "camera_position": (["x", "y", "z"], one.camera_position),
        **dict(zip(("u_px", "v_px"), numbered("marker", u, v), strict=True)),
        **{
            what: (list(one.labels), getattr(one, what))
            for what in ("phi", "sigma", "clearance", "active")
        },
    }
    columns = {
        (what, name): own[:, i]
        for what, (names, own) in parts.items()
        for i, name in enumerate(names)
    }
    columns |= {
        (what, ""): getattr(one, what)
        for what in ("feature_error_px", "saturated", "rows_time", "step_time")
    }
    frame = pd.DataFrame(columns, index=pd.Index(one.t, name="t"))
    frame.columns = pd.MultiIndex.from_tuples(columns)
    return frame


def table_of(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Lines of a table as a data frame; raises ConfigurationError if pandas is not installed."""
    demand("pandas")
    import pandas as pd

    return pd.DataFrame(lines)
