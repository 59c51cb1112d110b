"""Folder of a campaign: shards, which record the finished scenes, and some trajectories."""

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
from .own_files import changed, contents, own_folders
from .parquet import RUNS, TABLES
from .work import Batch, benches, make_batch, shard_name

MARK = "runs"  # the table that is written last: a shard is complete if it has this part


@dataclass(frozen=True)
class Facts:
    """Footer of a shard: identity of its scenes, machine, number of runs and process time [s].

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
        """Read the footer of a part of a shard. Raises ConfigurationError if it is unreadable."""
        table = parquet.facts_of(path)
        try:
            return from_table(cls, table, "its footer")
        except ConfigurationError as error:
            raise ConfigurationError(
                f"{path} cannot be read: it is not a shard of a campaign ({error})"
            ) from error


class StoredShard(NamedTuple):
    """Shard of a folder: name, footer, and path of the part that is written last.

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

    def of(self, scenes: Sequence[int]) -> StoredShard:
        """Return the shard with only these scenes."""
        return self._replace(scenes=tuple(scenes))

    @property
    def name_of_scenes(self) -> str:
        """Name of a shard that has only the scenes that are read."""
        return self.name if self.whole else shard_name(self.facts.family, self.scenes)

    def table(self, name: str, columns: Sequence[str] | None = None) -> Any:
        """Read one table of the shard, with the named columns or all."""
        names = columns if columns is None or self.whole else [*columns, "scene"]
        lines = parquet.read([shard_file(self.folder, name, self.name)], TABLES[name], names)
        if not self.whole:
            wanted = set(self.scenes)
            lines = lines.filter([number in wanted for number in lines["scene"].to_pylist()])
        return lines if columns is None else lines.select(columns)


def shard_file(folder: Path, table: str, name: str) -> Path:
    """Return the path of a part of a shard."""
    return folder / table / f"{name}.parquet"


def shard_names(folder: Path) -> list[str]:
    """Return the names of the shards in a folder, ordered by family and scene."""
    return sorted(path.stem for path in (folder / MARK).glob("part-*.parquet"))


def shards(folder: Path) -> list[StoredShard]:
    """Return the shards in a folder, ordered by family and scene.

    Raises ConfigurationError if a footer cannot be read.
    """
    return [_stored_shard(folder, name) for name in shard_names(folder)]


def _stored_shard(folder: Path, name: str) -> StoredShard:
    path = shard_file(folder, MARK, name)
    facts = Facts.of(path)
    return StoredShard(folder, name, facts, path, facts.scenes)


def files_of(shards: Iterable[Facts]) -> Files:
    """Return hashes of the files that custom parts loaded or read when shards were made."""
    files: Files = {}
    for facts in shards:
        files.update(facts.files)
    return files


def stored_files(folder: Path) -> list[Path]:
    """Return the files of a campaign except reports.

    The manifest comes first, followed by the files that are written once.
    """
    parts = (path for table in TABLES for path in sorted((folder / table).glob("part-*.parquet")))
    return [folder / MANIFEST, *parts, *sorted((folder / TRAJECTORIES).glob("*.npz"))]


def write_parts(folder: Path, name: str, tables: Mapping[str, Any], facts: Facts) -> None:
    """Write the parts of a shard, the table that marks it as complete last. Raises OSError."""
    for table in sorted(TABLES, key=lambda table: table == MARK):
        (folder / table).mkdir(exist_ok=True)
        parquet.write(shard_file(folder, table, name), tables[table], vars(facts))
    add_sums(folder, (shard_file(folder, table, name) for table in TABLES))


def finished_shards(folder: Path, campaign: Campaign) -> list[Facts]:
    """Return the footers of the finished shards of a campaign.

    Unfinished shards and changed files are removed. Raises ConfigurationError if the folder holds
    scenes of another campaign, or scenes that were run with different code, settings or files;
    nothing is removed then.
    """
    problems = _differences([shard.facts for shard in _complete_shards(folder)], campaign)
    if problems:
        instead = "Give another folder with --out, or --fresh to replace the folder's content"
        raise ConfigurationError(
            f"{folder} holds evidence of another campaign: {in_words(problems)}. {instead}"
        )
    for path in list(folder.rglob("*.part")):
        path.unlink(missing_ok=True)
    remove_changed(folder, stored_files(folder)[1:])
    complete = _complete_shards(folder)  # again: a changed file was removed with its shard
    names = {shard.name for shard in complete}
    for path in stored_files(folder):
        if path.suffix == ".parquet" and path.stem not in names:
            path.unlink()
    return [shard.facts for shard in complete]


def _complete_shards(folder: Path) -> list[StoredShard]:
    """Return the shards of which every table can be read."""
    complete = []
    for name in shard_names(folder):
        with suppress(ConfigurationError):  # a truncated file has no footer
            for table in TABLES:
                parquet.line_count(shard_file(folder, table, name))
            complete.append(_stored_shard(folder, name))
    return complete


