"""``vsconstraints reproduce``: the whole paper, one of its figures, or one of its claims."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import ConfigurationError
from ..reports.plots import formats_of
from . import completions
from .terminal import (
    NOTHING_DONE,
    Formats,
    Jobs,
    Latex,
    console,
    errors,
    note_processes,
    progress_bar,
    taken_up_again,
    typed_command,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..paper import Claim, Finding


def reproduce(
    figure: Annotated[
        list[int] | None,
        typer.Option(
            metavar="NUMBER", help="Only this figure of the paper. Can be repeated.", autocompletion=completions.figures
        ),
    ] = None,
    claim: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NUMBER",
            help="Only these claims: 5, or 5d for one of them. Can be repeated.",
            autocompletion=completions.claims,
        ),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            help="With --figure: a law instead of the paper's, a name or module:Class.",
            autocompletion=completions.controllers,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for report, table and figures.")] = Path("vsconstraints-paper"),
    jobs: Jobs = None,
    formats: Formats = None,
    latex: Latex = False,
) -> None:
    """Check every claim of the paper, redraw its figures, and write a report; or only one of them."""
    from ..paper import check, chosen_claims, chosen_figures, redraw
    from ..paper import reproduce as run
    from ..reports.latex import write_tables

    if controller is not None and (claim or not figure):
        raise ConfigurationError("--controller is for figures: give --figure NUMBER. Claims are about the paper's law")
    # what there is not is said before anything begins
    written = formats_of(formats or ())
    chosen_figures(figure or (), controller)
    chosen_claims(claim or ())
    note_processes(jobs)
    with taken_up_again(out), progress_bar() as progress:
        bar = progress.add_task("starting", total=None)

        def show(what: str, done: int, total: int) -> None:
            progress.update(bar, description=what, completed=done, total=total)

        if not figure and not claim:
            result = run(out, workers=jobs, on_progress=show, command=typed_command(), formats=written)
        drawn = (
            redraw(figure, out, controller=controller, workers=jobs, on_progress=show, formats=written)
            if figure
            else {}
        )
        found = check(claim, out, workers=jobs, on_progress=show) if claim else {}
    if not figure and not claim:
        for name, why in result.problems.items():
            errors.print(f"{name}: {why}")
        console.print(result.summary())
        if latex:
            console.print(f"Tables for LaTeX: {write_tables(result.report)}")
    _say_claims(found)
    _say_figures(drawn)


def _say_claims(found: Mapping[Claim, Finding]) -> None:
    for claim, finding in found.items():
        console.print(f"{claim.key} ({claim.where}): {finding.verdict}")
        console.print(f"  the paper says  {claim.sentence}")
        console.print(f"  measured        {finding.text}")
        console.print(f"  it holds if     {claim.rule}")


def _say_figures(drawn: Mapping[Path, str]) -> None:
    for path, why in drawn.items():
        if why:
            errors.print(f"{path} could not be drawn: {why}")
        else:
            console.print(f"Figure: {path}")
    if drawn and all(drawn.values()):
        raise typer.Exit(NOTHING_DONE)
