"""``vsconstraints evidence``, and ``vsconstraints merge`` for folders that were made on several machines."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from ..comparisons.runs.signals import exit_code
from ..errors import ConfigurationError
from . import completions
from .reporting import Asked, evidence_report
from .terminal import (
    NOTHING_DONE,
    Figures,
    Formats,
    Jobs,
    Latex,
    Trust,
    console,
    errors,
    note,
    note_processes,
    progress_bar,
    typed_command,
)

if TYPE_CHECKING:
    from ..comparisons.evidence import Campaign, Finished, Keep, OpenWorkers, Progress

Given = list[str] | None
"""An option that can be repeated."""


def evidence(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            help="A campaign file, or real-world; all families with the default comparison's controllers if not given."
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for results; scenes stored there are not run again.")] = Path(
        "vsconstraints-evidence"
    ),
    scenes: Annotated[int | None, typer.Option(help="How many of each family, instead of the campaign's.")] = None,
    family: Annotated[
        Given,
        typer.Option(help="Only this family: a name or a path. Can be repeated.", autocompletion=completions.families),
    ] = None,
    controller: Annotated[
        Given, typer.Option(help="Only this controller. Can be repeated.", autocompletion=completions.controllers)
    ] = None,
    jobs: Jobs = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Of a Dask scheduler, whose workers make the runs: tls://10.0.0.1:8786."),
    ] = None,
    keep: Annotated[
        str,
        typer.Option(
            help="Whose trajectories are kept: none, failed, worst, first or all.",
            autocompletion=completions.ways_to_keep,
        ),
    ] = "none",
    shard: Annotated[
        str, typer.Option(metavar="I/N", help="Only this part of the scenes, for machines that share no folder.")
    ] = "1/1",
    settings: Annotated[
        Given,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change a setting, e.g. hierarchical-qp.alpha=10, seed=1, half=training or conditions=nominal. "
            "Can be repeated.",
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Replace what the folder holds.")] = False,
    figures: Figures = True,
    formats: Formats = None,
    latex: Latex = False,
    run_limit: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="A run that takes longer is ended and fails; 120 s and 0.1 s per sample if not given.",
        ),
    ] = None,
) -> None:
    """Run every controller on thousands of drawn scenes, store the scores as Parquet shards, and write a report."""
    from ..comparisons.evidence import Campaign, Plan, Shard, collect
    from ..reports.page import where

    if cluster is not None and jobs is not None:
        raise ConfigurationError("--jobs is how many processes of this machine are used: with --cluster there are none")
    asked = Asked(figures, formats=formats, latex=latex, trust=True)
    chosen = Campaign.load(campaign).select(family or (), controller or (), scenes, settings or ())
    note_processes(jobs)
    part = Shard.parsed(shard)
    with _workers(cluster, jobs, chosen) as workers, progress_bar() as bar:
        # whether it is a way to keep is said before anything runs
        plan = Plan(part, cast("Keep", keep), run_limit, fresh, workers)
        shown = bar.add_task("scenes", total=None)

        def show(progress: Progress) -> None:
            bar.update(shown, total=progress.scenes, completed=progress.done)

        finished = collect(chosen, out, plan, command=typed_command(), on_progress=show)
    _say(finished)
    if plan.shard.of == 1:
        console.print(where(evidence_report(out, asked)))
    if finished.progress.all_failed:
        errors.print("error: every run of the controllers that were to be compared failed; column reason says why")
        raise typer.Exit(NOTHING_DONE)


def _workers(address: str | None, jobs: int | None, campaign: Campaign) -> AbstractContextManager[OpenWorkers]:
    """Who makes the runs; of a cluster it is found out first whether it is there, and like this machine."""
    from ..comparisons.evidence import processes

    if address is None:
        return nullcontext(processes(jobs))
    from ..comparisons.evidence.cluster import cluster

    return cluster(address, campaign.identities)


def _say(finished: Finished) -> None:
    progress, out = finished.progress, finished.folder
    for kind, count in progress.failed.items():
        what = " · ".join(kind)
        errors.print(f"{what}: {count} of {progress.of_kind[kind]} runs failed, {progress.reasons[kind]}")
    if progress.stored_before:
        console.print(f"{progress.stored_before} of {progress.scenes} scenes were stored in {out} already.")
    if finished.interrupted:
        errors.print(
            f"Interrupted: {progress.done} of {progress.scenes} scenes are stored in {out}; the same command goes on."
        )
        raise typer.Exit(exit_code(finished.interrupted))
    console.print(
        f"{progress.done - progress.stored_before} scenes, {progress.runs} runs in {finished.wall_time:.1f} s: "
        f"{finished.rate:.1f} runs a second. Stored in {out}"
    )


def merge(
    out: Annotated[Path, typer.Argument(help="Folder for all of it.")],
    shards: Annotated[list[Path], typer.Argument(help="Folders that `evidence --shard` has written.")],
    figures: Figures = True,
    formats: Formats = None,
    latex: Latex = False,
    trust: Trust = False,
) -> None:
    """Put the parts of a campaign together that were run apart, and write its report."""
    from ..comparisons.evidence import merge as put_together
    from ..reports.page import where

    asked = Asked(figures, formats=formats, latex=latex, trust=trust)
    merged = put_together(out, shards)
    for remark in merged.remarks:
        note(remark)
    console.print(f"{merged.scenes} scenes, {merged.runs} runs of {len(shards)} folders. Stored in {out}")
    console.print(where(evidence_report(out, asked)))
