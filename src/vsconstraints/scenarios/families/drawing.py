"""From the tables of a family's file to those of one scene: distributions stand where a scenario
has values.

A table of one key states one: ``{ uniform = [least, greatest] }``. Every draw has its own stream of
random numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from ...errors import ConfigurationError, shown, unknown_name
from ...rows import Array
from ..reading import Table
from .placements import PLACEMENTS

MAX_NUMBER = 1e300  #: numbers beyond cannot be drawn with
ALIKE = 0.75  #: how close a key must be to that of a distribution to count as a slip of it

Random = np.random.Generator


class Rule(NamedTuple):
    """A distribution of two numbers, or of two arrays of one shape after broadcasting, drawn number
    by number.

    ``words`` says what the two are and ``needs`` what they must satisfy, ``holds`` tests it,
    ``sample`` draws an array.
    """

    words: str
    needs: str
    holds: Callable[[Array, Array], Any]
    sample: Callable[[Random, Array, Array], Any]


def _log_uniform(random: Random, least: Array, greatest: Array) -> Array:
    # rounding of exp and log must not leave the range
    return np.clip(np.exp(random.uniform(np.log(least), np.log(greatest))), least, greatest)


def _integer(random: Random, least: Array, greatest: Array) -> Any:
    return random.integers(least.astype(np.int64), greatest.astype(np.int64), endpoint=True)


def _integers(least: Array, greatest: Array) -> Any:
    numbers = np.stack((least, greatest))
    return (
        (numbers == np.round(numbers)).all(axis=0)
        & (np.abs(numbers) < 2**53).all(axis=0)
        & (least <= greatest)
    )


RANGE = "least, greatest"
SPREAD = "mean, standard deviation"

#: Distributions of two numbers, by the key of their tables.
RULES: Mapping[str, Rule] = {
    "uniform": Rule(RANGE, "least ≤ greatest", lambda a, b: a <= b, Random.uniform),
    "log-uniform": Rule(
        RANGE, "0 < least ≤ greatest", lambda a, b: (a > 0.0) & (a <= b), _log_uniform
    ),
    # not "normal", since half-spaces have normals
    "gaussian": Rule(SPREAD, "a standard deviation ≥ 0", lambda a, b: b >= 0.0, Random.normal),
    "integer": Rule(RANGE, "integers, least ≤ greatest", _integers, _integer),
}
#: The keys of the tables that state a distribution; a choice is of a list of any values, each as
#: likely.
DISTRIBUTIONS = (*RULES, "choice")


@dataclass(frozen=True)
class Distribution:
    """A distribution by its key, with its two numbers or arrays, or the values to choose from."""

    name: str
    values: Sequence[Any]

    def draw(self, random: Random) -> Any:
        """A value of Python's own, as files hold it."""
        if self.name == "choice":
            return self.values[int(random.integers(len(self.values)))]
        return np.asarray(RULES[self.name].sample(random, *self.values)).tolist()


def _distribution(name: str, value: object, where: str) -> Distribution:
    """The distribution that a table ``{ name = value }`` states; ConfigurationError if nothing can
    be drawn from it.
    """
    if name == "choice":
        if not isinstance(value, list) or not value:
            raise ConfigurationError(
                f"{where}: choice must be a list of one or more values, not {shown(value)}"
            )
        return Distribution(name, value)
    rule = RULES[name]
    where = f"{where}: {name}"
    try:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError
        both = np.broadcast_arrays(*(np.asarray(part, dtype=np.float64) for part in value))
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{where} must be [{rule.words}], not {shown(value)}") from error
    if not (np.abs(both) <= MAX_NUMBER).all():
        raise ConfigurationError(f"{where} must be finite, and less than 1e300, not {shown(value)}")
    if both[0].size == 0:
        raise ConfigurationError(f"{where} is of no number at all: {shown(value)}")
    if not np.all(rule.holds(*both)):
        numbers = [part.tolist() for part in both]
        raise ConfigurationError(
            f"{where} = [{rule.words}] needs {rule.needs}, not {shown(numbers)}"
        )
    return Distribution(name, both)


