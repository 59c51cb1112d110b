"""What a worker does, wherever it runs: from a task to the tables of its runs, and nothing else."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir
from dataclasses import dataclass
from typing import Any

from ...errors import described
from ...plugins.classes import beside
from ...scenarios.families import Drawn
from ...simulation import Prepared, Setup, simulate, until_settled
from ..metrics import Score, score
from ..record import RunRecord
from ..runs.signals import INTERRUPTS, deadline
from ..runs.spec import BASELINE, ControllerSpec
from . import parquet
from .parquet import TABLES
from .task import Batch

Line = dict[str, Any]
"""Values by columns."""


@dataclass(frozen=True)
class Part:
    """The result of a task: Arrow tables of runs, of their rows, and of scenes, and how long it took [s]."""

    runs: Any
    rows: Any
    scenes: Any
    seconds: float

    @classmethod
    def of(cls, lines: Mapping[str, list[Line]], seconds: float) -> Part:
        """From lines by table."""
        return cls(**{name: parquet.table(columns, lines[name]) for name, columns in TABLES.items()}, seconds=seconds)

    @classmethod
    def joined(cls, parts: list[Part]) -> Part:
        """All of them as one, in their order."""
        tables = {name: parquet.joined([getattr(part, name) for part in parts]) for name in TABLES}
        return cls(**tables, seconds=sum(part.seconds for part in parts))


def scored(task: Batch) -> Part:
    """Draw the scenes of a task, run every controller on each in every condition, and score the runs.

    All controllers see the same scene with the same disturbances and noise. A run that fails in any way becomes a line
    with its reason; what ends the process is left to the caller.
    """
    begun = time.perf_counter()
    lines: dict[str, list[Line]] = {name: [] for name in TABLES}
    with deadline(task.limit) as step:
        for number in task.scenes:
            step()
            scene, setups = set_up(task, number)
            if task.single is None:
                lines["scenes"].append(_scene_line(task, number, scene))
            if not isinstance(scene, Drawn) or not scene.found:
                continue
            for condition in task.conditions:
                if task.single is None or task.single.condition == condition:
                    bench = Bench(scene, condition, setups.get(condition))
                    for entry, result in _scores(task, bench, step):
                        _add(lines, keys_of(task, number, condition, entry.name), result)
    return Part.of(lines, time.perf_counter() - begun)


def failed(task: Batch, reason: str) -> Part:
    """The result of a task of one scene, or of one run of it, that no process survives."""
    lines: dict[str, list[Line]] = {name: [] for name in TABLES}
    (number,) = task.scenes
    if task.single is None:
        lines["scenes"].append(_scene_line(task, number, reason))
    else:
        keys = keys_of(task, number, task.single.condition, task.single.controller)
        _add(lines, keys, score(RunRecord.failed(reason, ""), None))
    return Part.of(lines, 0.0)


def set_up(task: Batch, number: int) -> tuple[Drawn | str, Mapping[str, Setup]]:
    """A scene and its setups by condition; the reason if drawing it raised something, which only own parts do."""
    try:
        with chdir("."), beside(task.family.folder):
            return task.family.set_up(number, task.half, task.seed)
    except Exception as error:  # own constraints can raise anything: the scene is listed with the reason
        return described(error), {}


def keys_of(task: Batch, number: int, condition: str, controller: str) -> Line:
    """The columns that identify a run."""
    return {
        "family": task.family.name,
        "condition": condition,
        "half": task.half,
        "scene": number,
        "controller": controller,
    }


def _add(lines: Mapping[str, list[Line]], keys: Line, scored: Score) -> None:
    lines["runs"].append({**keys, **scored.result})
    lines["rows"] += [
        {**keys, **row}
        for row in scored.constraints
        if row["challenged"] or row["violation_depth"] > 0.0 or row["active_time_s"] > 0.0
    ]


def _scene_line(task: Batch, number: int, scene: Drawn | str) -> Line:
    if isinstance(scene, str):
        # nothing else is known of a scene that could not be drawn
        scene = Drawn(task.family.name, number, task.half, task.seed, task.family.folder, rejected={scene: 1})
    return {
        "family": task.family.name,
        "half": task.half,
        "scene": number,
        "found": scene.found,
        "attempts": scene.attempts,
        "rejected": _json(scene.rejected),
        "challenged": "; ".join(scene.challenged),
        "share_to_hold": scene.share_to_hold,
        "values": _json(scene.values),
        "least_time_s": scene.least_time,
        "duration_s": scene.duration,
    }


def _json(data: Any) -> str:
    return json.dumps(dict(data), ensure_ascii=False, default=lambda value: value.tolist())


def _scores(task: Batch, bench: Bench, step: Callable[[], None]) -> Iterator[tuple[ControllerSpec, Score]]:
    """Each controller's score, relative to the unconstrained baseline, which is the first of them."""
    baseline = None
    for entry in task.controllers:
        wanted = task.single is None or task.single.controller == entry.name
        if wanted or entry.name == BASELINE:
            step()
            record = bench.run(entry)
            if entry.name == BASELINE:
                baseline = record
            if wanted:
                yield entry, _scored(record, baseline)


def _scored(record: RunRecord, baseline: RunRecord | None) -> Score:
    try:
        return score(record, baseline)
    except Exception as error:  # arrays of own parts can be anything
        return score(RunRecord.failed(f"the run cannot be scored: {described(error)}", ""), None)


class Bench:
    """One scene in one condition, on which controllers are run one after the other.

    The setup is used again after runs of the package's own laws, which leave nothing in it. Own laws and constraints
    may, and so may what fails: after these it is made anew.

    Parameters
    ----------
    scene, condition
        What is set up.
    setup
        The same, if it is set up already.
    """

    def __init__(self, scene: Drawn, condition: str, setup: Setup | None = None) -> None:
        self._scene, self._condition, self._setup = scene, condition, setup
        self._ready: tuple[Prepared, list[str]] | None = None

    def run(self, entry: ControllerSpec) -> RunRecord:
        """A run; whatever goes wrong becomes a failed one with its reason."""
        try:
            # own parts may change the working directory, and import what lies beside them whenever they like
            with chdir("."), beside(self._scene.folder, entry.folder):
                scenario = self._scene.scenario(self._condition)
                prepared, remarks = self._ready or self._prepare(bool(scenario.own_parts))
                self._ready = None
                run = simulate(prepared.setup, entry.make(), remarks=remarks, prepared=prepared)
                record = RunRecord.of(prepared.setup, run, "")
        except INTERRUPTS:
            raise
        except BaseException as error:  # even SystemExit: this is where one run ends and the others begin
            return RunRecord.failed(described(error), "")
        if record.trajectory.status != "failed" and ":" not in entry.law and not scenario.own_parts:
            self._ready = prepared, remarks
        return record

    def _prepare(self, own_parts: bool) -> tuple[Prepared, list[str]]:
        given, self._setup = self._setup, None
        setup = until_settled(self._scene.setup(self._condition) if given is None or own_parts else given)
        remarks = setup.check_start()
        return Prepared(setup), remarks
