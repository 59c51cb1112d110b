"""Evidence read from its folder, with every batch checked against the manifest.

Each planned run is stored exactly once, and there are no others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
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
from .folder import (
    MARK,
    Facts,
    RunKey,
    StoredBatch,
    batch_file,
    files_of,
    require_same_files,
    stored_batches,
    stored_files,
    trajectory_file,
)
from .parquet import KEYS
from .together import combined_batches, combined_manifest, in_order

MAX_ROWS = 1000  # maximum number of constraint rows of a run in a batch
MAX_NAMED = 5  # maximum number of scene ranges in a message

#: Kinds of the entries of a manifest that may be missing.
OPTIONAL_ENTRIES: dict[str, Any] = {
    "machine": Table,
    "packages": Table,
    "command": Texts,
    "keep": Keep,
    "shard": tuple[int, int],
    "runs": int,
    "scenes": int,
    "finished": int,
    "wall_time_s": Number,
    "process_time_s": Number,
    "runs_per_s": Number,
}

RunCells = tuple[Any, ...]  #: Cells of a run in the columns :data:`.parquet.KEYS`.
SCENE_CELL = 3  #: Position of the scene in :data:`RunCells`.


@dataclass(frozen=True)
class Evidence(StoredResults):
    """Stored results of a campaign, in one folder or, as ``parts``, in several.

    The manifest of several folders lists what differs between them as ``merged``.
    """

    parts: tuple[Evidence, ...] = ()
    combined: tuple[StoredBatch, ...] = ()  #: Batches of all ``parts``, which have each scene once.

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
        remarks: list[str] = []
        stored: list[StoredBatch] = []
        for part in parts:
            remarks += part.remarks
            stored += part.batches
        manifests = {part.folder: part.manifest for part in parts}
        batches = combined_batches(manifests, stored)
        manifest = combined_manifest(manifests, batches)
        return cls(folders[0], manifest, trust, tuple(remarks), parts, batches)

    @property
    def manifests(self) -> Mapping[Path, Mapping[str, Any]]:
        """Manifest of each folder."""
        return {part.folder: part.manifest for part in self.parts or (self,)}

    @cached_property
    def batches(self) -> tuple[StoredBatch, ...]:
        """Batches of all folders, which have each scene once."""
        return self.combined if self.parts else in_order(stored_batches(self.folder))

    @cached_property
    def _folders(self) -> Mapping[tuple[str, int], Path]:
        """Folder of each scene of several folders, by family and number."""
        folders = {}
        for batch in self.batches:
            for number in batch.scenes:
                folders[batch.facts.family, number] = batch.folder
        return folders

    def folder_of(self, family: str, scene: int) -> Path:
        """Return the folder that holds a scene."""
        return self._folders[family, scene] if self.parts else self.folder

    def missing_scenes(self, wanted: range) -> str:
        """List the wanted scenes that are not stored, by family; empty if none is missing."""
        missing = {name: set(wanted) for name in self.manifest["configuration"]["families"]}
        for batch in self.batches:
            facts = batch.facts
            missing[facts.family].difference_update(facts.scenes)
        ranges = []
        for name, numbers in missing.items():
            first = -1
            for number in sorted(numbers):
                if number - 1 not in numbers:
                    first = number
                if number + 1 not in numbers:
                    ranges.append(f"{name} {first}–{number}")
        text = ", ".join(ranges[:MAX_NAMED])
        return f"{text} and more" if len(ranges) > MAX_NAMED else text

    @property
    def families(self) -> dict[str, Family]:
        """Families as they were run, by name."""
        families = {}
        for name, entry in self.manifest["configuration"]["families"].items():
            # paths of shipped families are stored relative to a folder that depends on the machine
            folder = SHIPPED / entry["folder"]
            families[name] = family_of(name, entry["tables"], folder, self.trusted)
        return families

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions in which scenes were run, in the order of the families."""
        conditions: dict[str, None] = {}
        for entry in self.manifest["configuration"]["families"].values():
            conditions |= dict.fromkeys(entry["conditions"])
        return tuple(conditions)

    @property
    def own_files(self) -> Files:
        """Hashes of files that custom parts loaded or read, see :mod:`.own_files`."""
        return files_of(batch.facts for batch in self.batches)

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
        half = configuration["half"]
        seed = configuration["seed"]
        return self.families[family].scene(scene, half, seed)

    def record(self, family: str, condition: str, scene: int, controller: str) -> RunRecord | None:
        """Return the record of a run, None if its trajectory is not stored.

        Raises ConfigurationError if the trajectory was changed after it was stored.
        """
        if family not in self.families:
            return None
        for part in self.parts:
            record = part.record(family, condition, scene, controller)
            if record is not None:
                return record
        if self.parts:
            return None
        key = RunKey(family, condition, scene, controller)
        path = trajectory_file(self.folder, key)
        require_unchanged(self.folder, [path], "finished" in self.manifest)
        most = most_samples(self.families[family].tables)
        return RunRecord.load(path, most)

    def _table(self, name: str) -> Any:
        import pandas as pd

        columns = parquet.tables()[name]
        empty = parquet.table(columns, [])
        tables = [batch.table(name) for batch in self.batches]
        table = parquet.joined([empty, *tables]).to_pandas()
        orders: dict[str, Sequence[str]] = {
            "family": tuple(self.families),
            "condition": self.conditions,
            "controller": self.controllers,
            "status": get_args(Outcome),
        }
        for column in columns:
            if column.category:
                values = table[column.name]
                order = orders.get(column.name, sorted(values.unique()))
                table[column.name] = pd.Categorical(values, order)
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
        for batch in self.batches:
            facts = batch.facts
            path = batch.path
            for table in parquet.tables():
                file = batch_file(self.folder, table, batch.name)
                if table != MARK and Facts.of(file) != facts:
                    raise ConfigurationError(
                        f"the metadata of {path} contradicts that of its other tables"
                    )
            # lines are read only if the footer is valid
            problem = _foreign(facts, self.manifest) or _wrong_lines(batch, configuration)
            if problem:
                raise ConfigurationError(
                    f"{path}, a batch: {problem}; {MANIFEST} does not ask for that"
                )
            for scene in facts.scenes:
                other = owner.setdefault((facts.family, scene), batch.name)
                if other != batch.name:
                    raise ConfigurationError(
                        f"{path}, a batch: {other} has scene {scene} of {facts.family}, too"
                    )
        require_same_files(self.batches)

    @classmethod
    def _require_readable(cls, manifest: Mapping[str, Any], where: str) -> None:
        manifest = entries(manifest, where, {"configuration": Table}, OPTIONAL_ENTRIES)
        where += ".configuration"
        needed = {
            "families": Table,
            "controllers": Table,
            "scenes": int,
            "half": str,
            "seed": int,
        }
        optional = {"scenes_in": dict[str, int]}
        configuration = entries(manifest["configuration"], where, needed, optional)
        has_valid_scenes = 0 < configuration["scenes"] <= MAX_SCENES
        has_valid_seed = configuration["seed"] >= 0
        if not has_valid_scenes or not has_valid_seed or configuration["half"] not in HALVES:
            must = (
                f"scenes must be from 1 to {MAX_SCENES}, seed 0 or more and half one of "
                f"{', '.join(HALVES)}"
            )
            raise ConfigurationError(f"{where}: {must}")
        families = configuration["families"]
        controllers = configuration["controllers"]
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
    is_ascending = list(scenes) == sorted(set(scenes))
    if not scenes or not is_ascending or scenes[0] < 0 or scenes[-1] >= configuration["scenes"]:
        return f"its scenes are {format_value(scenes)}, of {configuration['scenes']}"
    planned = {
        **manifest,
        **configuration,
        "conditions": family["conditions"],
        "family": family["tables"],
    }
    controllers = {}
    for name, entry in _inside(identity.get("controllers")).items():
        # without hashes of custom files and versions of packages
        controllers[name] = {
            key: value
            for key, value in _inside(entry).items()
            if not key.startswith(("file ", "package "))
        }
    stored = {
        **identity,
        "family": _inside(identity.get("family")).get("tables"),
        "controllers": controllers,
    }
    for name in ("seed", "half", "code", "scenes_in", "conditions", "family", "controllers"):
        if name in stored and name in planned and stored[name] != planned[name]:
            return f"its runs were made with another {name}"
    return ""


