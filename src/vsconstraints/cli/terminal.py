"""What the commands share: the application, its terminal, options that several have, and progress."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ..comparisons.runs.signals import INTERRUPTS, exit_code, signal_of
from . import completions

if TYPE_CHECKING:
    from rich.progress import Progress

app = typer.Typer(
    help="Compare controllers that keep visual servoing inside its limits.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
# no markup, no emoji: names and paths may contain square brackets, and `my_camera:eye:` is no picture of one
console = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
errors = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)

NOTHING_DONE, USAGE_ERROR = 1, 2


Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; as many as there are cores if not given.")]

Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Whether the report has figures.")]
AllFigures = Annotated[
    bool,
    typer.Option("--all-figures", help="Figures of every scenario of a large suite, not of the most telling alone."),
]

Replays = Annotated[
    bool,
    typer.Option(
        "--replays",
        help="Replay the most telling runs of each scenario that has figures: a page for a browser, linked.",
    ),
]

Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="png|svg|pdf",
        help="Of figures; PNG if not given. Can be repeated.",
        autocompletion=completions.formats,
    ),
]
Latex = Annotated[
    bool, typer.Option("--latex", help="Write the report's tables for LaTeX, too, into the folder tables.")
]


Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run code that the stored results name as module:Class, to draw what needs it; else none is imported.",
    ),
]


def note(remark: str) -> None:
    """Say what a reader should know."""
    errors.print(f"note: {remark}")


def typed_command() -> list[str]:
    """What the user typed, such that files in UTF-8 can hold it."""
    return ["vsconstraints", *(word.encode("utf-8", "backslashreplace").decode() for word in sys.argv[1:])]


def note_processes(asked: int | None) -> None:
    """Say so where fewer processes are used than were asked for."""
    from ..comparisons.runs.machine import process_count

    used = process_count(asked)
    if asked is not None and used < asked:
        errors.print(f"note: --jobs {asked}: there are cores and memory for {used}; {used} used")


@contextmanager
def taken_up_again(folder: Path) -> Iterator[None]:
    """Say, where it is interrupted, that what was finished is kept."""
    try:
        yield
    except INTERRUPTS as interrupt:
        errors.print(f"Interrupted: finished runs are kept in {folder}; the same command goes on.")
        raise typer.Exit(exit_code(signal_of(interrupt))) from interrupt


def progress_bar() -> Progress:
    """A bar with how many of how many are done."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=errors)
