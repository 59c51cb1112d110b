"""Merge folders of one campaign, so that every scene is stored exactly once."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ...comparisons.runs.files import (
    TRAJECTORIES,
    replaced,
    require_unchanged,
    seal,
    storing,
    write_json,
)
from ...comparisons.runs.folder import MANIFEST, locked, manifest_of
from ...comparisons.runs.identity import differences, in_words
from ...comparisons.runs.machine import VERSION
from ...errors import ConfigurationError
from .folder import (  # fmt: skip
    MARK,
    StoredShard,
    chosen,
    clear,
    missing_scenes,
    require_same_files,
    shards,
    stored_files,
    trajectory_file,
    write_parts,
)
from .parquet import TABLES, TIMING
from .stored import Evidence

# OWN: entries of a manifest that may differ between folders.
# COMMON: entries of an identity that all families share.
OWN = (
    *(
        "shard",
        "command",
        "started",
        "wall_time_s",
        "process_time_s",
        "scenes",
        "runs",
        "runs_per_s",
    ),
    *("finished", "stored_before", "trajectories", "machine"),
)
COMMON = ("code", "version", "packages", "compiled", "seed", "half", "controllers")

Manifests = Mapping[Path, Mapping[str, Any]]  # by folder


class Merged(NamedTuple):
    """Numbers of merged scenes, runs and trajectories, and the remarks on the folders."""

    scenes: int
    runs: int
    trajectories: int
    remarks: tuple[str, ...] = ()


def merge(out: Path, folders: Sequence[Path]) -> Merged:
    """Merge folders of one campaign into ``out``.

    ``out`` is a new or empty folder, or that of an earlier merge, which is replaced. Raises
    ConfigurationError, before anything is written, if code, settings or packages of the folders
    differ, if scenes are missing, or if a scene is stored twice with different results. Raises
    StorageError if a file cannot be written.
    """
    read = {folder: Evidence.load(folder) for folder in folders}
    if not read:
        raise ConfigurationError(
            "there is nothing to merge: give the folders to merge after the output folder"
        )
    manifests = {folder: evidence.manifest for folder, evidence in read.items()}
    for folder, manifest in manifests.items():
        require_unchanged(
            folder, (folder / TRAJECTORIES).glob("*.npz"), "finished" in manifest, all_there=True
        )
    # in the order of scenes, so that the output does not depend on the order of the folders
    sources = [shard for folder in read for shard in shards(folder)]
    sources.sort(key=lambda source: (source.facts.family, source.facts.scenes))
    _require_alike(sources, manifests)
    _require_all(sources, manifests)
    once = _each_once(sources)
    if manifest_of(out) and "merged" not in manifest_of(out):
        raise ConfigurationError(f"{out} already holds results: give an empty or new folder")
    if out.resolve() in {folder.resolve() for folder in folders}:
        raise ConfigurationError(
            f"{out} is one of the folders to merge: give another output folder"
        )
    with locked(out, "evidence"):
        clear(out)
        with storing("evidence", out):
            counts = Counter[str]()
            for source, scenes in once:
                tables = {name: _lines(source, name, scenes) for name in TABLES}
                counts.update({name: table.num_rows for name, table in tables.items()})
                name = f"part-{source.facts.family}-{scenes[0]:07d}-{scenes[-1]:07d}"
                facts = replace(source.facts, scenes=tuple(scenes), runs=tables[MARK].num_rows)
                write_parts(
                    out,
                    name if len(scenes) < len(source.facts.scenes) else source.name,
                    tables,
                    facts,
                )
            remarks = tuple(text for evidence in read.values() for text in evidence.remarks)
            merged = Merged(
                counts["scenes"], counts[MARK], _copy_trajectories(manifests, out), remarks
            )
            write_json(out / MANIFEST, _merged_manifest(list(manifests.values()), merged))
            seal(out, stored_files(out))
    return merged


def _lines(source: StoredShard, name: str, scenes: Sequence[int]) -> Any:
    table = source.table(name)
    wanted = set(scenes)
    return table.filter([number in wanted for number in table["scene"].to_pylist()])


def _require_alike(sources: Sequence[StoredShard], manifests: Manifests) -> None:
    """Raise ConfigurationError if code, settings or packages of the folders differ.

    Machines and the folders of families may differ.
    """

    def require_same(what: Iterable[tuple[Path, Mapping[str, Any]]]) -> None:
        (there, one), *others = [*what] or [(Path(), {})]
        for here, other in others:
            if one != other:
                texts = [f"{text} ({there} and {here})" for text in differences(one, other)]
                raise ConfigurationError(f"these are not parts of one campaign: {in_words(texts)}")

    for family in {source.facts.family for source in sources}:
        require_same(
            (each.folder, each.facts.identity) for each in sources if each.facts.family == family
        )
    require_same(
        (each.folder, {name: each.facts.identity.get(name) for name in COMMON}) for each in sources
    )
    settings = {}
    for folder, manifest in manifests.items():
        configuration = manifest["configuration"]
        families = {
            name: {**entry, "folder": ""} for name, entry in configuration["families"].items()
        }
        settings[folder] = {**configuration, "families": families}
    require_same(settings.items())
    require_same_files(sources)


def _require_all(sources: Sequence[StoredShard], manifests: Manifests) -> None:
    """Raise ConfigurationError that names missing shards and scenes."""
    configuration = next(iter(manifests.values()))["configuration"]
    there = [tuple(manifest.get("shard", (1, 1))) for manifest in manifests.values()]
    missing = [
        f"shard {i}/{n}"
        for n in {n for _, n in there}
        for i in range(1, n + 1)
        if (i, n) not in there
    ]
    lost = missing_scenes(
        configuration, [source.facts for source in sources], range(configuration["scenes"])
    )
    if lost:
        which = (
            f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
            if missing
            else ""
        )
        unfinished = "to continue an interrupted command, give it again"
        raise ConfigurationError(
            f"{which or 'the campaign is incomplete'}: scenes {lost} are missing; {unfinished}"
        )


def _each_once(sources: Sequence[StoredShard]) -> list[tuple[StoredShard, list[int]]]:
    """Return each shard with its scenes that no earlier shard contains.

    Raises ConfigurationError if two shards hold different results for the same scene.
    """
    owners: dict[tuple[str, int], StoredShard] = {}
    once = []
    for source in sources:
        # scenes of this shard, by the path of the first shard that contains them
        scenes: dict[str, list[int]] = {}
        for number in source.facts.scenes:
            owner = owners.setdefault((source.facts.family, number), source)
            scenes.setdefault(str(owner.path), []).append(number)
        if own := scenes.pop(str(source.path), []):
            once.append((source, own))
        for shared in scenes.values():
            _require_same_results(owners[source.facts.family, shared[0]], source, shared)
    return once


def _require_same_results(one: StoredShard, other: StoredShard, scenes: list[int]) -> None:
    def differ(name: str, scenes: list[int]) -> bool:
        columns = [column.name for column in TABLES[name] if column.name not in TIMING]
        first, second = (_lines(source, name, scenes).select(columns) for source in (one, other))
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


def _copy_trajectories(folders: Manifests, out: Path) -> int:
    """Copy the trajectories that the merged campaign keeps, and return their number.

    The rule of each folder (``keep``) is applied to all runs. Trajectories that no folder holds are
    skipped.
    """
    count = 0
    for keep in sorted({manifest.get("keep", "none") for manifest in folders.values()} - {"none"}):
        for key in chosen(out, keep):
            to = trajectory_file(out, key)
            at = next(
                (file for folder in folders if (file := trajectory_file(folder, key)).is_file()),
                None,
            )
            if at is not None and not to.exists():
                (out / TRAJECTORIES).mkdir(exist_ok=True)
                with replaced(to) as part:
                    shutil.copyfile(at, part)
                count += 1
    return count


def _merged_manifest(manifests: Sequence[Mapping[str, Any]], merged: Merged) -> dict[str, Any]:
    """Return the first manifest, extended by the entries that differ between the folders."""
    first = manifests[0]
    return {
        **{name: value for name, value in first.items() if name not in OWN},
        "version": VERSION,
        "merged": [
            {name: manifest[name] for name in OWN if name in manifest} for manifest in manifests
        ],
        "machine": first.get("machine", {}),
        "process_time_s": sum(manifest.get("process_time_s", 0.0) for manifest in manifests),
        # merging makes no runs: all scenes were stored before
        **dict.fromkeys(("scenes", "finished", "stored_before"), merged.scenes),
        "runs": merged.runs,
        "trajectories": merged.trajectories,
        "shard": [1, 1],
    }
