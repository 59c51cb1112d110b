"""How the report of evidence prints conditions, shares and intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...comparisons.statistics import Rate
from ...rows.readable import counted
from ..markdown import enumeration, plain
from ..numbers import DASH

CONDITIONS = {
    "nominal": "Without disturbances",
    "disturbed": "With disturbances",
    "limited": "Under the arms' own limits",
    "calibrated": "With calibration errors",
    "dynamics": "On arms with mass",
    "images": "By images",
    "images-and-dynamics": "By images and on arms with mass",
}
"""What conditions are called at the beginning of a sentence."""

MAX_NAMES = 4
"""A sentence names no more controllers than this."""


def condition_text(condition: str, inside: bool = False) -> str:
    """The beginning of a sentence on a condition, or the same inside a sentence."""
    text = CONDITIONS.get(condition, f"In the condition {plain(condition)}")
    return text[0].lower() + text[1:] if inside else text


@dataclass(frozen=True)
class Share:
    """A share, or a difference of two, and its interval; printed in per cent.

    Attributes
    ----------
    value, low, high
        From 0 to 1, or from −1 to 1 of a difference.
    """

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, rate: Rate) -> Share:
        """The share of a rate."""
        return cls(rate.share, rate.low, rate.high)

    @property
    def complement(self) -> Share:
        """How often it does not happen."""
        return Share(1.0 - self.value, 1.0 - self.high, 1.0 - self.low)

    @property
    def digits(self) -> int:
        """Decimals: as many as the interval can resolve, and no more."""
        half = 50.0 * (self.high - self.low)
        if not (math.isfinite(half) and half > 0.0):
            return 1
        return min(max(math.ceil(-math.log10(half / 3.0)), 0), 4)

    @property
    def percent(self) -> str:
        """The value without its unit."""
        return percentage(self.value, self.digits)

    @property
    def interval(self) -> str:
        """The interval without a unit."""
        # a dash before or behind a negative number would be read as a sign
        between = " to " if self.low < 0.0 else "–"
        return f"{percentage(self.low, self.digits)}{between}{percentage(self.high, self.digits)}"

    @property
    def cell(self) -> str:
        """``93.0 (91.2–94.6)``, for tables in per cent."""
        return f"{self.percent} ({self.interval})" if math.isfinite(self.value) else DASH

    @property
    def text(self) -> str:
        """``93.0 % (91.2–94.6 %)``."""
        return f"{self.percent} % ({self.interval} %)"

    def numbers(self, name: str, low: str = "low", high: str = "high", law: str = "") -> dict[str, float]:
        """The three numbers by these names, of a controller if one is named."""
        of = f"[{law}]" if law else ""
        return {name + of: self.value, low + of: self.low, high + of: self.high}


def percentage(share: float, digits: int) -> str:
    """A share in per cent; never 0 or 100 where it is not, and without decimals where it is."""
    if not math.isfinite(share):
        return DASH
    if share in (0.0, 1.0):
        return f"{100.0 * share:.0f}"
    while digits < 6 and abs(float(f"{100.0 * share:.{digits}f}")) in (0.0, 100.0):
        digits += 1
    return f"{100.0 * share:.{digits}f}".replace("-", "−")


def scenes_text(scenes: int, families: int) -> str:
    """How many scenes, of how many families."""
    return f"{counted(scenes, 'scene')} of {counted(families, 'family', 'families')}"


def first_names(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """The names that a sentence names, and how many more there are, as text."""
    if len(names) <= MAX_NAMES:
        return list(names), []
    return list(names[: MAX_NAMES - 1]), [f"{len(names) - MAX_NAMES + 1} more"]


def names_text(names: Sequence[str]) -> str:
    """The names, or the first of them and how many more there are."""
    named, more = first_names(names)
    return enumeration([*named, *more])
