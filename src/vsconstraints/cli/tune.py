"""``vsconstraints tune``: settings of laws, sought on training scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ConfigurationError
from . import completions
from .terminal import Jobs, console, errors, note_processes, progress_bar, taken_up_again, typed_command


def tune(
    campaign: Annotated[
        Path | None, typer.Argument(help="A campaign file; all shipped families with the default laws if not given.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for results; what is evaluated there is not run again.")] = Path(
        "vsconstraints-tuning"
    ),
    evaluations: Annotated[int, typer.Option(help="Settings of each law and tuner seed, the default included.")] = 40,
    seeds: Annotated[int, typer.Option(help="How often tuning is repeated with another seed.")] = 3,
    scenes: Annotated[int, typer.Option(help="Training scenes of each family.")] = 10,
    violations: Annotated[float, typer.Option(help="Share of runs that may have a violated row.")] = 0.2,
    family: Annotated[
        list[str] | None, typer.Option(help="Only this family. Can be repeated.", autocompletion=completions.families)
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(help="Only this controller. Can be repeated.", autocompletion=completions.controllers),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the campaign, as of evidence."),
    ] = None,
    jobs: Jobs = None,
) -> None:
    """Tune every law alike on training scenes, and write settings that a campaign can take over."""
    from ..plugins.extras import demand

    demand("tune")
    from ..comparisons.evidence import Campaign
    from ..comparisons.tuning import Budget, Problem
    from ..comparisons.tuning import tune as run
    from ..comparisons.tuning.result import TUNED
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
    with taken_up_again(out), progress_bar() as progress:
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
            errors.print(f"note: no setting of {law.law.law.name} keeps to the violations that are allowed")
    console.print(f"Settings: {out / TUNED}. {where(out / REPORT)}")
