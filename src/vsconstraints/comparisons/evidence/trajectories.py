"""Trajectories of some runs: which ones, is read from the scores; they are made again, which gives the same runs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ...scenarios.families import Drawn
from ..record import RunRecord
from ..runs.checksums import TRAJECTORIES
from ..runs.deadline import Deadline
from ..runs.keep import Keep, Kinds, kept_lines
from ..runs.pool import Failure
from .columns import RUNS
from .folder import MARK, shard_file, shard_names
from .parquet import read
from .task import Batch, Work
from .worker import Bench, drawn
from .workers import OpenWorkers

KINDS = Kinds(("family", "condition", "controller"), "scene", "family")


class RunKey(NamedTuple):
    """Which run it is."""

    family: str
    condition: str
    scene: int
    controller: str


def trajectory_file(folder: Path, key: RunKey) -> Path:
    """Where a run's trajectory is stored below a campaign's folder."""
    return folder / TRAJECTORIES / f"{key.family}--{key.condition}--{key.scene:07d}--{key.controller}.npz"


def chosen(folder: Path, keep: Keep) -> list[RunKey]:
    """The runs whose trajectories are to be kept, of those in a folder: the same in whatever order they were made.

    A run that left no sample, since its process died, say, has no trajectory.
    """
    if keep == "none":
        return []
    names = ("family", "condition", "scene", "controller", "status", "violation_depth", "duration_s")
    files = [shard_file(folder, MARK, name) for name in shard_names(folder)]
    lines = read(files, RUNS, names).to_pandas().dropna(subset="duration_s")
    lines = lines.sort_values(["family", "scene", "condition", "controller"], ignore_index=True)
    return [
        RunKey(*(line[name] for name in RunKey._fields)) for line in kept_lines(lines.to_dict("records"), keep, KINDS)
    ]


def keep_trajectories(folder: Path, keep: Keep, work: Work, workers: OpenWorkers) -> int:
    """Make the runs whose trajectories are to be kept once more, unless they are there; how many there are then.

    Those of other runs are removed, which another way to keep has left. Raises OSError.
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
    families = {family.name: family for family in work.campaign.families}
    calls = {at: (work.task(families[at[0]], [at[1]]), tuple(keys)) for at, keys in missing.items()}
    kept = len(wanted) - sum(map(len, missing.values()))
    if not calls:
        return kept
    with workers(made) as open_workers:
        for _, answer in open_workers.run(calls):
            # what cannot be made again is left out: its scores are there
            for key, record in {} if isinstance(answer, Failure) else answer.items():
                record.save(trajectory_file(folder, key))
                kept += 1
    return kept


def made(task: Batch, keys: tuple[RunKey, ...]) -> dict[RunKey, RunRecord]:
    """Make runs of one scene again: what workers do."""
    found: dict[RunKey, RunRecord] = {}
    entries = {entry.name: entry for entry in task.controllers}
    with Deadline(task.limit) as deadline:
        deadline.step()
        scene = drawn(task, task.scenes[0])
        if not isinstance(scene, Drawn):
            return found
        for condition in dict.fromkeys(key.condition for key in keys):
            bench = Bench(scene, condition)
            for key in keys:
                if key.condition == condition:
                    deadline.step()
                    found[key] = bench.run(entries[key.controller])
    return found
