"""Folders of one campaign merged: every scene once, and nothing else."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import ConfigurationError
from ..runs.files import TRAJECTORIES, demand_unchanged, replaced, seal, storing, write_json
from ..runs.folder import MANIFEST, held, manifest_of
from ..runs.machine import VERSION
from . import parquet
from .campaign import differences, in_words
from .folder import MARK, Facts, chosen, clear, shard_file, shard_names, stored_files, trajectory_file, write_parts
from .parquet import TABLES, TIMING
from .stored import Evidence, missing_scenes

# Entries of a manifest that may differ from folder to folder, and of an identity that different families share.
OWN = (
    *("shard", "command", "started", "wall_time_s", "process_time_s", "scenes", "runs", "runs_per_s"),
    *("finished", "stored_before", "trajectories", "machine"),
)
COMMON = ("code", "version", "packages", "compiled", "seed", "half", "controllers")


@dataclass(frozen=True)
class Merged:
    """How many scenes, runs and trajectories were put together, and what a reader should know of the folders."""

    scenes: int
    runs: int
    trajectories: int
    remarks: tuple[str, ...] = ()


class _Source(NamedTuple):
    """A shard of one of the folders."""

    folder: Path
    name: str
    facts: Facts

    def table(self, name: str, scenes: Sequence[int]) -> Any:
        """The lines of these scenes."""
        table, wanted = parquet.read([shard_file(self.folder, name, self.name)], TABLES[name]), set(scenes)
        return table.filter([number in wanted for number in table["scene"].to_pylist()])


def merge(out: Path, folders: Sequence[Path]) -> Merged:
    """Put folders of one campaign together in ``out``: new, empty, or one that the same merge has left.

    Raises ConfigurationError if they are not of the same code, settings and package versions, scenes are missing, or a
    scene is there twice with different results; it says what, and where, and nothing has been written then. Raises
    StorageError if something cannot be written.
    """
    read = {folder: Evidence.load(folder) for folder in folders}
    if not read:
        raise ConfigurationError("there is nothing to merge: give the folders after the one that is written")
    manifests = {folder: evidence.manifest for folder, evidence in read.items()}
    for folder, manifest in manifests.items():
        demand_unchanged(folder, (folder / TRAJECTORIES).glob("*.npz"), "finished" in manifest, all_there=True)
    sources = [
        _Source(folder, name, Facts.of(shard_file(folder, MARK, name)))
        for folder in manifests
        for name in shard_names(folder)
    ]
    # in the order of scenes, so that what is written does not depend on that of the folders
    sources.sort(key=lambda source: (source.facts.family, source.facts.scenes))
    _demand_alike(sources, manifests)
    _demand_all(sources, manifests)
    once = _each_once(sources)
    if manifest_of(out) and "merged" not in manifest_of(out):
        raise ConfigurationError(f"{out} holds results of its own: give a folder that is empty or new")
    if out.resolve() in {folder.resolve() for folder in folders}:
        raise ConfigurationError(f"{out} is one of the folders that are to be merged: give another one to be written")
    with held(out, "evidence"):
        clear(out)
        with storing("evidence", out):
            counts = dict.fromkeys(TABLES, 0)
            for source, scenes in once:
                tables = {name: source.table(name, scenes) for name in TABLES}
                counts = {name: counts[name] + table.num_rows for name, table in tables.items()}
                name = f"part-{source.facts.family}-{scenes[0]:07d}-{scenes[-1]:07d}"
                facts = replace(source.facts, scenes=tuple(scenes), runs=tables[MARK].num_rows)
                write_parts(out, name if len(scenes) < len(source.facts.scenes) else source.name, tables, facts)
            kept = _copy_trajectories(manifests, out)
            remarks = tuple(text for evidence in read.values() for text in evidence.remarks)
            merged = Merged(counts["scenes"], counts[MARK], kept, remarks)
            write_json(out / MANIFEST, _merged_manifest(list(manifests.values()), merged))
            seal(out, stored_files(out))
    return merged


def _demand_alike(sources: Sequence[_Source], manifests: Mapping[Path, Mapping[str, Any]]) -> None:
    """Raise ConfigurationError if code, settings or packages differ; machines may."""
    first: dict[str, _Source] = {}
    for source in sources:
        other = first.setdefault(source.facts.family, source)
        _demand_same(other.facts.identity, source.facts.identity, other.folder, source.folder)
    for source in first.values():
        one, two = ({name: each.facts.identity.get(name) for name in COMMON} for each in (sources[0], source))
        _demand_same(one, two, sources[0].folder, source.folder)
    (start, manifest), *others = manifests.items()
    for folder, other_manifest in others:
        _demand_same(_settings(manifest), _settings(other_manifest), start, folder)


def _settings(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration without the folders of families, which differ from machine to machine."""
    configuration = manifest["configuration"]
    families = {name: {**entry, "folder": ""} for name, entry in configuration["families"].items()}
    return {**configuration, "families": families}