def _inside(table: Any) -> Mapping[str, Any]:
    return table if isinstance(table, dict) else {}


def _wrong_lines(batch: StoredBatch, configuration: Mapping[str, Any]) -> str:
    """Return the first problem in the lines of a batch whose footer is valid, or an empty text."""
    planned = _planned_runs(batch.facts, configuration)
    # lines are read only if there are as many as the footer states
    wrong_counts = _wrong_counts(batch, len(planned))
    if wrong_counts:
        return wrong_counts
    scenes = _lines(batch, "scenes", ["family", "half", "scene", "found"])
    family = batch.facts.family
    half = configuration["half"]
    keys_in_footer = Counter((family, half, scene) for scene in batch.facts.scenes)
    if Counter(cells[:-1] for cells in scenes) != keys_in_footer:
        return "its scenes are not those of its footer"
    found_scenes = {scene for _, _, scene, found in scenes if found}
    expected = {run for run in planned if run[SCENE_CELL] in found_scenes}
    return _wrong_runs(batch, expected, planned)


def _wrong_counts(batch: StoredBatch, most_runs: int) -> str:
    """Return which table of a batch has a wrong number of lines, or an empty text."""
    facts = batch.facts
    counts = {}
    for table in parquet.tables():
        file = batch_file(batch.folder, table, batch.name)
        counts[table] = parquet.line_count(file)
    if counts["scenes"] != len(facts.scenes):
        return f"it has {counts['scenes']} lines of {len(facts.scenes)} scenes"
    runs_are_wrong = counts[MARK] != facts.runs or facts.runs > most_runs
    if runs_are_wrong or counts["rows"] > MAX_ROWS * facts.runs:
        return (
            f"it has {counts[MARK]} runs of {facts.runs}, and {counts['rows']} rows; planned "
            f"are {most_runs} runs"
        )
    return ""


