"""What a figure is: a name, what it shows, and the function that draws it from what it needs."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .formats import PNG, Formats
from .sheet import Sheet
from .style import FORMULAS, STYLE


@dataclass(frozen=True)
class Figure:
    """One line of a table of figures.

    Attributes
    ----------
    name
        Of its file, and what it is asked for by.
    title
        What it shows, in a few words: the text instead of the picture.
    caption
        What is to be seen.
    draw
        Makes the sheet from what the figure needs; None if there is nothing to show.
    needs
        What it is drawn from, where that differs from figure to figure.
    reading
        How to read it, said once where it is shown several times.
    formulas
        Whether its texts hold formulas between dollars. Names that a user gives may contain anything.
    """

    name: str
    title: str
    caption: str
    draw: Callable[..., Sheet | None]
    needs: tuple[Any, ...] = ()
    reading: str = ""
    formulas: bool = False

    @property
    def file(self) -> str:
        """Its file's name, as PNG."""
        return self.file_in(PNG)

    def file_in(self, formats: Formats, suffix: str = "") -> str:
        """The name of the file that pages show; ``suffix`` stands behind its own name."""
        return f"{self.name}{suffix}.{formats[0]}"

    def write(self, path: Path, *needed: object, formats: Formats = ()) -> bool:
        """Draw it and write it, each file whole or not at all; raises whatever goes wrong.

        Parameters
        ----------
        path
            Where to; its suffix is the format.
        needed
            What it is drawn from.
        formats
            Of files beside it, in which it is written as well.

        Returns
        -------
        bool
            Whether there was anything to show.
        """
        from matplotlib import rc_context

        files = dict.fromkeys((path, *(path.with_suffix(f".{one}") for one in formats)))
        with _uncollected(), rc_context({**STYLE, **(FORMULAS if self.formulas else {})}), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return self._written(files, *needed)

    def _written(self, files: Iterable[Path], *needed: object) -> bool:
        sheet = self.draw(*needed)
        if sheet is not None:
            for file in files:
                sheet.save(file)
        return sheet is not None

    def drawn(self, *needed: object) -> Any:
        """Draw it, and return the figure of matplotlib; None if there was nothing to show. As :meth:`write` else."""
        from matplotlib import rc_context

        with rc_context({**STYLE, **(FORMULAS if self.formulas else {})}), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sheet = self.draw(*needed)
            return None if sheet is None else sheet.placed()


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without looking for unreachable objects: a figure makes many that all live until it is written.

    They are collected at the end, and only they: what was there before is not looked at.
    """
    collected, frozen = gc.isenabled(), gc.get_freeze_count() > 0
    gc.disable()
    if not frozen:
        gc.freeze()
    try:
        yield
    finally:
        gc.collect()
        if not frozen:
            gc.unfreeze()
        if collected:
            gc.enable()
