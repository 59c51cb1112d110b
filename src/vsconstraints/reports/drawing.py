"""Selection of the scenarios and runs that a report shows, and their figures and sections.

An error in one figure leaves out only that figure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

import numpy as np

from ..comparisons import RunRecord
from ..comparisons.record import run_file
from ..comparisons.runs.machine import most_samples
from ..comparisons.runs.pool import Failure, run_all
from ..errors import described
from ..plugins.registry import load, registered, with_figures_of_parts
from ..scenarios import Scenario
from .figures import FIGURES, OVERVIEW, View
from .figures.overview import shown_runs
from .figures.view import violated_in_samples
from .groups import Group
from .numbers import largest
from .plots import FORMATS, PNG, Figure, Formats
from .results import Results, RowsShown

# Up to this many scenarios are drawn in this process: starting others takes about as long.
IN_PROCESS = 2
REPLAY = "replay"  #: Section of a report that is made on request only.
#: A suite with more than MAX_FIGURES figures shows only MAX_SCENARIOS scenarios.
MAX_FIGURES = 48
MAX_SCENARIOS = 3
#: Trial that figures and replays show: it starts at the scenario's own start.
TRIAL_SHOWN = 0


def shown_scenarios(results: Results) -> tuple[str, ...]:
    """Return all scenarios of a small suite, or the most informative ones of a large suite.

    The most informative scenarios are those on which controllers differ most, then those with the
    deepest violations.
    """
    figure_count = len(FIGURES) * len(results.groups) * len(results.scenarios)
    if figure_count <= MAX_FIGURES:
        return results.scenarios

    def informativeness(scenario: str) -> tuple[int, float]:
        solvers = len(results.solvers(scenario))
        others = len(results.competitors) - solvers
        relative_depths = [0.0]
        for name in results.competitors:
            runs = results.runs(scenario, name)
            relative_depths += [run["violation_depth"] for run in runs]
        return min(solvers, others), largest(relative_depths)

    ordered = sorted(results.scenarios, key=informativeness, reverse=True)
    chosen = ordered[:MAX_SCENARIOS]
    return tuple(name for name in results.scenarios if name in chosen)


@dataclass(frozen=True)
class ScenarioJob:
    """Figures of one scenario to be drawn: one of each kind for each group of controllers.

    ``finished`` are the controllers with a line in results.csv for the shown trial; ``rows`` are
    the rows that are drawn.
    """

    folder: Path
    scenario: Scenario
    groups: tuple[Group, ...]
    finished: tuple[str, ...]
    seed: int
    rows: RowsShown
    formats: Formats = PNG

    def files(self) -> dict[str, Path]:
        """Return the files of the trajectories, by controller."""
        files = {}
        for name in self.finished:
            files[name] = run_file(self.folder, self.scenario.name, name, TRIAL_SHOWN)
        return files


@dataclass
class Drawn:
    """Drawn figures of one scenario.

    ``files`` are names below ``figures``, ``pictures`` the Markdown that shows them. ``problems``
    are sentences on what is missing. ``first_outside`` is the time at which a controller first
    violates a row [s], by controller and row. ``sections`` are Markdown of parts.
    """

    files: list[str] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    first_outside: dict[tuple[str, str], float] = field(default_factory=dict)
    sections: list[str] = field(default_factory=list)


def picture(
    figure: Figure,
    folder: Path,
    formats: Formats,
    *needed: object,
    suffix: str = "",
    remark: str = "",
) -> str:
    """Draw a figure and return the Markdown that shows it with its caption.

    The file name ends in ``suffix``. If drawing fails, the returned text states the error.
    """
    file = figure.file_in(formats, suffix)
    try:
        folder.mkdir(exist_ok=True)
        drawn = figure.write(folder / file, *needed, formats=formats)
    except Exception as error:  # a figure must not cost the report
        return _failure_text(figure, error)
    if not drawn:
        return ""
    title = figure.title[0].upper() + figure.title[1:]
    return _picture_text(title, file, figure.caption + remark)


def _picture_text(title: str, file: str, caption: str) -> str:
    return f"![{title}](figures/{file})\n\n*{caption}*"


def _failure_text(figure: Figure, error: Exception) -> str:
    return f"The figure of {figure.title} could not be drawn: {type(error).__name__}: {error}"


def scenario_jobs(
    results: Results, scenarios: Sequence[str] | None = None, formats: Formats = PNG
) -> list[ScenarioJob]:
    """Return the jobs that draw these scenarios of a stored comparison, by default all."""
    if scenarios is None:
        scenarios = results.scenarios
    stored = results.stored
    jobs = []
    for name in scenarios:
        finished = []
        for law in results.controllers:
            if any(line["trial"] == TRIAL_SHOWN for line in results.runs(name, law)):
                finished.append(law)
        job = ScenarioJob(
            folder=stored.folder,
            scenario=stored.scenarios[name],
            groups=results.groups,
            finished=tuple(finished),
            seed=results.seed,
            rows=results.rows_shown(name),
            formats=formats,
        )
        jobs.append(job)
    return jobs


def draw_all(
    results: Results,
    scenarios: Sequence[str],
    formats: Formats,
    on_drawn: Callable[[int, int], None],
) -> tuple[str, dict[str, Drawn]]:
    """Draw the figures of the comparison and of these scenarios.

    Return the text that shows the figure of the comparison, and the drawn figures by scenario.
    Failures are recorded in both.
    """
    calls: dict[Any, tuple[Any, ...]] = {}
    for job in scenario_jobs(results, scenarios, formats):
        calls[job.scenario.name] = draw_scenario, job
    here = [*calls, None] if len(calls) <= IN_PROCESS else []
    # The call for the whole comparison has the key None.
    calls[None] = draw_overview, results, results.stored.folder / "figures", formats
    drawn: dict[Any, Any] = run_all(_call, calls, here=here, on_progress=on_drawn)
    overview = drawn.pop(None)
    if isinstance(overview, Failure):
        overview = f"The figure of all scenarios could not be drawn: {overview.reason}."
    for name, answer in drawn.items():
        if isinstance(answer, Failure):
            problem = f"Its figures could not be drawn: {answer.reason}."
            drawn[name] = Drawn(problems=[problem])
    return overview, drawn


def _call(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


def draw_scenario(job: ScenarioJob) -> Drawn:
    """Draw the figures of one scenario; an error leaves out one figure and is recorded."""
    drawn = Drawn()
    runs = stored_runs(job, drawn)
    if not runs:
        return drawn
    setup = None
    try:
        setup = job.scenario.setup(TRIAL_SHOWN, job.seed)
    except Exception as error:  # for example a robot file that has been moved
        drawn.problems.append(
            f"The scenario cannot be built here ({type(error).__name__}: {error}); "
            "the figures show no goals and no boundaries."
        )
    views = {}
    for group in job.groups:
        view = View(setup, runs, group.controllers, job.rows.phi)
        if view.competitors or len(job.groups) == 1:
            lanes = acting_in(job.rows.lanes, [runs[law] for law in view.competitors])
            views[group.suffix] = replace(view, lane_rows=lanes)
    for figure in figures_of_scenarios():
        for suffix, view in views.items():
            _draw_figure(job, figure, view, suffix, drawn)
    return drawn


def figures_of_scenarios() -> list[Figure]:
    """Return the figures of each scenario, of the core and of parts."""
    return with_figures_of_parts("vsconstraints.reports", FIGURES)


def require_distinct_names() -> None:
    """Raise ConfigurationError if two parts register a report, figure or section by one name.

    Raises it also if a figure cannot be imported.
    """
    registered("results")
    registered("report_sections")
    figures_of_scenarios()


def _draw_figure(job: ScenarioJob, figure: Figure, view: View, suffix: str, drawn: Drawn) -> None:
    """Draw one figure of a scenario, and note its file or an error in ``drawn``."""
    name = job.scenario.name
    file = f"{name}--{figure.file_in(job.formats, suffix)}"
    caption = figure.caption
    if figure.name == "phi" and job.rows.hidden:
        caption += f" {job.rows.hidden} further rows acted for a shorter time and are not shown."
    try:
        if figure.write(job.folder / "figures" / file, view, formats=job.formats):
            drawn.files.append(file)
            drawn.pictures.append(_picture_text(f"{name}: {figure.name}", quote(file), caption))
    except Exception as error:  # one bad run or figure must not cost the report
        drawn.problems.append(_failure_text(figure, error))


def stored_runs(job: ScenarioJob, drawn: Drawn) -> dict[str, RunRecord]:
    """Return the runs with at least two samples, by controller.

    Missing trajectories and the times of first violations are noted in ``drawn``.
    """
    runs = {}
    for name, path in job.files().items():
        record = RunRecord.load(path, most_samples(job.scenario.tables))
        if record is None:
            defect = "cannot be read" if path.exists() else "is missing"
            drawn.problems.append(f"The trajectory of {name} {defect}; the figures leave it out.")
        elif len(record.trajectory.t) < 2:
            drawn.problems.append(
                f"The run of {name} left no trajectory; the figures leave it out."
            )
        else:
            runs[name] = record
            trajectory = record.trajectory
            outside = violated_in_samples(record)
            for i in np.flatnonzero(outside.any(axis=0)):
                first = outside[:, i].argmax()
                label = trajectory.labels[i]
                drawn.first_outside[name, label] = float(trajectory.t[first])
    return runs


def acting_in(labels: Sequence[str], runs: Iterable[RunRecord]) -> tuple[str, ...]:
    """Return the rows that are active in at least one of these runs."""
    active = set[str]()
    for run in runs:
        trajectory = run.trajectory
        for i in np.flatnonzero(trajectory.active.any(axis=0)):
            active.add(trajectory.labels[i])
    return tuple(label for label in labels if label in active)


def draw_overview(results: Results, folder: Path, formats: Formats = PNG) -> str:
    """Draw the figure of a whole comparison into ``folder``, and return the text that shows it."""
    remove_stale(folder, figures=(OVERVIEW,))
    texts = []
    for group in results.groups:
        shown = shown_runs(results, group.controllers)
        left_out = 0
        for name, runs in shown.items():
            left_out += len(results.all_runs(name)) - len(runs)
        remark = ""
        if left_out:
            remark = (
                f" {left_out} runs that did not converge, or were not limited by any row, "
                "are left out."
            )
        text = picture(
            OVERVIEW,
            folder,
            formats,
            results,
            group.controllers,
            suffix=group.suffix,
            remark=remark,
        )
        texts.append(text)
    return "\n\n".join(filter(None, texts))


def remove_stale(
    folder: Path, kept: Iterable[str] = (), formats: Formats = PNG, figures: Sequence[Figure] = ()
) -> None:
    """Remove the files of an earlier report's figures, in every format that a report can have.

    The ``kept`` files stay, in these ``formats``. Without ``figures`` the figures of scenarios are
    removed.
    """
    current = set[str]()
    for file in kept:
        for kind in formats:
            current.add(PurePath(file).with_suffix(f".{kind}").name)
    starts = [figure.name for figure in figures]
    if not figures:
        starts = [f"*--{figure.name}" for figure in figures_of_scenarios()]
    stale = list[Path]()
    for start in starts:
        # A group of controllers has a number after the figure's name.
        for end in (".*", "--*"):
            stale += folder.glob(start + end)
    for path in stale:
        is_figure = path.suffix.removeprefix(".") in FORMATS
        if is_figure and path.name not in current:
            path.unlink(missing_ok=True)


def add_sections(
    results: Results, scenarios: Sequence[str], drawn: Mapping[str, Drawn], replays: bool
) -> None:
    """Add the sections that parts register to these scenarios; an error costs only its section.

    That of replays is added only with ``replays``, because it takes long.
    """
    sections = registered("report_sections")
    if not replays:
        sections.pop(REPLAY, None)
    for what, reference in sections.items():
        for name in scenarios:
            try:
                section = load(reference)
                drawn[name].sections.append(section(results, name))
            except Exception as error:  # one bad run or page must not cost the report
                problem = f"Its {what} could not be made: {described(error)}."
                drawn[name].problems.append(problem)
