"""How figures look: type, lines, and one colour, marker and line style for each law wherever it appears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any
from zlib import crc32

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

GREY, BLUE, ORANGE, VERMILLION, GREEN, PURPLE, SKY, BLACK, OLIVE, BROWN, TEAL, WINE = COLOURS = (
    "#8A8A8A",
    "#0072B2",
    "#E69F00",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#000000",
    "#9C8A00",
    "#7B4B2A",
    "#44AA99",
    "#882255",
)
"""Okabe and Ito's palette, safe for colour-blind readers, and four more."""

FREE_COLOURS = (BROWN, TEAL, WINE, PURPLE, VERMILLION)
"""Preferred by laws of other names: none of the default comparison has them."""

LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*")


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of a controller."""

    colour: str
    marker: str
    line: str = "-"


LOOKS = {
    "tracking": Look(GREY, "o"),
    "sliding-mode": Look(BLUE, "s"),
    "potential-field": Look(ORANGE, "^"),
    "potential-field-priority": Look(VERMILLION, "v"),
    "hierarchical-qp": Look(GREEN, "D"),
    "hierarchical-qp-active": Look(PURPLE, "<"),
    "implicit-switch": Look(SKY, "P"),
    "cbf-filter": Look(BLACK, "X"),
    "predictive": Look(OLIVE, "p"),
    "super-twisting": Look(BROWN, ">"),
    "goal-governor": Look(TEAL, "h"),
    "boundary-layer": Look(WINE, "*"),
    "implicit-switch-with-drift": Look(SKY, "*", "--"),
    "implicit-super-twisting": Look(BROWN, "<", "--"),
    "cbf-filter-task": Look(BLACK, "o", "--"),
    "outer-layer": Look(WINE, "v", "--"),
    "firas": Look(ORANGE, "v", "--"),
    "high-order-barrier": Look(GREEN, "o", "--"),
    "sampled-barrier": Look(SKY, "o", "-."),
    "robust-barrier": Look(OLIVE, "o", "--"),
    "reciprocal-barrier": Look(VERMILLION, "o", "--"),
    "finite-time-barrier": Look(PURPLE, "o", "--"),
    "input-to-state-safe-barrier": Look(TEAL, "o", "--"),
    "gradient-robust-barrier": Look(BLUE, "o", "--"),
    "saturation": Look(BLUE, "X", "-."),
    "saturation-unscaled": Look(ORANGE, "X", "-."),
    "scaling": Look(PURPLE, "X", "-."),
    "projection": Look(GREEN, "X", "-."),
}
"""Those of the laws of the comparisons that come with the package."""

TUNED = "-tuned"
"""How the name of a tuned law ends, after that of the law it was tuned from."""


def looks(controllers: Sequence[str]) -> dict[str, Look]:
    """A look for each controller, which depends on its name alone as far as possible.

    Names in :data:`LOOKS` look the same in every figure. Any other name has a preferred colour and marker of its own,
    and another colour only where one of ``controllers`` has the preferred one. A tuned law has the colour of the law it
    was tuned from, and another line style and marker.
    """
    result = {name: LOOKS[name] for name in controllers if name in LOOKS}
    for name in dict.fromkeys(controllers):
        if name not in result and not name.endswith(TUNED):
            result[name] = _free(name, [*result.values()])
    for name in dict.fromkeys(controllers):
        if name not in result:
            original = name.removesuffix(TUNED)
            look = result.get(original) or LOOKS.get(original) or _free(original, [*result.values()])
            marker = _first(MARKERS, MARKERS.index(look.marker) + 1, {one.marker for one in result.values()})
            result[name] = Look(look.colour, marker, LINES[1])
    return {name: result[name] for name in controllers}


def _free(name: str, taken: Sequence[Look]) -> Look:
    """The preferred look of a name, as far as no other law has it."""
    number = crc32(name.encode())
    colours, pairs = {look.colour for look in taken}, {(look.colour, look.line) for look in taken}
    k = number % len(FREE_COLOURS)
    own = FREE_COLOURS[k:] + FREE_COLOURS[:k]
    every = (*own, *(colour for colour in COLOURS[1:] if colour not in own))
    preferred = [(colour, style) for style, colour in product(LINES, every)]
    unused = [pair for pair in preferred if pair not in pairs]
    colour, style = next((pair for pair in unused if pair[0] not in colours), (unused or preferred)[0])
    return Look(colour, _first(MARKERS, number, {look.marker for look in taken}), style)


def _first(choices: Sequence[str], start: int, taken: set[str]) -> str:
    """The first choice from ``start`` on, around the end, that is not taken; the first one if all are."""
    around = [choices[(start + k) % len(choices)] for k in range(len(choices))]
    return next((choice for choice in around if choice not in taken), around[0])


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, up to 255, of ``#RRGGBB``."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def darker(colour: str, share: float = 0.8) -> str:
    """A shade of a colour ``#RRGGBB``, dark enough for text on white."""
    return "#" + "".join(f"{int(share * part):02X}" for part in rgb(colour))


def paler(colour: str, white: float = 0.45) -> str:
    """A colour ``#RRGGBB`` mixed with white."""
    return "#" + "".join(f"{int((1.0 - white) * part + white * 255):02X}" for part in rgb(colour))


def shortened(name: str, most: int = 25) -> str:
    """A name that fits into a title or legend: a long one loses its middle."""
    half = (most - 1) // 2
    return name if len(name) <= most else f"{name[:half]}…{name[-half:]}"
