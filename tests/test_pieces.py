"""Tasks that no worker survives: all their pieces at once, and what is to blame fails alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from campaigns import campaign
from vsconstraints.comparisons.evidence.runner import GRACE, results
from vsconstraints.comparisons.evidence.work import Batch, failed, task_of
from vsconstraints.comparisons.runs.pool import Failure


class Mortal:
    """Workers that die of several scenes, and of one law in one scene; the last call is answered first."""

    def __init__(self, scene: int, law: str) -> None:
        self.scene, self.law = scene, law
        self.asked: list[tuple[list[Batch], Mapping[Any, float] | None, bool]] = []

    def run(
        self, calls: Mapping[Any, tuple[Any, ...]], limits: Mapping[Any, float] | None = None, *, again: bool = True
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
    tasks = [task_of(small, family, scenes, 7.0) for scenes in ((0, 1), (2, 3, 4))]
    workers = Mortal(3, "sliding-mode")
    found = list(results(tasks, workers))
    # the task that is whole first, and scenes of each in their order
    assert [i for i, _ in found] == [0, 1]
    assert [part.scenes["scene"].to_pylist() for _, part in found] == [[0, 1], [2, 3, 4]]
    _, (scenes, no_limits, again), (runs, limits, runs_again) = workers.asked
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
