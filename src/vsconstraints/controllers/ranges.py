"""Options of laws: default, meaning, search range and limits, and their checks."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import Field, dataclass, field
from numbers import Integral, Real
from typing import Any, ClassVar, NoReturn, TypeVar

import numpy as np

from ..errors import ConfigurationError, InvalidInput, format_value, unknown_name
from ..rows.factors import FACTORS

Known = TypeVar("Known")


def _finite(value: object) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)


def positive(value: object) -> float | None:
    """Return the value as a float if it is a positive, finite number, else None."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if 0.0 < number < np.inf else None


def rank_tolerance(value: object) -> float:
    """Return the tolerance if it is between 0 and 1; raise InvalidInput otherwise."""
    number = positive(value)
    if number is None or number >= 1.0:
        raise InvalidInput(f"rank_tolerance must be between 0 and 1, not {format_value(value)}")
    return number


def share_number(name: str, value: object) -> float:
    """Return the value as a float; raise InvalidInput unless it is from 0 to less than 1."""
    number = 0.0 if value == 0.0 and value is not False else positive(value)
    if number is None or number >= 1.0:
        raise InvalidInput(f"{name} must be at least 0 and less than 1, not {format_value(value)}")
    return number


def positive_number(name: str, value: object) -> float:
    """Return the value as a float; raise ConfigurationError unless positive and finite."""
    number = positive(value)
    if number is None:
        raise ConfigurationError(
            f"{name} must be a positive, finite number, not {format_value(value)}"
        )
    return number


def duration(name: str, value: object) -> float:
    """Return the value as a float; raise ConfigurationError unless it is a duration.

    A duration is a number of seconds, 0 or more.
    """
    number = 0.0 if value == 0.0 and value is not False else positive(value)
    if number is None:
        raise ConfigurationError(
            f"{name} must be a number of seconds, 0 or more, not {format_value(value)}"
        )
    return number


def one_of(what: str, name: object, known: Mapping[str, Known]) -> Known:
    """Return the entry of that name; raise ConfigurationError, with the candidates, if unknown."""
    if not (isinstance(name, str) and name in known):
        raise unknown_name(what, name, known)
    return known[name]


