"""How far a comparison is, told where somebody looks: in a terminal or a notebook, and nowhere else."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

OFTEN = 0.2
"""Between two lines of a notebook [s]."""


@contextmanager
def told(total: int, console: Console | None = None) -> Iterator[Callable[[], None]]:
    """Tell how many of ``total`` runs are done, which the function that it gives counts; nothing in files and pipes.

    ``console`` is where, the standard error stream if not given.
    """
    console = console or Console(stderr=True)
    if console.is_jupyter:
        line = Line(total)
        yield line.advance
        line.end()
    elif console.is_terminal:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task("comparing", total=total)
            yield lambda: progress.advance(bar)
    else:
        yield lambda: None


class Line:
    """A line below a cell, written again as runs are done."""

    def __init__(self, total: int) -> None:
        self.total, self.done = total, 0
        self.begun = self.shown = time.monotonic()
        self.handle: Any = None
        self._write()

    def advance(self) -> None:
        """Another run is done."""
        self.done += 1
        if time.monotonic() - self.shown > OFTEN:
            self._write()

    def end(self) -> None:
        """Say what it came to."""
        self._write()

    def _write(self) -> None:
        from IPython import display

        show: Any = display.display
        self.shown = time.monotonic()
        text = {"text/plain": f"comparing: {self.done} of {self.total} runs, {self.shown - self.begun:.0f} s"}
        if self.handle is None:
            self.handle = show(text, raw=True, display_id=True)
        else:
            self.handle.update(text, raw=True)
