"""Evidence read from its folder, with every shard checked against the manifest.

Each planned run is stored exactly once, and there are no others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Self, get_args

from ...comparisons.experiment import require_names
from ...comparisons.record import RunRecord
from ...comparisons.runs.files import TRAJECTORIES, require_unchanged
from ...comparisons.runs.folder import MANIFEST, Keep, StoredResults, entries, kind_of
from ...comparisons.runs.machine import most_samples
from ...comparisons.runs.spec import ControllerSpec
from ...comparisons.stored import Number, Texts
from ...errors import ConfigurationError, format_value
from ...plugins.provenance import Files
from ...scenarios.reading import Table
from ...simulation.trajectory import Outcome
from ..families import HALVES, SHIPPED, Drawn, Family
from ..families.frozen import family_of
from . import parquet
from .campaign import MAX_SCENES
from .folder import (  # fmt: skip
    MARK,
    Facts,
    RunKey,
    StoredShard,
    files_of,
    require_same_files,
    shard_file,
    shards,
    stored_files,
    trajectory_file,
)
from .parquet import KEYS, TABLES
from .together import combined_manifest, combined_shards, in_order

MAX_ROWS = 1000  # maximum number of constraint rows of a run in a shard
MAX_NAMED = 5  # maximum number of scene ranges in a message


@dataclass(frozen=True)
class Evidence(StoredResults):
    """Stored results of a campaign, in one folder or, as ``parts``, in several.

    The manifest of several folders lists what differs between them as ``merged``.
    """

    parts: tuple[Evidence, ...] = ()

    with_code = ("families", "controllers")

    @classmethod
    def load(cls, folder: Path | Sequence[Path], trust: bool = False) -> Self:
        """Read one folder, or several as one campaign, see :meth:`.StoredResults.load`.

        Raises ConfigurationError, which names the difference, also if the folders are not parts of
        one campaign, or if a scene is stored twice with different results.
        """
        folders = [folder] if isinstance(folder, Path) else list(dict.fromkeys(folder))
        if not folders:
            raise ConfigurationError("no folder of evidence is given: give one or several")
        parts = tuple(super(Evidence, cls).load(each, trust) for each in folders)
        if len(parts) == 1:
            return parts[0]
        remarks = tuple(text for part in parts for text in part.remarks)
        manifests = {part.folder: part.manifest for part in parts}
        stored = combined_shards(manifests, [shard for part in parts for shard in part.shards])
        manifest = combined_manifest(manifests, stored)
        evidence = cls(folders[0], manifest, trust, remarks, parts)
        vars(evidence)["shards"] = stored  # the cached property, which would compare them again
        return evidence

    @property
    def manifests(self) -> Mapping[Path, Mapping[str, Any]]:
        """Manifest of each folder."""
        return {part.folder: part.manifest for part in self.parts or (self,)}

    @cached_property
    def shards(self) -> tuple[StoredShard, ...]:
        """Shards of all folders, which have each scene once."""
        if self.parts:
            stored = [shard for part in self.parts for shard in part.shards]
            return combined_shards(self.manifests, stored)
        return in_order(shards(self.folder))

    def missing_scenes(self, wanted: range) -> str:
        """List the wanted scenes that are not stored, by family; empty if none is missing."""
        missing = {name: set(wanted) for name in self.manifest["configuration"]["families"]}
        for shard in self.shards:
            missing[shard.facts.family].difference_update(shard.facts.scenes)
        lost = []
        for name, numbers in missing.items():
            firsts = sorted(number for number in numbers if number - 1 not in numbers)
            lasts = sorted(number for number in numbers if number + 1 not in numbers)
            lost += [f"{name} {first}–{last}" for first, last in zip(firsts, lasts, strict=True)]
        return f"{', '.join(lost[:MAX_NAMED])}{' and more' if len(lost) > MAX_NAMED else ''}"

    @property
    def families(self) -> dict[str, Family]:
        """Families as they were run, by name."""
        stored = self.manifest["configuration"]["families"]
        # paths of shipped families are stored relative to a folder that depends on the machine
        return {
            name: family_of(name, entry["tables"], SHIPPED / entry["folder"], self.trusted)
            for name, entry in stored.items()
        }

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions in which scenes were run, in the order of the families."""
        stored = self.manifest["configuration"]["families"].values()
        return tuple(dict.fromkeys(name for entry in stored for name in entry["conditions"]))

    @property
    def own_files(self) -> Files:
        """Hashes of files that custom parts loaded or read, see :mod:`.own_files`."""
        return files_of(shard.facts for shard in self.shards)

    @cached_property
    def runs(self) -> Any:
        """DataFrame with one line for each run.

        Lines are ordered by family, condition, scene and controller.
        """
        return self._table("runs")

    @cached_property
    def rows(self) -> Any:
        """DataFrame with one line for each challenged, active or violated row of a run."""
        return self._table("rows")

    @cached_property
    def scenes(self) -> Any:
        """DataFrame with one line for each scene."""
        return self._table("scenes")

    def drawn(self, family: str, scene: int) -> Drawn:
        """Draw a scene again, as it was run."""
        configuration = self.manifest["configuration"]
        return self.families[family].scene(scene, configuration["half"], configuration["seed"])

    def record(self, family: str, condition: str, scene: int, controller: str) -> RunRecord | None:
        """Return the record of a run, None if its trajectory is not stored.

        Raises ConfigurationError if the trajectory was changed after it was stored.
        """
        if family not in self.families:
            return None
        if self.parts:
            found = (part.record(family, condition, scene, controller) for part in self.parts)
            return next((record for record in found if record is not None), None)
        path = trajectory_file(self.folder, RunKey(family, condition, scene, controller))
        require_unchanged(self.folder, [path], "finished" in self.manifest)
        return RunRecord.load(path, most_samples(self.families[family].tables))

    def _table(self, name: str) -> Any:
        import pandas as pd

        lines = [parquet.table(TABLES[name], []), *(shard.table(name) for shard in self.shards)]
        table = parquet.joined(lines).to_pandas()
        orders: dict[str, Sequence[str]] = {
            "family": tuple(self.families),
            "condition": self.conditions,
            "controller": self.controllers,
            "status": get_args(Outcome),
        }
        for column in TABLES[name]:
            if column.category:
                order = orders.get(column.name, sorted(table[column.name].unique()))
                table[column.name] = pd.Categorical(table[column.name], order)
        keys = [key for key in RunKey._fields if key in table]
        # a stable sort keeps the order of the rows of a run
        return table.sort_values(keys, kind="stable", ignore_index=True)

    @classmethod
    def _files(cls, folder: Path) -> Sequence[Path]:
        if kind_of(folder) != "evidence":
            raise ConfigurationError(
                f"{folder} holds no evidence: {MANIFEST} is missing, or is not a campaign's"
            )
        # trajectories are numerous: each is checked when it is read
        return [path for path in stored_files(folder) if path.parent.name != TRAJECTORIES]

    def _require_planned(self) -> None:
        configuration = self.manifest["configuration"]
        owner = dict[tuple[str, int], str]()
        for shard in self.shards:
            facts = shard.facts
            path = shard.path
            others = [
                shard_file(self.folder, table, shard.name) for table in TABLES if table != MARK
            ]
            if any(Facts.of(other) != facts for other in others):
                raise ConfigurationError(
                    f"the metadata of {path} contradicts that of its other tables"
                )
            if problem := _foreign(facts, self.manifest) or next(
                _wrong_lines(shard, configuration), ""
            ):
                raise ConfigurationError(
                    f"{path}, a shard: {problem}; {MANIFEST} does not ask for that"
                )
            for scene in facts.scenes:
                other = owner.setdefault((facts.family, scene), shard.name)
                if other != shard.name:
                    raise ConfigurationError(
                        f"{path}, a shard: {other} has scene {scene} of {facts.family}, too"
                    )
        require_same_files(self.shards)

    @classmethod
    def _require_readable(cls, manifest: Mapping[str, Any], where: str) -> None:
        others: dict[str, Any] = {
            "machine": Table,
            "packages": Table,
            "command": Texts,
            "keep": Keep,
        }
        others |= {"shard": tuple[int, int], **dict.fromkeys(("runs", "scenes", "finished"), int)}
        others |= dict.fromkeys(("wall_time_s", "process_time_s", "runs_per_s"), Number)
        manifest = entries(manifest, where, {"configuration": Table}, others)
        where += ".configuration"
        needed = {"families": Table, "controllers": Table, "scenes": int, "half": str, "seed": int}
        configuration = entries(
            manifest["configuration"], where, needed, {"scenes_in": dict[str, int]}
        )
        scenes, families, controllers = (
            configuration[name] for name in ("scenes", "families", "controllers")
        )
        if not (
            0 < scenes <= MAX_SCENES
            and configuration["seed"] >= 0
            and configuration["half"] in HALVES
        ):
            must = (
                f"scenes must be from 1 to {MAX_SCENES}, seed 0 or more and half one of "
                f"{', '.join(HALVES)}"
            )
            raise ConfigurationError(f"{where}: {must}")
        require_names("family", families, f"{where}: ")
        require_names("controller", controllers, f"{where}: ")
        for name, entry in families.items():
            at = f"{where}.families.{name}"
            family = entries(entry, at, {"folder": str, "conditions": Texts, "tables": Table})
            require_names("condition", family["conditions"], f"{at}: ")
        for name, entry in controllers.items():
            ControllerSpec.from_table(name, entry, f"{where}.controllers")


