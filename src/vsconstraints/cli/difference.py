"""``vsconstraints diff A B``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ConfigurationError, shown
from .terminal import console, note

GOT_WORSE = 1


def diff(
    a: Annotated[Path, typer.Argument(help="Folder of a comparison: before.")],
    b: Annotated[Path, typer.Argument(help="Another one of the same scenes: after.")],
    metric: Annotated[
        list[str] | None, typer.Option(help="Only this metric, a column of results.csv. Can be repeated.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File for the whole page; shown if not given.")] = None,
    rename: Annotated[
        list[str] | None,
        typer.Option(metavar="OLD=NEW", help="What B calls a controller of A. Can be repeated."),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(min=0.0, help="Share by which a value may move; a millionth if not given.")
    ] = None,
    strict: Annotated[
        bool | None,
        typer.Option(
            "--strict/--rates",
            help="Whether each run counts that is lost, or only rates that are significantly worse. If not given, each "
            "counts of a suite's scenes, rates of drawn ones.",
        ),
    ] = None,
) -> None:
    """Say what changed between two comparisons; exit code 1 if something got worse, 2 if they cannot be compared."""
    from ..plugins.extras import demand

    demand("evidence", "a difference of two folders")
    from ..comparisons.difference.difference import TOLERANCE, Question, difference
    from ..reports.difference import page, verdict

    renamed = dict(_renaming(text) for text in rename or ())
    question = Question(metric or (), strict, TOLERANCE if tolerance is None else tolerance, renamed)
    found = difference(a, b, question)
    for side in (found.a, found.b):
        for remark in side.remarks:
            note(remark)
    if out is None:
        console.print(page(found), end="")
    else:
        try:
            out.write_text(page(found), encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise ConfigurationError(f"{out} cannot be written: {error}") from error
        console.print(verdict(found))
        console.print(f"Page: {out}")
    if found.worse:
        raise typer.Exit(GOT_WORSE)


def _renaming(text: str) -> tuple[str, str]:
    old, equals, new = text.partition("=")
    if not (old and equals and new):
        raise ConfigurationError(f"--rename needs OLD=NEW, not {shown(text)}")
    return old, new
