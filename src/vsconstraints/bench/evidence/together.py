"""Shards of several folders, read as one campaign: each scene once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...comparisons.runs.identity import differences, in_words
from ...comparisons.runs.machine import VERSION
from ...errors import ConfigurationError
from .folder import MARK, StoredShard, require_same_files
from .parquet import TABLES, TIMING

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
COMMON = ("code", "version", "packages", "compiled", "seed", "half", "controllers")

Manifests = Mapping[Path, Mapping[str, Any]]  #: Manifests by folder.


def combined_shards(manifests: Manifests, stored: Iterable[StoredShard]) -> tuple[StoredShard, ...]:
    """Return the shards of all folders, each with the scenes that no earlier one contains.

    Shards are ordered by family and scene, whatever the order of the folders. Raises
    ConfigurationError if the folders are not parts of one campaign, or if two shards hold different
    results of a scene; the message names the difference.
    """
    every = in_order(stored)
    _require_one_campaign(every, manifests)
    return _each_once(every)


def in_order(stored: Iterable[StoredShard]) -> tuple[StoredShard, ...]:
    """Return shards in the order of families and scenes."""
    return tuple(sorted(stored, key=lambda shard: (shard.facts.family, shard.facts.scenes)))


def _require_one_campaign(stored: Sequence[StoredShard], manifests: Manifests) -> None:
    """Raise ConfigurationError if code, settings, packages or files of the folders differ.

    Machines and the folders of families may differ.
    """
    for family in {shard.facts.family for shard in stored}:
        own = (shard for shard in stored if shard.facts.family == family)
        _require_equal((shard.folder, shard.facts.identity) for shard in own)
    _require_equal(
        (shard.folder, {name: shard.facts.identity.get(name) for name in COMMON})
        for shard in stored
    )
    settings = {}
    for folder, manifest in manifests.items():
        configuration = manifest["configuration"]
        families = {
            name: {**entry, "folder": ""} for name, entry in configuration["families"].items()
        }
        settings[folder] = {**configuration, "families": families}
    _require_equal(settings.items())
    require_same_files(stored)


def _require_equal(tables: Iterable[tuple[Path, Mapping[str, Any]]]) -> None:
    """Raise ConfigurationError that names differences between tables of two folders."""
    (there, first), *others = [*tables] or [(Path(), {})]
    for here, other in others:
        if first != other:
            texts = [f"{text} ({there} and {here})" for text in differences(first, other)]
            raise ConfigurationError(f"these are not parts of one campaign: {in_words(texts)}")


def _each_once(stored: Sequence[StoredShard]) -> tuple[StoredShard, ...]:
    """Return each shard with the scenes that no earlier shard contains."""
    owners: dict[tuple[str, int], StoredShard] = {}
    once = []
    for shard in stored:
        # scenes of this shard, by the path of the first shard that contains them
        scenes: dict[str, list[int]] = {}
        for number in shard.facts.scenes:
            owner = owners.setdefault((shard.facts.family, number), shard)
            scenes.setdefault(str(owner.path), []).append(number)
        if own := scenes.pop(str(shard.path), []):
            once.append(shard.of(own))
        for shared in scenes.values():
            _require_same_results(owners[shard.facts.family, shared[0]], shard, shared)
    return tuple(once)


def _require_same_results(one: StoredShard, other: StoredShard, scenes: list[int]) -> None:
    """Raise ConfigurationError if two shards hold different results of the same scenes."""

    def differ(name: str, scenes: list[int]) -> bool:
        columns = [column.name for column in TABLES[name] if column.name not in TIMING]
        first, second = (shard.of(scenes).table(name, columns) for shard in (one, other))
        return not first.equals(second)

    for name in TABLES:
        if differ(name, scenes):
            at = next(number for number in scenes if differ(name, [number]))
            twice = (
                f"scene {at} of {one.facts.family} is in {one.folder} and in {other.folder}, "
                f"with different {name}"
            )
            why = "one of them was changed, or the law's runs are not reproducible"
            raise ConfigurationError(f"{twice}: {why}")


def _run_count(shard: StoredShard) -> int:
    """Return the number of runs of the scenes that are read."""
    return shard.facts.runs if shard.whole else int(shard.table(MARK, ["scene"]).num_rows)


def combined_manifest(manifests: Manifests, stored: Sequence[StoredShard]) -> dict[str, Any]:
    """Return the first manifest, extended by the entries that differ between the folders."""
    every = list(manifests.values())
    first = every[0]
    configuration = first["configuration"]
    finished = sum(len(shard.scenes) for shard in stored)
    return {
        **{name: value for name, value in first.items() if name not in OWN},
        "version": VERSION,
        "merged": [
            {name: manifest[name] for name in OWN if name in manifest} for manifest in every
        ],
        "machine": first.get("machine", {}),
        "process_time_s": sum(manifest.get("process_time_s", 0.0) for manifest in every),
        "scenes": configuration["scenes"] * len(configuration["families"]),
        # all scenes were stored before: combining makes no runs
        "finished": finished,
        "stored_before": finished,
        "runs": sum(map(_run_count, stored)),
        "trajectories": sum(manifest.get("trajectories", 0) for manifest in every),
        "shard": [1, 1],
    }
