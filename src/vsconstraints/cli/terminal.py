"""The terminal that all commands write to: consoles, progress, notes, interrupts and exit codes."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import typer
from rich.console import Console

from ..plugins.processes import INTERRUPTS, exit_code, signal_of

# no markup, no emoji: names and paths may contain square brackets, and `my_camera:eye:` is no picture of one
console = Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
errors = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)

NOTHING_DONE, USAGE_ERROR = 1, 2

Show = Callable[..., None]  #: shows progress: of what, how many are done, and of how many if that is known


TEXTS: dict[str, str] = tomllib.loads(Path(__file__).with_name("texts.toml").read_text(encoding="utf-8"))


def say(text: str, **values: Any) -> None:
    """Print a template of ``texts.toml`` with values."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    console.print(environment.from_string(TEXTS[text]).render(values).strip("\n"))


def note(*remarks: str) -> None:
    """Print remarks on the error stream."""
    for remark in remarks:
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


def stop(signal: int, what: str, then: str = "continues") -> NoReturn:
    """End a command that a signal interrupted, and tell what the same command does then."""
    errors.print(f"Interrupted: {what}; the same command {then}.")
    raise typer.Exit(exit_code(signal))


@contextmanager
def progress(folder: Path | None = None) -> Iterator[Show]:
    """A bar, from the first call of what it yields on; an interrupt says that ``folder`` keeps finished runs."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
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
