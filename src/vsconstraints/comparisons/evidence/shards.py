"""Shards held against the campaign that its manifest describes: every run once, and no other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, product
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError, shown
from ..runs.folder import MANIFEST
from . import parquet
from .columns import TABLES
from .folder import MARK, Facts, shard_file

MOST_ROWS = 1000
"""Rows that a run may have in a shard."""

MOST_NAMED = 5
"""Ranges of scenes that a message names."""

KEYS = ["family", "condition", "half", "scene", "controller"]

SAME = ("seed", "half", "code", "scenes_in")
"""What an identity and a manifest both say."""


def demand_planned(folder: Path, names: Iterable[str], manifest: Mapping[str, Any]) -> dict[str, Facts]:
    """The facts of shards, by their names, all of whose lines are what a campaign's manifest asks for.

    Raises
    ------
    ConfigurationError
        that names the first shard of another campaign, with a scene that another one has too, or whose lines are not
        those of its scenes: some are gone, there twice, or of other laws.
    """
    owner: dict[tuple[str, int], str] = {}
    every = {}
    for name in names:
        found = [Facts.of(shard_file(folder, table, name)) for table in (MARK, *TABLES)]
        facts, path = found[0], shard_file(folder, MARK, name)
        if any(other != facts for other in found):
            raise ConfigurationError(f"{path} and its parts in other tables say different things of themselves")
        for problem in chain(_foreign(facts, manifest), _wrong_lines(folder, name, facts, manifest["configuration"])):
            raise ConfigurationError(f"{path}, a shard: {problem}; {MANIFEST} does not ask for that")
        for scene in facts.scenes:
            other = owner.setdefault((facts.family, scene), name)
            if other != name:
                raise ConfigurationError(f"{path}, a shard: {other} has scene {scene} of {facts.family}, too")
        every[name] = facts
    return every


def missing_scenes(configuration: Mapping[str, Any], shards: Iterable[Facts], wanted: range) -> str:
    """Families with those of the wanted scenes that no shard has, in words; empty if none is missing."""
    there: dict[str, set[int]] = {name: set() for name in configuration["families"]}
    for facts in shards:
        there[facts.family].update(facts.scenes)
    lost = [f"{name} {first}–{last}" for name, own in there.items() for first, last in _ranges(set(wanted) - own)]
    return f"{', '.join(lost[:MOST_NAMED])}{' and more' if len(lost) > MOST_NAMED else ''}"


def _ranges(numbers: set[int]) -> Iterator[tuple[int, int]]:
    """First and last of numbers that follow each other."""
    first = last = None
    for number in sorted(numbers):
        if first is None or last is None:
            first = last = number
        elif number == last + 1:
            last = number
        else:
            yield first, last
            first = last = number
    if first is not None and last is not None:
        yield first, last


def _foreign(facts: Facts, manifest: Mapping[str, Any]) -> Iterator[str]:
    """What a footer says otherwise than the manifest."""
    configuration = manifest["configuration"]
    family = configuration["families"].get(facts.family)
    if family is None:
        yield f"it is of the family {shown(facts.family)}"
        return
    scenes = facts.scenes
    if not scenes or list(scenes) != sorted(set(scenes)) or scenes[0] < 0 or scenes[-1] >= configuration["scenes"]:
        yield f"its scenes are {shown(scenes)}, of {configuration['scenes']}"
    said = {**manifest, **configuration, "conditions": family["conditions"]}
    made = facts.identity
    pairs = {name: (made.get(name), said.get(name)) for name in (*SAME, "conditions") if name in made and name in said}
    of_family = made.get("family")
    pairs["family"] = (of_family.get("tables") if isinstance(of_family, dict) else None, family["tables"])
    pairs["controllers"] = (_without_files(made.get("controllers")), configuration["controllers"])
    for name, (here, there) in pairs.items():
        if here != there:
            yield f"its runs were made with another {name}"


def _without_files(controllers: Any) -> Any:
    """Laws and options of an identity, without what files of own ones hold and which packages they use."""
    if not isinstance(controllers, dict):
        return controllers
    return {
        name: {key: value for key, value in entry.items() if not key.startswith(("file ", "package "))}
        if isinstance(entry, dict)
        else entry
        for name, entry in controllers.items()
    }


def _wrong_lines(folder: Path, name: str, facts: Facts, configuration: Mapping[str, Any]) -> Iterator[str]:
    """What is wrong with the lines of a shard whose footer is as it should be."""
    files = {table: shard_file(folder, table, name) for table in TABLES}
    counts = {table: parquet.line_count(path) for table, path in files.items()}
    family, most = configuration["families"][facts.family], configuration.get("scenes_in", {})
    conditions = {
        scene: [one for one in family["conditions"] if scene < most.get(one, configuration["scenes"])]
        for scene in facts.scenes
    }
    laws = list(configuration["controllers"])
    planned = sum(map(len, conditions.values())) * len(laws)
    if counts["scenes"] != len(facts.scenes):
        yield f"it has {counts['scenes']} lines of {len(facts.scenes)} scenes"
        return
    if counts[MARK] != facts.runs or facts.runs > planned or counts["rows"] > MOST_ROWS * facts.runs:
        yield f"it has {counts[MARK]} runs of {facts.runs}, and {counts['rows']} rows; planned are {planned} runs"
        return
    scenes = _lines(files["scenes"], "scenes", ["family", "half", "scene", "found"])
    own = facts.family, configuration["half"]
    if Counter(line[:3] for line in scenes) != Counter((*own, scene) for scene in facts.scenes):
        yield "its scenes are not those of its footer"
    runs = _lines(files[MARK], MARK, [*KEYS, "violated"])
    there = Counter(line[:-1] for line in runs)
    allowed = {
        (facts.family, condition, own[1], scene, law)
        for scene, named in conditions.items()
        for condition, law in product(named, laws)
    }
    drawn = {scene for *_, scene, found in scenes if found}
    needed = {key for key in allowed if key[3] in drawn}
    for problem, keys in (
        ("has no run", needed - there.keys()),
        ("has a run", there.keys() - allowed),
        ("has more than once", {key for key, count in there.items() if count > 1}),
    ):
        if keys:
            yield f"it {problem} {', '.join(map(str, min(keys, key=str)))}"
    rows = Counter(_lines(files["rows"], "rows", [*KEYS, "constraint"]))
    left = {(*line[:-1], label) for line in runs for label in (line[-1] or "").split("; ") if label}
    if max(rows.values(), default=1) > 1 or not {row[:-1] for row in rows} <= there.keys() or not left <= rows.keys():
        yield "its rows are not those of its runs"


def _lines(path: Path, table: str, names: list[str]) -> list[tuple[Any, ...]]:
    """The lines of some columns, in the order in which they are named."""
    found = parquet.read([path], TABLES[table], names)
    return list(zip(*(found[name].to_pylist() for name in names), strict=True))
