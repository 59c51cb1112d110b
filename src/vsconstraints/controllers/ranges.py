"""Options of laws: default, meaning, range of search and limits, stated once; how they are
checked.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import Field, dataclass, field
from numbers import Integral, Real
from typing import Any, ClassVar, NoReturn, TypeVar

import numpy as np

from ..errors import ConfigurationError, InvalidInput, shown, unknown_name
from ..rows.factors import FACTORS

Known = TypeVar("Known")


def _finite(value: object) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and math.isfinite(value)


def positive(value: object) -> float | None:
    """The value if it is a positive, finite number, and None if it is not."""
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
        raise InvalidInput(f"rank_tolerance must be between 0 and 1, not {shown(value)}")
    return number


def share(name: str, value: object) -> float:
    """Return the value as a float; raise InvalidInput unless it is from 0 to less than 1."""
    number = 0.0 if value == 0.0 and value is not False else positive(value)
    if number is None or number >= 1.0:
        raise InvalidInput(f"{name} must be at least 0 and less than 1, not {shown(value)}")
    return number


def positive_number(name: str, value: object) -> float:
    """Return the value as a float; raise ConfigurationError unless it is a positive, finite
    number.
    """
    number = positive(value)
    if number is None:
        raise ConfigurationError(f"{name} must be a positive, finite number, not {shown(value)}")
    return number


def duration(name: str, value: object) -> float:
    """Return the value as a float; raise ConfigurationError unless it is a number of seconds, 0 or
    more.
    """
    number = 0.0 if value == 0.0 and value is not False else positive(value)
    if number is None:
        raise ConfigurationError(
            f"{name} must be a number of seconds, 0 or more, not {shown(value)}"
        )
    return number


def one_of(what: str, name: object, known: Mapping[str, Known]) -> Known:
    """What is known by that name; raises ConfigurationError that names the candidates."""
    if not (isinstance(name, str) and name in known):
        raise unknown_name(what, name, known)
    return known[name]


class Fixed(dict[str, float]):
    """A dict that cannot be changed; unlike a :class:`types.MappingProxyType` it can be pickled."""

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
    """Numbers from ``least`` to ``greatest``, both included, integers only or all;
    ConfigurationError if it is empty.

    Where it is ``logarithmic`` factors count, not differences; then ``least`` is positive.
    """

    least: float
    greatest: float
    logarithmic: bool = True
    integer: bool = False

    def __post_init__(self) -> None:
        ends = (*self,)
        if not (all(map(_finite, ends)) and self.least < self.greatest):
            raise ConfigurationError(
                f"a range goes from a number to a greater one, not {shown(ends)}"
            )
        if self.logarithmic and self.least <= 0.0:
            raise ConfigurationError(f"a logarithmic range is above zero, not {shown(ends)}")
        if self.integer and not all(isinstance(end, Integral) for end in ends):
            raise ConfigurationError(f"a range of integers ends with integers, not {shown(ends)}")

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
    """One of several values: words, flags, numbers, or None where an option need not be given."""

    values: tuple[Any, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.values, tuple) or len(set(map(repr, self.values))) < 2:
            raise ConfigurationError(
                f"choices are a tuple of two values or more, not {shown(self.values)}"
            )

    def __iter__(self) -> Iterator[Any]:
        yield from self.values

    def __contains__(self, value: object) -> bool:
        return value in self.values

    def __str__(self) -> str:
        return " or ".join("none" if value is None else str(value).lower() for value in self.values)


#: Of what laws may set of their rows: :class:`.RowFactors`, and a share of the scale.
ROWS = {
    "K": Range(0.3, 10.0),
    "switching_gain": Range(0.1, 10.0),
    "speed_gain": Range(0.1, 10.0),
    "margin": Range(0.0, 0.2, logarithmic=False),
}
GAINS: tuple[str, ...] = "switching_gain", "speed_gain"

#: What classes declare; a pair of numbers is a logarithmic :class:`Range`.
Declared = Range | Choices | tuple[float, float]


def option(
    default: Any,
    meaning: str,
    search: Declared | None = None,
    at_least: float = 0.0,
    below: float = math.inf,
) -> Any:
    """An option of a demand or resolver: a dataclass field with its meaning, range of search and
    hard limits.
    """
    search = Range(*search) if isinstance(search, tuple) else search
    return field(
        default=default,
        metadata={"meaning": meaning, "range": search, "at_least": at_least, "below": below},
    )


class Part:
    """A law, demand or resolver: where it is a dataclass, its fields are options
    (:func:`option`).
    """

    #: From where to where options are worth searching; see
    #: :func:`vsconstraints.controllers.law_ranges`.
    ranges: ClassVar[Mapping[str, Declared]] = {}
    #: Which options of every law, factors on rows and those of the observer, change no command;
    #: none is searched.
    ignores: tuple[str, ...] = ()

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = {
            key: each.metadata.get("range")
            for key, each in vars(cls).items()
            if isinstance(each, Field)
        }
        ranges = {**super(cls, cls).ranges, **own, **vars(cls).get("ranges", {})}  # type: ignore[misc]
        cls.ranges = {
            key: search
            for key, search in ranges.items()
            if search is not None and key not in cls.ignores
        }


def ranges_of(law: object, name: str, fixed: Mapping[str, Any]) -> dict[str, Range | Choices]:
    """The ranges that a law's class declares, and those of its demand and resolver as far as its
    constructor has them.

    ``name`` is what messages call the law; options that the user has ``fixed`` are not searched.
    ConfigurationError if what is declared is no range, of no option, or does not contain the
    option's default.
    """
    parameters = inspect.signature(type(law)).parameters
    anything = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    declared: dict[str, Declared] = {}
    for part in ("demand", "resolver"):
        # the constructor of a user's law need not have the options of its parts
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
            raise ConfigurationError(f"{where}, which is none of its options")
        try:
            search = Range(*each) if isinstance(each, tuple) and len(each) == 2 else each
        except ConfigurationError as error:
            raise ConfigurationError(f"{where}: {error}") from error
        if not isinstance(search, Range | Choices):
            raise ConfigurationError(
                f"{where}: it must be a Range, Choices, or a pair of numbers, not {shown(search)}"
            )
        if default not in search:
            raise ConfigurationError(
                f"{where} that does not hold its default {shown(default)}: {search}"
            )
        ranges[key] = search
    return ranges


def default_of(law: object, option: str) -> Any:
    """The value of an option of a law as constructed; None where neither the law nor its
    constructor has one.
    """
    parameter = inspect.signature(type(law)).parameters.get(option)
    if option in FACTORS and parameter is None:
        return getattr(law.factors, option) or 1.0  # type: ignore[attr-defined]
    default = (
        None if parameter is None or parameter.default is parameter.empty else parameter.default
    )
    return getattr(law, option, default)
