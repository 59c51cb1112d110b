"""Wrong input, made from right input: scenarios, suites and stored files, with a thing or two
changed in each.

The same seed gives the same files. A file is refused with an error of this package or it is fine;
nothing else may happen, whatever was changed.
"""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.scenarios.toml import read_toml

DATA = Path(__file__).parent / "data"

FILE = "mutated.toml"
"""Name that a mutated scenario or suite is to be stored under: some of them name themselves."""


@dataclass(frozen=True)
class Mutated:
    """A changed file: what was done to it, and its bytes."""

    what: str
    content: bytes


def scenarios(count: int, seed: int = 0) -> Iterator[Mutated]:
    """Scenario files with one, sometimes two or three, things changed."""
    return _mutated(count, seed, _scenario_tables())


def suites(count: int, seed: int = 0) -> Iterator[Mutated]:
    """Suite files likewise."""
    return _mutated(count, seed, _suite_tables())


def edited(content: bytes, count: int, seed: int = 0) -> Iterator[Mutated]:
    """A stored file (a table, a manifest, a page) with single bytes changed, cut short, emptied, or
    lines moved.
    """
    chance = random.Random(f"{seed} {len(content)}")
    for _ in range(count):
        yield chance.choices([_byte, _cut, _lines], [8, 1, 2])[0](content, chance)


