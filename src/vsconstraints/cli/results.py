"""``compare``, and what reads its folder again, ``report``, ``diff`` and ``verify``; how commands write reports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from ..comparisons.runs.signals import INTERRUPTS, exit_code, signal_of
from ..errors import ConfigurationError, shown
from ..plugins.extras import demand
from ..reports.plots import formats_of
from . import options
from .terminal import NOTHING_DONE, console, errors, note, note_processes, progress_bar, typed_command

if TYPE_CHECKING:
    from ..comparisons import RunSpec
    from ..comparisons.metrics import Score

GOT_WORSE = 1
Folder = Annotated[Path, typer.Argument(help="Folder of a comparison, or of a campaign.")]


@dataclass(frozen=True)
class ReportOptions:
    """The options of all commands that write a report.

    Raises
    ------
    ConfigurationError
        for an unknown format, and where replays need packages that are not installed.
    """

    figures: bool = True
    all_figures: bool = False
    formats: Sequence[str] | None = None
    latex: bool = False
    replays: bool = False
    trust: bool = False

    def __post_init__(self) -> None:
        formats_of(self.formats or ())
        if self.replays:
            demand("replay")

    def finish(self, report: Path) -> Path:
        """Write the tables for LaTeX if they are wanted; returns the report's path."""
        from ..reports.latex import write_tables

        if self.latex:
            console.print(f"Tables for LaTeX: {write_tables(report)}")
        return report


def compare(
    context: typer.Context,
    suite: Annotated[Path | None, typer.Argument(help="A suite file; the default comparison if not given.")] = None,
    scenario: options.Scenarios = None,
    controller: options.Controllers = None,
    out: options.Out = Path("vsconstraints-results"),
    jobs: options.Jobs = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Instead of the suite's.")] = None,
    settings: options.Settings = None,
    fresh: options.Fresh = False,
    keep: options.Keep = "all",
    figures: options.Figures = True,
    all_figures: options.AllFigures = False,
    formats: options.Formats = None,
    latex: options.Latex = False,
    replays: options.Replays = False,
    run_limit: options.RunLimit = None,
) -> None:
    """Run every scenario with every controller, and write a report."""
    from ..comparisons import Suite, keep_trajectories
    from ..comparisons import compare as run
    from ..comparisons.runs.folder import demand_keep, locked
    from ..reports.page import where

    kept = demand_keep(keep)
    report_options = ReportOptions(figures, all_figures, formats, latex, replays, trust=True)
    chosen = Suite.load(suite).select(scenario or (), controller or (), seed, settings or ())
    for remark in chosen.remarks():
        note(remark)
    total = len(chosen.with_baseline().runs())
    note_processes(jobs)
    context.with_resource(locked(out, "a comparison"))
    failures: Counter[str] = Counter()
    with progress_bar() as progress:
        bar = progress.add_task("comparing", total=total)

        def finished(spec: RunSpec, score: Score, stored: bool) -> None:
            progress.advance(bar)
            _print_first_failure(spec, score, failures)

        result = run(
            chosen, out, workers=jobs, limit=run_limit, fresh=fresh, command=typed_command(), on_finished=finished
        )
    for failure, count in failures.items():
        if count > 1:
            errors.print(f"{failure}: {count} of {chosen.trials} trials")
    if result.stored_before:
        console.print(f"{result.stored_before} of {total} runs were stored in {out} already; --fresh runs them again.")
    if result.interrupted:
        errors.print(
            f"Interrupted: {len(result.scores)} of {total} runs are stored in {out}; the same command continues."
        )
        raise typer.Exit(exit_code(result.interrupted))
    try:
        report_file = comparison_report(out, report_options)
    except INTERRUPTS as interrupt:
        errors.print(
            f"Interrupted: all {total} runs are stored in {out}, the report is not; the same command does that."
        )
        raise typer.Exit(exit_code(signal_of(interrupt))) from interrupt
    print_laws(out)
    if kept != "all":
        console.print(f"Trajectories kept: {keep_trajectories(out, kept)} of {total}; --keep {kept}.")
    console.print(f"{total} runs in {result.wall_time:.1f} s. {where(report_file)}")
    if result.all_failed:
        errors.print("error: every run of the controllers that were to be compared failed; the report says why")
        raise typer.Exit(NOTHING_DONE)


