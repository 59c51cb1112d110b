"""Figures: their declaration, the sheet on which they are drawn in inches, and their files."""

from __future__ import annotations

import math
import tomllib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..formats import PNG, VECTOR, Formats
from .style import FORMULAS, STYLE_SHEET

WIDTH = 8.0  # width of every figure [in]: at this width the smallest text is 8 pt
DPI = 150
SCREEN_DPI = 100
POINTS = 72.0  #: Points per inch.
#: Least distance from the left edge; space below a row of panels for its numbers and label [in].
EDGE = 0.03
FOOT = 0.45
#: Texts of figures, by the names of figures.
TEXTS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("figures.toml").read_text(encoding="utf-8")
)


class Sheet:
    """Figure of the common width that grows downwards.

    Places are measured in inches from its top left corner. ``left`` and ``right`` are the margins
    of rows, ``bottom`` is the height that is filled so far, and ``beside`` the place for a legend
    right of the last row of views.
    """

    def __init__(self, left: float = 0.75, right: float = 0.15) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.transforms import Affine2D, ScaledTranslation

        self.left = left
        self.right = right
        self.bottom = 0.08
        self.beside = (left, self.bottom)
        self.figure: Any = Figure(dpi=DPI, facecolor="white")
        self.canvas: Any = FigureCanvasAgg(self.figure)
        downwards = Affine2D().scale(1.0, -1.0)
        whole: Any = self.figure.transFigure
        from_top = ScaledTranslation(0.0, 1.0, whole)
        self.inches: Any = downwards + self.figure.dpi_scale_trans + from_top
        self._places: dict[Any, tuple[float, float, float, float]] = {}

    def axes(self, left: float, top: float, width: float, height: float, **options: Any) -> Any:
        """Add axes whose frame is at this place."""
        ax = self.figure.add_axes((0.0, 0.0, 1.0, 1.0), **options)
        self._places[ax] = left, top, width, height
        self.bottom = max(self.bottom, top + height)
        return ax

    def axes_3d(self, left: float, top: float, width: float, height: float) -> Any:
        """Add axes in space, in which objects are drawn in the order of their ``zorder``."""
        return self.axes(left, top, width, height, projection="3d", computed_zorder=False)

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
        """Add a grid of panels that share their horizontal axis, row by row.

        ``height`` is the height of each panel or of each row. ``width`` is the width of a panel, or
        as much as fits if 0. ``gap`` separates columns, and ``above`` is the space for titles above
        each row [in]. ``labels`` are those of the horizontal axis, below, and of the vertical one,
        at the left. With ``same_y`` only panels at the left have vertical numbers.
        """
        columns = max(min(columns, count), 1)
        room = WIDTH - self.left - self.right - gap * (columns - 1)
        width = width or room / columns
        panels: list[Any] = []
        top = 0.0
        row_height = 0.0
        for i in range(count):
            row, column = divmod(i, columns)
            is_first = column == 0
            is_lowest = i + columns >= count
            if is_first:
                top = self.bottom + above
                row_height = height if isinstance(height, float) else height[row]
            left = self.left + column * (width + gap)
            ax = self.axes(left, top, width, row_height)
            ax.tick_params(labelbottom=is_lowest, labelleft=is_first or not same_y)
            ax.set_xlabel(labels[0] if is_lowest else "", labelpad=2)
            ax.set_ylabel(labels[1] if is_first else "", labelpad=2)
            panels.append(ax)
        if panels:
            self.bottom += FOOT
        return panels

    def views(self, *sizes: tuple[float, float], gap: float = 0.62) -> list[Any]:
        """Add axes of given sizes (width, height) side by side [in].

        A legend can be placed right of them.
        """
        left = self.left
        top = self.bottom
        views = []
        for width, height in sizes:
            views.append(self.axes(left, top, width, height))
            left += width + gap
        self.beside = (left - gap + 0.3, top)
        self.bottom += FOOT
        return views

    def beside_panel(self, panel: Any, gap: float, side: float) -> Any:
        """Add square axes without numbers right of a panel, aligned with its upper edge [in]."""
        left, top, width, _ = self._places[panel]
        ax = self.axes(left + width + gap, top, side, side)
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_visible(False)
        return ax

    def text(self, left: float, top: float, text: str, **options: Any) -> Any:
        """Write text at a place [in], and return it."""
        return self.figure.text(left, top, text, transform=self.inches, **options)

    def name(self, ax: Any, text: str, height: float = 0.5, **options: Any) -> None:
        """Write text in the left margin, beside a panel at a relative height in it (0 to 1)."""
        ax.annotate(
            text,
            (0.0, height),
            xytext=(POINTS * (0.08 - self.left), 0.0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center",
            **options,
        )

    def legend(
        self,
        entries: Sequence[Mapping[str, Any]],
        columns: int = 3,
        place: tuple[float, float] | None = None,
        labelspacing: float = 0.5,
    ) -> None:
        """Add a legend below the present content, or at a place [in].

        Entries are those of :func:`.line`, :func:`.patch` and :func:`.symbol`.
        """
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        handles: list[Any] = []
        has_marked_dashes = False
        for entry in entries:
            if "facecolor" in entry:
                handles.append(Patch(**entry))
                continue
            line = Line2D([], [], **entry)
            handles.append(line)
            if line.is_dashed() and "marker" in entry:
                has_marked_dashes = True
        self.figure.legend(
            handles=handles,
            ncols=columns,
            loc="upper left",
            bbox_to_anchor=place or (self.left, self.bottom),
            bbox_transform=self.inches,
            columnspacing=1.5,
            labelspacing=labelspacing,
            handlelength=4.0 if has_marked_dashes else None,  # a mark hides dashes of a short line
        )
        if place is None:
            self.bottom += 0.18 * math.ceil(len(entries) / columns) + 0.06

    def side_legend(self, entries: Sequence[Mapping[str, Any]]) -> None:
        """Add a legend right of the views."""
        self.legend(entries, 1, self.beside, labelspacing=0.75)

    def placed(self) -> Any:
        """Return the figure of matplotlib with its final size and all parts in place."""
        self.figure.set_size_inches(WIDTH, self.bottom)
        self._place()
        for ax in self.figure.axes:
            for axis in (ax.xaxis, ax.yaxis):
                if not axis.get_label_text():
                    axis.set_label_coords(0.0, 0.0)  # avoids a search for its place
        self.canvas.draw()
        # Labels of vertical axes would be cut off if their numbers are longer than expected.
        margin = 0.0
        for ax in self.figure.axes:
            if ax.get_ylabel() and ax.axison:
                cut = EDGE - float(ax.yaxis.label.get_window_extent().x0) / DPI
                margin = max(margin, cut / (1.0 - ax.get_position().x0))
        if margin > 0.0:
            self._place(margin)
            self.canvas.draw()
        return self.figure

    def _place(self, margin: float = 0.0) -> None:
        """Place all axes, with an additional margin at the left that makes all narrower [in]."""
        scale = 1.0 - margin / WIDTH
        for ax, (left, top, width, height) in self._places.items():
            position = (
                (margin + scale * left) / WIDTH,
                (self.bottom - top - height) / self.bottom,
                scale * width / WIDTH,
                height / self.bottom,
            )
            ax.set_position(position)

    def save(self, *paths: Path) -> None:
        """Write files atomically; their suffixes are in :data:`FORMATS`."""
        from PIL import Image

        from ...comparisons.runs.files import replaced

        self.placed()
        for path in paths:
            kind = path.suffix.removeprefix(".")
            with replaced(path) as part:
                if kind in VECTOR:
                    self.figure.savefig(part, format=kind, metadata=VECTOR[kind])
                else:  # already drawn
                    drawn = np.asarray(self.canvas.buffer_rgba())
                    without_alpha = drawn[..., :3]
                    image = Image.fromarray(without_alpha)
                    image.save(part, format="PNG", dpi=(DPI, DPI))


@dataclass(frozen=True)
class Figure:
    """Declaration of a figure.

    ``name`` is the name of its file, ``title`` a short description, ``caption`` a description of
    its contents. ``draw`` makes the sheet from the data of the figure, or None if the figure would
    be empty. ``needs`` are these data where they differ between figures. ``reading`` explains how
    to read it, once if it is shown several times. With ``formulas`` its texts contain formulas
    between dollar signs, none of which come from a user.
    """

    name: str
    title: str
    caption: str
    draw: Callable[..., Sheet | None]
    needs: tuple[Any, ...] = ()
    reading: str = ""
    formulas: bool = False

    @classmethod
    def named(cls, name: str, draw: Callable[..., Sheet | None]) -> Figure:
        """Return the figure of this name with its texts from ``figures.toml``."""
        return cls(name, draw=draw, **TEXTS[name])

    def file_in(self, formats: Formats = PNG, suffix: str = "") -> str:
        """Return the name of the file that pages show; ``suffix`` follows the figure's name."""
        return f"{self.name}{suffix}.{formats[0]}"

    def write(self, path: Path, *needed: object, formats: Formats = ()) -> bool:
        """Draw the figure into ``path`` and beside it in further formats; files are atomic.

        Return False if the figure would be empty. Any exception is passed on.
        """
        paths = [path, *(path.with_suffix(f".{kind}") for kind in formats)]
        with self._sheet(*needed) as sheet:
            if sheet is None:
                return False
            sheet.save(*dict.fromkeys(paths))
            return True

    def drawn(self, *needed: object) -> Any:
        """Draw the figure and return it as a figure of matplotlib, which notebooks show.

        Return None if the figure would be empty.
        """
        with self._sheet(*needed) as sheet:
            if sheet is None:
                return None
            figure = sheet.placed()
            figure._repr_png_ = partial(_notebook_png, figure)
            return figure

    @contextmanager
    def _sheet(self, *needed: object) -> Iterator[Sheet | None]:
        from matplotlib import rc_context

        with rc_context(FORMULAS if self.formulas else {}, STYLE_SHEET), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield self.draw(*needed)


def _notebook_png(figure: Any) -> tuple[bytes, dict[str, int]]:
    """Return a figure of matplotlib as PNG, and its size in pixels of the screen.

    The image has more pixels than that, so that it is sharp.
    """
    file = BytesIO()
    figure.savefig(file, format="png")
    width, height = figure.get_size_inches()
    pixels = {
        "width": round(SCREEN_DPI * float(width)),
        "height": round(SCREEN_DPI * float(height)),
    }
    return file.getvalue(), pixels
