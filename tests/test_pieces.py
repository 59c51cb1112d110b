"""Tasks that no worker survives: all their pieces at once, and what is to blame fails alone."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from campaigns import campaign
from vsconstraints.bench.evidence import work
from vsconstraints.bench.evidence.runner import GRACE, Plan, collect, results
from vsconstraints.bench.evidence.work import Batch, Part, failed, make_batch, scored
from vsconstraints.comparisons.runs.pool import Failure
from vsconstraints.plugins.processes import deadline


class Mortal:
    """Workers that die of several scenes, and of one law in one scene; the last call is answered
    first.
    """

    def __init__(self, scene: int, law: str) -> None:
        self.scene = scene
        self.law = law
        self.asked: list[tuple[list[Batch], Mapping[Any, float] | None, bool]] = []

    def run(
        self,
        calls: Mapping[Any, tuple[Any, ...]],
        limits: Mapping[Any, float] | None = None,
        *,
        again: bool = True,
    ) -> Iterator[tuple[Any, Any]]:
        """See :class:`vsconstraints.comparisons.runs.pool.Workers`."""
        self.asked.append(([task for (task,) in calls.values()], limits, again))
        for key, (task,) in reversed(calls.items()):
            to_blame = task.single in (None, self.law) and task.conditions
            dies = len(task.scenes) > 1 or (task.scenes == (self.scene,) and to_blame)
            yield key, Failure("it died") if dies else failed(task, "as asked")


def test_pieces_of_all_tasks_stand_in_one_queue(tmp_path: Path) -> None:
    small = campaign(tmp_path)
    (family,) = small.families
    tasks = [make_batch(small, family, scenes, 7.0) for scenes in ((0, 1), (2, 3, 4))]
    workers = Mortal(3, "sliding-mode")
    found = list(results(tasks, workers))
    # scenes of each task are in their order, although the last call is answered first
    assert {i: part.scenes["scene"].to_pylist() for i, part in found} == {0: [0, 1], 1: [2, 3, 4]}
    (_, no_limits, again), (runs, limits, runs_again) = workers.asked
    assert (not no_limits, again, runs_again) == (True, False, True)
    # of each scene every run, in every condition, and what is said of the scene
    assert len(runs) == 5 * (len(tasks[0].conditions) * len(tasks[0].controllers) + 1)
    assert limits is not None
    assert set(limits.values()) == {7.0}
    assert {run.limit for run in runs} == {7.0 + GRACE}
    lines = Part.joined([part for _, part in found]).runs.to_pandas()
    assert len(lines) == len(runs) - 5
    died = (lines["scene"] == 3) & (lines["controller"] == "sliding-mode")
    assert died.sum() == len(tasks[0].conditions)
    assert (lines["reason"] == died.map({True: "it died", False: "as asked"})).all()


def test_only_workers_end_at_a_time_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A batch has none by default, since its limit ends the process that runs it."""
    small = campaign(tmp_path)
    limits: list[float] = []
    monkeypatch.setattr(work, "deadline", lambda limit: (limits.append(limit), nullcontext())[1])
    batch = make_batch(small, small.families[0], (0,))
    batch = replace(batch, conditions=batch.conditions[:1])
    assert scored(batch).runs.num_rows == len(batch.controllers)
    assert limits == [math.inf] * (1 + len(batch.controllers))
    workers = Mortal(0, "sliding-mode")
    (_, part), *_ = results([replace(batch, scenes=(0, 1))], workers)
    assert "it died" in part.runs["reason"].to_pylist()
    assert set((workers.asked[1][1] or {}).values()) == {math.inf}


def test_a_process_without_a_time_limit_is_not_watched() -> None:
    threads = threading.active_count()
    with deadline(math.inf) as step:
        step()
        assert threading.active_count() == threads


def test_the_batches_of_a_campaign_have_the_limits_of_its_laws(tmp_path: Path) -> None:
    small = campaign(tmp_path)
    workers = Mortal(0, "sliding-mode")
    collect(small, tmp_path / "out", Plan(workers=lambda function: nullcontext(workers)))
    tables = small.families[0].tables
    for batch in workers.asked[0][0]:
        for entry in small.controllers:
            assert batch.run_limit(entry) == entry.run_limit(tables)
