"""Commands ``reproduce``, for the paper and its claims, and ``study``, for general questions."""

from __future__ import annotations

import tomllib
from functools import partial
from pathlib import Path

import typer

from ..bench.commands.campaigns import evidence
from ..cli.options import Names
from ..cli.terminal import (
    NOTHING_DONE,
    console,
    errors,
    note_processes,
    progress,
    say,
    typed_command,
)
from ..errors import ConfigurationError, unknown_name
from ..reports.formats import formats_of

TEXTS: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("texts.toml").read_text(encoding="utf-8")
)


def claim_names() -> list[str]:
    """Return the numbers of claims and of their parts."""
    from . import all_claims

    return [
        *dict.fromkeys(f"{claim.number}" for claim in all_claims()),
        *(claim.key for claim in all_claims()),
    ]


def reproduce(
    figure: list[int] | None = None,
    claim: Names = None,
    controller: str | None = None,
    out: Path = Path("vsconstraints-paper"),
    jobs: int | None = None,
    formats: Names = None,
    latex: bool = False,
) -> None:
    """Check every claim of the paper, redraw its figures, and write a report.

    Options select single claims or figures.
    """
    from ..reports.latex import write_tables
    from . import check, chosen_claims, chosen_figures, redraw
    from . import reproduce as run

    if controller is not None and (claim or not figure):
        raise ConfigurationError(
            "--controller is for figures: give --figure NUMBER. Claims are about the paper's law"
        )
    # unknown names are reported before any run starts
    written = formats_of(formats or ())
    chosen_figures(figure or (), controller)
    chosen_claims(claim or ())
    note_processes(jobs)
    result = None
    findings = {}
    drawn = {}
    with progress(out) as show:
        show("starting")
        if not figure and not claim:
            result = run(
                out, workers=jobs, on_progress=show, command=typed_command(), formats=written
            )
        if figure:
            drawn = redraw(
                figure, out, controller=controller, workers=jobs, on_progress=show, formats=written
            )
        if claim:
            findings = check(claim, out, workers=jobs, on_progress=show)
    if result is not None:
        for name, why in result.problems.items():
            errors.print(f"{name}: {why}")
        console.print(result.summary())
        if latex:
            console.print(f"Tables for LaTeX: {write_tables(result.report)}")
    if findings:
        say(TEXTS["claims"], findings=findings)
    for path, why in drawn.items():
        if why:
            errors.print(f"{path} could not be drawn: {why}")
        else:
            console.print(f"Figure: {path}")
    if drawn and all(drawn.values()):
        raise typer.Exit(NOTHING_DONE)


def study(
    names: Names = None,
    out: Path = Path("vsconstraints-studies"),
    jobs: int | None = None,
    formats: Names = None,
) -> None:
    """Answer a general question about controllers with many runs and one figure.

    The study real-world is a campaign.
    """
    from .studies import CAMPAIGNS, STUDIES, figure_file, run_studies

    written = formats_of(formats or ())
    chosen = dict.fromkeys(names or STUDIES)
    for name in [name for name in chosen if name not in (*STUDIES, *CAMPAIGNS)]:
        raise unknown_name("study", name, [*STUDIES, *CAMPAIGNS])
    for name in chosen:
        if name in CAMPAIGNS:
            evidence(Path(name), out / name, jobs=jobs, formats=formats)
    if not (studies := [name for name in chosen if name in STUDIES]):
        return
    note_processes(jobs)
    with progress(out) as show:
        show("studying")
        results = run_studies(
            studies, out, jobs, on_progress=partial(show, "studying"), formats=written
        )
    for name, result in results.items():
        console.print(f"{STUDIES[name].title} ({figure_file(out, name, written)})")
        for sentence in result.sentences:
            console.print(f"  {sentence}")
        for failure in result.failures:
            errors.print(f"  {failure}")
