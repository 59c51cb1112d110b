"""A campaign's folder: its shards, which record what is done, and the trajectories of some runs."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import ConfigurationError
from ...plugins.processes import deadline
from ...plugins.provenance import Files
from ...scenarios.reading import from_table
from ..record import RunRecord
from ..runs.files import SUMS, TRAJECTORIES, add_sums, remove_changed
from ..runs.folder import MANIFEST, Keep, kept_lines
from ..runs.pool import Failure, OpenWorkers
from . import parquet
from .campaign import Campaign, Identity, differences, in_words
from .own_files import changed, contents, own_folders
from .parquet import RUNS, TABLES
from .work import Batch, benches, task_of

MARK = "runs"  # the table that is written last: a shard is there when this part of it is
MAX_NAMED = 5  # ranges of scenes that a message names


@dataclass(frozen=True)
class Facts:
    """The footer of a shard: what its scenes depend on, the machine, number of runs, process time
    [s].

    ``files`` are hashes of what own parts have loaded or read, see :mod:`.own_files`.
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
        """The footer of a shard's part; raises ConfigurationError if it cannot be read."""
        table = parquet.facts_of(path)
        try:
            return from_table(cls, table, "its footer")
        except ConfigurationError as error:
            raise ConfigurationError(
                f"{path} cannot be read: it is no shard of a campaign ({error})"
            ) from error


class StoredShard(NamedTuple):
    """A shard of a folder: its name, its footer, and the path of the part that is written last."""

    folder: Path
    name: str
    facts: Facts
    path: Path

    def table(self, name: str, columns: Sequence[str] | None = None) -> Any:
        """The lines of one of its tables, of the named columns or all."""
        return parquet.read([shard_file(self.folder, name, self.name)], TABLES[name], columns)


def shard_file(folder: Path, table: str, name: str) -> Path:
    """Where a part of a shard is."""
    return folder / table / f"{name}.parquet"


def shard_names(folder: Path) -> list[str]:
    """Names of the shards in a folder, by family and scene."""
    return sorted(path.stem for path in (folder / MARK).glob("part-*.parquet"))


def shards(folder: Path) -> list[StoredShard]:
    """The shards in a folder, by family and scene; raises ConfigurationError if a footer cannot be
    read.
    """
    paths = [shard_file(folder, MARK, name) for name in shard_names(folder)]
    return [StoredShard(folder, path.stem, Facts.of(path), path) for path in paths]


def stored_files(folder: Path) -> list[Path]:
    """The files that a campaign consists of, reports apart: its manifest, then those that are
    written once.
    """
    parts = (path for table in TABLES for path in sorted((folder / table).glob("part-*.parquet")))
    return [folder / MANIFEST, *parts, *sorted((folder / TRAJECTORIES).glob("*.npz"))]


def write_parts(folder: Path, name: str, tables: Mapping[str, Any], facts: Facts) -> None:
    """Write a shard's parts, the mark last; raises OSError."""
    for table in sorted(TABLES, key=lambda table: table == MARK):
        (folder / table).mkdir(exist_ok=True)
        parquet.write(shard_file(folder, table, name), tables[table], vars(facts))
    add_sums(folder, (shard_file(folder, table, name) for table in TABLES))


def what_is_there(folder: Path, campaign: Campaign) -> list[Facts]:
    """What is done of a campaign, by shard; what was left unfinished, or was changed, is removed.

    Raises ConfigurationError if the folder holds scenes that are no part of this campaign or were
    made otherwise.
    """
    for path in list(folder.rglob("*.part")):
        path.unlink(missing_ok=True)
    remove_changed(folder, stored_files(folder)[1:])
    whole = set()
    for name in shard_names(folder):
        with suppress(ConfigurationError):  # one that was cut off has no footer
            for table in TABLES:
                parquet.line_count(shard_file(folder, table, name))
            whole.add(name)
    for path in stored_files(folder):
        if path.suffix == ".parquet" and path.stem not in whole:
            path.unlink()
    identities = campaign.identities()
    problems = list[str]()
    there = [shard.facts for shard in shards(folder)]
    for facts in there:
        only = [] if facts.family in identities else [f"family {facts.family} is only there"]
        problems = problems or only or list(differences(facts.identity, identities[facts.family]))
    problems = problems or _changed_files(there, campaign)
    last = max((max(facts.scenes) for facts in there), default=-1)
    if not problems and last >= campaign.scenes:
        problems = [f"it has scenes up to number {last}: give --scenes {last + 1} or more"]
    if problems:
        instead = "Give another folder with --out, or --fresh to replace what is there"
        raise ConfigurationError(
            f"{folder} holds evidence of another campaign: {in_words(problems)}. {instead}"
        )
    return there