def _wrong_runs(batch: StoredBatch, expected: set[RunCells], planned: set[RunCells]) -> str:
    """Return the first problem in the runs and constraint rows of a batch, or an empty text.

    Runs that are ``expected`` must be there; others that are ``planned`` may be.
    """
    keys = [column.name for column in KEYS]
    lines = _lines(batch, MARK, [*keys, "violated"])
    runs = Counter(cells[:-1] for cells in lines)
    problems = {
        "no run": expected - runs.keys(),
        "a run": runs.keys() - planned,
        "more than once": {run for run, count in runs.items() if count > 1},
    }
    for problem, wrong in problems.items():
        if wrong:
            first = min(wrong, key=str)
            return f"it has {problem} {', '.join(map(str, first))}"
    violated_rows = set()
    for *run, violated in lines:
        labels = (violated or "").split("; ")
        violated_rows |= {(*run, label) for label in labels if label}
    rows = Counter(_lines(batch, "rows", [*keys, "constraint"]))
    is_listed_twice = any(count > 1 for count in rows.values())
    runs_of_rows = {row[:-1] for row in rows}
    if is_listed_twice or not runs_of_rows <= runs.keys() or not violated_rows <= rows.keys():
        return "its rows are not those of its runs"
    return ""


def _lines(batch: StoredBatch, table: str, names: Sequence[str]) -> list[tuple[Any, ...]]:
    """Return the cells of the named columns in each line of a table of a batch."""
    read = batch.table(table, names)
    columns = [read[name].to_pylist() for name in names]
    return list(zip(*columns, strict=True))


def _planned_runs(facts: Facts, configuration: Mapping[str, Any]) -> set[RunCells]:
    """Return the cells that identify the runs of all scenes of a batch, whether found or not."""
    conditions = configuration["families"][facts.family]["conditions"]
    limits = configuration.get("scenes_in", {})
    planned = set()
    for condition in conditions:
        end = limits.get(condition, configuration["scenes"])
        scenes = [scene for scene in facts.scenes if scene < end]
        for scene, law in product(scenes, configuration["controllers"]):
            planned.add((facts.family, condition, configuration["half"], scene, law))
    return planned
