"""``vsconstraints report``, and what writes a report at the end of other commands."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from ..errors import ConfigurationError
from ..plugins.extras import demand
from ..reports.plots import formats_of
from .terminal import AllFigures, Figures, Formats, Latex, Replays, Trust, console, note, progress_bar


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a comparison, or of a campaign.")],
    figures: Figures = True,
    all_figures: AllFigures = False,
    formats: Formats = None,
    latex: Latex = False,
    replays: Replays = False,
    trust: Trust = False,
    tuning: Annotated[
        Path | None,
        typer.Option(help="Of a campaign: the folder of `vsconstraints tune` that its tuned settings come from."),
    ] = None,
) -> None:
    """Write the report of a comparison, or of a campaign, again from what is stored."""
    from ..comparisons.runs.folder import kind_of
    from ..reports.page import where

    asked = Asked(figures, all_figures, formats, latex, replays, trust)
    if replays and kind_of(folder) == "evidence":
        raise ConfigurationError(f"--replays is for comparisons, and {folder} holds a campaign")
    made = evidence_report(folder, asked, tuning) if kind_of(folder) == "evidence" else comparison_report(folder, asked)
    console.print(where(made))


@dataclass(frozen=True)
class Asked:
    """What a report was asked to have: the options of all commands that write one."""

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
        """Write what stands beside a report."""
        from ..reports.latex import write_tables

        if self.latex:
            console.print(f"Tables for LaTeX: {write_tables(report)}")
        return report


def comparison_report(folder: Path, asked: Asked) -> Path:
    """Write a comparison's report, and show how far its figures are."""
    from ..reports import write_report

    progress = progress_bar()
    bar = progress.add_task("drawing figures")
    with ExitStack() as shown:

        def drawn(done: int, total: int) -> None:
            if done == 0:
                shown.enter_context(progress)
            progress.update(bar, completed=done, total=total)

        written = write_report(
            folder,
            figures=asked.figures,
            all_figures=asked.all_figures,
            formats=formats_of(asked.formats or ()),
            replays=asked.replays,
            trust=asked.trust,
            on_drawn=drawn,
            on_remark=note,
        )
    return asked.finish(written)


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


def evidence_report(folder: Path, asked: Asked, tuning: Path | None = None) -> Path:
    """Write a campaign's report, and show how many of its parts are there."""
    from ..reports.evidence import write_evidence_report

    with progress_bar() as progress:
        bar = progress.add_task("writing the report", total=None)
        written = write_evidence_report(
            folder,
            figures=asked.figures,
            tuning=tuning,
            formats=formats_of(asked.formats or ()),
            trust=asked.trust,
            on_written=lambda done, total: progress.update(bar, completed=done, total=total),
            on_remark=note,
        )
    return asked.finish(written)