def _foreign(facts: Facts, manifest: Mapping[str, Any]) -> str:
    """Return the first contradiction between a footer and the manifest, or an empty text."""
    configuration = manifest["configuration"]
    identity = facts.identity
    scenes = facts.scenes
    family = configuration["families"].get(facts.family)
    if family is None:
        return f"it is of the family {format_value(facts.family)}"
    if (
        not scenes
        or list(scenes) != sorted(set(scenes))
        or scenes[0] < 0
        or scenes[-1] >= configuration["scenes"]
    ):
        return f"its scenes are {format_value(scenes)}, of {configuration['scenes']}"
    planned = {
        **manifest,
        **configuration,
        "conditions": family["conditions"],
        "family": family["tables"],
    }
    stored = {**identity, "family": _inside(identity.get("family")).get("tables")}
    # without hashes of custom files and versions of packages
    stored["controllers"] = {
        name: {
            key: value
            for key, value in _inside(entry).items()
            if not key.startswith(("file ", "package "))
        }
        for name, entry in _inside(identity.get("controllers")).items()
    }
    optional = [
        name for name in ("seed", "half", "code", "scenes_in", "conditions") if name in stored
    ]
    for name in (*optional, "family", "controllers"):
        if name in planned and stored[name] != planned[name]:
            return f"its runs were made with another {name}"
    return ""