class Streams(NamedTuple):
    """Random numbers of one attempt at a scene: one stream for every key, whatever else is
    drawn.
    """

    seed: int
    half: str
    number: int
    attempt: int
    family: str = ""
    """What else the streams depend on: without it, families have the same numbers under the same
    keys.
    """

    def of(self, key: str) -> Random:
        """The stream of a dotted key; the same in every process and on every machine."""
        return Random(np.random.PCG64(self.entropy(key)))

    def entropy(self, key: str, bits: int = 128) -> int:
        """A number that depends on all of this and the key, and on nothing else."""
        text = f"{self.family}{self.seed} {self.half} {self.number} {self.attempt} {key}"
        return int.from_bytes(hashlib.sha256(text.encode()).digest()[: bits // 8], "big")


@dataclass(frozen=True)
class Placed:
    """A placement as a file states it: its key in :data:`PLACEMENTS`, and the table that may hold
    distributions.
    """

    name: str
    table: Any


def parsed(value: Any, where: str) -> Any:
    """A file's value with distributions and placements in place of the tables that state them.

    Raises ConfigurationError for a distribution from which nothing can be drawn, or an unknown one.
    """
    if isinstance(value, list):
        return [parsed(inner, f"{where}.{i}") for i, inner in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if len(value) == 1:
        ((name, said),) = value.items()
        if name in DISTRIBUTIONS:
            return _distribution(name, said, where)
        if name in PLACEMENTS:
            return Placed(name, parsed(said, f"{where}.{name}"))
        known = [*DISTRIBUTIONS, *PLACEMENTS]
        if not isinstance(said, str | bool) and get_close_matches(name, known, n=1, cutoff=ALIKE):
            raise unknown_name(f"distribution in {where}", name, known)
    return {name: parsed(inner, f"{where}.{name}") for name, inner in value.items()}


def drawn(tree: Any, streams: Streams, key: str, values: dict[str, Any]) -> Any:
    """What is :func:`parsed` with everything drawn; placements stay, with their tables drawn.

    ``key`` is the dotted key of ``tree`` in the file; ``values`` takes what is drawn, by dotted
    keys.
    """
    if isinstance(tree, Distribution):
        values[key] = tree.draw(streams.of(key))
        return values[key]
    if isinstance(tree, Placed):
        return Placed(tree.name, drawn(tree.table, streams, f"{key}.{tree.name}", values))
    at = f"{key}." if key else ""
    if isinstance(tree, dict):
        return {name: drawn(inner, streams, f"{at}{name}", values) for name, inner in tree.items()}
    if isinstance(tree, list):
        return [drawn(inner, streams, f"{at}{i}", values) for i, inner in enumerate(tree)]
    return tree


def merged(under: Any, over: Mapping[str, Any], where: str) -> Table:
    """Tables over others: tables in them are merged, entries of lists are named by their number,
    the rest replaced.
    """
    result: Any = list(under) if isinstance(under, list) else dict(under)
    for name, value in over.items():
        at: Any = name
        if isinstance(result, list):
            if not (name.isdecimal() and int(name) < len(result)):
                raise unknown_name(
                    f"entry of a list in {where}", name, map(str, range(len(result)))
                )
            at = int(name)
        old = result[at] if isinstance(result, list) else result.get(at)
        deeper = (
            isinstance(value, dict)
            and isinstance(old, dict | list)
            and not _draws(value)
            and not _draws(old)
        )
        result[at] = merged(old, value, f"{where}.{name}") if deeper else value
    return result  # type: ignore[no-any-return]


def _draws(value: object) -> bool:
    """Whether a table of a file states a distribution or a placement."""
    return (
        isinstance(value, dict)
        and len(value) == 1
        and next(iter(value)) in (*DISTRIBUTIONS, *PLACEMENTS)
    )


def demand_no_placement(tree: Any, where: str) -> None:
    """Raise ConfigurationError if there is a placement in what is parsed: a scene is placed once
    for all conditions.
    """
    if isinstance(tree, Placed):
        raise ConfigurationError(f"{where}: {tree.name} stands in the family, not in a condition")
    inside = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    for name, inner in inside:
        demand_no_placement(inner, f"{where}.{name}")
