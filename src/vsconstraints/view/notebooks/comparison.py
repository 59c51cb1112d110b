"""Comparison of laws from a session, with its results as tables, figures and runs."""

from __future__ import annotations

import shutil
import tempfile
import time
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ...comparisons import StoredComparison, Suite
from ...comparisons import compare as compare_suite
from ...comparisons.metrics import run_metrics
from ...comparisons.runs.spec import BASELINE
from ...errors import ConfigurationError, FolderTaken, unknown_name
from ...reports.figures import View
from ...reports.page import render_html
from ...reports.results import Results
from ...reports.scenario import metric_text
from ...reports.summary import FIRST, MARKS, outcome
from ...rows.readable import counted, in_one_line
from .inputs import AnyScenario, Laws, scenarios_of, specs_of
from .notebook_run import TEMPLATE, NotebookRun, Plots, ReplayPage, table_of

if TYPE_CHECKING:
    import pandas as pd

UPDATE = 0.2  # between two updates of the number of finished runs [s]
NAME = "session"  # suite name of a session in results


def compare(
    laws: Laws,
    scenarios: AnyScenario | Iterable[AnyScenario],
    *,
    trials: int = 1,
    seed: int = 0,
    workers: int | None = None,
    limit: float | None = None,
    out: str | Path | None = None,
    progress: bool = True,
) -> Comparison:
    """Run every law and the unconstrained baseline on every scenario, and score all runs.

    The scores are those of ``vsconstraints compare``. ``laws`` are instances, classes, registered
    names, or ``module:Class``; a mapping names them, as two laws of one class require.
    ``scenarios`` are names of shipped ones, paths, scenarios, or setups made in Python. ``trials``
    is the number of runs of each law on each scenario, with starts or noise drawn from ``seed``.
    ``workers`` is the greatest number of processes, chosen automatically if None. With 0 all runs
    are made in this process: a debugger then reaches a law, and a law that hangs or ends its
    process stops the session. ``limit`` is the longest time of a run in another process [s],
    derived from its number of samples if None. ``out`` is a folder for results. The same call
    continues there after an interruption, also in another session, unless a setup, or a law that
    cannot be copied, is compared. Without ``out`` the results are deleted with the comparison.
    ``progress`` shows the number of finished runs.

    Classes may be defined anywhere, also in a cell of a notebook. Every run uses a copy of the
    instance in a separate process; a law that cannot be copied there runs in this process, with a
    warning. If a law fails, only its runs get the status ``failed``. Raises ConfigurationError if a
    law or a scenario cannot be used, if two have the same name, or if all trials would be the same
    run.
    """
    specs, notes = specs_of(laws)
    title = "Comparison from a session"
    suite = Suite(NAME, title, scenarios_of(scenarios), specs, trials, seed).checked()
    setups = {scenario.name: scenario for scenario in suite.scenarios if scenario.in_session}
    for name, setup in setups.items():
        notes += (f"{name} runs in this process: {setup.why_here}",)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    folder = Path(tempfile.mkdtemp(prefix="vsconstraints-")) if out is None else Path(out)
    run_count = len(suite.with_baseline().runs())
    shown = progress_shown(run_count) if progress else nullcontext(lambda: None)
    try:
        with shown as advance:
            finished = compare_suite(
                suite,
                folder,
                workers=workers,
                limit=limit,
                on_finished=lambda run, score, stored: advance(),
            )
        if finished.interrupted:
            raise KeyboardInterrupt
        stored = StoredComparison.load(folder, trust=True)
        stored.scenarios.update(setups)  # a setup cannot be loaded from its files
        comparison = Comparison(stored, (*notes, *stored.notes))
    except FolderTaken as error:
        another = "give another folder as out=…, or delete this one"
        raise ConfigurationError(f"{error.problem}: {another}") from None
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    if out is None:
        weakref.finalize(comparison, shutil.rmtree, folder, ignore_errors=True)
    return comparison