def _differences(stored: Sequence[Facts], campaign: Campaign) -> list[str]:
    """Describe how stored shards differ from a campaign; empty if they do not.

    Only the first kind of difference is described: identity of a shard, files, number of scenes.
    """
    identities = campaign.identities()
    for facts in stored:
        if facts.family not in identities:
            return [f"family {facts.family} is only there"]
        different = list(differences(facts.identity, identities[facts.family]))
        if different:
            return different
    changed_files = _changed_files(stored, campaign)
    if changed_files:
        return changed_files
    last = max((max(facts.scenes) for facts in stored), default=-1)
    if last >= campaign.scenes:
        return [f"it has scenes up to number {last}: give --scenes {last + 1} or more"]
    return []


def _changed_files(stored: Iterable[Facts], campaign: Campaign) -> list[str]:
    """Return a sentence for each custom file that changed since a stored shard was made."""
    folders = own_folders(campaign.controllers, campaign.families)
    files = files_of(stored)
    return [
        f"the content of {name} has changed" for name in changed(files, contents(files, folders))
    ]


def require_same_files(stored: Iterable[StoredShard]) -> None:
    """Raise ConfigurationError if shards were made with different contents of a custom file."""
    first: dict[str, StoredShard] = {}
    for shard in stored:
        for name, content in shard.facts.files.items():
            other = first.setdefault(name, shard)
            if other.facts.files[name] != content:
                made = f"{other.path} and {shard.path} were made with different contents of {name}"
                why = "which custom parts have loaded or read"
                raise ConfigurationError(f"these are not parts of one campaign: {made}, {why}")


def clear(folder: Path) -> None:
    """Remove all tables, trajectories and checksums of a campaign."""
    for name in (*TABLES, TRAJECTORIES):
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
    return (
        folder
        / TRAJECTORIES
        / f"{key.family}--{key.condition}--{key.scene:07d}--{key.controller}.npz"
    )


def chosen(folder: Path, keep: Keep) -> list[RunKey]:
    """Return the runs whose trajectories are kept, out of those with at least one sample.

    The choice does not depend on the order in which runs were stored.
    """
    if keep == "none":
        return []
    files = [shard_file(folder, MARK, name) for name in shard_names(folder)]
    names = (*RunKey._fields, "status", "violation_depth", "duration_s")
    lines = parquet.read(files, RUNS, names).to_pandas().dropna(subset="duration_s")
    lines = lines.sort_values(
        ["family", "scene", "condition", "controller"], ignore_index=True
    ).to_dict("records")
    kept = kept_lines(lines, keep, ("family", "condition", "controller"), ("family", "scene"))
    return [RunKey(*(line[name] for name in RunKey._fields)) for line in kept]


def keep_trajectories(
    folder: Path, keep: Keep, campaign: Campaign, limit: float | None, workers: OpenWorkers
) -> int:
    """Repeat runs whose trajectories are to be kept but missing, and remove all other trajectories.

    Returns the number of trajectories that are stored afterwards. If ``keep`` is "none", nothing is
    repeated or removed.
    """
    if keep == "none":
        return 0
    wanted = {trajectory_file(folder, key): key for key in chosen(folder, keep)}
    (folder / TRAJECTORIES).mkdir(exist_ok=True)
    for path in set((folder / TRAJECTORIES).glob("*.npz")).difference(wanted):
        path.unlink()
    missing: dict[tuple[str, int], list[RunKey]] = {}
    for path, key in wanted.items():
        if not path.exists():
            missing.setdefault((key.family, key.scene), []).append(key)
    families = {family.name: family for family in campaign.families}
    calls = {
        at: (make_batch(campaign, families[at[0]], [at[1]], limit), keys)
        for at, keys in missing.items()
    }
    if calls:
        with workers(rerun) as open_workers:
            for _, answer in open_workers.run(calls):
                # runs that cannot be repeated are left out: their scores are stored
                for key, record in {} if isinstance(answer, Failure) else answer.items():
                    record.save(trajectory_file(folder, key))
    return sum(path.exists() for path in wanted)


def rerun(task: Batch, keys: list[RunKey]) -> dict[RunKey, RunRecord]:
    """Repeat runs of one scene. Workers call this function."""
    records: dict[RunKey, RunRecord] = {}
    entries = {entry.name: entry for entry in task.controllers}
    with deadline(task.limit) as step:
        step()
        _, by_condition = benches(task, task.scenes[0])
        for key in sorted(
            keys if by_condition else (), key=lambda key: task.conditions.index(key.condition)
        ):
            step()
            records[key] = by_condition[key.condition].run(entries[key.controller])
    return records
