"""A policy as a law: what its network gives, filtered and not, and files that are refused."""

from __future__ import annotations

import pickle
from itertools import pairwise
from pathlib import Path
from typing import Any

import cvxpy
import numpy as np
import pytest

from vsconstraints.bench.families import Family
from vsconstraints.bench.learning import Observer, Policy
from vsconstraints.control import ControlStep
from vsconstraints.controllers import Tracking, make_controller
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.rows import Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, score_run, simulate

SIZE = 40  #: Of observations of the scene.
FILTERED = {"demand": "barrier", "resolver": "filter", "alpha": 20.0}


def scene(**changes: Any) -> Setup:
    scenario = Scenario.load("example-2d-fov")
    for key, value in {"duration": 0.5, **changes}.items():
        scenario = scenario.with_override(key, value)
    return scenario.setup()


def weights(
    folder: Path, sizes: tuple[int, ...] = (SIZE, 8, 3), scale: float = 1.0, **others: Any
) -> str:
    """A file with random layers of these sizes; ``others`` replace arrays, or leave them out if
    None.
    """
    random = np.random.default_rng(1)
    arrays = {}
    for i, (k, h) in enumerate(pairwise(sizes)):
        arrays[f"W{i}"], arrays[f"b{i}"] = (
            random.normal(0.0, scale, (h, k)),
            random.normal(0.0, 0.1, h),
        )
    path = folder / "weights.npz"
    np.savez(
        path, **{key: value for key, value in {**arrays, **others}.items() if value is not None}
    )
    return str(path)


def at_start(policy: Policy, setup: Setup) -> tuple[Rows, Task, Any]:
    step = ControlStep(
        setup.scene, setup.constraints, setup.task, limits=setup.limits, period=setup.Ts
    )
    evaluation, command = step.bind(policy)(0.0, setup.q0, setup.qd0)
    return evaluation.rows, evaluation.task, command


@pytest.mark.parametrize("law", [None, "tracking"])
def test_the_command_is_the_network_s(law: str | None, tmp_path: Path) -> None:
    """Layer by layer, by loops; what goes beyond -1 and 1 is cut, and a law's command is added."""
    setup = scene()
    policy = Policy(weights=weights(tmp_path, scale=1.0, acceleration=7.0, law=law))
    rows, task, command = at_start(policy, setup)
    x = Observer(rows.scale, np.full(3, np.inf), setup.scene.robot.ranges, 7.0)(
        rows, task, setup.q0, setup.qd0
    )
    assert x.shape == (SIZE,)
    with np.load(policy.weights) as file:
        hidden = [
            np.tanh(sum(w * y for w, y in zip(W, x, strict=True)) + b)
            for W, b in zip(file["W0"], file["b0"], strict=True)
        ]
        out = [
            sum(w * y for w, y in zip(W, hidden, strict=True)) + b
            for W, b in zip(file["W1"], file["b1"], strict=True)
        ]
    assert max(map(abs, out)) > 1.0 > min(map(abs, out))
    added = 0.0 if law is None else Tracking().command(rows, task).qdd
    np.testing.assert_allclose(
        command.qdd, added + 7.0 * np.clip(out, -1.0, 1.0), rtol=1e-9, atol=1e-12
    )
    assert command.status == "ok"


def test_the_filter_gives_the_nearest_command_that_meets_the_barriers(tmp_path: Path) -> None:
    """Against CVXPY, from states in which the network's q̈ does not meet them."""
    setup = scene()
    file = weights(tmp_path, acceleration=5.0)
    free = Policy(weights=file)
    filtered = Policy(weights=file, **FILTERED)
    run = simulate(setup, free)
    differing = 0
    for k in range(0, len(run.t), 10):
        step = ControlStep(setup.scene, setup.constraints, setup.task)
        evaluation, command = step.bind(filtered)(run.t[k], run.q[k], run.qd[k])
        wanted = step.command(free, run.t[k], run.q[k], run.qd[k])[1].qdd
        rows = evaluation.rows
        qdd = cvxpy.Variable(3)
        problem = cvxpy.Problem(
            cvxpy.Minimize(cvxpy.sum_squares(qdd - wanted)),
            [rows.Lg @ qdd <= -20.0 * rows.phi - rows.Lf],
        )
        problem.solve(solver="CLARABEL")
        if problem.status == "optimal":
            np.testing.assert_allclose(command.qdd, qdd.value, rtol=1e-4, atol=1e-4)
            differing += np.linalg.norm(command.qdd - wanted) > 1.0
    assert differing > 3


def test_filtered_it_keeps_rows_that_it_violates(tmp_path: Path) -> None:
    setup = scene(duration=1.0)
    file = weights(tmp_path, acceleration=20.0)
    least = [
        simulate(setup, Policy(weights=file, **options)).clearance.min()
        for options in ({}, FILTERED)
    ]
    assert least[0] < -0.1
    assert least[1] > -1e-3


