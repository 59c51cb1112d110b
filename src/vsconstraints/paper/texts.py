"""Sentences as data: Jinja templates with numbers filled in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import Any

from jinja2 import Environment, StrictUndefined

from ..reports.numbers import number, percent
from ..rows.readable import amount, counted


def shown_intervals(intervals: Sequence[tuple[float, float]]) -> str:
    """``2.96–4.90 s and 8.02–9.14 s``; ``never``."""
    return " and ".join(f"{first:.2f}–{last:.2f} s" for first, last in intervals) or "never"


ENVIRONMENT = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
#: Of templates: a value, or a multiple of it, in a format of Python; amounts and numbers as reports print them, shares
#: as per cent, intervals, samples.
ENVIRONMENT.filters |= {
    "fmt": lambda value, spec, factor=1: format(factor * value, spec),
    "amount": amount,
    "number": number,
    "percent": percent,
    "intervals": shown_intervals,
    "samples": lambda samples: counted(samples, "sample"),
}
ENVIRONMENT.tests["finite"] = math.isfinite
template = cache(ENVIRONMENT.from_string)
expression = cache(partial(ENVIRONMENT.compile_expression, undefined_to_none=False))


def filled(text: str, **values: Any) -> str:
    """A template with values filled in."""
    return template(text).render(values)


def calculated(formula: str, known: Mapping[str, Any]) -> Any:
    """The value of an expression of a template, from values by name."""
    return expression(formula)(known)
