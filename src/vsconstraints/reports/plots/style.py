"""How figures look: type, lines, and the same colour, marker and line for a controller wherever it appears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, cycle, product
from typing import Any

INK = "#222222"
FAINT = "#444444"

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "axes.titley": 1.0,  # else it is sought anew, from all that a panel holds, whenever one is drawn
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.edgecolor": FAINT,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "hatch.linewidth": 0.35,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.borderpad": 0.0,
    "legend.borderaxespad": 0.0,
    "legend.handlelength": 2.0,
    "path.simplify_threshold": 0.2,
    "text.parse_math": False,  # names may contain anything
    "svg.hashsalt": "vsconstraints",  # the same figure, the same bytes
    "pdf.fonttype": 42,  # text that can be searched and edited; journals want it
}
"""Settings of matplotlib."""

FORMULAS: dict[str, Any] = {"text.parse_math": True, "mathtext.fontset": "dejavusans"}
"""Those of figures whose texts hold formulas, none of which comes from a user."""

OWN_COLOURS = {
    "tracking": "#8A8A8A",
    "sliding-mode": "#0072B2",
    "potential-field": "#E69F00",
    "potential-field-priority": "#D55E00",
    "hierarchical-qp": "#009E73",
    "hierarchical-qp-active": "#CC79A7",
    "implicit-switch": "#56B4E9",
    "cbf-filter": "#000000",
    "predictive": "#9C8A00",
}
"""Colours of the laws that are compared most: Okabe and Ito's palette, safe for colour-blind readers."""

SPARE_COLOURS = ("#7B4B2A",)
"""For controllers of other names."""

TUNED = "-tuned"
"""How the name of a tuned law ends, behind that of the law it was tuned from."""

LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*")


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of a controller."""

    colour: str
    marker: str
    line: str


def looks(controllers: Sequence[str]) -> dict[str, Look]:
    """A look for each controller; when colours run out they come again with another line style.

    Parameters
    ----------
    controllers
        Names, in the comparison's order. Names that the package knows keep their colour in every comparison; a tuned
        law has that of the law from which it comes, shown or not.
    """
    taken = [OWN_COLOURS[name] for name in controllers if name in OWN_COLOURS]
    free = [*SPARE_COLOURS, *(colour for colour in OWN_COLOURS.values() if colour not in taken)]
    every = [*SPARE_COLOURS, *OWN_COLOURS.values()]
    spare = chain(product(LINES[:1], free), cycle(product(LINES[1:], every)))
    colours, result = dict(OWN_COLOURS), dict[str, Look]()
    for i, name in enumerate(controllers):
        before = name.removesuffix(TUNED)
        if name != before and before in colours:
            line, colour = LINES[1], colours[before]
        else:
            line, colour = (LINES[0], OWN_COLOURS[name]) if name in OWN_COLOURS else next(spare)
        colours[name] = colour
        result[name] = Look(colour, MARKERS[i % len(MARKERS)], line)
    return result


def darker(colour: str, share: float = 0.8) -> str:
    """A shade of a colour ``#RRGGBB``, dark enough for text on white; an opacity ``AA`` behind it stays."""
    parts = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return "#" + "".join(f"{int(share * part):02X}" for part in parts) + colour[7:]


def shortened(name: str, most: int = 25) -> str:
    """A name that fits into a title or legend: a long one loses its middle."""
    half = (most - 1) // 2
    return name if len(name) <= most else f"{name[:half]}…{name[-half:]}"
