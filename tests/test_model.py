"""What laws are given to look ahead with: the same rows and task, of states to come, as the control
believes them.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from vsconstraints.control import ControlStep, Model, Prediction
from vsconstraints.controllers import Controller, SlidingMode, Tracking
from vsconstraints.errors import SceneError
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate

PARTS = ("phi", "Lg", "Lf", "sigma", "sigma_dot", "J", "b", "error", "error_rate", "pixels")


class Looking(Controller):
    """Tracking that looks ahead in every sample; keeps what it was given, and what it saw at the
    present.
    """

    name = "looking"
    uses = ("model",)  # type: ignore[assignment]

    def __init__(self, ahead: float = 0.5) -> None:
        self.ahead = ahead
        self.tracking = Tracking()
        self.model: Model | None = None
        self.seen: list[tuple[Rows, Task, Prediction]] = []

    def reset(self, period: float | None = None, model: Model | None = None) -> None:
        self.model = model
        self.seen.clear()

    def solve(self, rows: Rows, task: Task) -> Command:
        assert self.model is not None
        t, q, qd = self.model.present
        after = np.linspace(0.0, self.ahead, 4)
        there = self.model.along(
            t + after, q + after[:, None] * qd, np.broadcast_to(qd, (4, len(qd)))
        )
        self.seen.append((rows, task, there))
        return self.tracking.command(rows, task)


def setup(name: str, **changes: Any) -> Setup:
    scenario = Scenario.load(name)
    for key, value in changes.items():
        scenario = scenario.with_override(key.replace("__", "."), value)
    return scenario.setup()


@contextmanager
def in_numpy(model: Model) -> Iterator[None]:
    kept = model.step
    model.step = None
    yield
    model.step = kept


@pytest.mark.parametrize(
    "name", ["case-study-6r", "ur5-image", "moving-target", "panda-fov", "moving-sphere"]
)
def test_predictions_are_what_the_ideal_robot_meets(name: str) -> None:
    scene = setup(name, duration=1.0)
    run = simulate(scene, Tracking())
    step = ControlStep(scene.scene, scene.constraints, scene.task)
    step.reset()
    step.evaluate(0.0, scene.q0, scene.qd0)
    found = step.model().along(run.t, run.q, run.qd)
    assert len(found) == len(run.t)
    for there, met in (
        (found.phi, run.phi),
        (found.sigma, run.sigma),
        (found.pixels, run.features_px),
    ):
        np.testing.assert_allclose(there, met, rtol=1e-12, atol=1e-12)
    # the error of the last states, whose rotations may have gone on turning
    np.testing.assert_allclose(found.error, run.error, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", ["case-study-6r", "example-2d-fov", "moving-sphere"])
def test_one_by_one_is_the_same(name: str) -> None:
    scene = setup(name)
    rng = np.random.default_rng(4)
    step = ControlStep(scene.scene, scene.constraints, scene.task)
    step.evaluate(0.3, scene.q0, scene.qd0)
    model = step.model()
    t = 0.3 + 0.02 * np.arange(5)
    q = scene.q0 + 0.02 * rng.normal(size=(5, len(scene.q0)))
    qd = rng.normal(size=q.shape)
    compiled = model.along(t, q, qd)
    with in_numpy(model):
        defined = model.along(t, q, qd)
    single = model.at(t[0], q[0], qd[0])
    assert np.array_equal(single.rows.phi, compiled.phi[0])
    assert np.array_equal(single.task.b, compiled.b[0])
    for part in PARTS:
        np.testing.assert_allclose(
            getattr(compiled, part), getattr(defined, part), rtol=1e-9, atol=1e-9
        )


@pytest.mark.parametrize("name", ["case-study-6r", "experiment-2-ibvs", "moving-target-unknown"])
def test_looking_ahead_changes_nothing_in_the_loop(name: str) -> None:
    scene = setup(name, duration=0.4)
    looked = simulate(scene, Looking())
    plain = simulate(scene, Tracking(), by_public_call=True)
    assert np.array_equal(looked.qdd_command, plain.qdd_command)
    assert np.array_equal(looked.phi, plain.phi)


def test_the_present_is_where_the_rows_were_made() -> None:
    law = Looking(ahead=0.0)
    run = simulate(setup("example-2d-fov", duration=0.2), law)
    assert len(law.seen) == len(run.t)
    for k, (rows, _, there) in enumerate(law.seen):
        np.testing.assert_array_equal(there.phi[0], rows.phi)
        np.testing.assert_array_equal(there.Lg[-1], rows.Lg)
        np.testing.assert_allclose(rows.phi, run.phi[k], atol=1e-12)


def test_of_an_unknown_motion_only_the_present_is_known() -> None:
    scene = setup("moving-target-unknown", duration=0.2)
    law = Looking(ahead=1.0)
    simulate(scene, law)
    assert ControlStep(scene.scene, scene.constraints, scene.task).believes
    _, _, there = law.seen[0]
    # nothing moves at first, and what the target does meanwhile is not told
    np.testing.assert_array_equal(there.pixels[0], there.pixels[-1])
    np.testing.assert_array_equal(there.phi[0], there.phi[-1])


def test_a_known_motion_is_foreseen() -> None:
    law = Looking(ahead=1.0)
    simulate(setup("moving-target", duration=0.1), law)
    _, _, there = law.seen[0]
    assert np.abs(there.pixels[0] - there.pixels[-1]).max() > 1.0


def test_errors_of_the_camera_are_those_that_the_control_makes() -> None:
    scene = setup("case-study-6r", duration=0.01, disturbances__focal_factor=[1.05, 1.05])
    law = Looking(ahead=0.0)
    simulate(scene, law)
    _, _, there = law.seen[0]
    camera = scene.scene.camera
    true = scene.scene.project(scene.scene.camera_pose(scene.q0))
    # what a point at these directions would give in the camera that is believed in
    np.testing.assert_allclose(
        there.pixels[0] - camera.offset, 1.05 * (true - camera.offset), rtol=1e-9
    )


def test_wrong_gradients_are_wrong_in_predictions_too() -> None:
    law = Looking(ahead=0.0)
    simulate(setup("experiment-1-pbvs-gradient-error", duration=1.0), law)
    for rows, _, there in law.seen:
        np.testing.assert_allclose(there.Lg[0], rows.Lg, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(there.phi[0], rows.phi, rtol=1e-9, atol=1e-12)


def test_a_state_that_cannot_be_seen_ends_the_prediction() -> None:
    scene = setup("case-study-6r")
    step = ControlStep(scene.scene, scene.constraints, scene.task)
    step.evaluate(0.0, scene.q0, scene.qd0)
    model = step.model()
    n = len(scene.q0)
    turned = scene.q0 + np.pi * np.eye(n)[0]
    with pytest.raises(SceneError, match="not in front"):
        model.at(0.0, turned, np.zeros(n))
    q = np.array([scene.q0, scene.q0, turned, scene.q0])
    assert len(model.along(np.zeros(4), q, np.zeros((4, n)))) == 2
    assert len(model.along(np.zeros(4), q[::-1][1:2], np.zeros((1, n)))) == 0
    with in_numpy(model):
        assert len(model.along(np.zeros(4), q, np.zeros((4, n)))) == 2
        assert model.along(np.zeros(1), q[2:3], np.zeros((1, n))).Lg.shape == (
            0,
            len(model.labels),
            n,
        )


def test_only_laws_that_use_a_model_have_one_made(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> Model:
        raise AssertionError("nobody asked for a model")

    monkeypatch.setattr(ControlStep, "model", refuse)
    scene = setup("example-2d-fov", duration=0.02)
    assert simulate(scene, SlidingMode()).status == "unfinished"
    ControlStep(scene.scene, scene.constraints, scene.task).command(
        SlidingMode(), 0.0, scene.q0, scene.qd0
    )


def test_a_step_gives_its_model_to_the_law_that_is_bound_to_it() -> None:
    scene = setup("example-2d-fov")
    law = Looking()
    step = ControlStep(scene.scene, scene.constraints, scene.task)
    step.command(law, 0.0, scene.q0, scene.qd0)
    first = law.model
    step.command(law, 0.002, scene.q0, scene.qd0)
    assert first is not None
    assert law.model is first
    assert len(law.seen) == 2
    assert first.present.t == 0.002


def test_a_model_can_be_copied() -> None:
    scene = setup("case-study-6r")
    step = ControlStep(scene.scene, scene.constraints, scene.task)
    step.evaluate(0.1, scene.q0, scene.qd0)
    model = step.model()
    other = pickle.loads(pickle.dumps(model))
    q = scene.q0[None, :]
    qd = scene.qd0[None, :]
    assert np.array_equal(model.along(np.ones(1), q, qd).phi, other.along(np.ones(1), q, qd).phi)
