"""Merge folders of one campaign into one, so that every scene is stored exactly once."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from ...comparisons.runs.files import TRAJECTORIES, replaced, require_unchanged
from ...comparisons.runs.folder import locked, manifest_of
from ...comparisons.runs.store import Store
from ...errors import ConfigurationError
from ...plugins.registry import packages_with_metrics
from . import parquet
from .folder import (
    MARK,
    StoredBatch,
    batch_file,
    chosen,
    clear,
    stored_files,
    trajectory_file,
    write_batch,
)
from .parquet import column_names
from .stored import Evidence
from .together import combined_manifest

#: Results that remain if a file of the merged campaign cannot be written.
KEPT = "the merged folders are unchanged, and the same command merges them again"


class Merged(NamedTuple):
    """Numbers of merged scenes, runs and trajectories, and the remarks on the folders."""

    scenes: int
    runs: int
    trajectories: int
    remarks: tuple[str, ...] = ()


def merge(out: Path, folders: Sequence[Path]) -> Merged:
    """Merge folders of one campaign into ``out``.

    ``out`` is a new or empty folder, or that of an earlier merge, which is replaced. Raises
    ConfigurationError, before anything is written, if the folders cannot be read as one campaign,
    see :meth:`.Evidence.load`, if scenes are missing, or if tables have columns of metrics that are
    not installed. Raises StorageError if a file cannot be written.
    """
    if not folders:
        raise ConfigurationError(
            "there is nothing to merge: give the folders to merge after the output folder"
        )
    evidence = Evidence.load(folders)
    for folder, manifest in evidence.manifests.items():
        trajectories = (folder / TRAJECTORIES).glob("*.npz")
        require_unchanged(folder, trajectories, "finished" in manifest, all_there=True)
    _require_all(evidence)
    for batch in evidence.batches:
        _require_known_columns(batch)
    if manifest_of(out) and "merged" not in manifest_of(out):
        raise ConfigurationError(f"{out} already holds results: give an empty or new folder")
    if out.resolve() in {folder.resolve() for folder in folders}:
        raise ConfigurationError(
            f"{out} is one of the folders to merge: give another output folder"
        )
    with locked(out, "evidence"):
        store = Store(out, "evidence", stored_files, kept=KEPT)
        clear(out)
        scenes = 0
        runs = 0
        with store.storing():
            for batch in evidence.batches:
                tables = {name: batch.table(name) for name in parquet.tables()}
                n_runs = tables[MARK].num_rows
                facts = replace(batch.facts, scenes=batch.scenes, runs=n_runs)
                write_batch(out, batch.name_of_scenes, tables, facts)
                scenes += tables["scenes"].num_rows
                runs += n_runs
            copied = _copy_trajectories(evidence, out)
        manifest = combined_manifest(evidence.manifests, evidence.batches)
        manifest["trajectories"] = copied
        store.finish(**manifest)
    return Merged(scenes, runs, copied, evidence.remarks)


def _require_all(evidence: Evidence) -> None:
    """Raise ConfigurationError that names missing shards and scenes."""
    configuration = evidence.manifest["configuration"]
    lost = evidence.missing_scenes(range(configuration["scenes"]))
    if not lost:
        return
    shards = []
    for manifest in evidence.manifests.values():
        shards.append(tuple(manifest.get("shard", (1, 1))))
    missing = []
    for of in {of for _, of in shards}:
        for number in range(1, of + 1):
            if (number, of) not in shards:
                missing.append(f"shard {number}/{of}")
    problem = "the campaign is incomplete"
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        problem = f"{', '.join(missing)} {verb} missing"
    unfinished = "to continue an interrupted command, give it again"
    raise ConfigurationError(f"{problem}: scenes {lost} are missing; {unfinished}")


def _require_known_columns(batch: StoredBatch) -> None:
    """Raise ConfigurationError if a table has columns that would be lost, with the remedy."""
    for name, columns in parquet.tables().items():
        path = batch_file(batch.folder, name, batch.name)
        known = {column.name for column in columns}
        unknown = [column for column in column_names(path) if column not in known]
        if not unknown:
            continue
        installed = packages_with_metrics()
        packages = []
        for package, version in batch.facts.identity.get("metrics", {}).items():
            if installed.get(package) != version:
                packages.append(f"{package} {version}")
        remedy = "merge with the version that wrote it"
        if packages:
            remedy = f"install {', '.join(packages)}, and merge again"
        raise ConfigurationError(
            f"{path} has columns that are unknown here and would be lost: {', '.join(unknown)}; "
            f"{remedy}"
        )


def _copy_trajectories(evidence: Evidence, out: Path) -> int:
    """Copy the trajectories that the merged campaign keeps, and return their number.

    The rule of each folder (``keep``) is applied to all runs. Trajectories that no folder holds are
    skipped.
    """
    count = 0
    rules = {manifest.get("keep", "none") for manifest in evidence.manifests.values()}
    for keep in sorted(rules - {"none"}):
        for key in chosen(out, keep):
            target = trajectory_file(out, key)
            files = [trajectory_file(folder, key) for folder in evidence.manifests]
            sources = [file for file in files if file.is_file()]
            if sources and not target.exists():
                target.parent.mkdir(exist_ok=True)
                with replaced(target) as part:
                    shutil.copyfile(sources[0], part)
                count += 1
    return count
