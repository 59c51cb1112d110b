"""Commands ``compare``, ``list``, ``report`` and ``verify``, and reports of all commands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..errors import ConfigurationError
from ..plugins.extras import demand
from ..plugins.processes import INTERRUPTS, signal_of
from ..plugins.registry import load, registered
from ..reports.formats import formats_of
from .options import Names
from .terminal import (
    NOTHING_DONE,
    Show,
    console,
    errors,
    note,
    note_processes,
    print_columns,
    print_paragraph,
    progress,
    stop,
    typed_command,
)

if TYPE_CHECKING:
    from ..comparisons import RunSpec
    from ..comparisons.metrics import Score


@dataclass(frozen=True)
class ReportOptions:
    """Options of all commands that write a report.

    ``out`` is the folder of the report if it is not that of the results. Raises ConfigurationError
    for an unknown format, and if packages that replays need are not installed.
    """

    figures: bool = True
    all_figures: bool = False
    formats: Sequence[str] | None = None
    latex: bool = False
    replays: bool = False
    trust: bool = False
    out: Path | None = None

    def __post_init__(self) -> None:
        formats_of(self.formats or ())
        if self.replays:
            demand("replay")


@dataclass(frozen=True)
class ResultsKind:
    """Commands for one kind of stored results, in one folder or in several."""

    #: Write the report of folders, with its options, the folder of a tuning, and a function that
    #: shows progress; return the report's path.
    write_report: Callable[[Sequence[Path], ReportOptions, Path | None, Show], Path]
    #: Return a summary of the contents of folders, their files, and sentences on missing parts.
    #: Raises ConfigurationError if they cannot be loaded.
    contents: Callable[[Sequence[Path]], tuple[str, list[Path], list[str]]]


def kind_in(folder: Path) -> ResultsKind:
    """Return the kind of results in a folder; a comparison if it cannot be told."""
    from ..comparisons.runs.folder import kind_of

    kinds = registered("results")
    kind: ResultsKind = load(kinds.get(kind_of(folder) or "", kinds["a comparison"]))
    return kind


def write_report(
    folder: Path | Sequence[Path], wanted: ReportOptions, tuning: Path | None = None
) -> str:
    """Write the report of stored results, in one folder or in several, with a progress bar.

    Return a text that names its file.
    """
    from ..reports.latex import write_tables
    from ..reports.page import where

    folders = [folder] if isinstance(folder, Path) else folder
    with progress() as show:
        report = kind_in(folders[0]).write_report(folders, wanted, tuning, show)
    if wanted.latex:
        console.print(f"Tables for LaTeX: {write_tables(report)}")
    return where(report)


def list_(what: Names = None) -> None:
    """List the contents of the package, or describe a kind or a name."""
    from .listing import print_listing

    print_listing(what or ())


def compare(
    context: typer.Context,
    suite: Path | None = None,
    scenarios: Names = None,
    controllers: Names = None,
    stacks: Names = None,
    out: Path = Path("vsconstraints-results"),
    jobs: int | None = None,
    seed: int | None = None,
    settings: Names = None,
    fresh: bool = False,
    keep: str = "all",
    figures: bool = True,
    all_figures: bool = False,
    formats: Names = None,
    latex: bool = False,
    replays: bool = False,
    run_limit: float | None = None,
) -> None:
    """Run every scenario with every controller, and write a report."""
    from ..comparisons import Suite, keep_trajectories
    from ..comparisons import compare as run
    from ..comparisons.runs.folder import locked, parse_keep
    from ..comparisons.runs.pool import processes_kept
    from ..reports.drawing import require_distinct_names
    from ..reports.results import reason_kind

    require_distinct_names()  # otherwise the report would be lost after all runs
    kept = parse_keep(keep)
    wanted = ReportOptions(figures, all_figures, formats, latex, replays, trust=True)
    chosen = Suite.load(suite).select(scenarios or (), controllers or (), seed)
    chosen = chosen.with_stacks(stacks or ()).with_settings(settings or ()).checked()
    warnings = chosen.warnings()
    note(*(f"{name}: {text}" for name, texts in warnings.items() for text in texts))
    runs = chosen.with_baseline().runs()
    total = len(runs)
    note_processes(jobs)
    context.with_resource(locked(out, "a comparison"))
    # custom laws may change their process in any way, so that it cannot be reused
    if not any(spec.has_own_parts for spec in runs):
        context.with_resource(processes_kept())
    failures = Counter[str]()
    done = count(1)
    with progress() as show:

        def finished(spec: RunSpec, score: Score, stored: bool) -> None:
            show("comparing", next(done), total)
            status = score.result["status"]
            reason = score.result["reason"]
            if status in ("failed", "aborted"):
                # printed once for each scenario, law and kind of reason
                name = f"{spec.name} · {spec.controller.name}"
                failure = f"{name}: {status}, {reason_kind(reason)}"
                if failure not in failures:
                    errors.print(f"{name} · trial {spec.trial}: {status}, {reason}")
                failures[failure] += 1

        show("comparing", 0, total)
        command = typed_command()
        result = run(
            chosen,
            out,
            workers=jobs,
            limit=run_limit,
            fresh=fresh,
            command=command,
            warnings=warnings,
            on_finished=finished,
        )
    for failure, times in failures.items():
        if times > 1:
            errors.print(f"{failure}: {times} of {chosen.trials} trials")
    if result.stored_before:
        console.print(
            f"{result.stored_before} of {total} runs were stored in {out} already; --fresh runs "
            f"them again."
        )
    if result.interrupted:
        stop(result.interrupted, f"{len(result.scores)} of {total} runs are stored in {out}")
    try:
        report_file = write_report(out, wanted)
    except INTERRUPTS as interrupt:
        stop(
            signal_of(interrupt),
            f"all {total} runs are stored in {out}, the report is not",
            "does that",
        )
    print_laws(out)
    if kept != "all":
        console.print(
            f"Trajectories kept: {keep_trajectories(out, kept)} of {total}; --keep {kept}."
        )
    console.print(f"{total} runs in {result.wall_time:.1f} s. {report_file}")
    if result.all_failed:
        errors.print(
            "error: all runs of the compared controllers failed; see the report for the reasons"
        )
        raise typer.Exit(NOTHING_DONE)


def report(
    folders: list[Path],
    out: Path | None = None,
    figures: bool = True,
    all_figures: bool = False,
    formats: Names = None,
    latex: bool = False,
    replays: bool = False,
    trust: bool = False,
    tuning: Path | None = None,
) -> None:
    """Write the report of stored results again.

    Several folders are parts of one campaign, whose report is written to --out.
    """
    options = ReportOptions(figures, all_figures, formats, latex, replays, trust, out)
    console.print(write_report(folders, options, tuning))


def verify(folders: list[Path]) -> None:
    """Check that stored results are complete and unchanged.

    Every file must be as stored, with every planned run and no other. Several folders are parts of
    one campaign. Exit code 1 if something was changed, is missing, unfinished or carries no
    checksum; 2 if a folder cannot be read.
    """
    from ..comparisons.runs.files import check_sums
    from ..comparisons.runs.folder import kind_of

    for folder in folders:
        kind = kind_of(folder)
        # an unreadable manifest does not tell the kind of results
        is_comparison = kind is None and (folder / "results.csv").is_file()
        if (kind is None and not is_comparison) or kind == "a tuning":
            raise ConfigurationError(f"{folder} holds no comparison and no campaign")
    names = ", ".join(map(str, folders))
    problems: list[tuple[object, str]] = []
    try:
        contents, files, missing = kind_in(folders[0]).contents(folders)
        for folder in folders:
            own = [path for path in files if folder in path.parents]
            wrong, remark = check_sums(folder, own)
            if remark and not wrong:
                wrong = [remark]
            problems += [(folder, text) for text in wrong]
        problems += [(names, text) for text in missing]
    except ConfigurationError as error:
        contents = ""
        problems = [(names, str(error))]
    for where, problem in problems:
        errors.print(problem if problem.startswith(str(where)) else f"{where}: {problem}")
    if problems:
        raise typer.Exit(NOTHING_DONE)
    verb = "is" if len(folders) == 1 else "are"
    console.print(f"{names} {verb} complete and unchanged: {contents}.")


def _single(folders: Sequence[Path]) -> Path:
    """Return the only folder; raises ConfigurationError if there are several."""
    if len(folders) > 1:
        raise ConfigurationError(
            f"{folders[0]} holds a comparison, and only campaigns are read from several folders"
        )
    return folders[0]


def _write_comparison(
    folders: Sequence[Path], wanted: ReportOptions, tuning: Path | None, show: Show
) -> Path:
    """Write the report of a comparison."""
    from ..reports.report import write_report as write

    if wanted.out is not None:
        raise ConfigurationError("--out is for the report of several folders of a campaign")
    return write(
        _single(folders),
        figures=wanted.figures,
        all_figures=wanted.all_figures,
        formats=formats_of(wanted.formats or ()),
        replays=wanted.replays,
        trust=wanted.trust,
        on_drawn=partial(show, "drawing figures"),
        on_remark=note,
    )


def _comparison(folders: Sequence[Path]) -> tuple[str, list[Path], list[str]]:
    """Return a summary of a comparison, its files, and missing parts.

    Raises ConfigurationError if it cannot be loaded.
    """
    from ..comparisons import StoredComparison
    from ..comparisons.record import run_file
    from ..comparisons.stored import stored_files
    from ..reports.results import Results

    folder = _single(folders)
    # trust: reading builds none of its scenarios and laws
    results = Results(StoredComparison.load(folder, trust=True))
    problems = []
    if results.finished < results.planned:
        problems.append(f"{results.finished} of {results.planned} runs have a line in results.csv")
    for law in results.controllers:
        for line in results.all_runs(law):
            key = line["scenario"], line["controller"], int(line["trial"])
            path = run_file(folder, *key)
            if path.is_file() and results.stored.run(*key) is None:
                problems.append(f"{path.name} cannot be read")
    contents = f"{results.finished} runs of {len(results.scenarios)} scenarios"
    return contents, stored_files(folder), problems


COMPARISON = ResultsKind(_write_comparison, _comparison)


def print_laws(folder: Path) -> None:
    """Print the first table of a comparison's report."""
    from ..comparisons import StoredComparison
    from ..reports.groups import UNCOMPILED
    from ..reports.results import Results
    from ..reports.summary import IMPLEMENTATION, law_table

    results = Results(StoredComparison.load(folder))
    if not results.competitors:
        return
    laws = law_table(results)
    *_, last = laws.header
    implementations = {line[-1] for line in laws.lines}
    timings = "Timings are not ranked"
    if last == IMPLEMENTATION and len(implementations) == 1:
        # a column with one value for all laws is replaced by a clause
        print_columns(laws.header[:-1], [line[:-1] for line in laws.lines])
        implementation = implementations.pop()
        if implementation:
            timings = f"{timings}; all are of {implementation} code"
    else:
        print_columns(laws.header, laws.lines)
    why = "the controller failed a run that another one solved, or violated a constraint"
    print_paragraph(f"{timings}. In parentheses: excluded from the ranking, since {why}.")
    slow = [name for name in results.competitors if UNCOMPILED in results.implementation(name)]
    if slow:
        print_paragraph(
            f"Uncompiled, since Python runs their law, rows or task: {', '.join(slow)}. Such runs "
            "take some ten times as long; where there is no compiler, some 200 times."
        )