def _print_first_failure(spec: RunSpec, score: Score, failures: Counter[str]) -> None:
    """Print why a run failed, once for each scenario, law and kind of reason; all are counted."""
    from ..reports.results import reason_kind

    status, reason = score.result["status"], score.result["reason"]
    if status in ("failed", "aborted"):
        name = f"{spec.name} · {spec.controller.name}"
        failure = f"{name}: {status}, {reason_kind(reason)}"
        failures[failure] += 1
        if failures[failure] == 1:
            errors.print(f"{name} · trial {spec.trial}: {status}, {reason}")


def report(
    folder: Folder,
    figures: options.Figures = True,
    all_figures: options.AllFigures = False,
    formats: options.Formats = None,
    latex: options.Latex = False,
    replays: options.Replays = False,
    trust: options.Trust = False,
    tuning: Annotated[
        Path | None,
        typer.Option(help="Of a campaign: the folder of `vsconstraints tune` that its tuned settings come from."),
    ] = None,
) -> None:
    """Write the report of a comparison, or of a campaign, again from what is stored."""
    from ..comparisons.runs.folder import kind_of
    from ..reports.page import where

    wanted = ReportOptions(figures, all_figures, formats, latex, replays, trust)
    campaign = kind_of(folder) == "evidence"
    if replays and campaign:
        raise ConfigurationError(f"--replays is for comparisons, and {folder} holds a campaign")
    console.print(where(evidence_report(folder, wanted, tuning) if campaign else comparison_report(folder, wanted)))


