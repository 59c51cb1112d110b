"""Batches of several folders, read as one campaign: each scene once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...comparisons.metrics import timing_columns
from ...comparisons.runs.identity import differences, in_words
from ...errors import ConfigurationError
from .folder import MARK, StoredBatch, require_same_files
from .parquet import tables

#: Entries of a manifest that may differ between the folders of a campaign.
OWN = (
    "shard",
    "command",
    "started",
    "wall_time_s",
    "process_time_s",
    "scenes",
    "runs",
    "runs_per_s",
    "finished",
    "stored_before",
    "trajectories",
    "machine",
)
#: Entries of an identity that all families share.
COMMON = ("code", "version", "packages", "compiled", "seed", "half", "controllers", "metrics")

Manifests = Mapping[Path, Mapping[str, Any]]  #: Manifests by folder.
FolderTable = tuple[Path, Mapping[str, Any]]  #: Folder and a table of what it states.


def combined_batches(
    manifests: Manifests, stored: Iterable[StoredBatch]
) -> tuple[StoredBatch, ...]:
    """Return the batches of all folders, each with the scenes that no earlier one contains.

    Batches are ordered by family and scene, whatever the order of the folders. Raises
    ConfigurationError if the folders are not parts of one campaign, or if two batches hold
    different results of a scene; the message names the difference.
    """
    every = in_order(stored)
    _require_one_campaign(every, manifests)
    return _each_once(every)


def in_order(stored: Iterable[StoredBatch]) -> tuple[StoredBatch, ...]:
    """Return batches in the order of families and scenes."""

    def place(batch: StoredBatch) -> tuple[str, tuple[int, ...]]:
        return batch.facts.family, batch.facts.scenes

    return tuple(sorted(stored, key=place))


def _require_one_campaign(stored: Sequence[StoredBatch], manifests: Manifests) -> None:
    """Raise ConfigurationError if version, code, settings, packages or files of the folders differ.

    Machines and the folders of families may differ.
    """
    by_family: dict[str, list[FolderTable]] = {}
    common: list[FolderTable] = []
    for batch in stored:
        batch_identity = batch.facts.identity
        of_family = by_family.setdefault(batch.facts.family, [])
        of_family.append((batch.folder, batch_identity))
        of_all_families = {name: batch_identity.get(name) for name in COMMON}
        common.append((batch.folder, of_all_families))
    # two folders may have no family in common, and families differ in their tables and conditions:
    # whole identities are compared within a family, and what all families share across them
    for identities in by_family.values():
        _require_equal(identities)
    _require_equal(common)
    settings: list[FolderTable] = []
    for folder, manifest in manifests.items():
        configuration = manifest["configuration"]
        families = {}
        for name, entry in configuration["families"].items():
            families[name] = {**entry, "folder": ""}
        version = manifest.get("version")
        settings.append((folder, {**configuration, "families": families, "version": version}))
    _require_equal(settings)
    require_same_files(stored)


def _require_equal(tables: Sequence[FolderTable]) -> None:
    """Raise ConfigurationError that names differences between tables of two folders."""
    for folder, table in tables[1:]:
        first_folder, first = tables[0]
        if table != first:
            found = differences(first, table, "in the first", "in the second")
            raise ConfigurationError(
                f"{first_folder} and {folder} are not parts of one campaign: "
                f"{in_words(list(found))}"
            )


def _each_once(stored: Sequence[StoredBatch]) -> tuple[StoredBatch, ...]:
    """Return each batch with the scenes that no earlier batch contains."""
    owners: dict[tuple[str, int], StoredBatch] = {}
    once = []
    for batch in stored:
        new_scenes = []
        # scenes that an earlier batch contains, by the path of that batch
        repeated: dict[Path, list[int]] = {}
        for number in batch.facts.scenes:
            owner = owners.setdefault((batch.facts.family, number), batch)
            if owner is batch:
                new_scenes.append(number)
            else:
                repeated.setdefault(owner.path, []).append(number)
        if new_scenes:
            once.append(batch.of(new_scenes))
        for scenes in repeated.values():
            owner = owners[batch.facts.family, scenes[0]]
            _require_same_results(owner, batch, scenes)
    return tuple(once)


def _require_same_results(first: StoredBatch, second: StoredBatch, scenes: list[int]) -> None:
    """Raise ConfigurationError if two batches hold different results of the same scenes."""
    for name in tables():
        if _differ(first, second, name, scenes):
            at = next(number for number in scenes if _differ(first, second, name, [number]))
            problem = (
                f"scene {at} of {first.facts.family} is in {first.folder} and in {second.folder}, "
                f"with different {name}"
            )
            why = "one of them was changed, or the law's runs are not reproducible"
            raise ConfigurationError(f"{problem}: {why}")


def _differ(first: StoredBatch, second: StoredBatch, name: str, scenes: list[int]) -> bool:
    """Return True if tables differ in these scenes, except in columns of times."""
    times = timing_columns()
    columns = [column.name for column in tables()[name] if column.name not in times]
    lines = first.of(scenes).table(name, columns)
    other_lines = second.of(scenes).table(name, columns)
    return not lines.equals(other_lines)


def _run_count(batch: StoredBatch) -> int:
    """Return the number of runs of the scenes that are read."""
    if batch.whole:
        return batch.facts.runs
    return int(batch.table(MARK, ["scene"]).num_rows)


def combined_manifest(manifests: Manifests, stored: Sequence[StoredBatch]) -> dict[str, Any]:
    """Return the first manifest, extended by the entries that differ between the folders."""
    every = list(manifests.values())
    first = every[0]
    common = {name: value for name, value in first.items() if name not in OWN}
    own = []
    for manifest in every:
        own.append({name: manifest[name] for name in OWN if name in manifest})
    configuration = first["configuration"]
    finished = sum(len(batch.scenes) for batch in stored)
    return {
        **common,
        "merged": own,
        "machine": first.get("machine", {}),
        "process_time_s": sum(manifest.get("process_time_s", 0.0) for manifest in every),
        "scenes": configuration["scenes"] * len(configuration["families"]),
        # all scenes were stored before: combining makes no runs
        "finished": finished,
        "stored_before": finished,
        "runs": sum(map(_run_count, stored)),
        "shard": [1, 1],
    }
