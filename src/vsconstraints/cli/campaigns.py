"""``families``, ``evidence``, ``merge`` and ``tune``: laws on thousands of drawn scenes."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from ..comparisons.runs.signals import exit_code
from ..errors import ConfigurationError
from ..plugins.extras import demand
from . import options
from .results import ReportOptions, evidence_report
from .terminal import (
    NOTHING_DONE,
    console,
    errors,
    note,
    note_processes,
    progress_bar,
    resumable,
    typed_command,
)

if TYPE_CHECKING:
    from ..comparisons.evidence import Finished, Progress
    from ..comparisons.evidence import Keep as Kept
    from ..scenarios.families import Family
    from ..scenarios.families.drawn import Summary


def families(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names or paths of families to draw from; if not given, all are listed.",
            autocompletion=options.family_names,
        ),
    ] = None,
    scenes: Annotated[int, typer.Option(min=1, max=10_000_000, help="How many scenes are drawn of each.")] = 100,
    half: options.Half = "held-out",
    seed: options.Seed = 0,
) -> None:
    """List the families of scenes; draw scenes of those that are named, and describe them."""
    from ..scenarios.families import Family
    from ..scenarios.families import families as shipped
    from ..scenarios.families.family import summarised

    if not names:
        for name in shipped():
            family = Family.load(name)
            console.print(f"{name}: {family.title} ({', '.join(family.conditions)})")
        return
    found = 0
    for family in [Family.load(name) for name in names]:
        with progress_bar() as progress:
            bar = progress.add_task(f"drawing {family.name}", total=scenes)
            summary = summarised(family, scenes, half, seed, lambda bar=bar: progress.advance(bar))  # type: ignore[misc]
        _print_summary(family, summary)
        found += len(summary.found)
    if not found:
        raise typer.Exit(NOTHING_DONE)


def _print_summary(family: Family, summary: Summary) -> None:
    drawn, accepted = len(summary.scenes), len(summary.found)
    attempts = sum(scene.attempts for scene in summary.scenes)
    console.print(f"{family.name}: {family.title}\n  conditions: {', '.join(family.conditions)}")
    console.print(
        f"  {accepted} of {drawn} scenes found in {attempts} attempts ({summary.acceptance:.0%} accepted), "
        f"{summary.seconds / drawn * 1e3:.0f} ms a scene"
    )
    _print_counts("rejected", summary.rejected, attempts, "attempts")
    _print_counts("violated by tracking alone", summary.challenged, accepted, "scenes")
    if not isnan(summary.beyond_limits):
        console.print(
            f"  under its limits, no law could satisfy a row from where tracking alone first meets it in "
            f"{summary.beyond_limits:.0%} of the scenes"
        )
    if summary.timed:
        late = sum(scene.too_far for scene in summary.timed)
        console.print(f"  under its limits, no law can arrive in time in {late} of {len(summary.timed)} scenes")


def _print_counts(what: str, counts: Counter[str], of: int, unit: str) -> None:
    console.print(f"  {what}{'' if counts else ': nothing'}")
    for name, count in counts.most_common():
        console.print(f"    {count:6d}  {count / of:4.0%} of {unit}  {name}")


def evidence(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            help="A campaign file, or real-world; all families with the default comparison's controllers if not given."
        ),
    ] = None,
    out: options.Out = Path("vsconstraints-evidence"),
    scenes: Annotated[int | None, typer.Option(help="How many of each family, instead of the campaign's.")] = None,
    family: options.Families = None,
    controller: options.Controllers = None,
    jobs: options.Jobs = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Of a Dask scheduler, whose workers make the runs: tls://10.0.0.1:8786."),
    ] = None,
    keep: options.Keep = "none",
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Only this part of the scenes, for machines that share no folder.")
    ] = "1/1",
    settings: options.Settings = None,
    fresh: options.Fresh = False,
    figures: options.Figures = True,
    formats: options.Formats = None,
    latex: options.Latex = False,
    run_limit: options.RunLimit = None,
) -> None:
    """Run every controller on thousands of drawn scenes, store the scores as Parquet shards, and write a report."""
    from ..comparisons.evidence import Campaign, Plan, Shard, collect, processes
    from ..reports.page import where

    if cluster is not None and jobs is not None:
        raise ConfigurationError("--jobs is for processes of this machine, and none are used with --cluster")
    wanted = ReportOptions(figures, formats=formats, latex=latex, trust=True)
    chosen = Campaign.load(campaign).select(family or (), controller or (), scenes, settings or ())
    note_processes(jobs)
    part = Shard.parsed(shard)
    with ExitStack() as stack:
        if cluster is None:
            workers = processes(jobs)
        else:
            from ..comparisons.evidence.cluster import cluster as connected

            workers = stack.enter_context(connected(cluster, chosen.identities))
        # an unknown way to keep trajectories is an error before anything runs
        plan = Plan(part, cast("Kept", keep), run_limit, fresh, workers)
        bar = stack.enter_context(progress_bar())
        task = bar.add_task("scenes", total=None)

        def show(progress: Progress) -> None:
            bar.update(task, total=progress.scenes, completed=progress.done)

        finished = collect(chosen, out, plan, command=typed_command(), on_progress=show)
    _print_finished(finished)
    if plan.shard.of == 1:
        console.print(where(evidence_report(out, wanted)))
    if finished.progress.all_failed:
        errors.print("error: every run of the controllers that were to be compared failed; column reason says why")
        raise typer.Exit(NOTHING_DONE)


def _print_finished(finished: Finished) -> None:
    progress, out = finished.progress, finished.folder
    for kind, count in progress.failed.items():
        errors.print(f"{' · '.join(kind)}: {count} of {progress.of_kind[kind]} runs failed, {progress.reasons[kind]}")
    if progress.stored_before:
        console.print(f"{progress.stored_before} of {progress.scenes} scenes were stored in {out} already.")
    if finished.interrupted:
        errors.print(
            f"Interrupted: {progress.done} of {progress.scenes} scenes are stored in {out}; the same command continues."
        )
        raise typer.Exit(exit_code(finished.interrupted))
    console.print(
        f"{progress.done - progress.stored_before} scenes, {progress.runs} runs in {finished.wall_time:.1f} s: "
        f"{finished.rate:.1f} runs a second. Stored in {out}"
    )


def merge(
    out: Annotated[Path, typer.Argument(help="Folder for all of it.")],
    shards: Annotated[list[Path], typer.Argument(help="Folders that `evidence --shard` has written.")],
    figures: options.Figures = True,
    formats: options.Formats = None,
    latex: options.Latex = False,
    trust: options.Trust = False,
) -> None:
    """Merge the parts of a campaign that were run apart, and write its report."""
    from ..comparisons.evidence import merge as merge_shards
    from ..reports.page import where

    wanted = ReportOptions(figures, formats=formats, latex=latex, trust=trust)
    merged = merge_shards(out, shards)
    for remark in merged.remarks:
        note(remark)
    console.print(f"{merged.scenes} scenes, {merged.runs} runs of {len(shards)} folders. Stored in {out}")
    console.print(where(evidence_report(out, wanted)))


def tune(
    campaign: Annotated[
        Path | None, typer.Argument(help="A campaign file; all shipped families with the default laws if not given.")
    ] = None,
    out: options.Out = Path("vsconstraints-tuning"),
    evaluations: Annotated[int, typer.Option(help="Settings of each law and tuner seed, the default included.")] = 40,
    seeds: Annotated[int, typer.Option(help="How often tuning is repeated with another seed.")] = 3,
    scenes: Annotated[int, typer.Option(help="Training scenes of each family.")] = 10,
    violations: Annotated[float, typer.Option(help="Share of runs that may have a violated row.")] = 0.2,
    family: options.Families = None,
    controller: options.Controllers = None,
    settings: options.Settings = None,
    jobs: options.Jobs = None,
) -> None:
    """Tune every law with the same budget on training scenes, and write settings that a campaign can take over."""
    demand("tune")
    from ..comparisons.evidence import Campaign
    from ..comparisons.tuning import Budget, Problem
    from ..comparisons.tuning.tune import TUNED
    from ..comparisons.tuning.tune import tune as run
    from ..reports.page import where
    from ..reports.tuning import REPORT, write_report

    for setting in settings or ():
        key = setting.partition("=")[0].strip()
        if key in ("half", "scenes"):
            raise ConfigurationError(
                f"--set {key}: laws are tuned on training scenes alone, and --scenes says on how many"
            )
    chosen = Campaign.load(campaign).select(family or (), controller or (), settings=settings or ())
    problem = Problem(chosen, Budget(evaluations, seeds, scenes, violations))
    note_processes(jobs)
    with resumable(out), progress_bar() as progress:
        bar = progress.add_task("starting", total=None)
        tuning = run(
            problem,
            out,
            workers=jobs,
            command=typed_command(),
            on_progress=lambda what, done, total: progress.update(bar, description=what, completed=done, total=total),
        )
        write_report(tuning, out)
    for law in tuning.laws:
        if law.chosen is not None and not law.chosen.feasible:
            note(f"no setting of {law.law.name} keeps to the violations that are allowed")
    console.print(f"Settings: {out / TUNED}. {where(out / REPORT)}")
