"""``testset run``, ``verify`` and ``make``: laws on frozen scenes, and the files that hold these."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from ..errors import ConfigurationError
from ..plugins.extras import demand
from . import options
from .campaigns import run_campaign, with_call_times
from .results import ReportOptions
from .terminal import NOTHING_DONE, console, errors, note_processes, progress

_FOLDER = "Folder of a test set; the one that comes with the package if not given."
_SECRET = "Draw as many other scenes in the same way, with a seed that nobody knows before."
_ENTRY = "A law besides the default ones. Can be repeated."
_LAWS = "A campaign or suite, whose laws are run instead of the default ones."
_Folder = Annotated[Path | None, Argument(help=_FOLDER)]
_Entries = Annotated[options.Names, Option(metavar="MODULE:CLASS", help=_ENTRY)]
_Secret = Annotated[int | None, Option(min=0, metavar="SEED", help=_SECRET)]
_Most = Annotated[int | None, Option(min=1, help="How many of each family; all if not given.")]
_Held = Annotated[int, Option(min=1, help="Held-out scenes of each family; a fifth as many for training.")]
_Share = Annotated[float, Option(min=0.0, max=1.0, help="Share of the scenes that is drawn again and compared.")]
_TABLES = "Tables that `advise --keep` has written, or folders of `testset run`."
_Rerun = Annotated[float, Option(min=0.0, max=1.0, help="Share of the runs that is made again and compared.")]


def run(
    folder: _Folder = None,
    half: options.Half = "held-out",
    laws: Annotated[Path | None, Option(help=_LAWS)] = None,
    entry: _Entries = None,
    secret_seed: _Secret = None,
    family: options.Families = None,
    scenes: _Most = None,
    out: options.Out = Path("vsconstraints-testset"),
    jobs: options.Jobs = None,
    settings: options.Settings = None,
    figures: options.Figures = True,
    time_passes: options.TimePasses = None,
    slower: options.Slower = None,
    budget_us: options.Budget = None,
) -> None:
    """Run the default laws and one's own on the scenes of a test set, and write a report."""
    from ..comparisons import Suite
    from ..comparisons.evidence import Campaign, Plan, processes
    from ..scenarios.families.frozen import V1, TestSet
    from ..scenarios.toml import read_toml

    frozen = TestSet.load(folder or V1)
    chosen = frozen.chosen(family or (), half, scenes, secret_seed)
    if laws and "scenarios" in read_toml(laws):
        chosen["controllers"], laws = Suite.load(laws).controllers, None
    campaign = Campaign.load(laws).changed(title=f"Test set {frozen.version}", **chosen)
    names = [each.name for each in campaign.controllers]
    note_processes(jobs)
    campaign = campaign.select(controllers=[*names, *(entry or ())], settings=settings or ())
    run_campaign(
        with_call_times(campaign, out, jobs, time_passes, slower, budget_us),
        out,
        Plan(),
        nullcontext(processes(jobs)),
        ReportOptions(figures, trust=True),
    )


def verify(folder: _Folder = None, redraw: _Share = 0.0, seed: options.Seed = 0) -> None:
    """Check every scene of a test set against its hash, and name what was changed, added or is missing."""
    from ..scenarios.families.frozen import V1, TestSet

    frozen = TestSet.load(folder or V1)
    with progress() as show:
        problems = list(frozen.problems(redraw, seed, show))
    for problem in problems:
        errors.print(f"error: {problem}")
    if problems:
        raise typer.Exit(NOTHING_DONE)
    whole = f"{sum(map(len, frozen.hashes.values()))} scenes are as they were made"
    console.print(f"Test set {frozen.version}: {whole}. SHA-256 of its index: {frozen.sha256}")


def make(
    scenes: _Held = 100,
    seed: options.Seed = 0,
    family: options.Families = None,
    version: Annotated[str, Option(help="Its name, on which the draws depend.")] = "own",
    out: options.Out = Path("vsconstraints-testset"),
) -> None:
    """Draw scenes of all families, or those that are named, and freeze them with their hashes in a new folder."""
    from ..scenarios.families import Family, families
    from ..scenarios.families.frozen import TestSet

    counts = {"training": -(-scenes // 5), "held-out": scenes}
    with progress() as show:
        made = TestSet.make(out, [Family.load(name) for name in family or families()], version, counts, seed, show)
    console.print(f"Test set {made.version} of {len(made.families)} families. Stored in {out}")


def leaderboard(
    tables: Annotated[list[Path], Argument(help=_TABLES)],
    rerun: _Rerun = 0.0,
    seed: options.Seed = 0,
    trust: options.Trust = False,
) -> None:
    """Check tables of runs on all held-out scenes, and print their laws in order as a table in Markdown."""
    demand("evidence", "the leaderboard")
    from ..comparisons.rerun import differing
    from ..comparisons.study import Study
    from ..reports.leaderboard import leaderboard as board
    from ..scenarios.families.frozen import TestSet

    frozen, studies, problems = TestSet.load(), dict[str, Study](), list[str]()
    with progress() as show:
        for path in tables:
            if path.stem in studies:
                raise ConfigurationError(f"two tables are named {path.stem}, and laws are told apart by their names")
            study = Study.load(path, trust, lambda done, scenes: show("scenes", done, scenes), own=True)
            studies[path.stem] = study
        text = board(studies, frozen)
        families = {family.name: family for family in frozen.families}
        for name, study in studies.items():
            for difference, rounding in differing(study, families, rerun, seed, trust) if rerun else ():
                errors.print(f"{'remark: rounding decides' if rounding else 'error:'} {name}: {difference}")
                problems += [] if rounding else [difference]
    if problems:
        raise typer.Exit(NOTHING_DONE)
    print(text)
