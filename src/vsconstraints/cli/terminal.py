"""Terminal output of all commands: consoles, progress, notes, interrupts and exit codes."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import typer
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from ..errors import encodable
from ..plugins.processes import INTERRUPTS, exit_code, signal_of

# no markup and no emoji: names and paths may contain square brackets, or text such as
# `my_camera:eye:`
console = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
errors = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)

NOTHING_DONE = 1
USAGE_ERROR = 2

#: Shows progress: activity, number of finished items, and their total number if known.
Show = Callable[..., None]


def say(template: str, **values: Any) -> None:
    """Print a template with values."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    print_paragraph(environment.from_string(template).render(values).strip("\n"))


def print_columns(
    header: Sequence[str], lines: Sequence[Sequence[str]], wrapped: Mapping[int, int] | None = None
) -> None:
    """Print a table with the first column aligned left and the others right; no line is broken.

    A table wider than the terminal is printed as several tables, each of which begins with the
    first column. Headers are broken at spaces. Cells are not broken, except those of the columns in
    ``wrapped``, which are aligned left and have at least the given width. Text between two double
    stars is bold.
    """
    wrapped = wrapped or {}
    widths = []
    for column, title in enumerate(header):
        cells = [_emphasised(line[column]).cell_len for line in lines]
        content = wrapped.get(column) or max(cells, default=0)
        longest_word = max((cell_len(word) for word in title.split()), default=0)
        widths.append(max(longest_word, content))
    blocks = [[0]]
    for column in range(1, len(header)):
        needed = sum(widths[k] + 1 for k in (*blocks[-1], column))
        if needed > console.width + 1 and len(blocks[-1]) > 1:
            blocks.append([0])
        blocks[-1].append(column)
    for number, block in enumerate(blocks):
        if number:
            console.print()
        _print_block(header, lines, widths, block, wrapped)


def _print_block(
    header: Sequence[str],
    lines: Sequence[Sequence[str]],
    widths: Sequence[int],
    block: Sequence[int],
    wrapped: Mapping[int, int],
) -> None:
    from rich.table import Table

    has_room = sum(widths[column] + 2 for column in block) <= console.width
    table = Table(box=None, padding=(0, 2 if has_room else 1, 0, 0))
    spare = max(console.width + 1 - sum(widths[column] + 1 for column in block), 0)
    for column in block:
        width = widths[column]
        if column in wrapped:
            longest = max(_emphasised(line[column]).cell_len for line in lines)
            width = max(width, min(longest, width + spare))
        left = column == 0 or column in wrapped
        table.add_column(header[column], justify="left" if left else "right", width=width)
    for line in lines:
        table.add_row(*(_emphasised(line[column]) for column in block))
    console.print(table, soft_wrap=False, crop=False, overflow="ignore")


def _emphasised(text: str) -> Text:
    """Return text that is bold between double stars, as in Markdown.

    If the console is no terminal, the stars are kept.
    """
    if not console.is_terminal:
        return Text(text)
    emphasised = Text()
    for k, part in enumerate(text.split("**")):
        is_between_stars = k % 2 == 1
        emphasised.append(part, "bold" if is_between_stars else "")
    return emphasised


def print_paragraph(text: str) -> None:
    """Print a text; on a terminal it is wrapped between words, elsewhere its lines are kept."""
    console.print(text, soft_wrap=not console.is_terminal)


def note(*remarks: str) -> None:
    """Print warnings on the error stream."""
    for remark in remarks:
        errors.print(f"warning: {remark}", soft_wrap=not errors.is_terminal)


def typed_command() -> list[str]:
    """Return the command as typed, in a form that UTF-8 files can store."""
    return ["vsconstraints", *map(encodable, sys.argv[1:])]


def note_processes(jobs: int | None) -> None:
    """Warn if fewer processes are used than requested by ``--jobs``."""
    from ..comparisons.runs.machine import process_count

    used = process_count(jobs)
    if jobs is not None and used < jobs:
        note(f"--jobs {jobs}: cores and memory suffice for {used}; {used} used")


def stop(signal: int, what: str, then: str = "continues") -> NoReturn:
    """End a command that a signal interrupted; state the effect of repeating the same command."""
    errors.print(f"Interrupted: {what}; the same command {then}.")
    raise typer.Exit(exit_code(signal))


@contextmanager
def progress(folder: Path | None = None) -> Iterator[Show]:
    """Provide a function that shows a progress bar, which appears at its first call.

    After an interrupt, a message states that ``folder`` keeps finished runs.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    bar = Progress(*columns, console=errors)
    task = bar.add_task("", total=None)

    def show(what: str, done: int = 0, total: int | None = None) -> None:
        bar.start()
        bar.update(task, completed=done, total=total, description=what)

    try:
        yield show
    except INTERRUPTS as interrupt:
        if folder is None:
            raise
        stop(signal_of(interrupt), f"finished runs are kept in {folder}")
    finally:
        if bar.live.is_started:
            bar.stop()
