"""Tasks that no worker survives: all their pieces at once, and what is to blame fails alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from campaigns import campaign
from vsconstraints.comparisons.evidence.runner import GRACE, by_pieces
from vsconstraints.comparisons.evidence.task import Batch, Work
from vsconstraints.comparisons.evidence.worker import failed
from vsconstraints.comparisons.runs.pool import Failure


class Mortal:
    """Workers that die of one law in one scene; the last call is answered first."""

    def __init__(self, scene: int, law: str) -> None:
        self.scene, self.law = scene, law
        self.asked: list[tuple[list[Batch], Mapping[Any, float] | None, bool]] = []

    def run(
        self, calls: Mapping[Any, tuple[Any, ...]], limits: Mapping[Any, float] | None = None, *, again: bool = True
    ) -> Iterator[tuple[Any, Any]]:
        """See :class:`vsconstraints.comparisons.runs.pool.Workers`."""
        self.asked.append(([task for (task,) in calls.values()], limits, again))
        for key, (task,) in reversed(calls.items()):
            to_blame = task.single is None or task.single.controller == self.law
            dies = task.scenes == (self.scene,) and task.conditions and to_blame
            yield key, Failure("it died") if dies else failed(task, "as asked")


def test_pieces_of_all_tasks_stand_in_one_queue(tmp_path: Path) -> None:
    work = Work(campaign(tmp_path), limit=7.0)
    (family,) = work.campaign.families
    tasks = [work.task(family, (0, 1)), work.task(family, (2, 3, 4))]
    workers = Mortal(3, "sliding-mode")
    found = list(by_pieces(tasks, workers))
    # the task that is whole first, and scenes of each in their order
    assert [task.name for task, _ in found] == [tasks[0].name, tasks[1].name]
    assert [part.scenes["scene"].to_pylist() for _, part in found] == [[0, 1], [2, 3, 4]]
    (scenes, no_limits, again), (runs, limits, runs_again) = workers.asked
    assert [scene.scenes for scene in scenes] == [(0,), (1,), (2,), (3,), (4,)]
    assert (not no_limits, again, runs_again) == (True, False, True)
    # of the scene that nobody survived every run, in every condition, and what is said of the scene
    assert len(runs) == len(tasks[0].conditions) * len(tasks[0].controllers) + 1
    assert limits is not None
    assert set(limits.values()) == {7.0}
    assert {run.limit for run in runs} == {7.0 + GRACE}
    reasons = found[1][1].runs.to_pandas().set_index("controller")["reason"]
    assert len(reasons) == len(runs) - 1
    assert {law: set(reasons[[law]]) for law in set(reasons.index)} == {
        entry.name: {"it died" if entry.name == "sliding-mode" else "as asked"} for entry in tasks[0].controllers
    }