def _demand_same(one: Mapping[str, Any], other: Mapping[str, Any], there: Path, here: Path) -> None:
    if one != other:
        texts = [f"{text} ({there} and {here})" for text in differences(one, other)]
        raise ConfigurationError(f"these are not parts of one campaign: {in_words(texts)}")


def _demand_all(sources: Sequence[_Source], manifests: Mapping[Path, Mapping[str, Any]]) -> None:
    """Raise ConfigurationError that names shards and scenes that are missing."""
    configuration = next(iter(manifests.values()))["configuration"]
    shards = [tuple(manifest.get("shard", (1, 1))) for manifest in manifests.values()]
    missing = [f"shard {i}/{n}" for n in {n for _, n in shards} for i in range(1, n + 1) if (i, n) not in shards]
    lost = missing_scenes(configuration, [source.facts for source in sources], range(configuration["scenes"]))
    if lost:
        which = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing" if missing else ""
        unfinished = "an interrupted command goes on when it is given again"
        raise ConfigurationError(f"{which or 'not all is done'}: scenes {lost} are not there; {unfinished}")


def _each_once(sources: Sequence[_Source]) -> list[tuple[_Source, list[int]]]:
    """Shards with those of their scenes that no shard before has; raises ConfigurationError where results differ."""
    owner: dict[tuple[str, int], _Source] = {}
    once = []
    for source in sources:
        family, own, shared = source.facts.family, [], dict[str, tuple[_Source, list[int]]]()
        for number in source.facts.scenes:
            other = owner.setdefault((family, number), source)
            if other is source:
                own.append(number)
            else:
                shared.setdefault(f"{other.folder} {other.name}", (other, []))[1].append(number)
        for other, scenes in shared.values():
            _demand_same_results(other, source, scenes)
        if own:
            once.append((source, own))
    return once


def _demand_same_results(one: _Source, other: _Source, scenes: list[int]) -> None:
    def alike(name: str, scenes: list[int]) -> bool:
        columns = [column.name for column in TABLES[name] if column.name not in TIMING]
        first, second = (source.table(name, scenes).select(columns) for source in (one, other))
        return bool(first.equals(second))

    for name in TABLES:
        if not alike(name, scenes):
            at = next(number for number in scenes if not alike(name, [number]))
            raise ConfigurationError(
                f"scene {at} of {one.facts.family} is in {one.folder} and in {other.folder}, with different {name}: "
                "one of them was changed, or the law is not the same from run to run"
            )


def _copy_trajectories(folders: Mapping[Path, Mapping[str, Any]], out: Path) -> int:
    """Of the trajectories that the folders hold, those that are kept of the whole; how many."""
    count = 0
    for keep in sorted({manifest.get("keep", "none") for manifest in folders.values()} - {"none"}):
        for key in chosen(out, keep):
            to = trajectory_file(out, key)
            at = next((file for folder in folders if (file := trajectory_file(folder, key)).is_file()), None)
            if at is not None and not to.exists():
                (out / TRAJECTORIES).mkdir(exist_ok=True)
                with replaced(to) as part:
                    shutil.copyfile(at, part)
                count += 1
    return count


def _merged_manifest(manifests: Sequence[Mapping[str, Any]], merged: Merged) -> dict[str, Any]:
    """The first manifest, with the folders' own entries on how they were made."""
    first = manifests[0]
    return {
        **{name: value for name, value in first.items() if name not in OWN},
        "version": VERSION,
        "merged": [{name: manifest[name] for name in OWN if name in manifest} for manifest in manifests],
        "machine": first.get("machine", {}),
        "process_time_s": sum(manifest.get("process_time_s", 0.0) for manifest in manifests),
        # nothing was run by this command: all scenes were there before
        **dict.fromkeys(("scenes", "finished", "stored_before"), merged.scenes),
        "runs": merged.runs,
        "trajectories": merged.trajectories,
        "shard": [1, 1],
    }
