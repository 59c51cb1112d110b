"""Distributions that stand in a family's file where a number, or a list of numbers, stands in a scenario's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ...errors import ConfigurationError, shown
from ...rows import Array

MAX_NUMBER = 1e300
"""Numbers beyond cannot be drawn with."""

Random = np.random.Generator


class Distribution(Protocol):
    """What a value is drawn from."""

    def draw(self, random: Random) -> Any:
        """A value of Python's own, as files hold it."""


@dataclass(frozen=True)
class Rule:
    """A distribution of two numbers, or of two arrays of one shape after broadcasting, drawn number by number.

    Attributes
    ----------
    words
        What the two numbers are, for messages.
    needs, holds
        What they must satisfy, in words and as a test of the two arrays.
    sample
        Draws an array.
    """

    words: str
    needs: str
    holds: Callable[[Array, Array], Any]
    sample: Callable[[Random, Array, Array], Any]


def _log_uniform(random: Random, least: Array, greatest: Array) -> Array:
    # rounding of exp and log must not leave the range
    drawn: Array = np.clip(np.exp(random.uniform(np.log(least), np.log(greatest))), least, greatest)
    return drawn


def _integers(least: Array, greatest: Array) -> Any:
    numbers = np.stack((least, greatest))
    return (numbers == np.round(numbers)).all(axis=0) & (np.abs(numbers) < 2**53).all(axis=0) & (least <= greatest)


RULES: Mapping[str, Rule] = {
    "uniform": Rule(
        "least, greatest", "least ≤ greatest", lambda a, b: a <= b, lambda random, a, b: random.uniform(a, b)
    ),
    "log-uniform": Rule("least, greatest", "0 < least ≤ greatest", lambda a, b: (a > 0.0) & (a <= b), _log_uniform),
    # not "normal", since half-spaces have normals
    "gaussian": Rule(
        "mean, standard deviation",
        "a standard deviation ≥ 0",
        lambda a, b: b >= 0.0,
        lambda random, a, b: random.normal(a, b),
    ),
    "integer": Rule(
        "least, greatest",
        "integers, least ≤ greatest",
        _integers,
        lambda random, a, b: random.integers(a.astype(np.int64), b.astype(np.int64), endpoint=True),
    ),
}
"""Distributions of two numbers, by the key of their tables: ``{ uniform = [least, greatest] }``."""


@dataclass(frozen=True)
class TwoNumbers:
    """A distribution by its key in :data:`RULES`, with its two numbers or arrays."""

    name: str
    first: Array
    second: Array

    def draw(self, random: Random) -> Any:
        """A number, or a list of numbers."""
        return np.asarray(RULES[self.name].sample(random, self.first, self.second)).tolist()


@dataclass(frozen=True)
class Choice:
    """One of several values, of any kind, each as likely."""

    values: list[Any]

    def draw(self, random: Random) -> Any:
        """One of them."""
        return self.values[int(random.integers(len(self.values)))]


DISTRIBUTIONS = (*RULES, "choice")
"""The keys of the tables that state a distribution."""


def distribution(name: str, value: object, where: str) -> Distribution:
    """The distribution that a table ``{ name = value }`` states.

    Raises
    ------
    ConfigurationError
        that names ``where`` if nothing can be drawn from it.
    """
    if name == "choice":
        if not isinstance(value, list) or not value:
            raise ConfigurationError(f"{where}: choice must be a list of one or more values, not {shown(value)}")
        return Choice(value)
    rule, where = RULES[name], f"{where}: {name}"
    try:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError
        first, second = np.broadcast_arrays(*(np.asarray(part, dtype=np.float64) for part in value))
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{where} must be [{rule.words}], not {shown(value)}") from error
    if not (np.abs([first, second]) <= MAX_NUMBER).all():
        raise ConfigurationError(f"{where} must be finite, and less than 1e300, not {shown(value)}")
    if first.size == 0:
        raise ConfigurationError(f"{where} is of no number at all: {shown(value)}")
    if not np.all(rule.holds(first, second)):
        numbers = [first.tolist(), second.tolist()]
        raise ConfigurationError(f"{where} = [{rule.words}] needs {rule.needs}, not {shown(numbers)}")
    return TwoNumbers(name, first, second)
