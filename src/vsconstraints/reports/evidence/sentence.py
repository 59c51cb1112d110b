"""A sentence of the report, with the numbers in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True)
class Sentence:
    """What the report claims, and what it is computed from.

    Attributes
    ----------
    text
        As it stands in the report.
    about
        What kind of claim it is.
    condition
        In which condition; empty where it is about several.
    laws
        Those it is about, those it names first and in its order.
    numbers
        Every number that the text shows, unrounded, shares as such and not in per cent. Those of a law stand behind its
        name, as in ``success[sliding-mode]``.
    standard
        By which standard rows are violated in it, ``strict`` or ``tolerant``; empty where it is not about violations.
    """

    text: str
    about: str
    condition: str = ""
    laws: tuple[str, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
    standard: str = "strict"

    def as_data(self) -> dict[str, Any]:
        """For files."""
        return asdict(self)
