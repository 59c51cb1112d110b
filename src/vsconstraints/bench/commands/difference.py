"""Command ``diff``: changes between two stored results."""

from __future__ import annotations

from pathlib import Path

import typer

from ...cli.options import Names
from ...cli.terminal import console, note
from ...errors import ConfigurationError, format_value
from ...plugins.extras import demand


def diff(
    a: Path,
    b: Path,
    metric: Names = None,
    out: Path | None = None,
    rename: Names = None,
    tolerance: float | None = None,
    strict: bool | None = None,
) -> None:
    """Report changes between two comparisons.

    Exit code 1 if something got worse, 2 if they are not comparable.
    """
    demand("evidence", "a difference of two folders")
    from ..difference import TOLERANCE, difference
    from ..reports.difference import page, verdict

    names = {}
    for text in rename or ():
        old, _, new = text.partition("=")
        if not old or not new:
            raise ConfigurationError(f"--rename needs OLD=NEW, not {format_value(text)}")
        names[old] = new
    share = TOLERANCE if tolerance is None else tolerance
    metrics = metric or ()
    changes = difference(a, b, metrics=metrics, strict=strict, tolerance=share, renamed=names)
    note(*changes.a.remarks, *changes.b.remarks)
    if out is None:
        console.print(page(changes), end="")
    else:
        try:
            out.write_text(page(changes), encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise ConfigurationError(f"{out} cannot be written: {error}") from error
        console.print(f"{verdict(changes)}\nPage: {out}")
    if changes.worse:
        raise typer.Exit(1)  # something got worse
