"""A figure: what it is drawn from, the sheet whose parts are placed in inches from top to bottom, and its files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.runs.files import replaced
from ...errors import unknown_name
from .style import FORMULAS, STYLE

Formats = tuple[str, ...]
"""Of a figure's files, by their suffixes; pages show the first."""

PNG: Formats = ("png",)

VECTOR: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Formats that stay sharp at any size, and what leaves the day out of their files: the same figure, the same bytes."""

FORMATS = (*PNG, *VECTOR)
"""All there are."""

NOT_ON_PAGES = "pdf"
"""No browser shows it within a page."""


def formats_of(names: Sequence[str]) -> Formats:
    """The formats of these names, PNG if there are none; one that pages show comes first, PNG if none of them is.

    Raises
    ------
    ConfigurationError
        for a name that is none of :data:`FORMATS`.
    """
    for name in names:
        if name not in FORMATS:
            raise unknown_name("format", name, FORMATS)
    chosen = list(dict.fromkeys(names))
    shown = [name for name in chosen if name != NOT_ON_PAGES] or list(PNG)
    return (*shown, *(name for name in chosen if name == NOT_ON_PAGES))


WIDTH = 8.0
"""Width of every figure [in]: at this width the smallest text is 8 pt."""

DPI, SCREEN_DPI = 150, 100
EDGE = 0.03
"""Between what is drawn and the left edge, at least [in]."""

FOOT = 0.45
"""Room below a row of panels for its numbers and label [in]."""


class Sheet:
    """A figure of the common width that grows downwards; places are inches from its top left corner.

    Parameters
    ----------
    left, right
        Margins of what stands in rows [in].

    Attributes
    ----------
    at
        How far down it is filled [in].
    beside
        Right of the last row of views, where a legend finds room [in].
    """

    def __init__(self, left: float = 0.75, right: float = 0.15) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.transforms import Affine2D, ScaledTranslation

        self.left, self.right, self.at = left, right, 0.08
        self.beside = (left, self.at)
        self.figure: Any = Figure(dpi=DPI, facecolor="white")
        self.canvas: Any = FigureCanvasAgg(self.figure)
        whole: Any = self.figure.transFigure
        from_top = ScaledTranslation(0.0, 1.0, whole)
        self.inches: Any = Affine2D().scale(1.0, -1.0) + self.figure.dpi_scale_trans + from_top
        self._places: list[tuple[Any, tuple[float, float, float, float]]] = []

    def axes(self, left: float, top: float, width: float, height: float, **options: Any) -> Any:
        """Axes whose frame is at this place."""
        ax = self.figure.add_axes((0.0, 0.0, 1.0, 1.0), **options)
        self._places.append((ax, (left, top, width, height)))
        self.at = max(self.at, top + height)
        return ax

    def panels(
        self,
        count: int,
        columns: int = 1,
        *,
        height: float | Sequence[float],
        width: float = 0.0,
        gap: float = 0.7,
        above: float = 0.16,
        labels: tuple[str, str] = ("", ""),
        same_y: bool = False,
    ) -> list[Any]:
        """A grid of panels that share their horizontal axis.

        Parameters
        ----------
        count, columns
            How many, and in how many columns; row by row.
        height, width
            Of each, or the height of each row [in]; as wide as there is room if no width is given.
        gap
            Between columns [in].
        above
            Above each row [in]: room for titles.
        labels
            Of the horizontal axis, at the lowest panel of each column, and of the vertical one, at the left.
        same_y
            Whether panels share their vertical axis too.
        """
        columns = max(min(columns, count), 1)
        width = width or (WIDTH - self.left - self.right - gap * (columns - 1)) / columns
        heights = [height] * count if isinstance(height, float) else height
        made: list[Any] = []
        for first, tall in zip(range(0, count, columns), heights, strict=False):
            top = self.at + above
            for i in range(first, min(first + columns, count)):
                ax = self.axes(self.left + (i - first) * (width + gap), top, width, tall)
                lowest = i + columns >= count
                ax.tick_params(labelbottom=lowest, labelleft=i == first or not same_y)
                ax.set_xlabel(labels[0] if lowest else "", labelpad=2)
                ax.set_ylabel(labels[1] if i == first else "", labelpad=2)
                made.append(ax)
        self.at += FOOT if made else 0.0
        return made

    def views(self, *sizes: tuple[float, float], gap: float = 0.62) -> list[Any]:
        """Axes of given sizes (width, height) side by side [in]; right of them a legend finds room."""
        left, top, made = self.left, self.at, []
        for width, height in sizes:
            made.append(self.axes(left, top, width, height))
            left += width + gap
        self.beside = (left - gap + 0.3, top)
        self.at += FOOT
        return made

    def beside_panel(self, panel: Any, gap: float, side: float) -> Any:
        """Square axes without numbers right of a panel, level with its upper edge [in]."""
        (left, top, width, _) = next(place for ax, place in self._places if ax is panel)
        ax = self.axes(left + width + gap, top, side, side)
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_visible(False)
        return ax

    def text(self, left: float, top: float, text: str, **options: Any) -> None:
        """Text at a place."""
        self.figure.text(left, top, text, transform=self.inches, **options)

    def name(self, ax: Any, text: str, height: float = 0.5, **options: Any) -> None:
        """Text in the left margin, beside a panel at a height in it (0 to 1)."""
        away: dict[str, Any] = {"xytext": (72.0 * (0.08 - self.left), 0.0), "textcoords": "offset points"}
        ax.annotate(text, (0.0, height), xycoords="axes fraction", va="center", **away, **options)

    def legend(
        self, entries: Sequence[Mapping[str, Any]], columns: int = 3, at: tuple[float, float] | None = None, **look: Any
    ) -> None:
        """A legend below what is there already, or with its upper left corner at a place.

        Parameters
        ----------
        entries
            As :func:`vsconstraints.reports.plots.marks.line` and :func:`.patch` make them.
        columns
            In how many columns.
        at
            Left, top [in].
        look
            Settings of matplotlib.
        """
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        handles = [Patch(**entry) if "facecolor" in entry else Line2D([], [], **entry) for entry in entries]
        self.figure.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=at or (self.left, self.at),
            bbox_transform=self.inches,
            ncols=columns,
            **{"columnspacing": 1.5, "labelspacing": 0.5, **look},
        )
        if at is None:
            self.at += 0.18 * -(-len(entries) // columns) + 0.06

    def side_legend(self, entries: Sequence[Mapping[str, Any]]) -> None:
        """A legend right of the views."""
        self.legend(entries, 1, self.beside, labelspacing=0.75)

    def placed(self) -> Any:
        """The figure of matplotlib, with its size and everything where it belongs."""
        self.figure.set_size_inches(WIDTH, self.at)
        self._place()
        for axis in (axis for ax in self.figure.axes for axis in (ax.xaxis, ax.yaxis)):
            if not axis.get_label_text():
                axis.set_label_coords(0.0, 0.0)  # else room is sought for it, beside all numbers
        self.canvas.draw()
        if (cut := self._cut()) > 0.0:
            self._place(cut)
            self.canvas.draw()
        return self.figure

    def save(self, *paths: Path) -> None:
        """Write files, each whole or not at all; their suffixes are of :data:`FORMATS`."""
        self.placed()
        for path in paths:
            kind = path.suffix.removeprefix(".")
            with replaced(path) as part:
                if kind in VECTOR:
                    self.figure.savefig(part, format=kind, metadata=VECTOR[kind])
                else:
                    self._save_pixels(part)

    def _place(self, margin: float = 0.0) -> None:
        """Put axes where they belong, all so much narrower that there is a margin at the left [in]."""
        narrower = 1.0 - margin / WIDTH
        for ax, (left, top, width, height) in self._places:
            bottom = self.at - top - height
            place = (margin + narrower * left) / WIDTH, bottom / self.at, narrower * width / WIDTH, height / self.at
            ax.set_position(place)

    def _cut(self) -> float:
        """The margin that shows labels of vertical axes whose numbers are longer than expected [in]."""
        labelled = [ax for ax in self.figure.axes if ax.get_ylabel() and ax.axison]
        found = (
            (EDGE - float(ax.yaxis.label.get_window_extent().x0) / DPI) / (1.0 - float(ax.get_position().x0))
            for ax in labelled
        )
        return max(found, default=0.0)

    def _save_pixels(self, path: Path) -> None:
        """What is drawn already, as a PNG without transparency."""
        from PIL import Image

        pixels = np.asarray(self.canvas.buffer_rgba())[..., :3]
        Image.fromarray(pixels).save(path, format="PNG", dpi=(DPI, DPI))


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
        files = dict.fromkeys((path, *(path.with_suffix(f".{one}") for one in formats)))
        with self._style():
            sheet = self.draw(*needed)
            if sheet is not None:
                sheet.save(*files)
        return sheet is not None

    def drawn(self, *needed: object) -> Any:
        """Draw it, and return the figure of matplotlib; None if there was nothing to show. As :meth:`write` else."""
        with self._style():
            sheet = self.draw(*needed)
            if sheet is None:
                return None
            figure = sheet.placed()
            # notebooks show it, whatever they know of matplotlib
            figure._repr_png_ = partial(notebook_png, figure)
            return figure

    @contextmanager
    def _style(self) -> Iterator[None]:
        from matplotlib import rc_context

        with rc_context({**STYLE, **(FORMULAS if self.formulas else {})}), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield


def notebook_png(figure: Any) -> tuple[bytes, dict[str, int]]:
    """A figure of matplotlib as PNG, and its size in pixels of the screen: it has more, so that it is sharp."""
    file = BytesIO()
    figure.savefig(file, format="png")
    width, height = (float(side) for side in figure.get_size_inches())
    return file.getvalue(), {"width": round(SCREEN_DPI * width), "height": round(SCREEN_DPI * height)}