def test_the_example_s_weights_arrive_in_scenes_they_were_not_trained_on() -> None:
    file = str(Path(__file__).parents[1] / "examples" / "planar-arm-policy.npz")
    family = Family.load("planar-arm")
    setups = [family.scene(number, "held-out").setup() for number in (50, 51, 53, 54)]
    for options in ({}, FILTERED):
        runs = [score_run(setup, Policy(weights=file, **options)) for setup in setups]
        assert sum(run.status == "converged" for run in runs) >= 3
        assert not options or max(run.sigma_max.max() for run in runs) < 0.01


def test_it_is_made_by_name_and_says_what_it_uses(tmp_path: Path) -> None:
    file = weights(tmp_path)
    policy = make_controller(
        "vsconstraints.bench.learning:Policy", {"weights": file, "demand": "switch"}
    )
    assert policy.uses == ("L_fφ", "model")
    assert f"weights={file!r}" in repr(policy)
    with pytest.raises(ConfigurationError, match="unknown option of law 'alhpa'"):
        Policy(weights=file, alhpa=1.0)
    run = simulate(scene(), policy)
    np.testing.assert_array_equal(run.q, simulate(scene(), pickle.loads(pickle.dumps(policy))).q)
    np.testing.assert_array_equal(run.q, simulate(scene(), policy).q)


@pytest.mark.parametrize(
    ("limit", "law", "greatest"), [(2.0, None, 2.0), (20.0, None, 20.0), (0.1, "tracking", 0.1)]
)
def test_an_action_is_a_share_of_known_limits(
    limit: float, law: str | None, greatest: float, tmp_path: Path
) -> None:
    """Which no command leaves."""
    setup = scene(limits={"acceleration": limit})
    _, _, command = at_start(Policy(weights=weights(tmp_path, scale=100.0, law=law)), setup)
    assert np.abs(command.qdd).max() == pytest.approx(greatest, rel=1e-9)


def test_other_sizes_and_no_model_are_refused(tmp_path: Path) -> None:
    setup = scene()
    for sizes in ((SIZE + 1, 8, 3), (SIZE, 8, 2)):
        policy = Policy(weights=weights(tmp_path, sizes))
        wrong = rf"npz: a network of \({sizes[0]}, {sizes[2]}\), not \({SIZE}, 3\) numbers as for 2 rows, 3 joints and 6"
        with pytest.raises(InvalidInput, match=wrong):
            at_start(policy, setup)
        run = simulate(setup, policy)
        assert (run.status, len(run.t)) == ("failed", 0)
        assert "a network of" in run.reason
    step = ControlStep(setup.scene, setup.constraints, setup.task).evaluate(
        0.0, setup.q0, setup.qd0
    )
    with pytest.raises(InvalidInput, match=r"policy uses a model: .*reset\(model="):
        Policy(weights=weights(tmp_path)).command(step.rows, step.task)


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ({"W0": np.full((8, SIZE), np.nan)}, "W0 must have only finite numbers"),
        ({"b1": np.array([0.0, np.inf, 0.0])}, "b1 must have only finite numbers"),
        ({"W1": np.full((3, 8), 1e300)}, "W1 must have only finite numbers less than 1e[+]30"),
        ({"b0": np.array(["a"] * 8)}, "b0 must have only finite numbers"),
        ({"b1": None}, "layers are W0, b0, W1, b1 and so on, not W0, b0, W1$"),
        ({"W0": None, "b0": None}, "layers are W0, b0, W1, b1 and so on, not W1, b1$"),
        (dict.fromkeys(("W0", "b0", "W1", "b1")), "layers are W0, .* not none"),
        ({"extra": np.zeros(3)}, "layers are .* not W0, b0, W1, b1, extra"),
        (
            {"W1": np.zeros((3, 7))},
            r"W1 and b1 have the shapes \(3, 7\) and \(3,\), not \(h, 8\) and \(h,\)",
        ),
        ({"b0": np.zeros(7)}, r"W0 and b0 have the shapes \(8, 40\) and \(7,\), not \(h, 40\)"),
        ({"b1": np.zeros(())}, r"W1 and b1 have the shapes \(3, 8\) and \(\)"),
        ({"W0": np.zeros(SIZE)}, r"W0 and b0 have the shapes \(40,\) and \(8,\)"),
        ({"W0": np.zeros(())}, r"W0 and b0 have the shapes \(\) and \(8,\), not \(h, i\)"),
        (
            {"acceleration": np.array(-1.0)},
            "acceleration in .* must be a positive, finite number, not -1.0",
        ),
        ({"acceleration": np.zeros(3)}, "acceleration in .* must be a positive, finite number"),
        ({"law": "trakcing"}, "unknown controller 'trakcing'"),
        ({"law": np.array([1], dtype=object)}, "weights cannot be read: Object arrays"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_bad_weights_are_refused_by_name(
    others: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigurationError, match=message):
        Policy(weights=weights(tmp_path, **others))


@pytest.mark.parametrize("content", [None, b"", b"PK\x03\x04 broken", b"text", "array"])
def test_what_is_no_file_of_weights_is_refused(content: bytes | str | None, tmp_path: Path) -> None:
    path = tmp_path / "w.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content:
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    with pytest.raises(ConfigurationError, match=r"w\.npz: weights cannot be read"):
        Policy(weights=str(path))