@dataclass(frozen=True, repr=False)
class Comparison:
    """Laws on scenarios, including the baseline, in a folder written by ``vsconstraints compare``.

    ``stored`` is the comparison in this folder. ``notes`` are remarks for the reader.
    """

    stored: StoredComparison
    notes: tuple[str, ...] = ()

    @classmethod
    def load(cls, folder: str | Path, trust: bool = False) -> Comparison:
        """Load a comparison from a folder.

        Custom constraints that it names as ``module:Class`` run only with ``trust``; without it,
        scenarios that need them cannot be drawn. Raises ConfigurationError if the folder has no
        comparison or its files were changed.
        """
        stored = StoredComparison.load(Path(folder), trust)
        return cls(stored, (*stored.remarks, *stored.notes))

    @cached_property
    def _lines(self) -> Results:
        return Results(self.stored)

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of the scenarios."""
        return self._lines.scenarios

    @property
    def laws(self) -> tuple[str, ...]:
        """Names of the laws, the unconstrained baseline first."""
        return self._lines.controllers

    @cached_property
    def results(self) -> pd.DataFrame:
        """One line per run, with the columns of results.csv; needs pandas."""
        return table_of(self.stored.results)

    @cached_property
    def constraints(self) -> pd.DataFrame:
        """One line per row of each run, with the columns of constraints.csv; needs pandas."""
        return table_of(self.stored.constraints)

    def to_dataframe(self) -> pd.DataFrame:
        """Return :attr:`results`."""
        return self.results

    def run(self, law: str, scenario: str | None = None, trial: int = 0) -> NotebookRun:
        """Return the run of a law on a scenario.

        The scenario may be omitted if only one was compared. Raises ConfigurationError if the run
        does not exist; the message names candidates.
        """
        if law not in self.laws:
            raise unknown_name("law", law, self.laws)
        name = self._scenario(scenario)
        if not 0 <= trial < self._lines.trials:
            raise ConfigurationError(
                f"there is no trial {trial}: there are {self._lines.trials}, counted from 0"
            )
        records = []
        for controller in (law, BASELINE):
            record = self.stored.run(name, controller, trial)
            if record is None:
                lines = self._lines.runs(name, controller)
                reasons = [line["reason"] for line in lines if line["trial"] == trial]
                why = "; ".join(reasons) or "it was not run"
                raise ConfigurationError(f"{controller} has no results on {name}: {why}")
            records.append(record)
        found = self.stored.scenarios[name]
        setup = found.setup(trial, self._lines.seed)
        return NotebookRun(setup, records[0], law, name, found.title, found.folder, records[1])

    def plot(self, scenario: str | None = None) -> Plots:
        """Return the figures of a scenario with all laws, from the first trial.

        Example: ``comparison.plot("ur5-fov").rows()``.
        """
        name = self._scenario(scenario)
        runs = {}
        for law in self.laws:
            run = self.stored.run(name, law)
            if run is not None and len(run.trajectory.t) > 1:
                runs[law] = run
        rows = self._lines.rows_shown(name)
        setup = self.stored.scenarios[name].setup(0, self._lines.seed)
        view = View(setup, runs, self.laws, rows.phi, rows.lanes)
        return Plots(view)

    def replay(
        self,
        laws: Sequence[str] = (),
        scenario: str | None = None,
        *,
        trial: int = 0,
        path: str | Path | None = None,
    ) -> ReplayPage | Path:
        """Replay laws on one scenario, see :meth:`.NotebookRun.replay`.

        By default all laws except the unconstrained baseline are shown.
        """
        chosen = laws or [law for law in self.laws if law != BASELINE]
        first, *others = (self.run(law, scenario, trial) for law in chosen)
        return first.replay(*others, path=path)

    def _scenario(self, name: str | None) -> str:
        if name is None and len(self.scenarios) > 1:
            raise ConfigurationError(
                f"several scenarios were compared: name one of {', '.join(self.scenarios)}"
            )
        if name is not None and name not in self.scenarios:
            raise unknown_name("scenario", name, self.scenarios)
        return name or self.scenarios[0]

    @in_one_line
    def __repr__(self) -> str:
        results = self._lines
        run_count = sum(len(results.all_runs(name)) for name in results.competitors)
        clean = sum(results.clean.values())
        laws = counted(len(results.competitors), "law")
        scenarios = counted(len(self.scenarios), "scenario")
        trials = counted(results.trials, "trial")
        runs = counted(run_count, "run")
        return (
            f"<Comparison of {laws} on {scenarios}, {trials}: {clean} of {runs} converged inside>"
        )

    def _repr_html_(self) -> str:
        """Return the HTML for a notebook: outcomes of laws on scenarios, and main scores."""
        metrics = [metric for metric in run_metrics() if metric.column in FIRST]
        results = self._lines
        header = ["scenario", "law", "outcome"]
        header += [metric.header for metric in metrics]
        lines = []
        for scenario, law in product(self.scenarios, results.competitors):
            runs = results.runs(scenario, law)
            cells = [scenario, law, outcome(results, scenario, law)]
            cells += [metric_text(metric, runs) for metric in metrics]
            lines.append(cells)
        return render_html(TEMPLATE, header=header, lines=lines, marks=MARKS, notes=self.notes)


# --- Progress ---


@contextmanager
def progress_shown(total: int) -> Iterator[Callable[[], None]]:
    """Show the number of finished runs out of ``total`` in a terminal or a notebook.

    The context yields a function that counts a finished run.
    """
    console = Console(stderr=True)
    begun = time.monotonic()
    done = 0
    due = 0.0

    def show(text: str, end: str = "\r") -> None:
        if console.is_terminal:
            console.print(text, end=end, highlight=False)

    if console.is_jupyter:
        from IPython import display

        create: Any = display.display
        line = create({"text/plain": ""}, raw=True, display_id=True)

        def show(text: str, end: str = "") -> None:
            line.update({"text/plain": text}, raw=True)

    def report(end: str = "\r") -> None:
        elapsed = time.monotonic() - begun
        show(f"comparing: {done} of {total} runs, {elapsed:.0f} s", end)

    def advance() -> None:
        nonlocal done, due
        done += 1
        now = time.monotonic()
        if now >= due:
            due = now + UPDATE
            report()

    report()
    yield advance
    report("\n")
