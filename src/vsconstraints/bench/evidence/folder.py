"""Folder of a campaign: batches, which record the finished scenes, and some trajectories."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ...comparisons.record import RunRecord
from ...comparisons.runs.files import SUMS, TRAJECTORIES, add_sums, remove_changed
from ...comparisons.runs.folder import MANIFEST, Keep, kept_lines
from ...comparisons.runs.identity import Identity, differences, in_words
from ...comparisons.runs.pool import Failure, OpenWorkers
from ...errors import ConfigurationError
from ...plugins.processes import deadline
from ...plugins.provenance import Files
from ...scenarios.reading import from_table
from . import parquet
from .campaign import Campaign
from .own_files import changed, current_hashes, own_folders
from .work import Batch, batch_name, benches, make_batch

MARK = "runs"  # the table that is written last: a batch is complete if it has this file


@dataclass(frozen=True)
class Facts:
    """Footer of a batch: identity of its scenes, machine, number of runs and process time [s].

    ``files`` are hashes of files that custom parts loaded or read, see :mod:`.own_files`.
    """

    family: str
    scenes: tuple[int, ...]
    identity: Identity
    machine: dict[str, Any]
    runs: int
    seconds: float
    files: Files = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path) -> Facts:
        """Read the footer of a file of a batch. Raises ConfigurationError if it is unreadable."""
        table = parquet.facts_of(path)
        try:
            return from_table(cls, table, "its footer")
        except ConfigurationError as error:
            raise ConfigurationError(
                f"{path} cannot be read: it is not a batch of a campaign ({error})"
            ) from error


class StoredBatch(NamedTuple):
    """Batch of a folder: name, footer, and path of the file that is written last.

    ``scenes`` are those that are read; the others are read from another folder.
    """

    folder: Path
    name: str
    facts: Facts
    path: Path
    scenes: tuple[int, ...]

    @property
    def whole(self) -> bool:
        """True if all scenes are read."""
        return self.scenes == self.facts.scenes

    def of(self, scenes: Sequence[int]) -> StoredBatch:
        """Return the batch with only these scenes."""
        return self._replace(scenes=tuple(scenes))

    @property
    def name_of_scenes(self) -> str:
        """Name of a batch that has only the scenes that are read."""
        if self.whole:
            return self.name
        return batch_name(self.facts.family, self.scenes)

    def table(self, name: str, columns: Sequence[str] | None = None) -> Any:
        """Read one table of the batch, with the named columns or all."""
        names = columns
        if columns is not None and not self.whole:
            names = [*columns, "scene"]
        file = batch_file(self.folder, name, self.name)
        lines = parquet.read([file], parquet.tables()[name], names)
        if not self.whole:
            wanted = set(self.scenes)
            is_wanted = [number in wanted for number in lines["scene"].to_pylist()]
            lines = lines.filter(is_wanted)
        return lines if columns is None else lines.select(columns)


def batch_file(folder: Path, table: str, name: str) -> Path:
    """Return the path of the file with a table of a batch."""
    return folder / table / f"{name}.parquet"


def batch_names(folder: Path) -> list[str]:
    """Return the names of the batches in a folder, ordered by family and scene."""
    files = (folder / MARK).glob("part-*.parquet")
    return sorted(path.stem for path in files)


def stored_batches(folder: Path) -> list[StoredBatch]:
    """Return the batches in a folder, ordered by family and scene.

    Raises ConfigurationError if a footer cannot be read.
    """
    return [_stored_batch(folder, name) for name in batch_names(folder)]


def _stored_batch(folder: Path, name: str) -> StoredBatch:
    path = batch_file(folder, MARK, name)
    facts = Facts.of(path)
    return StoredBatch(folder, name, facts, path, facts.scenes)


def files_of(batches: Iterable[Facts]) -> Files:
    """Return hashes of the files that custom parts loaded or read when batches were made."""
    files: Files = {}
    for facts in batches:
        files.update(facts.files)
    return files


def stored_files(folder: Path) -> list[Path]:
    """Return the files of a campaign except reports.

    The manifest comes first, followed by the files that are written once.
    """
    files = [folder / MANIFEST]
    for table in parquet.tables():
        files += sorted((folder / table).glob("part-*.parquet"))
    files += sorted((folder / TRAJECTORIES).glob("*.npz"))
    return files


def write_batch(folder: Path, name: str, tables: Mapping[str, Any], facts: Facts) -> None:
    """Write the files of a batch, the table that marks it as complete last. Raises OSError."""
    files = []
    for table in sorted(parquet.tables(), key=lambda table: table == MARK):
        file = batch_file(folder, table, name)
        file.parent.mkdir(exist_ok=True)
        parquet.write(file, tables[table], vars(facts))
        files.append(file)
    add_sums(folder, files)


def finished_batches(folder: Path, campaign: Campaign) -> list[Facts]:
    """Return the footers of the finished batches of a campaign.

    Unfinished batches and changed files are removed. Raises ConfigurationError if the folder holds
    scenes of another campaign, or scenes that were run with different code, settings or files;
    nothing is removed then.
    """
    stored = [batch.facts for batch in _complete_batches(folder)]
    problems = _differences(stored, campaign)
    if problems:
        instead = "Give another folder with --out, or --fresh to replace the folder's content"
        raise ConfigurationError(
            f"{folder} holds evidence of another campaign: {in_words(problems)}. {instead}"
        )
    for path in list(folder.rglob("*.part")):
        path.unlink(missing_ok=True)
    remove_changed(folder, stored_files(folder)[1:])
    complete = {}  # again: a changed file was removed with its batch
    for batch in _complete_batches(folder):
        complete[batch.name] = batch.facts
    for path in stored_files(folder):
        if path.suffix == ".parquet" and path.stem not in complete:
            path.unlink()
    return list(complete.values())


def _complete_batches(folder: Path) -> list[StoredBatch]:
    """Return the batches of which every table can be read."""
    complete = []
    for name in batch_names(folder):
        with suppress(ConfigurationError):  # a truncated file has no footer
            for table in parquet.tables():
                parquet.line_count(batch_file(folder, table, name))
            complete.append(_stored_batch(folder, name))
    return complete


def _differences(stored: Sequence[Facts], campaign: Campaign) -> list[str]:
    """Describe how stored batches differ from a campaign; empty if they do not.

    Only the first kind of difference is described: identity of a batch, files, number of scenes.
    """
    identities = campaign.identities()
    for facts in stored:
        if facts.family not in identities:
            return [f"family {facts.family} is only there"]
        different = list(differences(facts.identity, identities[facts.family]))
        if different:
            return different
    changed_files = content_changes(files_of(stored), campaign)
    if changed_files:
        return changed_files
    last_scenes = [max(facts.scenes) for facts in stored]
    last = max(last_scenes, default=-1)
    if last >= campaign.scenes:
        return [f"it has scenes up to number {last}: give --scenes {last + 1} or more"]
    return []


def content_changes(files: Files, campaign: Campaign) -> list[str]:
    """Return a sentence for each custom file of a campaign that has other content now."""
    folders = own_folders(campaign.controllers, campaign.families)
    now = current_hashes(files, folders)
    return [f"the content of {name} has changed" for name in changed(files, now)]


def require_same_files(stored: Iterable[StoredBatch]) -> None:
    """Raise ConfigurationError if batches were made with different contents of a custom file."""
    first: dict[str, StoredBatch] = {}
    for batch in stored:
        for name, content in batch.facts.files.items():
            other = first.setdefault(name, batch)
            if other.facts.files[name] != content:
                made = f"{other.path} and {batch.path} were made with different contents of {name}"
                why = "which custom parts have loaded or read"
                raise ConfigurationError(f"these are not parts of one campaign: {made}, {why}")


def clear(folder: Path) -> None:
    """Remove all tables, trajectories and checksums of a campaign."""
    for name in (*parquet.tables(), TRAJECTORIES):
        shutil.rmtree(folder / name, ignore_errors=True)
    (folder / SUMS).unlink(missing_ok=True)


class RunKey(NamedTuple):
    """Key of a run."""

    family: str
    condition: str
    scene: int
    controller: str


def trajectory_file(folder: Path, key: RunKey) -> Path:
    """Return the path of the trajectory of a run."""
    name = f"{key.family}--{key.condition}--{key.scene:07d}--{key.controller}.npz"
    return folder / TRAJECTORIES / name


def chosen(folder: Path, keep: Keep) -> list[RunKey]:
    """Return the runs whose trajectories are kept, out of those with at least one sample.

    The choice does not depend on the order in which runs were stored.
    """
    if keep == "none":
        return []
    files = [batch_file(folder, MARK, name) for name in batch_names(folder)]
    names = (*RunKey._fields, "status", "violation_depth", "duration_s")
    # runs without a sample have no duration
    columns = parquet.tables()["runs"]
    runs = parquet.read(files, columns, names).to_pandas().dropna(subset="duration_s")
    order = ["family", "scene", "condition", "controller"]
    lines = runs.sort_values(order, ignore_index=True).to_dict("records")
    group = ("family", "condition", "controller")
    kept = kept_lines(lines, keep, group, ("family", "scene"))
    keys = []
    for line in kept:
        cells = {name: line[name] for name in RunKey._fields}
        keys.append(RunKey(**cells))
    return keys


def keep_trajectories(
    folder: Path, keep: Keep, campaign: Campaign, limit: float | None, workers: OpenWorkers
) -> int:
    """Repeat runs whose trajectories are to be kept but missing, and remove all other trajectories.

    Returns the number of trajectories that are stored afterwards. If ``keep`` is "none", nothing is
    repeated or removed. ``limit`` is the time limit of a run [s]; None is that of each law.
    """
    if keep == "none":
        return 0
    trajectories = folder / TRAJECTORIES
    trajectories.mkdir(exist_ok=True)
    wanted = {trajectory_file(folder, key): key for key in chosen(folder, keep)}
    for path in set(trajectories.glob("*.npz")).difference(wanted):
        path.unlink()
    missing: dict[tuple[str, int], list[RunKey]] = {}
    for path, key in wanted.items():
        if not path.exists():
            of_scene = missing.setdefault((key.family, key.scene), [])
            of_scene.append(key)
    families = {family.name: family for family in campaign.families}
    calls = {}
    for (family, scene), keys in missing.items():
        batch = make_batch(campaign, families[family], [scene], limit)
        calls[family, scene] = batch, keys
    if calls:
        with workers(rerun) as open_workers:
            for _, answer in open_workers.run(calls):
                if isinstance(answer, Failure):
                    continue  # runs that cannot be repeated are left out: their scores are stored
                for key, record in answer.items():
                    record.save(trajectory_file(folder, key))
    return sum(path.exists() for path in wanted)


def rerun(batch: Batch, keys: list[RunKey]) -> dict[RunKey, RunRecord]:
    """Repeat runs of one scene. Workers call this function."""
    records: dict[RunKey, RunRecord] = {}
    entries = {entry.name: entry for entry in batch.controllers}
    with deadline(batch.drawing_limit):
        _, bench_of = benches(batch, batch.scenes[0])
    if not bench_of:
        return records

    def place(key: RunKey) -> int:
        return batch.conditions.index(key.condition)

    # runs in the same condition share a setup
    for key in sorted(keys, key=place):
        entry = entries[key.controller]
        with deadline(batch.run_limit(entry)):
            records[key] = bench_of[key.condition].run(entry)
    return records