def _changed_files(there: Iterable[Facts], campaign: Campaign) -> list[str]:
    """Sentences that name the own files which are not what the stored shards were made with."""
    folders = own_folders(campaign.controllers, campaign.families)
    files: Files = {}
    for facts in there:
        files.update(facts.files)
    return [
        f"the content of {name} is another one now"
        for name in changed(files, contents(files, folders))
    ]


def demand_same_files(stored: Iterable[StoredShard]) -> None:
    """Raise ConfigurationError if shards were made with different contents of an own file."""
    first: dict[str, StoredShard] = {}
    for shard in stored:
        for name, content in shard.facts.files.items():
            other = first.setdefault(name, shard)
            if other.facts.files[name] != content:
                made = f"{other.path} and {shard.path} were made with different contents of {name}"
                why = "which own parts have loaded or read"
                raise ConfigurationError(f"these are not parts of one campaign: {made}, {why}")


def clear(folder: Path) -> None:
    """Remove everything that a campaign left."""
    for name in (*TABLES, TRAJECTORIES):
        shutil.rmtree(folder / name, ignore_errors=True)
    (folder / SUMS).unlink(missing_ok=True)


def missing_scenes(configuration: Mapping[str, Any], there: Iterable[Facts], wanted: range) -> str:
    """Families with those of the wanted scenes that no shard has, in words; empty if none is
    missing.
    """
    missing = {name: set(wanted) for name in configuration["families"]}
    for facts in there:
        missing[facts.family].difference_update(facts.scenes)
    lost = []
    for name, numbers in missing.items():
        firsts, lasts = (sorted(n for n in numbers if n + step not in numbers) for step in (-1, 1))
        lost += [f"{name} {first}–{last}" for first, last in zip(firsts, lasts, strict=True)]
    return f"{', '.join(lost[:MAX_NAMED])}{' and more' if len(lost) > MAX_NAMED else ''}"


class RunKey(NamedTuple):
    """What identifies a run."""

    family: str
    condition: str
    scene: int
    controller: str


def trajectory_file(folder: Path, key: RunKey) -> Path:
    """Where a run's trajectory is stored below a campaign's folder."""
    return (
        folder
        / TRAJECTORIES
        / f"{key.family}--{key.condition}--{key.scene:07d}--{key.controller}.npz"
    )


def chosen(folder: Path, keep: Keep) -> list[RunKey]:
    """The runs whose trajectories are kept, of those in a folder that left a sample: whatever order
    they came in.
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
    """Repeat the runs whose trajectories are kept and missing, and remove those of others; how many
    there are then.
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
        at: (task_of(campaign, families[at[0]], [at[1]], limit), keys)
        for at, keys in missing.items()
    }
    if calls:
        with workers(rerun) as open_workers:
            for _, answer in open_workers.run(calls):
                # what cannot be repeated is left out: its scores are there
                for key, record in {} if isinstance(answer, Failure) else answer.items():
                    record.save(trajectory_file(folder, key))
    return sum(path.exists() for path in wanted)


def rerun(task: Batch, keys: list[RunKey]) -> dict[RunKey, RunRecord]:
    """Repeat runs of one scene: what workers do."""
    records: dict[RunKey, RunRecord] = {}
    entries = {entry.name: entry for entry in task.controllers}
    with deadline(task.limit) as step:
        step()
        _, there = benches(task, task.scenes[0])
        for key in sorted(
            keys if there else (), key=lambda key: task.conditions.index(key.condition)
        ):
            step()
            records[key] = there[key.condition].run(entries[key.controller])
    return records
