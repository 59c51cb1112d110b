"""Single run in a notebook, with its figures, scores and replay."""

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
from ...comparisons.metrics import Score, run_metrics
from ...comparisons.run import Run, perform
from ...comparisons.runs.spec import BASELINE
from ...controllers import Controller, Tracking
from ...errors import ConfigurationError, unknown_name
from ...plugins.classes import beside
from ...plugins.extras import demand
from ...reports.figures import ACCELERATION, ERRORS, PHI, TRACKS, View
from ...reports.numbers import DASH
from ...reports.page import render_html
from ...reports.plots import Figure
from ...reports.results import RowsShown
from ...reports.scenario import metric_text
from ...rows.readable import amount, counted, in_one_line
from ...simulation import Trajectory, simulate
from .inputs import AnyLaw, AnyScenario, instance_of, own_spec, scenarios_of, spec_of

if TYPE_CHECKING:
    import pandas as pd

TEMPLATE = Path(__file__).with_name("notebook.html")
SHOWN = ("outcome", "task", "chattering")  # groups of metrics in the display of a run
#: Resolution of a picture as wide as a notebook's column, of about 50 kB; height of an embedded
#: page [px].
PICTURE_DPI = 75
PAGE_HEIGHT = 640


@dataclass(frozen=True)
class Plots:
    """Figures of runs of one scenario, drawn with matplotlib.

    All methods raise ConfigurationError if no run or row can be drawn.
    """

    view: View

    def tracks(self) -> Any:
        """Draw the markers' tracks in the image, with the boundaries of constraints in it."""
        return self._drawn(TRACKS)

    def rows(self, *labels: str) -> Any:
        """Draw φ of rows over time, relative to one switching step T_s u⁺, and their activity.

        By default the rows that are challenged or violated are drawn. Raises ConfigurationError for
        unknown labels.
        """
        known: dict[str, None] = {}
        for run in self.view.runs.values():
            known |= dict.fromkeys(run.trajectory.labels)
        for label in labels:
            if label not in known:
                raise unknown_name("row", label, known)
        view = self.view
        if labels:
            view = replace(view, phi_rows=labels, lane_rows=labels)
        return self._drawn(PHI, view)

    def errors(self) -> Any:
        """Draw the errors of the camera's pose or of the markers over time."""
        return self._drawn(ERRORS)

    def command(self) -> Any:
        """Draw commanded joint accelerations over time, with means and ranges in short windows."""
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
    """Run with figures, scores and replay.

    ``setup`` is the setup that was run, ``record`` the recorded run. ``law`` and ``scenario`` are
    their names in figures and tables. ``folder`` is the folder of custom parts of the scenario,
    None if unknown. ``stored_baseline`` is the run of the unconstrained baseline, if it exists
    already.
    """

    law: str = ""
    scenario: str = ""
    title: str = ""
    folder: Path | None = None
    stored_baseline: RunRecord | None = None

    @cached_property
    def baseline(self) -> RunRecord:
        """Run of the unconstrained baseline in the same setup, which defines the challenged rows.

        It is simulated on first access.
        """
        if self.law == BASELINE:
            return self.record
        if self.stored_baseline is not None:
            return self.stored_baseline
        with chdir("."), beside(self.folder):  # custom parts may change the working directory
            return RunRecord.of(
                self.setup, simulate(self.setup, Tracking(), by_public_call=True), ""
            )

    @cached_property
    def score(self) -> Score:
        """Scores as in a comparison: its lines of results.csv and constraints.csv."""
        return score(self.record, self.baseline)

    def scores(self) -> dict[str, Any]:
        """Return its line of results.csv by column name; see the documentation of metrics."""
        values = dict(self.score.result)
        for name, value in values.items():
            if isinstance(value, np.generic):
                values[name] = value.item()
        return values

    def row_scores(self) -> pd.DataFrame:
        """Return the lines of its rows in constraints.csv, indexed by label; needs pandas."""
        return table_of(self.score.constraints).set_index("constraint")

    def to_dataframe(self) -> pd.DataFrame:
        """Return its samples, one line each, indexed by time."""
        return frame_of(self.trajectory)

    @property
    def plot(self) -> Plots:
        """Figures: ``run.plot.tracks()``, ``.rows()``, ``.errors()`` and ``.command()``."""
        known = {BASELINE: self.baseline, self.law: self.record}
        runs = {}
        for name, record in known.items():
            if len(record.trajectory.t) > 1:
                runs[name] = record
        rows = RowsShown.of(self.score.constraints)
        view = View(self.setup, runs, tuple(known), rows.phi, rows.lanes)
        return Plots(view)

    def replay(self, *others: NotebookRun, path: str | Path | None = None) -> ReplayPage | Path:
        """Replay the run together with others of the same scene.

        The replay is shown in a notebook or, with ``path``, written to a file. Raises
        ConfigurationError if the extra ``replay`` is not installed, or if the runs are of different
        scenes.
        """
        from ..replay import ReplayRun, replay_html, write_replay

        runs = []
        for run in (self, *others):
            runs.append(ReplayRun(run.law, run.setup, run.trajectory, run.title))
        if path is None:
            return ReplayPage(replay_html(runs))
        write_replay(runs, path)
        return Path(path)

    @in_one_line
    def __repr__(self) -> str:
        # This text needs no baseline, so it costs no simulation.
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
        """Return the HTML for a notebook: a picture of the tracks, and the scores."""
        result = self.score.result
        file = BytesIO()
        if len(self.t) > 1 and self.trajectory.features_px.size:
            self.plot.tracks().savefig(file, format="png", dpi=PICTURE_DPI)
        picture = base64.b64encode(file.getvalue()).decode()
        lines = []
        for metric in run_metrics():
            if metric.header and metric.group in SHOWN:
                text = metric_text(metric, [result])
                if text != DASH:
                    lines.append((metric.header, text))
        return render_html(TEMPLATE, run=self, result=result, picture=picture, lines=lines)


