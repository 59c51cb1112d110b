"""``python -m checks.misplaced [--scenes N] [--offset M]``: predictive laws, misplaced target.

Disturbances of the test set do not change the target's pose and the arm's kinematics, and a
predictive law knows both exactly. Here its model has the target, and with it the goal, at an offset
from the true place, in a direction that is drawn for each scene. Rows and task in the loop are
measured as before. Other laws have no model, so that nothing changes for them. Runs are on the
first held-out scenes of test set v1 on arms; success is strict, in per cent.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from vsconstraints.bench.families import Drawn
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.comparisons.metrics import score
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.control.control_step import Model
from vsconstraints.control.evaluator import Evaluator
from vsconstraints.controllers.base import Controller
from vsconstraints.prediction.predictive import PredictiveControl
from vsconstraints.prediction.robust_predictive import RobustPredictive
from vsconstraints.robots.geometry import Pose
from vsconstraints.rows import Array
from vsconstraints.simulation import Setup, simulate, until_settled
from vsconstraints.vision.scene import Scene
from vsconstraints.vision.tracking import VisualTask

CONDITIONS = "nominal", "disturbed"
WITHOUT_ARM = "free-camera"


class MisplacedTarget(Model):
    """Model in which the target is displaced by ``offset`` (3,) [m] in its own frame."""

    def __init__(self, of: Model, offset: Array) -> None:
        super().__init__(of._of, of._estimate, of._gradient_error)
        scene = of._of.scene
        moved = Scene(scene.robot, scene.camera, scene.markers + offset, scene.points, scene.motion)
        goals = [
            goal
            if goal.camera is None
            else replace(goal, camera=Pose(goal.camera.R, goal.camera.t + offset))
            for goal in self.task.goals
        ]
        self.task = VisualTask(self.task.feature, goals, self.task.gains, rest=self.task.rest)
        self._own = Evaluator(moved, of._of.constraints, self.task, known=of._of.known)
        self.step = self._own.bound()
        if self._estimate is not None:
            self._estimate.write(self._own.packed.step)
        if self._gradient_error is not None and self.step is not None:
            self._gradient_error.write(self.step.packed.step)


class Misplaced(PredictiveControl):
    """:class:`.PredictiveControl` with such a model."""

    offset = np.zeros(3)

    def reset(self, period: float | None = None, model: Any = None) -> None:
        """Reset the law; see :meth:`.PredictiveControl.reset`."""
        super().reset(period, None if model is None else MisplacedTarget(model, self.offset))


def laws(offset: Array) -> dict[str, Controller]:
    """Predictive laws with the true and with the displaced target, and a law without a model."""
    robust = RobustPredictive()
    misplaced = Misplaced()
    robust_misplaced = RobustPredictive()
    robust_misplaced.law = Misplaced(margin=robust.law.margin)
    Misplaced.offset = offset
    observer = ControllerSpec("robust-hierarchical-qp", options={"observer": 0.1}).make()
    return {
        "predictive": PredictiveControl(),
        "predictive, misplaced": misplaced,
        "robust-predictive": robust,
        "robust-predictive, misplaced": robust_misplaced,
        "robust-hierarchical-qp-observer": observer,
    }


def success(setup: Setup, law: Controller) -> bool:
    """Return True if a run reaches the goal and violates no row, by the strict standard."""
    record = RunRecord.of(setup, simulate(setup, law), "")
    result = score(record, record).result
    return result["status"] == "converged" and not result["violated"]


def direction(scene: Drawn) -> Array:
    """Draw a unit vector (3,) for a scene."""
    drawn = np.random.default_rng(scene.number).standard_normal(3)
    unit: Array = drawn / np.linalg.norm(drawn)
    return unit


def measured(scenes: int, distance: float) -> Any:
    """DataFrame with one line for each run: family, scene, condition, law, and success."""
    test_set = TestSet.load()
    lines = []
    for family in test_set.families:
        if family.name == WITHOUT_ARM:
            continue
        for number in range(scenes):
            scene = family.scene(number, "held-out", test_set.seed)
            for condition in CONDITIONS:
                setup = until_settled(scene.setup(condition))
                for name, law in laws(distance * direction(scene)).items():
                    run = {
                        "family": family.name,
                        "scene": number,
                        "condition": condition,
                        "law": name,
                    }
                    lines.append(run | {"success": success(setup, law)})
    return pd.DataFrame(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the success of each law in each condition, and the number of scenes."""
    parser = ArgumentParser(prog="python -m checks.misplaced", description=__doc__)
    parser.add_argument("--scenes", type=int, default=10, help="of each family")
    parser.add_argument("--offset", type=float, default=0.04, help="of the target [m]")
    asked = parser.parse_args(arguments)
    runs = measured(asked.scenes, asked.offset)
    share = 100.0 * runs.groupby(["law", "condition"], sort=False)["success"].mean().unstack()
    print(
        f"{runs.groupby(['family', 'scene']).ngroups} scenes, target {1e3 * asked.offset:g} mm "
        f"beside its place\n"
    )
    print(share.round(1).to_string())
    return 0


if __name__ == "__main__":
    sys.exit(main())
