"""Commands ``testset …``: laws on frozen scenes, and the files that store these."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path

import typer

from ...cli.options import Names
from ...cli.results import ReportOptions
from ...cli.terminal import NOTHING_DONE, console, errors, note_processes, progress
from ...errors import ConfigurationError
from ...plugins.extras import demand
from .campaigns import run_campaign, with_call_times

FRESH_TABLE = "fresh.parquet"  #: File for the runs on fresh scenes.


def run(
    folder: Path | None = None,
    half: str = "held-out",
    laws: Path | None = None,
    entry: Names = None,
    secret_seed: int | None = None,
    families: Names = None,
    scenes: int | None = None,
    out: Path = Path("vsconstraints-testset"),
    jobs: int | None = None,
    settings: Names = None,
    figures: bool = True,
    time_passes: str | None = None,
    slower: float | None = None,
    budget_us: float | None = None,
) -> None:
    """Run the default laws and your own on a test set, and write a report."""
    from ...comparisons import Suite
    from ...scenarios.toml import read_toml
    from ..evidence import Campaign, Plan, processes
    from ..families.frozen import V1, TestSet

    frozen = TestSet.load(folder or V1)
    chosen = frozen.chosen(families or (), half, scenes, secret_seed)
    if laws and "scenarios" in read_toml(laws):
        chosen["controllers"] = Suite.load(laws).controllers
        laws = None
    campaign = Campaign.load(laws).changed(title=f"Test set {frozen.version}", **chosen)
    names = [each.name for each in campaign.controllers]
    note_processes(jobs)
    names += entry or ()
    campaign = campaign.select(controllers=names, settings=settings or ())
    campaign = with_call_times(campaign, out, jobs, time_passes, slower, budget_us)
    workers = nullcontext(processes(jobs))
    report = ReportOptions(figures, trust=True)
    run_campaign(campaign, out, Plan(), workers, report)


def fresh(
    seed: int | None = None,
    scenes: int = 20,
    families: Names = None,
    out: Path = Path("vsconstraints-fresh"),
    jobs: int | None = None,
) -> None:
    """Run the published laws on scenes of a secret seed.

    Their success is compared with the published one.
    """
    demand("evidence", "fresh scenes")
    from ..evidence import Campaign, Plan, processes
    from ..families.frozen import TestSet
    from ..repetition import secret_seed
    from ..reports.fresh import CONDITIONS, fresh_page
    from ..study import Study

    published = Study.load()
    drawn_by = secret_seed() if seed is None else seed
    chosen = TestSet.load().chosen(families or (), "held-out", scenes, drawn_by)
    laws = tuple(published.laws.values())
    title = f"Fresh scenes of seed {drawn_by}"
    campaign = Campaign.load(None).changed(
        title=title, controllers=laws, conditions=CONDITIONS, **chosen
    )
    note_processes(jobs)
    workers = nullcontext(processes(jobs))
    report = ReportOptions(figures=False)
    run_campaign(campaign.checked(), out, Plan(), workers, report)
    with progress() as show:
        study = Study.load(out, on_scene=partial(show, "scenes"))
    table = out / FRESH_TABLE
    study.keep(table)
    print(fresh_page(study, published))
    console.print(f"Seed: {drawn_by}. Table of all runs: {table}")


def verify(folder: Path | None = None, redraw: float = 0.0, seed: int = 0) -> None:
    """Check every scene of a test set against its hash; name changed, added and missing ones."""
    from ..families.frozen import V1, TestSet

    frozen = TestSet.load(folder or V1)
    with progress() as show:
        problems = list(frozen.problems(redraw, seed, show))
    for problem in problems:
        errors.print(f"error: {problem}")
    if problems:
        raise typer.Exit(NOTHING_DONE)
    count = sum(map(len, frozen.hashes.values()))
    whole = f"{count} scenes are unchanged"
    console.print(f"Test set {frozen.version}: {whole}. SHA-256 of its index: {frozen.sha256}")


def make(
    scenes: int = 100,
    seed: int = 0,
    families: Names = None,
    version: str = "own",
    out: Path = Path("vsconstraints-testset"),
) -> None:
    """Draw scenes of all or the named families, and freeze them with their hashes.

    They are stored in a new folder.
    """
    from ..families import Family
    from ..families import families as shipped
    from ..families.frozen import TestSet

    counts = {"training": -(-scenes // 5), "held-out": scenes}
    loaded = [Family.load(name) for name in families or shipped()]
    with progress() as show:
        made = TestSet.make(out, loaded, version, counts, seed, show)
    console.print(f"Test set {made.version} of {len(made.families)} families. Stored in {out}")


def leaderboard(
    tables: list[Path],
    rerun: float = 0.0,
    seed: int | None = None,
    jobs: int | None = None,
    trust: bool = False,
) -> None:
    """Check tables of runs on all held-out scenes, and print a ranking in Markdown."""
    demand("evidence", "the leaderboard")
    from ..evidence import processes
    from ..families.frozen import TestSet
    from ..repetition import NUDGE, TOLERANCE, repeat, secret_seed
    from ..reports.leaderboard import leaderboard as board
    from ..study import Study

    note_processes(jobs)
    frozen = TestSet.load()
    studies = dict[str, Study]()
    repetitions = {}
    drawn_by = secret_seed() if seed is None else seed
    with progress() as show:
        for path in tables:
            if path.stem in studies:
                raise ConfigurationError(
                    f"two tables have the name {path.stem}, which tells their laws apart: rename "
                    "one of the files"
                )
            on_scene = partial(show, "scenes")
            studies[path.stem] = Study.load(path, trust, on_scene, custom_laws=True)
        text = board(studies, frozen)
        families = {family.name: family for family in frozen.families}
        for name, study in studies.items() if rerun else ():
            repetitions[name] = repeat(
                study,
                families,
                rerun,
                drawn_by,
                trust=trust,
                workers=processes(jobs),
                on_progress=partial(show, f"repeating runs of {name}"),
            )
    for name, repetition in repetitions.items():
        for sentence in repetition.by_rounding:
            errors.print(f"warning: {name}: decided by rounding: {sentence}")
        for file in repetition.changed_files:
            errors.print(
                f"error: {name}: {file}, which custom laws have loaded or read, has different "
                "content here"
            )
        for sentence in repetition.differences:
            errors.print(f"error: {name}: {sentence}")
        for law, file in repetition.moved.items():
            errors.print(
                f"warning: {name}: no run of {law} is repeated, since this law is now {file}"
            )
        if repetition.not_compared:
            columns = ", ".join(repetition.not_compared)
            errors.print(
                f"warning: {name}: not compared, since no run that can be repeated has a value of "
                f"them: {columns}"
            )
        counts = f"{repetition.agreeing} agree, {len(repetition.differences)} differ"
        counts += f", {len(repetition.by_rounding)} count as decided by rounding"
        repeated = f"{repetition.runs} of {len(studies[name].runs)} runs of {name}"
        errors.print(f"{repeated} were repeated: {counts}. They were drawn by --seed {drawn_by}")
        if repetition.by_rounding:
            errors.print(
                f"warning: {name}: a run counts as decided by rounding if every result that "
                f"differs from the stored one also changes by more than {TOLERANCE:g} when the "
                f"start coordinates are changed by {NUDGE:g} rad or m, and those of a size above 1 "
                f"by a relative {NUDGE:g}. This can hide a fault of these results: compare the "
                "values above (stored, repeated, from the moved start)"
            )
    for repetition in repetitions.values():
        if repetition.differences or repetition.changed_files:
            raise typer.Exit(NOTHING_DONE)
    print(text)