@dataclass(frozen=True)
class ReplayPage:
    """Replay as a self-contained page that needs no network."""

    html: str

    def __repr__(self) -> str:
        return f"<Replay: a page of {len(self.html) / 1e6:.1f} MB; write it with .save(path)>"

    def _repr_html_(self) -> str:
        """Return the page for a notebook."""
        return (
            f'<iframe srcdoc="{escape(self.html)}" '
            f'style="width:100%;height:{PAGE_HEIGHT}px;border:0"></iframe>'
        )

    def save(self, path: str | Path) -> Path:
        """Write the page to a file for any browser."""
        Path(path).write_text(self.html, encoding="utf-8")
        return Path(path)


def run(scenario: AnyScenario, law: AnyLaw, *, trial: int = 0, seed: int = 0) -> NotebookRun:
    """Simulate a law on a scenario in this process.

    ``scenario`` is the name of a shipped one, a path, a :class:`.Scenario`, or a :class:`.Setup`
    made in Python. ``law`` is an instance, a class, a registered name, or ``module:Class``.
    ``trial`` and ``seed`` define the start, see :meth:`.Scenario.setup`; a setup defines its start
    directly. Raises ConfigurationError if the scenario or the law does not exist, or if the robot
    cannot start. A law that fails ends the run with the status ``failed``.
    """
    if not isinstance(law, str):
        law = instance_of(law)
    spec, _ = spec_of(law)
    if isinstance(law, Controller):
        spec = own_spec(law, spec.name)
    (loaded,) = scenarios_of([scenario])
    requested = RunSpec(loaded, spec, trial=trial, seed=seed)
    finished = perform(requested, by_public_call=True, to_the_goal=True)
    of_scenario = (loaded.name, loaded.title, loaded.folder)
    return NotebookRun(finished.setup, finished.record, spec.name, *of_scenario)


# --- Data frames and tables ---


def frame_of(trajectory: Trajectory) -> pd.DataFrame:
    """Return a trajectory as a data frame with one line per sample, indexed by time [s].

    Units are those of the trajectory. Columns have two levels: the quantity and its element.
    ``frame["phi"]["fov[marker 2]"]`` is a row's φ. ``frame["q"]`` has columns ``joint 1``,
    ``joint 2``, …. A scalar quantity has an empty second level. Raises ConfigurationError if pandas
    is not installed.
    """
    demand("pandas")
    import pandas as pd

    index = pd.Index(trajectory.t, name="t")
    u_px, v_px = np.moveaxis(trajectory.features_px, -1, 0)
    elements = {
        "q": (trajectory.q, "joint"),
        "qd": (trajectory.qd, "joint"),
        "qdd_command": (trajectory.qdd_command, "joint"),
        "error": (trajectory.error, "feature"),
        "camera_error": (trajectory.camera_error, ["distance [m]", "angle [rad]"]),
        "camera_position": (trajectory.camera_position, ["x", "y", "z"]),
        "u_px": (u_px, "marker"),
        "v_px": (v_px, "marker"),
    }
    for quantity in ("phi", "sigma", "clearance", "active"):
        elements[quantity] = (getattr(trajectory, quantity), trajectory.labels)
    for quantity in ("feature_error_px", "saturated", "rows_time", "step_time"):
        elements[quantity] = (getattr(trajectory, quantity), [""])
    parts = {}
    for quantity, (values, names) in elements.items():
        if isinstance(names, str):
            names = [f"{names} {i + 1}" for i in range(values.shape[1])]
        parts[quantity] = pd.DataFrame(values, index, names)
    return pd.concat(parts, axis="columns")


def table_of(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Return lines of a table as a data frame.

    Raises ConfigurationError if pandas is not installed.
    """
    demand("pandas")
    import pandas as pd

    return pd.DataFrame(lines)
