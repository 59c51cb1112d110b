"""Batches of scenes with all conditions and controllers, and the tables of their runs.

A batch is the unit of work that is sent to a worker.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import chdir, nullcontext
from dataclasses import dataclass, replace
from itertools import groupby, product, zip_longest
from typing import Any, NamedTuple

from ...comparisons.experiment import Entries
from ...comparisons.metrics import score
from ...comparisons.record import RunRecord
from ...comparisons.run import failed_record, failed_score
from ...comparisons.runs.law_process import LawRun, simulate_law
from ...comparisons.runs.machine import run_limit
from ...comparisons.runs.spec import BASELINE, ControllerSpec, RunSpec
from ...errors import ConfigurationError, described
from ...plugins.classes import beside
from ...plugins.processes import deadline
from ...plugins.provenance import Files, own_parts_noted
from ...scenarios.reading import Table
from ...simulation import RunWorkspace, Setup, until_settled
from ..families import Drawn, Family
from . import parquet
from .campaign import Campaign
from .own_files import has_own_parts, named, own_folders, require_unchanged_files

# Maximum number of runs of a batch, unless a single scene has more. It limits what an interrupt
# loses to some 12 s, and the size of a file to a hundred kilobytes. Results do not depend on it.
RUNS_OF_BATCH = 600
MIN_BATCHES = 16  # minimum number of batches of a family; results do not depend on it

NO_FILES: Files = {}

Lines = dict[str, list[dict[str, Any]]]  #: Lines by table, each with its values by column.


@dataclass(frozen=True)
class Shard:
    """Part of the scenes of a campaign that one of several machines runs.

    It is part ``number`` of ``of``, counted from 1.
    """

    number: int = 1
    of: int = 1

    @classmethod
    def parsed(cls, text: str) -> Shard:
        """Return the shard denoted by ``i/n``. Raises ConfigurationError for any other text."""
        number, _, of = text.partition("/")
        are_integers = number.isdecimal() and of.isdecimal()
        if not are_integers or not 1 <= int(number) <= int(of):
            raise ConfigurationError(
                f"--shard must be i/n with i from 1 to n, such as 2/4, not {text!r}"
            )
        return cls(int(number), int(of))

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def scenes(self, count: int) -> range:
        """Return the consecutive scene numbers of this shard out of ``count`` scenes."""
        first = (self.number - 1) * count // self.of
        end = self.number * count // self.of
        return range(first, end)


@dataclass(frozen=True)
class Batch:
    """Scenes of one family with all data that a worker needs to run them.

    Each of the ``scenes`` is run in every condition with every controller, the unconstrained
    baseline first. ``limit`` is the time limit [s] for drawing one scene and for making one run;
    None derives it from the number of samples, for each law, and infinity means no limit. The
    process that exceeds it ends, so only batches for workers have one. ``single`` is the only
    controller whose runs are requested; None requests the runs of all controllers and the line of
    each scene. ``drawn`` is the only scene, if it is already drawn.
    """

    family: Family
    scenes: tuple[int, ...]
    conditions: tuple[str, ...]
    controllers: Entries
    half: str
    seed: int
    limit: float | None = math.inf
    single: str | None = None
    drawn: Drawn | None = None

    @property
    def name(self) -> str:
        """Name of the batch."""
        return batch_name(self.family.name, self.scenes)

    @property
    def drawing_limit(self) -> float:
        """Time limit for drawing one scene [s]; infinite if there is none."""
        return run_limit(self._tables) if self.limit is None else self.limit

    def run_limit(self, entry: ControllerSpec) -> float:
        """Return the time limit of one run of a controller [s]; infinite if there is none."""
        return entry.run_limit(self._tables) if self.limit is None else self.limit

    @property
    def _tables(self) -> Table:
        """Tables with duration and sampling time, on which time limits depend."""
        if self.drawn is None or not self.conditions:
            return self.family.tables
        return self.drawn.tables[self.conditions[0]]

    def pieces(self) -> list[tuple[Batch, float]]:
        """Split the batch into one batch for each run; return each with its time limit [s].

        For each scene, a further batch without runs returns the line of the scene.
        """
        scenes = [replace(self, scenes=(number,)) for number in self.scenes]
        pieces: list[tuple[Batch, float]] = []
        for scene in scenes:
            drawing = replace(scene, conditions=())
            pieces.append((drawing, self.drawing_limit))
        for scene in scenes:
            for condition, entry in product(self.conditions, self.controllers):
                run = replace(scene, conditions=(condition,), single=entry.name)
                pieces.append((run, run.run_limit(entry)))
        return pieces


def batch_name(family: str, scenes: Sequence[int]) -> str:
    """Return the name of the batch of these scenes: family, first and last scene."""
    return f"part-{family}-{scenes[0]:07d}-{scenes[-1]:07d}"


WHOLE_CAMPAIGN = Shard()


def make_batch(
    campaign: Campaign, family: Family, scenes: Sequence[int], limit: float | None = math.inf
) -> Batch:
    """Return the batch of scenes that are run in the same conditions; ``limit`` is its limit."""
    return Batch(
        family,
        tuple(scenes),
        campaign.conditions_of(family, scenes[0]),
        campaign.controllers,
        campaign.half,
        campaign.seed,
        limit,
    )


def plan_batches(
    campaign: Campaign,
    shard: Shard = WHOLE_CAMPAIGN,
    limit: float | None = math.inf,
    finished: Collection[tuple[str, int]] = (),
) -> list[Batch]:
    """Split the scenes of a campaign, except the ``finished`` ones, into batches.

    Families are interleaved, so that a slow family does not end up alone in the last batches.
    ``limit`` is that of each :class:`Batch`.
    """
    scenes = shard.scenes(campaign.scenes)
    by_family = []
    for family in campaign.families:
        unfinished = [number for number in scenes if (family.name, number) not in finished]
        size = _batch_size(campaign, family, len(scenes))
        batches = []
        for numbers in _split(campaign, family, unfinished, size):
            batches.append(make_batch(campaign, family, numbers, limit))
        by_family.append(batches)
    rounds = zip_longest(*by_family)
    return [batch for batches in rounds for batch in batches if batch is not None]


def _batch_size(campaign: Campaign, family: Family, scenes: int) -> int:
    """Return the largest number of scenes of a batch of a family."""
    runs_of_scene = len(campaign.conditions_of(family)) * len(campaign.controllers)
    most = min(RUNS_OF_BATCH // runs_of_scene, math.ceil(scenes / MIN_BATCHES))
    return max(1, most)


def _split(
    campaign: Campaign, family: Family, scenes: Iterable[int], size: int
) -> Iterator[list[int]]:
    """Yield the scenes of each batch.

    A scene belongs to the same batch whichever scenes are finished. All scenes of a batch are run
    in the same conditions.
    """

    def batch_of(scene: int) -> tuple[int, tuple[str, ...]]:
        return scene // size, campaign.conditions_of(family, scene)

    for _, numbers in groupby(scenes, key=batch_of):
        yield list(numbers)


class Part(NamedTuple):
    """Result of a batch: Arrow tables, process time [s] and the files of custom parts.

    ``files`` are the :mod:`.own_files` that the results depend on.
    """

    runs: Any
    rows: Any
    scenes: Any
    seconds: float
    files: Files

    @classmethod
    def of(cls, lines: Lines, seconds: float, files: Files = NO_FILES) -> Part:
        """Return the result built from lines by table."""
        tables = {}
        for name, columns in parquet.tables().items():
            tables[name] = parquet.table(columns, lines[name])
        return cls(**tables, seconds=seconds, files=dict(files))

    @classmethod
    def joined(cls, parts: Sequence[Part]) -> Part:
        """Join results in the given order.

        Raises ConfigurationError if a file of a custom part changed between them.
        """
        files: Files = {}
        for part in parts:
            require_unchanged_files(part.files, files)
            files.update(part.files)
        return cls(
            runs=parquet.joined([part.runs for part in parts]),
            rows=parquet.joined([part.rows for part in parts]),
            scenes=parquet.joined([part.scenes for part in parts]),
            seconds=sum(part.seconds for part in parts),
            files=files,
        )

    @property
    def tables(self) -> dict[str, Any]:
        """Arrow tables by name."""
        return {name: getattr(self, name) for name in parquet.tables()}


def scored(batch: Batch) -> Part:
    """Draw the scenes of a batch, run every controller in every condition, and score the runs.

    All controllers see the same noise in a scene. A run that fails becomes a line with its reason.
    The caller handles failures that end the process.
    """
    begun = time.perf_counter()
    lines: Lines = {name: [] for name in parquet.tables()}
    own_parts = has_own_parts(batch.controllers, [batch.family])
    with own_parts_noted() if own_parts else nullcontext(NO_FILES) as files:
        for scene in batch.scenes:
            _score_scene(lines, batch, scene)
    if own_parts:
        folders = own_folders(batch.controllers, [batch.family])
        files = named(files, folders)
    return Part.of(lines, time.perf_counter() - begun, files)


def _score_scene(lines: Lines, batch: Batch, number: int) -> None:
    """Draw a scene, run the requested controllers in it, and add the results to ``lines``."""
    with deadline(batch.drawing_limit):
        scene, bench_of = benches(batch, number)
    if batch.single is None:
        lines["scenes"].append(_scene_line(batch, number, scene))
    for condition, bench in bench_of.items():
        baseline = None
        for entry in batch.controllers:
            is_baseline = entry.name == BASELINE
            is_requested = batch.single in (None, entry.name)
            if not is_requested and not is_baseline:
                continue
            with deadline(batch.run_limit(entry)):
                record = bench.run(entry)
                if is_baseline:
                    baseline = record
                if is_requested:
                    _add(lines, batch, (number, condition, entry.name), record, baseline)


def failed(batch: Batch, reason: str) -> Part:
    """Return the result of a batch of one scene, or of one of its runs, whose process died."""
    lines: Lines = {name: [] for name in parquet.tables()}
    (number,) = batch.scenes
    if batch.single is None:
        lines["scenes"].append(_scene_line(batch, number, reason))
    else:
        (condition,) = batch.conditions
        record = RunRecord.failed(reason, "")
        _add(lines, batch, (number, condition, batch.single), record)
    return Part.of(lines, 0.0)


def benches(batch: Batch, number: int) -> tuple[Drawn | str, dict[str, Bench]]:
    """Return a scene and its ``Bench`` for each condition, none if no scene was found.

    If drawing the scene raises an exception, which only custom parts do, the reason replaces the
    scene.
    """
    scene = batch.drawn
    setups: Mapping[str, Setup] = {}
    if scene is None:
        try:
            with chdir("."), beside(batch.family.folder):
                scene, setups = batch.family.set_up(number, batch.half, batch.seed)
        # custom constraints can raise anything: the scene is listed with the reason
        except Exception as error:
            return described(error), {}
    if not scene.found:
        return scene, {}
    bench_of = {}
    for condition in batch.conditions:
        bench_of[condition] = Bench(scene, condition, setups.get(condition))
    return scene, bench_of


def _add(
    lines: Lines,
    batch: Batch,
    key: tuple[int, str, str],
    record: RunRecord,
    baseline: RunRecord | None = None,
) -> None:
    """Score a run with this scene, condition and controller, and add its lines."""
    try:
        run = score(record, baseline)
    except Exception as error:  # arrays of custom parts can hold anything
        run = failed_score(f"the run cannot be scored: {described(error)}")
    scene, condition, controller = key
    keys = {
        "family": batch.family.name,
        "half": batch.half,
        "scene": scene,
        "condition": condition,
        "controller": controller,
    }
    lines["runs"].append({**keys, **run.result})
    for row in run.constraints:
        is_violated = row["violation_depth"] > 0.0
        is_active = row["active_time_s"] > 0.0
        if row["challenged"] or is_violated or is_active:
            lines["rows"].append({**keys, **row})


def _scene_line(batch: Batch, number: int, scene: Drawn | str) -> dict[str, Any]:
    """Return the line of a scene; a text is the reason why it could not be drawn."""
    family = batch.family
    if isinstance(scene, str):
        reasons = {scene: 1}
        scene = Drawn(family.name, number, batch.half, batch.seed, family.folder, rejected=reasons)
    return {
        "family": family.name,
        "half": batch.half,
        "scene": number,
        "found": scene.found,
        "attempts": scene.attempts,
        "share_to_hold": scene.share_to_hold,
        "rejected": _json(scene.rejected),
        "challenged": "; ".join(scene.challenged),
        "values": _json(scene.values),
        "least_time_s": scene.least_time,
        "duration_s": scene.duration,
    }


def _json(data: Any) -> str:
    def as_list(value: Any) -> Any:
        return value.tolist()

    return json.dumps(dict(data), ensure_ascii=False, default=as_list)


class Bench:
    """One scene in one condition, on which controllers are run one after the other.

    The setup is reused after runs that leave no state in it, and rebuilt after all others. Custom
    laws run in separate processes.
    """

    def __init__(self, scene: Drawn, condition: str, setup: Setup | None = None) -> None:
        self._scene = scene
        self._condition = condition
        self._setup = setup
        self._ready: tuple[RunWorkspace, list[str]] | None = None

    def run(self, entry: ControllerSpec) -> RunRecord:
        """Run one controller and return the record.

        Any exception except an interrupt gives a failed run with its reason.
        """
        scene = self._scene
        try:
            # custom parts may change the working directory, and import neighboring modules at any
            # time
            with chdir("."), entry.importing_beside(scene.folder):
                scenario = scene.scenario(self._condition)
                own_parts = bool(scenario.own_parts)
                prepared, remarks = self._ready or self._prepare(own_parts)
                self._ready = None
                setup = entry.run.of(prepared.setup)
                same = prepared if setup is prepared.setup else None
                spec = RunSpec(scenario, entry, seed=scene.noise)
                law_run = LawRun(spec, setup.time_limit, in_own_process=entry.in_own_process)
                trajectory = simulate_law(law_run, setup, remarks, same)
                record = RunRecord.of(setup, trajectory, "")
        except BaseException as error:
            return failed_record(error)
        is_custom = ":" in entry.law
        is_unchanged = entry.in_own_process or not is_custom
        if record.trajectory.status != "failed" and is_unchanged and not own_parts:
            self._ready = prepared, remarks
        return record

    def _prepare(self, own_parts: bool) -> tuple[RunWorkspace, list[str]]:
        """Return the workspace of a run and the remarks on its start.

        The setup from the drawing of the scene is used once, and not with custom parts.
        """
        setup = self._setup
        self._setup = None
        if setup is None or own_parts:
            setup = self._scene.setup(self._condition)
        setup = until_settled(setup)
        prepared = RunWorkspace(setup)
        return prepared, setup.check_start(prepared.world)
