"""Sentences as data: templates with numbers filled in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from string import Formatter
from typing import Any

from ..reports.numbers import number, percent
from ..rows.readable import amount, counted


def shown_intervals(intervals: Sequence[tuple[float, float]]) -> str:
    """``2.96–4.90 s and 8.02–9.14 s``; ``never``."""
    return " and ".join(f"{first:.2f}–{last:.2f} s" for first, last in intervals) or "never"


#: Behind ``!`` in a text: amounts and numbers as reports print them, intervals, samples; per cent, milli, micro.
CONVERSIONS: dict[str, Callable[[Any], Any]] = {
    "a": amount,
    "n": number,
    "p": percent,
    "i": shown_intervals,
    "k": lambda samples: counted(samples, "sample"),
    "c": lambda share: 100.0 * share,
    "m": lambda value: 1e3 * value,
    "u": lambda value: 1e6 * value,
}


class _Filled(Formatter):
    def convert_field(self, value: Any, conversion: Any) -> Any:
        return CONVERSIONS[conversion](value) if conversion in CONVERSIONS else super().convert_field(value, conversion)


def filled(template: str, **values: Any) -> str:
    """A text with values filled in as ``str.format`` does, with :data:`CONVERSIONS`."""
    return _Filled().vformat(template, (), values)
