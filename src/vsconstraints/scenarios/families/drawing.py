"""From the tables of a family's file to those of one scene: every draw has a stream of its own."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from ...errors import ConfigurationError, unknown_name
from ..reading import Table
from .distributions import DISTRIBUTIONS, Choice, TwoNumbers, distribution
from .placements import PLACEMENTS, Placement

ALIKE = 0.75
"""How close a key must be to that of a distribution to count as a slip of it."""


class Streams(NamedTuple):
    """Random numbers of one attempt at a scene: one stream for every key, whatever else is drawn."""

    seed: int
    half: str
    number: int
    attempt: int

    def of(self, key: str) -> np.random.Generator:
        """The stream of a dotted key; the same in every process and on every machine."""
        return np.random.Generator(np.random.PCG64(self.entropy(key)))

    def entropy(self, key: str, bits: int = 128) -> int:
        """A number that depends on all of this and the key, and on nothing else."""
        text = f"{self.seed} {self.half} {self.number} {self.attempt} {key}"
        return int.from_bytes(hashlib.sha256(text.encode()).digest()[: bits // 8], "big")


@dataclass(frozen=True)
class Placed:
    """A placement as a file states it: its kind, and the table that may hold distributions."""

    kind: type[Placement]
    table: Any


def parsed(value: Any, where: str) -> Any:
    """A file's value with distributions and placements in place of the tables that state them.

    Raises
    ------
    ConfigurationError
        for a distribution from which nothing can be drawn, or an unknown one.
    """
    if isinstance(value, list):
        return [parsed(inner, f"{where}.{i}") for i, inner in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if len(value) == 1:
        ((name, said),) = value.items()
        if name in DISTRIBUTIONS:
            return distribution(name, said, where)
        if name in PLACEMENTS:
            return Placed(PLACEMENTS[name], parsed(said, f"{where}.{name}"))
        known = [*DISTRIBUTIONS, *PLACEMENTS]
        if not isinstance(said, str | bool) and get_close_matches(name, known, n=1, cutoff=ALIKE):
            raise unknown_name(f"distribution in {where}", name, known)
    return {name: parsed(inner, f"{where}.{name}") for name, inner in value.items()}


def drawn(tree: Any, streams: Streams, key: str, values: dict[str, Any]) -> Any:
    """What is parsed with everything drawn; placements stay, with their tables drawn.

    Parameters
    ----------
    tree
        From :func:`parsed`.
    streams
        Of the attempt.
    key
        Dotted key of ``tree`` in the file.
    values
        Takes what is drawn, by dotted keys.
    """
    if isinstance(tree, TwoNumbers | Choice):
        values[key] = tree.draw(streams.of(key))
        return values[key]
    if isinstance(tree, Placed):
        return Placed(tree.kind, drawn(tree.table, streams, f"{key}.{tree.kind.name}", values))
    at = f"{key}." if key else ""
    if isinstance(tree, dict):
        return {name: drawn(inner, streams, f"{at}{name}", values) for name, inner in tree.items()}
    if isinstance(tree, list):
        return [drawn(inner, streams, f"{at}{i}", values) for i, inner in enumerate(tree)]
    return tree


def merged(under: Any, over: Mapping[str, Any], where: str) -> Table:
    """Tables over others: tables in them are merged, entries of lists are named by their number, the rest replaced."""
    result: Any = list(under) if isinstance(under, list) else dict(under)
    for name, value in over.items():
        if isinstance(result, list):
            if not (name.isdecimal() and int(name) < len(result)):
                raise unknown_name(f"entry of a list in {where}", name, map(str, range(len(result))))
            at: Any = int(name)
        else:
            at = name
        old = result[at] if isinstance(result, list) else result.get(at)
        deeper = isinstance(value, dict) and isinstance(old, dict | list) and not _draws(value) and not _draws(old)
        result[at] = merged(old, value, f"{where}.{name}") if deeper else value
    return result  # type: ignore[no-any-return]


def _draws(value: object) -> bool:
    """Whether a table of a file states a distribution or a placement."""
    return isinstance(value, dict) and len(value) == 1 and next(iter(value)) in (*DISTRIBUTIONS, *PLACEMENTS)


def demand_no_placement(tree: Any, where: str) -> None:
    """Raise ConfigurationError if there is a placement in what is parsed: a scene is placed once for all conditions."""
    if isinstance(tree, Placed):
        raise ConfigurationError(f"{where}: {tree.kind.name} stands in the family, not in a condition")
    inside = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for name, inner in inside:
        demand_no_placement(inner, f"{where}.{name}")
