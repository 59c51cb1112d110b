"""Drawing of a scene's tables from those of a family, which hold distributions in place of values.

A table of one key states a distribution: ``{ uniform = [least, greatest] }``. Every draw has its
own stream of random numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from ...errors import ConfigurationError, format_value, unknown_name
from ...rows import Array
from ...scenarios.reading import Table
from .placements import PLACEMENTS

MAX_NUMBER = 1e300  #: largest magnitude of a number in a distribution
ALIKE = 0.75  #: similarity above which an unknown key counts as a misspelled distribution

Random = np.random.Generator


class Rule(NamedTuple):
    """Distribution with two parameters: numbers, or arrays that broadcast, drawn elementwise.

    ``words`` names the parameters and ``needs`` the condition on them; ``holds`` tests that
    condition; ``sample`` draws an array.
    """

    words: str
    needs: str
    holds: Callable[[Array, Array], Any]
    sample: Callable[[Random, Array, Array], Any]


def _log_uniform(random: Random, least: Array, greatest: Array) -> Array:
    # rounding of exp and log must not leave the range
    logarithm = random.uniform(np.log(least), np.log(greatest))
    return np.clip(np.exp(logarithm), least, greatest)


def _integer(random: Random, least: Array, greatest: Array) -> Any:
    low = least.astype(np.int64)
    high = greatest.astype(np.int64)
    return random.integers(low, high, endpoint=True)


def _integers(least: Array, greatest: Array) -> Any:
    numbers = np.stack((least, greatest))
    is_integer = (numbers == np.round(numbers)).all(axis=0)
    is_exact = (np.abs(numbers) < 2**53).all(axis=0)
    return is_integer & is_exact & (least <= greatest)


RANGE = "least, greatest"
SPREAD = "mean, standard deviation"

#: Distributions with two parameters, by the key of their tables.
RULES: Mapping[str, Rule] = {
    "uniform": Rule(RANGE, "least ≤ greatest", lambda a, b: a <= b, Random.uniform),
    "log-uniform": Rule(
        RANGE, "0 < least ≤ greatest", lambda a, b: (a > 0.0) & (a <= b), _log_uniform
    ),
    # not "normal", since half-spaces have normals
    "gaussian": Rule(SPREAD, "a standard deviation ≥ 0", lambda a, b: b >= 0.0, Random.normal),
    "integer": Rule(RANGE, "integers, least ≤ greatest", _integers, _integer),
}
#: Keys of the tables that state a distribution. A choice is among a list of any values, with equal
#: probability.
DISTRIBUTIONS = (*RULES, "choice")


@dataclass(frozen=True)
class Distribution:
    """A distribution by its key, with two numbers or arrays, or the values to choose from."""

    name: str
    values: Sequence[Any]

    def draw(self, random: Random) -> Any:
        """Draw a value as a plain Python object, as files hold it."""
        if self.name == "choice":
            position = int(random.integers(len(self.values)))
            return self.values[position]
        sample = RULES[self.name].sample(random, *self.values)
        return np.asarray(sample).tolist()


def _distribution(name: str, value: object, where: str) -> Distribution:
    """Return the distribution that a table ``{ name = value }`` states.

    Raises ConfigurationError if the parameters are not valid.
    """
    if name == "choice":
        if not isinstance(value, list) or not value:
            raise ConfigurationError(
                f"{where}: choice must be a list of one or more values, not {format_value(value)}"
            )
        return Distribution(name, value)
    rule = RULES[name]
    where = f"{where}: {name}"
    try:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError
        parameters = [np.asarray(part, dtype=np.float64) for part in value]
        both = np.broadcast_arrays(*parameters)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(
            f"{where} must be [{rule.words}], not {format_value(value)}"
        ) from error
    if not (np.abs(both) <= MAX_NUMBER).all():
        raise ConfigurationError(
            f"{where} must be finite, and less than 1e300, not {format_value(value)}"
        )
    if both[0].size == 0:
        raise ConfigurationError(f"{where} has no number: {format_value(value)}")
    if not np.all(rule.holds(*both)):
        numbers = [part.tolist() for part in both]
        raise ConfigurationError(
            f"{where} = [{rule.words}] needs {rule.needs}, not {format_value(numbers)}"
        )
    return Distribution(name, both)


class Streams(NamedTuple):
    """Random numbers of one attempt at a scene: an independent stream for every key.

    A stream does not depend on which other keys are drawn.
    """

    seed: int
    half: str
    number: int
    attempt: int
    family: str = ""
    """Prefix of the streams; without it, families draw the same numbers for the same keys."""

    def of(self, key: str) -> Random:
        """Return the stream of a dotted key, the same in every process and on every machine."""
        return Random(np.random.PCG64(self.entropy(key)))

    def entropy(self, key: str, bits: int = 128) -> int:
        """Return an integer that depends only on the fields of this object and the key."""
        text = f"{self.family}{self.seed} {self.half} {self.number} {self.attempt} {key}"
        digest = hashlib.sha256(text.encode()).digest()
        return int.from_bytes(digest[: bits // 8], "big")


@dataclass(frozen=True)
class Placed:
    """A placement as a file states it.

    ``name`` is its key in :data:`PLACEMENTS`; its table may hold distributions.
    """

    name: str
    table: Any


def parsed(value: Any, where: str) -> Any:
    """Replace tables that state a distribution or a placement by the corresponding objects.

    Raises ConfigurationError if a distribution is unknown or not valid.
    """
    if isinstance(value, list):
        return [parsed(inner, f"{where}.{i}") for i, inner in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if len(value) == 1:
        ((name, content),) = value.items()
        if name in DISTRIBUTIONS:
            return _distribution(name, content, where)
        if name in PLACEMENTS:
            return Placed(name, parsed(content, f"{where}.{name}"))
        known = [*DISTRIBUTIONS, *PLACEMENTS]
        similar = get_close_matches(name, known, n=1, cutoff=ALIKE)
        if similar and not isinstance(content, str | bool):
            raise unknown_name(f"distribution in {where}", name, known)
    return {name: parsed(inner, f"{where}.{name}") for name, inner in value.items()}


def drawn(tree: Any, streams: Streams, key: str, values: dict[str, Any]) -> Any:
    """Draw all distributions in the result of :func:`parsed`.

    Placements remain, with their tables drawn. ``key`` is the dotted key of ``tree`` in the file.
    The drawn values are added to ``values`` by dotted key.
    """
    if isinstance(tree, Distribution):
        values[key] = tree.draw(streams.of(key))
        return values[key]
    if isinstance(tree, Placed):
        table = drawn(tree.table, streams, f"{key}.{tree.name}", values)
        return Placed(tree.name, table)
    prefix = f"{key}." if key else ""
    if isinstance(tree, dict):
        table = {}
        for name, inner in tree.items():
            table[name] = drawn(inner, streams, f"{prefix}{name}", values)
        return table
    if isinstance(tree, list):
        entries = []
        for i, inner in enumerate(tree):
            entries.append(drawn(inner, streams, f"{prefix}{i}", values))
        return entries
    return tree


def merged(under: Any, over: Mapping[str, Any], where: str) -> Table:
    """Merge ``over`` into ``under``.

    Nested tables are merged, entries of lists are addressed by number, other values are replaced. A
    distribution or placement is replaced as a whole.
    """
    result: Any = list(under) if isinstance(under, list) else dict(under)
    for name, value in over.items():
        position: Any = name
        if isinstance(result, list):
            if not (name.isdecimal() and int(name) < len(result)):
                raise unknown_name(
                    f"entry of a list in {where}", name, map(str, range(len(result)))
                )
            position = int(name)
        old = result[position] if isinstance(result, list) else result.get(position)
        are_nested = isinstance(value, dict) and isinstance(old, dict | list)
        if are_nested and not _draws(value) and not _draws(old):
            value = merged(old, value, f"{where}.{name}")
        result[position] = value
    return result  # type: ignore[no-any-return]


def _draws(value: object) -> bool:
    """True if a table of a file states a distribution or a placement."""
    if not isinstance(value, dict) or len(value) != 1:
        return False
    (name,) = value
    return name in DISTRIBUTIONS or name in PLACEMENTS


def require_no_placement(tree: Any, where: str) -> None:
    """Raise ConfigurationError if a parsed tree contains a placement.

    A condition must not have one, since a scene is placed once for all conditions.
    """
    if isinstance(tree, Placed):
        raise ConfigurationError(f"{where}: {tree.name} belongs in the family, not in a condition")
    if isinstance(tree, list):
        tree = dict(enumerate(tree))
    if isinstance(tree, dict):
        for name, inner in tree.items():
            require_no_placement(inner, f"{where}.{name}")
