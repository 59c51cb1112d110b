"""From where to where the options of laws are worth searching, as classes declare it."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError, shown

if TYPE_CHECKING:
    from .base import Controller


@dataclass(frozen=True)
class Range:
    """Numbers from ``least`` to ``greatest``, both included.

    Attributes
    ----------
    least, greatest
        Its ends.
    logarithmic
        Whether factors count, not differences; then ``least`` is positive.
    integer
        Whether it holds integers alone.

    Raises
    ------
    ConfigurationError
        if that is no range.
    """

    least: float
    greatest: float
    logarithmic: bool = True
    integer: bool = False

    def __post_init__(self) -> None:
        if not (_number(self.least) and _number(self.greatest) and self.least < self.greatest):
            raise ConfigurationError(f"a range goes from a number to a greater one, not {shown((*self,))}")
        if self.logarithmic and self.least <= 0.0:
            raise ConfigurationError(f"a logarithmic range is above zero, not {shown((*self,))}")
        if self.integer and not all(isinstance(end, Integral) for end in self):
            raise ConfigurationError(f"a range of integers ends with integers, not {shown((*self,))}")

    def __iter__(self) -> Iterator[float]:
        """Its ends."""
        yield from (self.least, self.greatest)

    def __contains__(self, value: object) -> bool:
        kind = Integral if self.integer else Real
        number = not isinstance(value, bool) and isinstance(value, kind)
        return number and self.least <= float(value) <= self.greatest  # type: ignore[arg-type]

    def __str__(self) -> str:
        return f"{self.least:g}–{self.greatest:g}"


@dataclass(frozen=True)
class Choices:
    """One of several values: words, flags, numbers, or None where an option need not be given."""

    values: tuple[Any, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.values, tuple) or len(set(map(repr, self.values))) < 2:
            raise ConfigurationError(f"choices are a tuple of two values or more, not {shown(self.values)}")

    def __iter__(self) -> Iterator[Any]:
        """All values."""
        yield from self.values

    def __contains__(self, value: object) -> bool:
        return value in self.values

    def __str__(self) -> str:
        return " or ".join("none" if value is None else str(value).lower() for value in self.values)


Declared = Range | Choices | tuple[float, float]
"""What classes declare; a pair of numbers is a logarithmic :class:`Range`."""


def ranges_of(law: Controller, name: str, fixed: Mapping[str, Any]) -> dict[str, Range | Choices]:
    """The ranges that a law's class declares, and those of its demand and resolver as far as its constructor has them.

    Parameters
    ----------
    law
        A law as it comes out of its constructor.
    name
        What messages call it.
    fixed
        Options that are not searched, since they were given.

    Raises
    ------
    ConfigurationError
        if what is declared is no range, of no option, or does not hold the option's default.
    """
    parts = [getattr(law, part, None) for part in ("demand", "resolver")]
    parameters = inspect.signature(type(law)).parameters
    anything = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    found: dict[str, Declared] = {}
    for part in parts:
        # a constructor of one's own need not have the options of its parts
        found |= {key: one for key, one in getattr(part, "ranges", {}).items() if anything or key in parameters}
    found |= getattr(type(law), "ranges", {})
    checked = {}
    for option, declared in found.items():
        if option in fixed:
            continue
        where = f"{name} declares a range of {option!r}"
        if not anything and option not in parameters:
            raise ConfigurationError(f"{where}, which is none of its options")
        try:
            pair = isinstance(declared, tuple) and len(declared) == 2
            one = Range(*declared) if pair else declared
        except ConfigurationError as error:
            raise ConfigurationError(f"{where}: {error}") from error
        if not isinstance(one, Range | Choices):
            raise ConfigurationError(f"{where}: it must be a Range, Choices, or a pair of numbers, not {shown(one)}")
        default = default_of(law, option)
        if default not in one:
            raise ConfigurationError(f"{where} that does not hold its default {shown(default)}: {one}")
        checked[option] = one
    return checked


def default_of(law: Controller, option: str) -> Any:
    """The value of an option of a law as it was made; None where neither the law nor its constructor tells."""
    parameter = inspect.signature(type(law)).parameters.get(option)
    told = None if parameter is None or parameter.default is parameter.empty else parameter.default
    return getattr(law, option, told)


def _number(value: object) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)
