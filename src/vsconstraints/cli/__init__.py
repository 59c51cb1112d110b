"""The command line: ``vsconstraints compare``, ``preview``, ``run``, ``evidence``, ``report`` and more."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated

import typer

from .. import __version__
from ..comparisons.runs.signals import INTERRUPTS, exit_code, obey_signals, signal_of
from ..errors import StorageError, VsconstraintsError, WorkersLost, unknown_name
from . import completions
from .difference import diff
from .evidence import evidence, merge
from .families import families
from .frames import frames
from .preview import preview
from .replay import replay
from .reporting import Asked, comparison_report, print_laws, report
from .reproduce import reproduce
from .run import run
from .terminal import (
    NOTHING_DONE,
    USAGE_ERROR,
    AllFigures,
    Figures,
    Formats,
    Jobs,
    Latex,
    Replays,
    app,
    console,
    errors,
    note_processes,
    progress_bar,
    taken_up_again,
    typed_command,
)
from .tune import tune
from .verify import verify


def compare(
    context: typer.Context,
    suite: Annotated[Path | None, typer.Argument(help="A suite file; the default comparison if not given.")] = None,
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            help="Only this scenario: a name or a path. Can be repeated.", autocompletion=completions.scenarios
        ),
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(help="Only this controller. Can be repeated.", autocompletion=completions.controllers),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for results; runs stored there are not run again.")] = Path(
        "vsconstraints-results"
    ),
    jobs: Jobs = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Instead of the suite's.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change a setting, e.g. scenario.sampling_time=0.004, case-study-6r.task.Kp0=30, "
            "hierarchical-qp.solver=osqp or trials=5. Can be repeated.",
        ),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Run again what is stored, and replace another comparison in the folder.")
    ] = False,
    keep: Annotated[
        str,
        typer.Option(
            help="Whose trajectories stay when the report is made: none, failed, worst, first or all.",
            autocompletion=completions.ways_to_keep,
        ),
    ] = "all",
    figures: Figures = True,
    all_figures: AllFigures = False,
    formats: Formats = None,
    latex: Latex = False,
    replays: Replays = False,
    run_limit: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="A run that takes longer is ended and fails; 120 s and 0.1 s per sample if not given.",
        ),
    ] = None,
) -> None:
    """Run every scenario with every controller, and write a report."""
    from ..comparisons import RunSpec, Suite, keep_trajectories
    from ..comparisons import compare as run
    from ..comparisons.metrics import Score
    from ..comparisons.runs.folder import demand_keep, held
    from ..reports.failures import kind
    from ..reports.page import where

    kept = demand_keep(keep)
    asked = Asked(figures, all_figures, formats, latex, replays, trust=True)
    chosen = Suite.load(suite).select(scenario or (), controller or (), seed, settings or ())
    for remark in chosen.remarks():
        errors.print(f"note: {remark}")
    total = len(chosen.with_baseline().runs())
    note_processes(jobs)
    context.with_resource(held(out, "a comparison"))
    failed: Counter[str] = Counter()
    with progress_bar() as progress:
        bar = progress.add_task("comparing", total=total)

        def finished(made: RunSpec, score: Score, stored: bool) -> None:
            progress.advance(bar)
            status, reason = score.result["status"], score.result["reason"]
            if status in ("failed", "aborted"):
                what = f"{made.name} · {made.controller.name}"
                alike = f"{what}: {status}, {kind(reason)}"
                failed[alike] += 1
                if failed[alike] == 1:
                    progress.console.print(f"{what} · trial {made.trial}: {status}, {reason}")

        result = run(
            chosen,
            out,
            workers=jobs,
            limit=run_limit,
            fresh=fresh,
            command=typed_command(),
            on_finished=finished,
        )
    for alike, count in failed.items():
        if count > 1:
            errors.print(f"{alike}: {count} of {chosen.trials} trials")
    if result.stored_before:
        console.print(f"{result.stored_before} of {total} runs were stored in {out} already; --fresh runs them again.")
    if result.interrupted:
        errors.print(
            f"Interrupted: {len(result.scores)} of {total} runs are stored in {out}; the same command goes on."
        )
        raise typer.Exit(exit_code(result.interrupted))
    try:
        report_file = comparison_report(out, asked)
    except INTERRUPTS as interrupt:
        errors.print(f"Interrupted: all {total} runs are stored in {out}, the report is not; the same command goes on.")
        raise typer.Exit(exit_code(signal_of(interrupt))) from interrupt
    print_laws(out)
    if kept != "all":
        console.print(f"Trajectories kept: {keep_trajectories(out, kept)} of {total}; --keep {kept}.")
    console.print(f"{total} runs in {result.wall_time:.1f} s. {where(report_file)}")
    if result.all_failed:
        errors.print(
            "error: every run of the controllers that were to be compared failed; the report gives the reasons"
        )
        raise typer.Exit(NOTHING_DONE)


def list_() -> None:
    """Show the scenarios, controllers, solvers, robots and constraints there are."""
    from .listing import print_listing

    print_listing(console)


def study(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Which studies; all if not given.", autocompletion=completions.studies),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for figures and tables.")] = Path("vsconstraints-studies"),
    jobs: Jobs = None,
    formats: Formats = None,
) -> None:
    """Answer a general question about the controllers with many runs and one figure; real-world is a whole campaign."""
    from ..paper.studies import CAMPAIGNS, STUDIES, figure_file, run_studies
    from ..reports.plots import formats_of

    written = formats_of(formats or ())
    for name in names or ():
        if name not in STUDIES and name not in CAMPAIGNS:
            raise unknown_name("study", name, [*STUDIES, *CAMPAIGNS])
    for name in dict.fromkeys(names or ()):
        if name in CAMPAIGNS:
            evidence(Path(name), out / name, jobs=jobs, formats=formats)
    names = [name for name in names or STUDIES if name in STUDIES]
    if not names:
        return
    note_processes(jobs)
    with taken_up_again(out), progress_bar() as progress:
        bar = progress.add_task("studying", total=None)
        results = run_studies(
            names,
            out,
            jobs,
            on_progress=lambda done, total: progress.update(bar, completed=done, total=total),
            formats=written,
        )
    for name, result in results.items():
        console.print(f"{STUDIES[name].title} ({figure_file(out, name, written)})")
        for sentence in result.sentences:
            console.print(f"  {sentence}")
        for failure in result.failures:
            errors.print(f"  {failure}")


GROUPS: dict[str, dict[str, Callable[..., None]]] = {
    "Laws in a few scenes": {"compare": compare, "list": list_, "report": report, "diff": diff, "verify": verify},
    "A look at a scene, or at a run of it": {"preview": preview, "replay": replay, "frames": frames},
    "On an arm": {"run": run},
    "The paper, and general questions": {"reproduce": reproduce, "study": study},
    "Thousands of drawn scenes": {"families": families, "evidence": evidence, "merge": merge, "tune": tune},
}
"""The commands by what they are for, in the order in which ``--help`` shows them."""

for _what, _commands in GROUPS.items():
    for _name, _command in _commands.items():
        app.command(_name, rich_help_panel=_what)(_command)


def _version(value: bool) -> None:
    if value:
        console.print(f"vsconstraints {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Compare controllers that keep visual servoing inside its limits."""


def main() -> None:
    """Run the command line; errors of this package and of the system end it with one line (see ``docs/errors.md``)."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # names and paths may hold what the terminal's encoding does not have
            stream.reconfigure(errors="backslashreplace")
    obey_signals()
    try:
        app()
    except (VsconstraintsError, OSError) as error:
        errors.print(f"error: {' '.join(str(error).splitlines())}")
        sys.exit(NOTHING_DONE if isinstance(error, StorageError | WorkersLost) else USAGE_ERROR)
    except INTERRUPTS as interrupt:
        errors.print("Interrupted.")
        sys.exit(exit_code(signal_of(interrupt)))