class Fixed(dict[str, float]):
    """Dict that cannot be changed; unlike a :class:`types.MappingProxyType` it can be pickled."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        """Raise TypeError."""
        raise TypeError(
            "the options of a controller cannot be changed in parts: make one with others"
        )

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return Fixed, (dict(self),)


@dataclass(frozen=True)
class Range:
    """Search range from ``least`` to ``greatest``, both included.

    ``integer`` restricts it to integers. On a ``logarithmic`` range factors count instead of
    differences, and ``least`` is positive. Raises ConfigurationError if the range is empty or an
    end is invalid.
    """

    least: float
    greatest: float
    logarithmic: bool = True
    integer: bool = False

    def __post_init__(self) -> None:
        ends = (*self,)
        if not (all(map(_finite, ends)) and self.least < self.greatest):
            raise ConfigurationError(
                f"a range goes from a number to a greater one, not {format_value(ends)}"
            )
        if self.logarithmic and self.least <= 0.0:
            raise ConfigurationError(f"a logarithmic range is above zero, not {format_value(ends)}")
        if self.integer and not all(isinstance(end, Integral) for end in ends):
            raise ConfigurationError(
                f"a range of integers ends with integers, not {format_value(ends)}"
            )

    def __iter__(self) -> Iterator[float]:
        yield from (self.least, self.greatest)

    def __contains__(self, value: object) -> bool:
        number = not isinstance(value, bool) and isinstance(
            value, Integral if self.integer else Real
        )
        return number and self.least <= float(value) <= self.greatest  # type: ignore[arg-type]

    def __str__(self) -> str:
        return f"{self.least:g}–{self.greatest:g}"


@dataclass(frozen=True)
class Choices:
    """One of several values: words, flags, numbers, or None for an option that may be omitted."""

    values: tuple[Any, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.values, tuple) or len(set(map(repr, self.values))) < 2:
            raise ConfigurationError(
                f"choices are a tuple of two values or more, not {format_value(self.values)}"
            )

    def __iter__(self) -> Iterator[Any]:
        yield from self.values

    def __contains__(self, value: object) -> bool:
        return value in self.values

    def __str__(self) -> str:
        return " or ".join("none" if value is None else str(value).lower() for value in self.values)


#: Ranges of row options: :class:`.RowFactors`, and the margin as a share of the scale.
ROWS = {
    "K": Range(0.3, 10.0),
    "switching_gain": Range(0.1, 10.0),
    "speed_gain": Range(0.1, 10.0),
    "margin": Range(0.0, 0.2, logarithmic=False),
}
GAINS: tuple[str, ...] = "switching_gain", "speed_gain"

#: Declaration of a search range; a pair of numbers is a logarithmic :class:`Range`.
Declared = Range | Choices | tuple[float, float]


def option(
    default: Any,
    meaning: str,
    search: Declared | None = None,
    at_least: float = 0.0,
    below: float = math.inf,
) -> Any:
    """Create an option of a demand or resolver.

    It is a dataclass field with its meaning, search range and hard limits.
    """
    search = Range(*search) if isinstance(search, tuple) else search
    return field(
        default=default,
        metadata={"meaning": meaning, "range": search, "at_least": at_least, "below": below},
    )


class Part:
    """Law, demand or resolver; the fields of a dataclass are its options (:func:`option`)."""

    #: Search ranges of options, see :func:`vsconstraints.controllers.law_ranges`.
    ranges: ClassVar[Mapping[str, Declared]] = {}
    #: Common options, factors on rows and those of the observer, that change no command; they are
    #: not searched.
    ignores: tuple[str, ...] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = {
            key: each.metadata.get("range")
            for key, each in vars(cls).items()
            if isinstance(each, Field)
        }
        inherited = super(cls, cls).ranges  # type: ignore[misc]
        ranges = {**inherited, **own, **vars(cls).get("ranges", {})}
        cls.ranges = {
            key: search
            for key, search in ranges.items()
            if search is not None and key not in cls.ignores
        }


def ranges_of(law: object, name: str, fixed: Mapping[str, Any]) -> dict[str, Range | Choices]:
    """Return the search ranges declared by a law's class, its demand and its resolver.

    Ranges of the parts count if the constructor of the law has the option. ``name`` is the name of
    the law in messages, and options that the user has ``fixed`` are not searched. Raises
    ConfigurationError if a declaration is no range, belongs to no option, or does not contain the
    default of the option.
    """
    parameters = inspect.signature(type(law)).parameters
    anything = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    declared: dict[str, Declared] = {}
    for part in ("demand", "resolver"):
        # the constructor of a custom law may lack options of its parts
        searched = getattr(getattr(law, part, None), "ranges", {})
        declared |= {
            key: each
            for key, each in searched.items()
            if anything or key in (*parameters, *FACTORS)
        }
    declared |= getattr(type(law), "ranges", {})
    ranges = {}
    for key, each in declared.items():
        default = default_of(law, key)
        if key in fixed or isinstance(default, Mapping):
            continue
        where = f"{name} declares a range of {key!r}"
        if not anything and key not in (*parameters, *FACTORS):
            raise ConfigurationError(f"{where}, which is not one of its options")
        try:
            search = Range(*each) if isinstance(each, tuple) and len(each) == 2 else each
        except ConfigurationError as error:
            raise ConfigurationError(f"{where}: {error}") from error
        if not isinstance(search, Range | Choices):
            raise ConfigurationError(
                f"{where}: it must be a Range, Choices, or a pair of numbers, not "
                f"{format_value(search)}"
            )
        if default not in search:
            raise ConfigurationError(
                f"{where} that does not hold its default {format_value(default)}: {search}"
            )
        ranges[key] = search
    return ranges


def default_of(law: object, option: str) -> Any:
    """Return the value of an option of a law as constructed.

    None if neither the law nor its constructor has one.
    """
    parameter = inspect.signature(type(law)).parameters.get(option)
    if option in FACTORS and parameter is None:
        return getattr(law.factors, option) or 1.0  # type: ignore[attr-defined]
    default = (
        None if parameter is None or parameter.default is parameter.empty else parameter.default
    )
    return getattr(law, option, default)
