"""Runs studies together, and writes their figures and data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.metrics import load_metrics
from ...comparisons.record import RunRecord
from ...comparisons.run import perform
from ...comparisons.runs.files import write_arrays
from ...comparisons.runs.folder import make_folder
from ...comparisons.runs.pool import Failure, run_all
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec, longest_first
from ...comparisons.tables import write_table
from ...compiled import prepare
from ...errors import unknown_name
from ...reports.plots import PNG, Formats
from ..unfinished import kept_file, kept_run, unfinished
from .gradient_error import GradientError
from .non_static import NonStatic
from .pareto import Pareto
from .sampling_time import SamplingTime
from .shrinking_region import ShrinkingRegion
from .study import Study, StudyResult
from .summary import RunSummary, summarise
from .switching_gain import SwitchingGain
from .unselected_experiments import UnselectedExperiments

Progress = Callable[[int, int], None]  #: Called with the number of finished runs and their total.

_SHIPPED: tuple[Study, ...] = (
    ShrinkingRegion(),
    SwitchingGain(),
    SamplingTime(),
    GradientError(),
    Pareto(),
    NonStatic(),
    UnselectedExperiments(),
)
#: Studies by their names in files and on the command line.
STUDIES = {study.name: study for study in _SHIPPED}
#: Campaigns of drawn scenes, each with a separate folder and report. They take long, and run only
#: if named.
CAMPAIGNS = ("real-world",)


def figure_file(folder: Path, name: str, formats: Formats = PNG) -> Path:
    """Path of a study's figure, in the format that pages show."""
    return folder / "figures" / f"study-{name}.{formats[0]}"


def data_file(folder: Path, name: str) -> Path:
    """Path of the table with a study's points."""
    return folder / "studies" / f"{name}.csv"


def run_studies(
    names: Sequence[str] | None = None,
    folder: Path | None = None,
    workers: int | None = None,
    on_progress: Progress = lambda done, total: None,
    *,
    small: bool = False,
    studies: Mapping[str, Study] = STUDIES,
    formats: Formats = PNG,
    kept: Path | None = None,
) -> dict[str, StudyResult]:
    """Run ``studies``, or those that are named, and write figures and tables below ``folder``.

    Without ``folder`` nothing is written. A failed run is listed in its study's ``failures``; so is
    a failed evaluation or drawing. ``workers`` is the greatest number of processes. With ``small``,
    a few short runs replace all runs. Finished runs are stored in ``kept`` until all are finished,
    or else below the folder. Raises ConfigurationError for unknown names, and if the folder cannot
    be created.
    """
    for name in names or ():
        if name not in studies:
            raise unknown_name("study", name, studies)
    runs = {name: studies[name].runs(small=small) for name in dict.fromkeys(names or studies)}
    if folder is not None:
        for file in (figure_file(folder, ""), data_file(folder, "")):
            make_folder(file.parent)
    drift_noted: dict[RunSpec, bool] = {}
    for name, cases in runs.items():
        drift_noted |= {
            run: drift_noted.get(run, False) or studies[name].drift_noted for run in cases.values()
        }
    # the baseline on the unchanged scenario determines which rows are challenged
    baselines = {run.name: RunSpec(run.name, ControllerSpec(BASELINE)) for run in drift_noted}
    first = longest_first(baselines.values())
    limits = longest_first(drift_noted)
    load_metrics()  # a metric that cannot be used ends the command before any run
    prepare()
    with nullcontext(kept) if kept else unfinished(folder) as store:
        answers = run_all(
            summarised,
            {run: (run, store, run, False) for run in baselines.values()},
            {run: (run, store, baselines[run.name], drift_noted[run]) for run in limits},
            workers=workers,
            limits=first | limits,
            on_progress=on_progress,
        )
        lost = {
            run: RunSummary("failed", why.reason)
            for run, why in answers.items()
            if isinstance(why, Failure)
        }
        summaries: dict[RunSpec, Any] = answers | lost
        return {
            name: _finish(
                studies[name],
                {case: summaries[run] for case, run in cases.items()},
                folder,
                formats,
            )
            for name, cases in runs.items()
        }


def summarised(run: RunSpec, kept: Path, baseline: RunSpec, drift_noted: bool) -> RunSummary:
    """Simulate a run, or load its summary from an interrupted call; raises any error."""
    file = kept_file(kept, run, "drift" if drift_noted else "summary")
    if (stored := RunSummary.load(file)) is not None:
        return stored
    # some studies include runs that diverge
    with np.errstate(over="ignore", invalid="ignore"):
        performed = kept_run(run, kept_file(kept, run)) if run == baseline else perform(run)
        summary = summarise(
            performed, RunRecord.load(kept_file(kept, baseline)), drift_noted=drift_noted
        )
    with suppress(OSError):
        write_arrays(file, vars(summary))
    return summary


def _finish(
    study: Study, summaries: Mapping[Any, RunSummary], folder: Path | None, formats: Formats
) -> StudyResult:
    """Evaluate and draw one study; its errors affect neither its numbers nor other studies."""
    result = StudyResult(study.name)
    doing = "evaluation"
    try:
        result = study.evaluate(summaries)
        doing = "figure"
        if folder is not None:
            write_table(
                data_file(folder, study.name), list(next(iter(result.points), {})), result.points
            )
            for suffix in formats:
                study.draw(result, figure_file(folder, study.name, (suffix,)))
    except Exception as error:
        failure = f"{doing}: {type(error).__name__}: {error}"
        return replace(result, failures=(*result.failures, failure))
    return result