def toml(tables: dict[str, Any]) -> str:
    """Tables as TOML text, each key in a line."""
    return "".join(f"{json.dumps(str(key))} = {_toml(value)}\n" for key, value in tables.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return (
            "{ " + ", ".join(f"{json.dumps(str(k))} = {_toml(v)}" for k, v in value.items()) + " }"
        )
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return value[len(RAW) :] if value.startswith(RAW) else json.dumps(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)


RAW = "raw:"
"""Begins a text that goes into the file as it is, for what Python does not print."""

ODD: tuple[Any, ...] = (
    0, -1, 1, 2, 7, 0.5, -0.5, 1e-300, 5e-324, 1e300, -1e300, 1e154, 2**63, 10**400, 10**30, 1e9, 1e7, 65,
    float("nan"), float("inf"), float("-inf"), True, False,
    "", "x", "ur5", "tracking", "image-points", "current", "links", "a/b", "../x", "\x00", "nul\x00l", "ä ö", "\ud800",
    "x" * 300, "x" * 100_000, "no_such_module:Class", "json:JSONDecoder", "os:_exit", ":", "a:", FILE,
    [], [[]], [[], []], [0], [0.0, 0.0], [0.0] * 3, [1.0] * 6, [1.0] * 7, [1e300] * 3, [float("nan")] * 3, ["a"],
    [{}], [None], [1e308] * 2, [[1e300, 0.0, 0.0]], [[0.0] * 3] * 4, [[0.0, 0.0, 1.0]] * 65, [1] * 10_000, [True] * 3,
    {}, {"x": 1}, {"shape": "circle"}, {"velocity": [1.0, 2.0, 3.0]}, {"urdf": "\x00"}, {"name": "a"},
    RAW + "9" * 5000, RAW + "[" * 2000 + "]" * 2000, RAW + "[" * 300 + "]" * 300, RAW + "{a = " * 400 + "1" + "}" * 400,
    RAW + "1979-05-27T07:32:00Z", RAW + "07:32:00", RAW + "0x7fffffffffffffffffff", RAW + "1e999", RAW + "'''\n'''",
)  # fmt: skip
"""Values that are put where another belongs."""

Place = tuple[str | int, ...]


def _mutated(
    count: int, seed: int, bases: tuple[tuple[str, dict[str, Any]], ...]
) -> Iterator[Mutated]:
    chance = random.Random(seed)
    for _ in range(count):
        name, base = chance.choice(bases)
        tables = copy.deepcopy(base)
        done = []
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            done.append(chance.choice(CHANGES)(tables, chance))
        content = toml(tables).encode("utf-8", "surrogatepass")
        if chance.random() < 0.15:
            spoilt = chance.choice((_byte, _byte, _cut, _lines, _encoding))(content, chance)
            done = [*done, spoilt.what]
            content = spoilt.content
        yield Mutated(f"{name}: {'; '.join(done)}", content)


# --- changes of tables, in place; each says what it did ---


def _places(value: Any, path: Place = ()) -> Iterator[Place]:
    """Where there is anything in nested tables."""
    if path:
        yield path
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, inner in items:
        yield from _places(inner, (*path, key))


def _pick(tables: dict[str, Any], chance: random.Random) -> tuple[Any, Any, str]:
    """Something in the tables: what it is in, its key there, and its dotted name."""
    places = list(_places(tables))
    if not places:
        tables["x"] = 0
        places = [("x",)]
    path = chance.choice(places)
    at: Any = tables
    for key in path[:-1]:
        at = at[key]
    return at, path[-1], ".".join(map(str, path))


def _replace(tables: dict[str, Any], chance: random.Random) -> str:
    at, key, name = _pick(tables, chance)
    at[key] = copy.deepcopy(chance.choice(ODD))
    return f"{name} = {str(at[key])[:40]!r}"


def _remove(tables: dict[str, Any], chance: random.Random) -> str:
    at, key, name = _pick(tables, chance)
    del at[key]
    return f"without {name}"


def _repeat(tables: dict[str, Any], chance: random.Random) -> str:
    at, key, name = _pick(tables, chance)
    at[key] = [copy.deepcopy(at[key]) for _ in range(chance.choice((0, 1, 2, 3, 7, 50)))]
    return f"{name} {len(at[key])} times"


def _rename(tables: dict[str, Any], chance: random.Random) -> str:
    at, key, name = _pick(tables, chance)
    if not isinstance(at, dict):
        return _replace(tables, chance)
    other = chance.choice(
        (f"{key}s", str(key)[:-1], "", "\x00", "ä", "motion", "urdf", "name", "extends", "seed")
    )
    at[other] = at.pop(key)
    return f"{name} called {other!r}"


def _add(tables: dict[str, Any], chance: random.Random) -> str:
    at, key, name = _pick(tables, chance)
    key = chance.choice(KEYS)
    target = at if isinstance(at, dict) else tables
    target[key] = copy.deepcopy(chance.choice(ODD))
    return f"{key} beside {name} = {str(target[key])[:40]!r}"


def _scale(tables: dict[str, Any], chance: random.Random) -> str:
    places = [_at(tables, path) for path in _places(tables)]
    numbers = [
        (at, key)
        for at, key in places
        if isinstance(at[key], (int, float)) and not isinstance(at[key], bool)
    ]
    if not numbers:
        return _replace(tables, chance)
    at, key = chance.choice(numbers)
    factor = chance.choice((0, -1, 1e-12, 1e-6, 1e3, 1e9, 1e160, 1e308))
    at[key] = float(min(max(at[key], -1e300), 1e300)) * factor
    return f"{key} × {factor:g}"


def _swap(tables: dict[str, Any], chance: random.Random) -> str:
    at, key, name = _pick(tables, chance)
    bt, other, other_name = _pick(tables, chance)
    at[key], bt[other] = copy.deepcopy(bt[other]), copy.deepcopy(at[key])
    return f"{name} for {other_name}"


def _at(tables: Any, path: Place) -> tuple[Any, Any]:
    for key in path[:-1]:
        tables = tables[key]
    return tables, path[-1]


Change = Callable[[dict[str, Any], random.Random], str]

CHANGES: tuple[Change, ...] = (
    *[_replace] * 4,
    _remove,
    _repeat,
    _rename,
    _add,
    *[_scale] * 2,
    _swap,
)

KEYS = (
    "extends", "x", "title", "motion", "disturbances", "tolerances", "name", "type", "urdf", "dh", "tip", "locked",
    "actuation", "points", "markers", "seed", "trials", "set", "each", "scenario", "options", "solver", "fixed", "n",
)  # fmt: skip
"""Keys that are added where they need not belong."""


# --- changes of bytes ---


def _byte(content: bytes, chance: random.Random) -> Mutated:
    if not content:
        return Mutated("empty as it was", content)
    i = chance.randrange(len(content))
    new = chance.choice(
        (
            bytes([chance.randrange(256)]),
            b"\x00",
            b"\xff",
            b",",
            b'"',
            b"\n",
            b"-",
            b"9",
            b"e",
            b"",
            b"]",
        )
    )
    return Mutated(
        f"byte {i}: {content[i : i + 1]!r} is {new!r}", content[:i] + new + content[i + 1 :]
    )


def _cut(content: bytes, chance: random.Random) -> Mutated:
    end = chance.choice((0, 1, len(content) - 1, chance.randrange(len(content) + 1)))
    return Mutated(f"cut at {end} of {len(content)}", content[:end])


def _lines(content: bytes, chance: random.Random) -> Mutated:
    lines = content.splitlines(keepends=True) or [b"\n"]
    i = chance.randrange(len(lines))
    j = chance.randrange(len(lines))
    what = chance.choice(("doubled", "left out", "moved"))
    if what == "doubled":
        lines.insert(i, lines[i])
    elif what == "left out":
        del lines[i]
    else:
        lines[i], lines[j] = lines[j], lines[i]
    return Mutated(f"line {i} {what}", b"".join(lines))


def _encoding(content: bytes, chance: random.Random) -> Mutated:
    name = chance.choice(("utf-16", "utf-32", "utf-8-sig", "utf-7"))
    return Mutated(f"in {name}", content.decode("utf-8", "replace").encode(name))


# --- what is changed ---


@cache
def _scenario_tables() -> tuple[tuple[str, dict[str, Any]], ...]:
    shipped = [(name, Scenario.load(name).tables) for name in shipped_scenarios()]
    everything = Scenario.load(DATA / "everything.toml").tables
    # a mutated file can be anywhere
    everything["robot"]["urdf"] = str(DATA.parent.parent / "examples" / "six_axis.urdf")
    # the one in which most can be wrong as often as all the others
    return (*shipped, *[("everything", everything)] * len(shipped))


@cache
def _suite_tables() -> tuple[tuple[str, dict[str, Any]], ...]:
    suites = DATA.parent.parent / "comparisons"
    files = [suites / f"{name}.toml" for name in ("eye-to-hand", "qp-solvers", "non-static")]
    kept = [(path.stem, read_toml(path)) for path in files]
    return (*kept, *[("everything", read_toml(DATA / "everything-suite.toml"))] * len(kept))
