"""The terminal that all commands write to: consoles, progress bars, notes and exit codes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.console import Console

from ..comparisons.runs.signals import INTERRUPTS, exit_code, signal_of

if TYPE_CHECKING:
    from rich.progress import Progress

# no markup, no emoji: names and paths may contain square brackets, and `my_camera:eye:` is no picture of one
console = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
errors = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)

NOTHING_DONE, USAGE_ERROR = 1, 2


def note(remark: str) -> None:
    """Print a remark on the error stream."""
    errors.print(f"note: {remark}")


def typed_command() -> list[str]:
    """What the user typed, such that files in UTF-8 can hold it."""
    return ["vsconstraints", *(word.encode("utf-8", "backslashreplace").decode() for word in sys.argv[1:])]


def note_processes(jobs: int | None) -> None:
    """Print a note where fewer processes are used than ``--jobs`` asks for."""
    from ..comparisons.runs.machine import process_count

    used = process_count(jobs)
    if jobs is not None and used < jobs:
        note(f"--jobs {jobs}: there are cores and memory for {used}; {used} used")


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """On an interrupt, print that finished runs are kept, and exit."""
    try:
        yield
    except INTERRUPTS as interrupt:
        errors.print(f"Interrupted: finished runs are kept in {folder}; the same command continues.")
        raise typer.Exit(exit_code(signal_of(interrupt))) from interrupt


def progress_bar() -> Progress:
    """A bar with how many of how many are done."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=errors)