def diff(
    a: Annotated[Path, typer.Argument(help="Folder of a comparison: before.")],
    b: Annotated[Path, typer.Argument(help="Another one of the same scenes: after.")],
    metric: Annotated[
        list[str] | None, typer.Option(help="Only this metric, a column of results.csv. Can be repeated.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File for the whole page; printed if not given.")] = None,
    rename: Annotated[
        list[str] | None, typer.Option(metavar="OLD=NEW", help="What B calls a controller of A. Can be repeated.")
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(min=0.0, help="Share by which a value may move; a millionth if not given.")
    ] = None,
    strict: Annotated[
        bool | None,
        typer.Option(
            "--strict/--rates",
            help="Whether each lost run counts, or only rates that are significantly worse. If not given, each run "
            "counts in a suite's scenes, rates in drawn ones.",
        ),
    ] = None,
) -> None:
    """Report what changed between two comparisons; exit code 1 if something got worse, 2 if they are not comparable."""
    demand("evidence", "a difference of two folders")
    from ..comparisons.difference import TOLERANCE, difference
    from ..reports.difference import page, verdict

    names = {}
    for text in rename or ():
        old, _, new = text.partition("=")
        if not (old and new):
            raise ConfigurationError(f"--rename needs OLD=NEW, not {shown(text)}")
        names[old] = new
    changes = difference(
        a,
        b,
        metrics=metric or (),
        strict=strict,
        tolerance=TOLERANCE if tolerance is None else tolerance,
        renamed=names,
    )
    for side in (changes.a, changes.b):
        for remark in side.remarks:
            note(remark)
    if out is None:
        console.print(page(changes), end="")
    else:
        try:
            out.write_text(page(changes), encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise ConfigurationError(f"{out} cannot be written: {error}") from error
        console.print(f"{verdict(changes)}\nPage: {out}")
    if changes.worse:
        raise typer.Exit(GOT_WORSE)


def verify(folder: Folder) -> None:
    """Check that stored results are complete and unchanged: every file as stored, every planned run, and no other.

    Exit code 1 if something was changed, is missing, unfinished or carries no checksum; 2 if the folder cannot be read.
    """
    from ..comparisons.runs.folder import kind_of

    # a manifest that cannot be read does not say what it is of
    kind = kind_of(folder) or ("a comparison" if (folder / "results.csv").is_file() else None)
    if kind is None or kind == "a tuning":
        raise ConfigurationError(f"{folder} holds no comparison and no campaign")
    try:
        contents, problems = _verify_campaign(folder) if kind == "evidence" else _verify_comparison(folder)
    except ConfigurationError as error:
        contents, problems = "", [str(error)]
    for problem in problems:
        errors.print(problem if problem.startswith(str(folder)) else f"{folder}: {problem}")
    if problems:
        raise typer.Exit(NOTHING_DONE)
    console.print(f"{folder} is whole: {contents}.")


def _verify_comparison(folder: Path) -> tuple[str, list[str]]:
    """What a comparison holds, and its problems; raises ConfigurationError if it cannot be loaded."""
    from ..comparisons import StoredComparison
    from ..comparisons.record import run_file
    from ..comparisons.runs.files import check_sums
    from ..comparisons.stored import stored_files
    from ..reports.results import Results

    results = Results(StoredComparison.load(folder, trust=True))  # nothing of it is built
    problems, remark = check_sums(folder, stored_files(folder))
    problems += [remark] if not problems and remark else []
    if results.finished < results.planned:
        problems.append(f"{results.finished} of {results.planned} runs have a line in results.csv")
    for name in results.scenarios:
        for law in results.controllers:
            for line in results.runs(name, law):
                path = run_file(folder, name, law, int(line["trial"]))
                if path.is_file() and results.stored.run(name, law, int(line["trial"])) is None:
                    problems.append(f"{path.name} cannot be read")
    return f"{results.finished} runs of {len(results.scenarios)} scenarios", problems


def _verify_campaign(folder: Path) -> tuple[str, list[str]]:
    """What a campaign holds, and its problems; raises ConfigurationError if it cannot be loaded."""
    demand("evidence", "a campaign")
    from ..comparisons.evidence import Evidence, Shard
    from ..comparisons.evidence.folder import missing_scenes, shards, stored_files
    from ..comparisons.runs.files import check_sums

    evidence = Evidence.load(folder, trust=True)  # nothing of it is built
    problems, remark = check_sums(folder, stored_files(folder))
    problems += [remark] if not problems and remark else []
    configuration, shard = evidence.manifest["configuration"], Shard(*evidence.manifest.get("shard", (1, 1)))
    facts = [each.facts for each in shards(folder)]
    if lost := missing_scenes(configuration, facts, shard.scenes(configuration["scenes"])):
        problems.append(f"scenes {lost} are not there")
    return f"{len(evidence.runs)} runs in {len(evidence.scenes)} scenes of {len(evidence.families)} families", problems


def comparison_report(folder: Path, wanted: ReportOptions) -> Path:
    """Write a comparison's report, with a progress bar for its figures; returns its path."""
    from ..reports import write_report

    progress = progress_bar()
    bar = progress.add_task("drawing figures")
    with ExitStack() as started:

        def drawn(done: int, total: int) -> None:
            if done == 0:
                started.enter_context(progress)
            progress.update(bar, completed=done, total=total)

        written = write_report(
            folder,
            figures=wanted.figures,
            all_figures=wanted.all_figures,
            formats=formats_of(wanted.formats or ()),
            replays=wanted.replays,
            trust=wanted.trust,
            on_drawn=drawn,
            on_remark=note,
        )
    return wanted.finish(written)


def evidence_report(folder: Path, wanted: ReportOptions, tuning: Path | None = None) -> Path:
    """Write a campaign's report, with a progress bar for its parts; returns its path."""
    from ..reports.evidence import write_evidence_report

    with progress_bar() as progress:
        bar = progress.add_task("writing the report", total=None)
        written = write_evidence_report(
            folder,
            figures=wanted.figures,
            tuning=tuning,
            formats=formats_of(wanted.formats or ()),
            trust=wanted.trust,
            on_written=lambda done, total: progress.update(bar, completed=done, total=total),
            on_remark=note,
        )
    return wanted.finish(written)


def print_laws(folder: Path) -> None:
    """Print the table that the report of a comparison begins with."""
    from rich.table import Table

    from ..comparisons import StoredComparison
    from ..reports.results import Results
    from ..reports.summary import law_table

    results = Results(StoredComparison.load(folder))
    if not results.competitors:
        return
    laws = law_table(results)
    table = Table(box=None, padding=(0, 1, 0, 0))
    for k, header in enumerate(laws.header):
        # headers are broken at spaces, values stay whole
        widest = max(map(len, (*header.split(), *(_emphasised(line[k]).plain for line in laws.lines))))
        table.add_column(header, justify="right" if k else "left", min_width=widest, no_wrap=not k)
    for line in laws.lines:
        table.add_row(*map(_emphasised, line))
    console.print(table, crop=False, overflow="ignore")
    why = "the controller failed a run that another one solved, or violated a constraint"
    console.print(f"Timings are not ranked. In parentheses: excluded from the ranking, since {why}.")


def _emphasised(text: str) -> Text:
    """Bold where Markdown has stars; where nothing can be bold the stars stay."""
    before, star, rest = text.partition("**")
    if not star or not console.is_terminal:
        return Text(text)
    inside, _, after = rest.partition("**")
    return Text.assemble(before, (inside, "bold"), after)