def _inside(table: Any) -> Mapping[str, Any]:
    return table if isinstance(table, dict) else {}


def _wrong_lines(shard: StoredShard, configuration: Mapping[str, Any]) -> Iterator[str]:
    """Yield problems in the lines of a shard whose footer is valid."""

    def lines(table: str, *names: str) -> list[tuple[Any, ...]]:
        read = shard.table(table, names)
        return list(zip(*(read[name].to_pylist() for name in names), strict=True))

    facts = shard.facts
    half = configuration["half"]
    most = configuration.get("scenes_in", {})
    counts = {
        table: parquet.line_count(shard_file(shard.folder, table, shard.name)) for table in TABLES
    }
    conditions = configuration["families"][facts.family]["conditions"]
    planned = {
        (facts.family, condition, half, scene, law)
        for scene, condition, law in product(facts.scenes, conditions, configuration["controllers"])
        if scene < most.get(condition, configuration["scenes"])
    }
    if counts["scenes"] != len(facts.scenes):
        yield f"it has {counts['scenes']} lines of {len(facts.scenes)} scenes"
    if (
        counts[MARK] != facts.runs
        or facts.runs > len(planned)
        or counts["rows"] > MAX_ROWS * facts.runs
    ):
        yield (
            f"it has {counts[MARK]} runs of {facts.runs}, and {counts['rows']} rows; planned "
            f"are {len(planned)} runs"
        )
    scenes = lines("scenes", "family", "half", "scene", "found")
    if Counter(line[:3] for line in scenes) != Counter(
        (facts.family, half, scene) for scene in facts.scenes
    ):
        yield "its scenes are not those of its footer"
    keys = [column.name for column in KEYS]
    runs = lines(MARK, *keys, "violated")
    there = Counter(line[:-1] for line in runs)
    drawn = {scene for *_, scene, found in scenes if found}
    missing = {key for key in planned if key[3] in drawn} - there.keys()
    more = there.keys() - planned, {key for key, count in there.items() if count > 1}
    for problem, wrong in zip(("no run", "a run", "more than once"), (missing, *more), strict=True):
        if wrong:
            yield f"it has {problem} {', '.join(map(str, min(wrong, key=str)))}"
    rows = Counter(lines("rows", *keys, "constraint"))
    violated = {
        (*line[:-1], label) for line in runs for label in (line[-1] or "").split("; ") if label
    }
    once = max(rows.values(), default=1) == 1
    if not (once and {row[:-1] for row in rows} <= there.keys() and violated <= rows.keys()):
        yield "its rows are not those of its runs"
