"""``vsconstraints report``, and what writes a report at the end of other commands."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from .terminal import AllFigures, Figures, console, progress_bar


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a comparison, or of a campaign.")],
    figures: Figures = True,
    all_figures: AllFigures = False,
    tuning: Annotated[
        Path | None,
        typer.Option(help="Of a campaign: the folder of `vsconstraints tune` that its tuned settings come from."),
    ] = None,
) -> None:
    """Write the report of a comparison, or of a campaign, again from what is stored."""
    from ..runs.folder import kind_of

    if kind_of(folder) == "evidence":
        console.print(f"Report: {evidence_report(folder, figures, tuning)}")
    else:
        console.print(f"Report: {comparison_report(folder, figures, all_figures)}")


def comparison_report(folder: Path, figures: bool, all_figures: bool) -> Path:
    """Write a comparison's report, and show how far its figures are."""
    from ..reports import write_report

    progress = progress_bar()
    bar = progress.add_task("drawing figures")
    with ExitStack() as shown:

        def drawn(done: int, total: int) -> None:
            if done == 0:
                shown.enter_context(progress)
            progress.update(bar, completed=done, total=total)

        return write_report(folder, figures=figures, all_figures=all_figures, on_drawn=drawn)


def print_laws(folder: Path) -> None:
    """Print the table that the report of a comparison begins with, and what is bold in it."""
    from rich.table import Table

    from ..comparisons import StoredComparison
    from ..reports.results import Results
    from ..reports.summary import FIRST_LEGEND, law_columns

    results = Results(StoredComparison.load(folder))
    if not results.competitors:
        return
    names, columns = law_columns(results)
    table = Table(box=None, padding=(0, 1, 0, 0))
    table.add_column("controller", no_wrap=True)
    for header, texts in columns:
        # headers are broken at spaces, values stay whole
        widest = max(map(len, (*header.split(), *(_emphasised(text).plain for text in texts))))
        table.add_column(header, justify="right", min_width=widest)
    for i, name in enumerate(names):
        table.add_row(Text(name), *(_emphasised(texts[i]) for _, texts in columns))
    console.print(table, crop=False, overflow="ignore")
    console.print(FIRST_LEGEND.replace("*", ""))


def _emphasised(text: str) -> Text:
    """Bold where Markdown has stars; where nothing can be bold the stars stay."""
    before, star, rest = text.partition("**")
    if not star or not console.is_terminal:
        return Text(text)
    inside, _, after = rest.partition("**")
    return Text.assemble(before, (inside, "bold"), after)


def evidence_report(folder: Path, figures: bool, tuning: Path | None = None) -> Path:
    """Write a campaign's report, and show how many of its parts are there."""
    from ..reports.evidence import write_evidence_report

    with progress_bar() as progress:
        bar = progress.add_task("writing the report", total=None)
        return write_evidence_report(
            folder,
            figures=figures,
            tuning=tuning,
            on_written=lambda done, total: progress.update(bar, completed=done, total=total),
        )
