"""A model whose target is beside its place: what it predicts, against the scene with its markers
moved.
"""

from __future__ import annotations

import numpy as np
import pytest
from checks.misplaced import MisplacedTarget

from vsconstraints.control import ControlStep
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.scene import Scene

OFFSET = np.array([0.04, 0.0, 0.0])


@pytest.mark.parametrize("offset", [np.zeros(3), OFFSET])
def test_only_the_target_of_the_model_is_moved(offset: np.ndarray) -> None:
    setup = Scenario.load("ur5-fov").setup()
    scene = setup.scene
    q = setup.q0
    qd = setup.qd0
    step = ControlStep(scene, setup.constraints, setup.task)
    step.evaluate(0.0, q, qd)
    model = step.model()
    moved = Scene(scene.robot, scene.camera, scene.markers + offset, scene.points, scene.motion)
    times = np.zeros(1)
    states = q[None], qd[None]
    known = model.along(times, *states)
    found = MisplacedTarget(model, offset).along(times, *states)
    assert found.pixels[0] == pytest.approx(moved.glance(q)[0], abs=1e-9)
    assert known.pixels[0] == pytest.approx(scene.glance(q)[0], abs=1e-9)
    if not offset.any():
        assert found.b == pytest.approx(known.b, abs=1e-12)
    else:
        # the goal of a pose is beside its place as well
        assert np.abs(found.error - known.error).max() > 0.01
    # the loop goes on with the scene as it is
    assert step.evaluate(0.0, q, qd).pixels == pytest.approx(scene.glance(q)[0], abs=1e-9)
