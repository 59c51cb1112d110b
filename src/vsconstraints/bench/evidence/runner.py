"""Run a campaign on any kind of workers, and store each batch as soon as it is finished."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...comparisons.metrics import load_metrics
from ...comparisons.runs.folder import Keep, locked, manifest_of, parse_keep
from ...comparisons.runs.machine import loaded_versions, machine, new_manifest
from ...comparisons.runs.pool import Failure, OpenWorkers, Workers, processes
from ...comparisons.runs.spec import BASELINE, prepare_laws
from ...comparisons.runs.store import Store
from ...plugins.provenance import Files
from .campaign import Campaign
from .folder import (
    Facts,
    clear,
    files_of,
    finished_batches,
    keep_trajectories,
    stored_files,
    write_batch,
)
from .own_files import current_hashes, own_folders, require_unchanged_files
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

    def add(self, batch: Batch, part: Part) -> None:
        """Count the result of a batch."""
        self.done += len(batch.scenes)
        self.runs += part.runs.num_rows
        self.seconds += part.seconds
        columns = ["family", "condition", "controller", "status", "reason"]
        for line in part.runs.select(columns).to_pylist():
            kind = (line["family"], line["condition"], line["controller"])
            self.of_kind[kind] += 1
            if line["status"] == "failed":
                self.failed[kind] += 1
                self.reasons.setdefault(kind, line["reason"])

    @property
    def all_failed(self) -> bool:
        """True if runs were made and all runs of the compared controllers failed."""
        kinds = list(self.of_kind)
        compared = [kind for kind in kinds if kind[2] != BASELINE] or kinds
        runs = sum(self.of_kind[kind] for kind in compared)
        failed = sum(self.failed[kind] for kind in compared)
        return runs > 0 and failed == runs


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
    """Settings for the execution of a campaign.

    They do not change results, with one exception: a run that takes longer than ``limit`` [s] ends
    as ``failed``. None derives the limit from the number of samples, for each law. ``fresh``
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
    """Run a campaign and store its batches in ``folder``, without repeating scenes that are stored.

    ``on_progress`` is called once at the start and after every batch. Raises ConfigurationError if
    the folder cannot be used, a family has no scene, or a metric of another package cannot be used.
    Raises StorageError if a file cannot be written; stored batches remain.
    """
    plan = plan or Plan()
    parse_keep(plan.keep)
    load_metrics()  # a metric that cannot be used ends the command before any run
    with locked(folder, "evidence"):
        folder = folder.absolute()  # custom parts may change the working directory
        store = Store(folder, "evidence", stored_files)
        if plan.fresh:
            clear(folder)
        before = finished_batches(folder, campaign)
        finished_scenes = {(facts.family, scene) for facts in before for scene in facts.scenes}
        batches = plan_batches(campaign, plan.shard, plan.limit, finished_scenes)
        families = {batch.family.name: batch.family for batch in batches}
        for family in families.values():
            family.require_scenes(campaign.half, campaign.seed)
        prepare_laws(campaign.controllers)
        manifest = new_manifest(command, campaign.resolved())
        manifest["shard"] = [plan.shard.number, plan.shard.of]
        manifest["keep"] = plan.keep
        for name, value in manifest_of(folder).items():
            if name in OF_WORK:
                manifest[name] = value
        store.begin(manifest, stored_files(folder)[1:])
        planned = sum(len(batch.scenes) for batch in batches)
        stored = len(finished_scenes)
        progress = Progress(stored + planned, stored, stored)
        on_progress(progress)
        kept = 0
        with store.interruptible():
            if batches:
                with plan.workers(scored) as workers:
                    for batch, part in _stored(campaign, batches, workers, store, files_of(before)):
                        progress.add(batch, part)
                        on_progress(progress)
            with store.storing():
                kept = keep_trajectories(folder, plan.keep, campaign, plan.limit, plan.workers)
        finished = Finished(folder, progress, store.seconds, kept, store.interrupted)
        rates: dict[str, float] = {}
        if progress.runs:
            rates = {"wall_time_s": finished.wall_time, "runs_per_s": finished.rate}
        store.finish(
            **rates,
            process_time_s=sum(facts.seconds for facts in before) + progress.seconds,
            runs=sum(facts.runs for facts in before) + progress.runs,
            scenes=progress.scenes,
            finished=progress.done,
            stored_before=stored,
            trajectories=kept,
            loaded=loaded_versions(),
        )
        return finished


def _stored(
    campaign: Campaign, batches: Sequence[Batch], workers: Workers, store: Store, files: Files
) -> Iterator[tuple[Batch, Part]]:
    """Run batches, and yield each with its result as soon as it is stored.

    ``files`` are hashes of the custom parts' files on which the stored results depend. Raises
    ConfigurationError if the content of such a file changes.
    """
    identities = campaign.identities()
    here = machine()
    folders = own_folders(campaign.controllers, campaign.families)
    for i, part in results(batches, workers):
        batch = batches[i]
        family = batch.family.name
        # files that no earlier batch has loaded must be the same on this machine
        files = current_hashes(part.files.keys() - files.keys(), folders) | files
        require_unchanged_files(part.files, files)
        files.update(part.files)
        facts = Facts(
            family,
            batch.scenes,
            identities[family],
            here,
            runs=part.runs.num_rows,
            seconds=part.seconds,
            files=part.files,
        )
        with store.storing():
            write_batch(store.folder, batch.name, part.tables, facts)
        yield batch, part


def results(batches: Sequence[Batch], workers: Workers) -> Iterator[tuple[int, Part]]:
    """Yield the number and the result of every batch as soon as it is finished.

    Batches whose process died are repeated run by run when all others are finished, in one queue. A
    run whose process dies again fails with the reason.
    """
    died: dict[int, Batch] = {}
    calls = {i: (batch,) for i, batch in enumerate(batches)}
    for i, answer in workers.run(calls, again=False):
        if isinstance(answer, Failure):
            died[i] = batches[i]
        else:
            yield i, answer
    yield from _run_by_run(died, workers)


def _run_by_run(batches: Mapping[int, Batch], workers: Workers) -> Iterator[tuple[int, Part]]:
    """Run batches in pieces of one run each; yield number and result of each complete batch."""
    calls: dict[tuple[int, int], tuple[Batch]] = {}
    limits: dict[tuple[int, int], float] = {}
    unfinished = Counter[int]()
    for i, batch in batches.items():
        for j, (piece, limit) in enumerate(batch.pieces()):
            calls[i, j] = (replace(piece, limit=limit + GRACE),)
            limits[i, j] = limit
            unfinished[i] += 1
    parts: dict[int, dict[int, Part]] = defaultdict(dict)
    for (i, j), answer in workers.run(calls, limits):
        if isinstance(answer, Failure):
            answer = failed(*calls[i, j], answer.reason)
        parts[i][j] = answer
        unfinished[i] -= 1
        if unfinished[i] == 0:
            by_piece = parts.pop(i)
            yield i, Part.joined([by_piece[j] for j in sorted(by_piece)])
