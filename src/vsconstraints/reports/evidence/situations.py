"""Success of every controller in every situation, a family in a condition: as table, heat map and data."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from ...comparisons.statistics.judged import UNSUCCESSFUL
from ..markdown import Table
from ..page import TEMPLATES, parser
from .dataset import Dataset
from .failures import reason_text, worst_last
from .ranking import Ranking, Share, percentage, ranking

#: Relative luminance above which black is read better than white, the contrast of both being the same there (WCAG).
BRIGHT = 0.179


class Cell(NamedTuple):
    """A controller in a situation: success, how runs ended, and whether it is in ``front``, with others behind it.

    ``worst`` is the number of the scene of its worst run, with its ``status`` and, unless it is a success, the
    ``reason`` in Markdown.
    """

    share: Share
    front: bool
    endings: dict[str, int]
    worst: int
    status: str
    reason: str

    @property
    def percent(self) -> str:
        """Success without decimals."""
        return percentage(self.share.value, 0)

    @property
    def colours(self) -> tuple[str, str]:
        """Of the ground, as readable for colour-blind people as for others, and of the text on it."""
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        rgb = colormaps["cividis"](self.share.value)[:3]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in rgb]
        luminance = sum(w * part for w, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
        return to_hex(rgb), "#000" if luminance > BRIGHT else "#fff"


class Situation(NamedTuple):
    """A family in a condition: how often controllers succeed there, and a cell for each that has runs."""

    family: str
    condition: str
    ranked: Ranking
    cells: dict[str, Cell]


def situations(dataset: Dataset) -> list[Situation]:
    """All situations, in the order of families and conditions."""
    return dataset.once("situations", lambda: _situations(dataset))


def _situations(dataset: Dataset) -> list[Situation]:
    keys = ["family", "condition", "controller"]
    counts = Counter(dataset.runs[[*keys, "ending"]].itertuples(index=False, name=None))
    last = worst_last(dataset.runs).groupby(keys, observed=True).tail(1)
    worst: dict[tuple[str, ...], Any] = {tuple(run[keys]): run for _, run in last.iterrows()}
    found = []
    for family, condition in dataset.situations:
        ranked, cells = ranking(dataset, condition, families=[family]), {}
        for law, share in ranked.shares.items():
            run, front = worst[family, condition, law], law in ranked.front and ranked.next is not None
            ends = {name: counts[family, condition, law, name] for name in ("success", *UNSUCCESSFUL)}
            reason = "" if run["success"] else reason_text(dataset, run)
            cells[law] = Cell(share, front, ends, int(run["scene"]), str(run["status"]), reason)
        if cells:
            found.append(Situation(family, condition, ranked, cells))
    return found


def situation_table(dataset: Dataset) -> Table:
    """Success in per cent with intervals, one line for each situation."""
    laws, each = dataset.laws, situations(dataset)
    lines = [[f"{one.family}, {one.condition}", *(one.ranked.cell(law) for law in laws)] for one in each]
    return Table(["situation", *laws], lines)


def heat_map(dataset: Dataset) -> str:
    """The same as HTML with a colour for each cell, which leads to its worst run; columns are sorted by a click."""
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["markdown"] = lambda text: Markup(parser(html=False).renderInline(text))  # which escapes HTML
    entries = dataset.configuration["controllers"]
    own = {law for law in dataset.laws if ":" in str(entries.get(law, {}).get("type", law))}
    page = environment.get_template("heat-map.html")
    return page.render(situations=situations(dataset), laws=dataset.laws, endings=UNSUCCESSFUL, own=own)


def situation_data(dataset: Dataset) -> list[dict[str, Any]]:
    """For files: a line for each controller in each situation, the share with its interval and counts of endings."""
    return [
        {
            "family": one.family,
            "condition": one.condition,
            "law": law,
            **cell.share.numbers("success"),
            "endings": cell.endings,
            "front": cell.front,
            "worst_scene": cell.worst,
        }
        for one in situations(dataset)
        for law, cell in one.cells.items()
    ]
