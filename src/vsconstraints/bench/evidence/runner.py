"""Run a campaign on any kind of workers, and store each shard as soon as it is finished."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...comparisons.runs.folder import Keep, locked, manifest_of, parse_keep
from ...comparisons.runs.machine import loaded_versions, machine, new_manifest
from ...comparisons.runs.pool import Failure, OpenWorkers, Workers, processes
from ...comparisons.runs.spec import BASELINE, prepare_laws
from ...comparisons.runs.store import Store
from .campaign import Campaign
from .folder import (
    Facts,
    clear,
    files_of,
    finished_shards,
    keep_trajectories,
    stored_files,
    write_parts,
)
from .own_files import contents, own_folders, require_unchanged_files
from .parquet import TABLES
from .work import Batch, Part, Shard, failed, plan_batches, scored

# manifest entries of the last command that made runs; a command without runs keeps them
OF_WORK = ("wall_time_s", "runs_per_s")
# The pool ends a single run at its limit, with the reason. As a fallback, the process of the run
# ends itself this much later [s].
GRACE = 60.0


Kind = tuple[str, str, str]  #: Family, condition and controller.


@dataclass
class Progress:
    """Progress of a campaign.

    ``scenes`` is the total number of scenes. ``stored_before`` scenes were finished by earlier
    commands, and ``done`` scenes are finished now, these included. ``runs`` counts the new runs,
    and ``seconds`` is their process time. ``of_kind`` and ``failed`` count runs and failed runs of
    each kind; ``reasons`` holds the reason of the first failed run of each kind.
    """

    scenes: int
    stored_before: int
    done: int = 0
    runs: int = 0
    of_kind: Counter[Kind] = field(default_factory=Counter)
    failed: Counter[Kind] = field(default_factory=Counter)
    reasons: dict[Kind, str] = field(default_factory=dict)
    seconds: float = 0.0

    def add(self, task: Batch, part: Part) -> None:
        """Count the result of a batch."""
        self.done += len(task.scenes)
        self.runs += part.runs.num_rows
        self.seconds += part.seconds
        for line in part.runs.select(
            ["family", "condition", "controller", "status", "reason"]
        ).to_pylist():
            family, condition, controller, status, reason = line.values()
            self.of_kind[family, condition, controller] += 1
            if status == "failed":
                self.failed[family, condition, controller] += 1
                self.reasons.setdefault((family, condition, controller), reason)

    @property
    def all_failed(self) -> bool:
        """True if runs were made and all runs of the compared controllers failed."""
        compared = [kind for kind in self.of_kind if kind[2] != BASELINE] or list(self.of_kind)
        return bool(compared) and all(self.failed[kind] == self.of_kind[kind] for kind in compared)


@dataclass(frozen=True)
class Finished:
    """Result of a campaign, with its wall time [s].

    ``kept`` is the number of stored trajectories. ``interrupted`` is the number of the signal that
    ended the campaign, or 0.
    """

    folder: Path
    progress: Progress
    wall_time: float
    kept: int
    interrupted: int

    @property
    def rate(self) -> float:
        """Runs per second of wall time."""
        return self.progress.runs / self.wall_time


@dataclass(frozen=True)
class Plan:
    """Settings for the execution of a campaign that do not change its results.

    ``limit`` is the time limit of a run [s]; None derives it from the number of samples. ``fresh``
    replaces the content of the folder. ``workers`` opens the workers that make the runs.
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
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> Finished:
    """Run a campaign and store its shards in ``folder``, without repeating scenes that are stored.

    ``on_progress`` is called once at the start and after every batch. Raises ConfigurationError if
    the folder cannot be used or a family has no scene. Raises StorageError if a file cannot be
    written; stored shards remain.
    """
    plan = plan or Plan()
    parse_keep(plan.keep)
    with locked(folder, "evidence"):
        folder = folder.absolute()  # custom parts may change the working directory
        store = Store(folder, "evidence", stored_files)
        if plan.fresh:
            clear(folder)
        there = finished_shards(folder, campaign)
        scenes_there = {(facts.family, scene) for facts in there for scene in facts.scenes}
        tasks = plan_batches(campaign, plan.shard, plan.limit, scenes_there)
        for family in {task.family.name: task.family for task in tasks}.values():
            family.require_scenes(campaign.half, campaign.seed)
        prepare_laws(campaign.controllers)
        manifest = {
            **new_manifest(command, campaign.resolved()),
            "shard": [plan.shard.number, plan.shard.of],
            "keep": plan.keep,
            **{name: value for name, value in manifest_of(folder).items() if name in OF_WORK},
        }
        store.begin(manifest, stored_files(folder)[1:])
        stored = len(scenes_there)
        progress = Progress(stored + sum(len(task.scenes) for task in tasks), stored, stored)
        on_progress(progress)
        identities = campaign.identities()
        here = machine()
        folders = own_folders(campaign.controllers, campaign.families)
        files = files_of(there)
        kept = 0
        with store.interruptible():
            if tasks:
                with plan.workers(scored) as workers:
                    for i, part in results(tasks, workers):
                        task = tasks[i]
                        name = task.family.name
                        files = contents(part.files.keys() - files.keys(), folders) | files
                        require_unchanged_files(part.files, files)
                        files.update(part.files)
                        made = part.runs.num_rows, part.seconds, part.files
                        facts = Facts(name, task.scenes, identities[name], here, *made)
                        tables = dict(zip(TABLES, part, strict=False))
                        with store.storing():
                            write_parts(folder, task.name, tables, facts)
                        progress.add(task, part)
                        on_progress(progress)
            with store.storing():
                kept = keep_trajectories(folder, plan.keep, campaign, plan.limit, plan.workers)
        finished = Finished(folder, progress, store.seconds, kept, store.interrupted)
        rates: dict[str, float] = {}
        if progress.runs:
            rates = {"wall_time_s": finished.wall_time, "runs_per_s": finished.rate}
        store.finish(
            **rates,
            process_time_s=sum(facts.seconds for facts in there) + progress.seconds,
            runs=sum(facts.runs for facts in there) + progress.runs,
            scenes=progress.scenes,
            finished=progress.done,
            stored_before=stored,
            trajectories=kept,
            loaded=loaded_versions(),
        )
        return finished


def results(tasks: Sequence[Batch], workers: Workers) -> Iterator[tuple[int, Part]]:
    """Yield the number and the result of every batch as soon as it is finished.

    Batches whose process died are repeated run by run when all others are finished, in one queue. A
    run whose process dies again fails with the reason.
    """
    pieces: dict[tuple[int, int], Batch] = {}
    for i, answer in workers.run({i: (task,) for i, task in enumerate(tasks)}, again=False):
        if isinstance(answer, Failure):
            pieces |= {(i, j): piece for j, piece in enumerate(tasks[i].pieces())}
        else:
            yield i, answer
    limits = {key: piece.limit for key, piece in pieces.items() if piece.limit is not None}
    patient = {key: replace(pieces[key], limit=limit + GRACE) for key, limit in limits.items()}
    count = Counter(i for i, _ in pieces)
    parts = defaultdict[int, dict[int, Part]](dict)
    for (i, j), answer in workers.run(
        {key: (patient.get(key, piece),) for key, piece in pieces.items()}, limits
    ):
        parts[i][j] = failed(pieces[i, j], answer.reason) if isinstance(answer, Failure) else answer
        if len(parts[i]) == count[i]:
            yield i, Part.joined([part for _, part in sorted(parts.pop(i).items())])
