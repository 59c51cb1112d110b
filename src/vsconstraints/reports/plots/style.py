"""How figures look: type and lines, and one colour, marker and line style for each law wherever it appears."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any
from zlib import crc32

INK, FAINT = "#222222", "#444444"
STYLE_SHEET = Path(__file__).with_name("figures.mplstyle")
#: Settings of figures whose texts hold formulas, none of which comes from a user.
FORMULAS: dict[str, Any] = {"text.parse_math": True, "mathtext.fontset": "dejavusans"}

_TABLE = tomllib.loads(Path(__file__).with_name("looks.toml").read_text(encoding="utf-8"))
COLOURS: dict[str, str] = _TABLE["colours"]
#: Preferred by laws of other names: none of the default comparison has them.
FREE_COLOURS = [COLOURS[name] for name in ("brown", "teal", "wine", "purple", "vermillion")]

LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p", "h", "*")
TUNED = "-tuned"  # how the name of a tuned law ends, after that of the law it was tuned from


@dataclass(frozen=True)
class Look:
    """Colour, marker and line style of a controller."""

    colour: str
    marker: str
    line: str = "-"


LOOKS = {
    law: Look(COLOURS[colour], marker, line)
    for law, (colour, marker, line) in ((law, look.split()) for law, look in _TABLE["laws"].items())
}


def looks(controllers: Sequence[str]) -> dict[str, Look]:
    """A look for each controller, which depends on its name alone as far as possible.

    Names in ``looks.toml`` look the same in every figure. Any other name has a preferred colour and marker, and others
    only where one of ``controllers`` has these. A tuned law has the colour of the law it was tuned from, dashed.
    """
    result = {name: LOOKS[name] for name in controllers if name in LOOKS}
    for name in sorted(dict.fromkeys(controllers), key=lambda name: name.endswith(TUNED)):
        if name in result:
            continue
        original, taken = name.removesuffix(TUNED), [*result.values()]
        look = result.get(original) or LOOKS.get(original) or _free_look(original, taken)
        if original != name:
            look = Look(look.colour, _free_marker(MARKERS.index(look.marker) + 1, taken), LINES[1])
        result[name] = look
    return {name: result[name] for name in controllers}


def _free_look(name: str, taken: Sequence[Look]) -> Look:
    """The preferred look of a name, as far as no other law has it."""
    number, colours, pairs = crc32(name.encode()), {look.colour for look in taken}, {(x.line, x.colour) for x in taken}
    k = number % len(FREE_COLOURS)
    ordered = dict.fromkeys([*FREE_COLOURS[k:], *FREE_COLOURS[:k], *list(COLOURS.values())[1:]])
    preferred = list(product(LINES, ordered))
    unused = [pair for pair in preferred if pair not in pairs] or preferred
    line, colour = next((pair for pair in unused if pair[1] not in colours), unused[0])
    return Look(colour, _free_marker(number, taken), line)


def _free_marker(start: int, taken: Sequence[Look]) -> str:
    """The first marker from ``start`` on that no other law has; that one if all are taken."""
    k, used = start % len(MARKERS), {look.marker for look in taken}
    ordered = MARKERS[k:] + MARKERS[:k]
    return next((marker for marker in ordered if marker not in used), ordered[0])


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
