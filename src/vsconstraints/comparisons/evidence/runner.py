"""Runs a campaign on any kind of workers; every shard is stored as soon as it is there."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...compiled import prepare
from ..runs.checksums import seal
from ..runs.files import storing, write_json
from ..runs.folder import MANIFEST, held, manifest_of
from ..runs.keep import Keep, demand_keep
from ..runs.machine import loaded_versions, made_by, used_versions
from ..runs.pool import Failure
from ..runs.signals import INTERRUPTS, signal_of
from .campaign import Campaign
from .folder import clear, stored_files, what_is_there, write_shard
from .pieces import by_pieces
from .progress import Finished, Progress
from .task import Batch, Shard, Work
from .trajectories import keep_trajectories
from .worker import Part, scored
from .workers import OpenWorkers, Workers, processes

OF_WORK = ("wall_time_s", "runs_per_s")
"""Of a manifest: how long the command took that made runs last, and how many a second they were."""

OnProgress = Callable[[Progress], None]
"""Told how far a campaign is, first of all and after every task."""


@dataclass(frozen=True)
class Plan:
    """How a campaign is carried out; it changes none of its results.

    Attributes
    ----------
    shard
        Which part of the scenes.
    keep
        Whose trajectories are kept.
    limit
        How long a run may take [s]; by its number of samples if None.
    fresh
        Whether what the folder holds is replaced.
    workers
        Who makes the runs.
    """

    shard: Shard = field(default_factory=Shard)
    keep: Keep = "none"
    limit: float | None = None
    fresh: bool = False
    workers: OpenWorkers = field(default_factory=processes)


def collect(
    campaign: Campaign,
    folder: Path,
    plan: Plan | None = None,
    *,
    command: Sequence[str] = (),
    on_progress: OnProgress = lambda progress: None,
) -> Finished:
    """Run a campaign, and store its shards below ``folder``; scenes that are there already are not run again.

    Parameters
    ----------
    campaign
        What is run.
    folder
        Where to; made if it is not there.
    plan
        How.
    command
        What the user typed, for the manifest.
    on_progress
        Told how far it is, first of all and after every task.

    Raises
    ------
    ConfigurationError
        if the folder cannot be used, or a family has no scene.
    StorageError
        if something cannot be written; what is there stays.
    """
    plan = plan or Plan()
    demand_keep(plan.keep)
    with held(folder, "evidence"):
        started = time.perf_counter()
        folder = folder.absolute()  # own parts may change the working directory
        if plan.fresh:
            clear(folder)
        there = what_is_there(folder, campaign)
        work = Work(campaign, plan.shard, plan.limit, there.scenes)
        tasks = work.tasks()
        for family in {task.family.name: task.family for task in tasks.values()}.values():
            family.demand_scenes(campaign.half, campaign.seed)
        prepare()
        manifest = _manifest(campaign, plan, command)
        # of a command that finds all done, these stay what they were
        manifest |= {name: value for name, value in manifest_of(folder).items() if name in OF_WORK}
        with storing("evidence", folder):
            seal(folder, stored_files(folder)[1:])
            write_json(folder / MANIFEST, manifest)
        stored = sum(map(len, there.scenes.values()))
        progress = Progress(stored + sum(len(task.scenes) for task in tasks.values()), stored, stored)
        on_progress(progress)
        interrupted = kept = 0
        try:
            if tasks:
                with plan.workers(scored) as workers:
                    _carry_out(tasks, workers, _Store(campaign, folder, progress, on_progress))
            with storing("evidence", folder):
                kept = keep_trajectories(folder, plan.keep, work, plan.workers)
        except INTERRUPTS as interrupt:
            interrupted = signal_of(interrupt)
        finished = Finished(folder, progress, time.perf_counter() - started, kept, interrupted)
        if progress.runs:
            manifest.update(wall_time_s=finished.wall_time, runs_per_s=finished.rate)
        manifest.update(
            process_time_s=there.seconds + progress.seconds,
            runs=there.runs + progress.runs,
            scenes=progress.scenes,
            finished=progress.done,
            stored_before=stored,
            trajectories=kept,
            loaded=loaded_versions(),
        )
        with storing("evidence", folder):
            write_json(folder / MANIFEST, manifest)
            seal(folder, stored_files(folder))
        return finished


class _Store:
    """Takes what tasks come to: writes it, counts it, and forgets it."""

    def __init__(self, campaign: Campaign, folder: Path, progress: Progress, on_progress: OnProgress) -> None:
        self._identities = campaign.identities()
        self._folder, self._progress, self._on_progress = folder, progress, on_progress

    def __call__(self, task: Batch, part: Part) -> None:
        with storing("evidence", self._folder):
            write_shard(self._folder, task, part, self._identities[task.family.name])
        self._progress.add(task, part)
        self._on_progress(self._progress)


def _carry_out(tasks: Mapping[str, Batch], workers: Workers, store: Callable[[Batch, Part], None]) -> None:
    """Store what every task comes to; what no worker survives is made again by pieces when all others are done."""
    broken = []
    for name, answer in workers.run({name: (task,) for name, task in tasks.items()}, again=False):
        if isinstance(answer, Failure):
            broken.append(tasks[name])
        else:
            store(tasks[name], answer)
    for task, part in by_pieces(broken, workers):
        store(task, part)


def _manifest(campaign: Campaign, plan: Plan, command: Sequence[str]) -> dict[str, Any]:
    configuration = campaign.resolved()
    return {
        **made_by(command, used_versions(configuration)),
        "seed": campaign.seed,
        "shard": [plan.shard.number, plan.shard.of],
        "keep": plan.keep,
        "configuration": configuration,
    }
