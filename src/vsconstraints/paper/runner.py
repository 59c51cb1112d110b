"""Reproduction of the paper: simulate, measure the claims, draw the figures, write the report."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from string import ascii_lowercase
from typing import Any, TypedDict, Unpack

from ..comparisons.metrics import load_metrics
from ..comparisons.run import Run
from ..comparisons.runs.folder import make_folder
from ..comparisons.runs.pool import Failure, run_all
from ..comparisons.runs.spec import ControllerSpec, RunSpec, longest_first
from ..compiled import prepare
from ..errors import ConfigurationError, format_value, unknown_name
from ..reports.plots import PNG, Figure, Formats
from .claims import CLAIMS, all_claims
from .figures import FIGURES
from .report import TOPICS, Reproduction, write_report
from .studies import run_studies
from .unfinished import kept_file, kept_run, unfinished
from .verdicts import Claim, Finding

#: Called with the current activity, the number of its finished tasks, and their total.
Progress = Callable[[str, int, int], None]


class Options(TypedDict, total=False):
    """Options of all commands: greatest number of processes; :data:`Progress`; formats of figures.

    Reports show the first of the formats.
    """

    workers: int | None
    on_progress: Progress
    formats: Formats


@dataclass(frozen=True)
class Work:
    """Settings shared by the steps of a command.

    These are its folder, the folder of finished runs, processes, progress and formats.
    """

    folder: Path
    kept: Path
    workers: int | None = None
    on_progress: Progress = lambda activity, done, total: None
    formats: Formats = PNG


def reproduce(
    folder: Path, *, command: Sequence[str] = (), **options: Unpack[Options]
) -> Reproduction:
    """Check every claim of the paper and redraw its figures.

    Everything is simulated anew, except for results that an interrupted call of the same command
    had finished. A scenario, run, study or figure that fails affects only the claims that need it:
    they become ``not measured``, with the reason.

    report.md, claims.csv and figures go into the folder, which is created if missing;
    ConfigurationError is raised if that fails. ``command`` is the user's command line, for the
    report. For the other options see :class:`Options`.
    """
    started = time.perf_counter()
    claims = all_claims()
    make_folder(folder / "figures")
    with unfinished(folder) as kept:
        work = Work(folder, kept, **options)
        runs = run_specs(work, [*claims, *FIGURES.values()])
        studies = study_results(work)
        available: dict[Any, Any] = {**runs, **studies}
        findings = {claim.key: claim.check(available) for claim in claims}
        missing = draw_figures(work, FIGURES, available)
        problems = {
            str(spec): reason for spec, reason in available.items() if isinstance(reason, str)
        }
        problems |= {f"figure {number}": why for number, why in missing.items() if why}
        wall_time = time.perf_counter() - started
        result = Reproduction(folder / "report.md", findings, problems, wall_time, work.formats)
        write_report(result, missing, studies, command)
    return result


def redraw(
    numbers: Sequence[int],
    folder: Path,
    *,
    controller: str | None = None,
    **options: Unpack[Options],
) -> dict[Path, str]:
    """Redraw figures by the paper's numbers into ``folder/figures``.

    Only the runs that they show are simulated. ``controller`` is a law that replaces the paper's, a
    name or ``module:Class``, and becomes part of the file's name. For the other options see
    :class:`Options`. Returns, by each figure's file, the reason why it could not be drawn, or an
    empty text if it was. Raises ConfigurationError for a number without a figure, an invalid law,
    and as :func:`reproduce`.
    """
    figures = chosen_figures(numbers, controller)
    place = folder / "figures"
    make_folder(place)
    with unfinished(None) as kept:
        work = Work(folder, kept, **options)
        missing = draw_figures(work, figures, run_specs(work, figures.values()))
    return {
        place / figure.file_in(work.formats): missing[number] for number, figure in figures.items()
    }


def check(keys: Sequence[str], folder: Path, **options: Unpack[Options]) -> dict[Claim, Finding]:
    """Measure claims by number (``"5"``) or key (``"5d"``), on the runs and studies that they need.

    Figures and tables of studies go to the folder. For the other options see :class:`Options`.
    Returns findings in the order of the report. Raises ConfigurationError for an unknown claim, and
    as :func:`reproduce`.
    """
    claims = chosen_claims(keys)
    names = [need for claim in claims for need in claim.needs if isinstance(need, str)]
    with unfinished(None) as kept:
        work = Work(folder, kept, **options)
        available: dict[Any, Any] = {
            **run_specs(work, claims),
            **(study_results(work, names) if names else {}),
        }
        return {claim: claim.check(available) for claim in claims}


def chosen_figures(numbers: Sequence[int], controller: str | None = None) -> dict[int, Figure]:
    """Return figures by number, with another law if one is named.

    Raises ConfigurationError for unknown numbers.
    """
    for number in numbers:
        if number not in FIGURES:
            raise ConfigurationError(
                f"there is no counterpart of Fig. {number}. Available: "
                f"{', '.join(map(str, FIGURES))}; Figs. 1 and 13 "
                "of the paper show frames and a laboratory"
            )
    figures = {number: FIGURES[number] for number in numbers}
    if controller is None:
        return figures
    law = ControllerSpec(controller, folder=Path.cwd())
    law = replace(law, name=law.make().name)
    for number, figure in figures.items():
        if figure.needs:  # Fig. 2 shows no run
            needs = tuple(replace(need, controller=law) for need in figure.needs)
            figures[number] = replace(figure, name=f"{figure.name}--{law.name}", needs=needs)
    return figures


def chosen_claims(keys: Sequence[str]) -> list[Claim]:
    """Return claims by number or key, each once, in the order of the report.

    Raises ConfigurationError for unknown claims.
    """
    chosen: set[str] = set()
    for key in keys:
        number = key.rstrip(ascii_lowercase)
        of_number = [claim.key for claim in all_claims() if str(claim.number) == number]
        if not of_number:
            topics = ", ".join(f"{number} ({topic})" for number, topic in TOPICS.items())
            raise ConfigurationError(f"unknown claim {format_value(key)}. Available: {topics}")
        if key not in CLAIMS and not key.isdecimal():
            raise unknown_name("claim", key, of_number)
        chosen |= {key} if key in CLAIMS else set(of_number)
    return [claim for claim in all_claims() if claim.key in chosen]


def run_specs(work: Work, of: Iterable[Claim | Figure]) -> dict[RunSpec, Run | str]:
    """Simulate the runs that claims or figures need, each once.

    The result of a run that failed is the reason, as a sentence.
    """
    load_metrics()  # a metric that cannot be used ends the command before any run
    prepare()
    limits = longest_first(
        need for claim in of for need in claim.needs if isinstance(need, RunSpec)
    )
    calls = {spec: (spec, kept_file(work.kept, spec)) for spec in limits}
    progress = partial(work.on_progress, "simulating")
    runs = run_all(kept_run, calls, workers=work.workers, limits=limits, on_progress=progress)
    return {
        spec: run.reason.split(". ")[0] if isinstance(run, Failure) else run
        for spec, run in runs.items()
    }


def draw_figures(
    work: Work, figures: Mapping[int, Figure], available: Mapping[Any, Any]
) -> dict[int, str]:
    """Draw figures from the available runs.

    Returns, by number, the reason why a figure could not be drawn, or an empty text.
    """
    why = dict.fromkeys(figures, "")
    calls = {}
    folder = work.folder / "figures"
    for number, figure in figures.items():
        runs = {need: available[need] for need in figure.needs}
        why[number] = next(
            (f"{need}: {run}" for need, run in runs.items() if not isinstance(run, Run)), ""
        )
        if not why[number]:
            calls[number] = (figure, folder / figure.file_in(work.formats), *runs.values())
    draw = partial(Figure.write, formats=work.formats)
    progress = partial(work.on_progress, "drawing")
    answers = run_all(draw, calls, workers=work.workers, on_progress=progress)
    why |= {
        number: answer.reason for number, answer in answers.items() if isinstance(answer, Failure)
    }
    for number in filter(why.__getitem__, why):  # no older figure stays in its place
        for suffix in work.formats:
            (folder / figures[number].file_in((suffix,))).unlink(missing_ok=True)
    return why


def study_results(work: Work, names: Sequence[str] = ()) -> dict[str, Any]:
    """Return results of the named studies, or of all.

    If they could not be run, the reason takes their place.
    """
    progress = partial(work.on_progress, "studying")
    try:
        return dict(
            run_studies(
                names, work.folder, work.workers, progress, kept=work.kept, formats=work.formats
            )
        )
    except Exception as error:  # claims and figures of the paper do not depend on studies
        return {name: f"{type(error).__name__}: {error}" for name in names or ["studies"]}
