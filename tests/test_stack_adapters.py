"""Adapters answer what a direct call of their package gives, in that package's environment.

The environments take some 7 GB: they are made in the folder that VSCONSTRAINTS_STACKS names.
"""

import ast
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tomllib
from itertools import product
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from vsconstraints.scenarios import Scenario
from vsconstraints.simulation.programs import Observation
from vsconstraints.stacks import USES
from vsconstraints.stacks.description import describe, matrix
from vsconstraints.stacks.environments import make_environment, requirements
from vsconstraints.stacks.external import ADAPTERS, adapters
from vsconstraints.stacks.protocol import encode, setup_message
from vsconstraints.stacks.stack import Measured

ENVIRONMENTS = os.environ.get("VSCONSTRAINTS_STACKS")
ROOT = Path(__file__).parents[1]
SUITE = ROOT / "comparisons" / "stacks.toml"
VISP = ROOT / "controllers" / "visp" / "visp_stack.cpp"
#: Greatest difference from a direct call, relative to the largest answer. The solvers of OInK and
#: cbfpy stop their iteration at a tolerance of their own, which magnifies rounding of their input.
#: TSID's QP is regularised by 1e-8 alone in the direction that the task leaves free on the Panda.
TOLERANCE = {"oink": 1e-8, "cbfpy": 1e-11, "tsid-panda": 1e-7}
EXACT = 1e-12
ACCELERATION = 40.0  #: Limit of accelerations in the recorded states [rad/s²].
TO_RANGE_LIMIT = 0.16  #: From the start to the ends of narrow ranges [rad].
MOST_AWAY = 0.156  #: From the start to the recorded states [rad]: near the ends of narrow ranges.
#: Settings of the adapters other than their defaults, and the acceleration limit of those that have
#: one, which entries of the suite switch on.
SETTINGS = {
    "pink": {"gain": 1.5, "barrier_gain": 3.0, "damping": 1e-2, "acceleration_limit": False},
    "mink": {"gain": 1.5, "view_gain": 3.0, "damping": 1e-2},
    "placo": {"gain": 1.5, "view_gain": 3.0, "regularization": 1e-4},
    "rtb": {"gain": 1.5, "view_gain": 3.0},
    "oink": {"gain": 1.5, "acceleration_limit": False},
    "tsid": {"stiffness": 20.0, "damping": 12.0},
    "cbfpy": {"gain": 1.5, "barrier_gain": 3.0},
    "mvt": {"gain": 1.5},
}


def python_of(adapter):
    if ENVIRONMENTS is None:
        pytest.skip("VSCONSTRAINTS_STACKS names no folder for the environments of the adapters")
    try:
        return make_environment(Path(ENVIRONMENTS), adapter)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"{adapter} cannot be installed here: {error}")


def narrow(robot):
    """The scene of an arm with ranges, speeds and accelerations that act near its start."""
    scenario = Scenario.load(f"{robot}-fov").with_override("sampling_time", 0.008)
    view, ranges, speeds = scenario.tables["constraints"]
    q0 = np.array(scenario.tables["q0"])
    lower = q0 - TO_RANGE_LIMIT
    upper = q0 + TO_RANGE_LIMIT
    ranges = {**ranges, "lower": lower.tolist(), "upper": upper.tolist()}
    speeds = {**speeds, "upper": [0.6] * len(q0)}
    scenario = scenario.with_override("constraints", [view, ranges, speeds])
    return scenario.with_override("limits", {"acceleration": ACCELERATION})


def recorded(feature="camera-pose", count=12, scenario=None, spread=0.15):
    """A setup message and states around the start of a scene, with what direct calls need.

    Joints are at most MOST_AWAY from the start, within the ranges of :func:`narrow`. With a larger
    ``spread``, many joints are exactly that far away.
    """
    scenario = Scenario.load("ur5-fov") if scenario is None else scenario
    setup = scenario.with_override("task.feature", feature).setup()
    scene = setup.scene
    measured = Measured(setup, tuple(USES))
    goal = setup.task.goals[0].camera
    random = np.random.default_rng(5)
    half = setup.constraints.constraints[0].half_size
    states = []
    while len(states) < count:
        away = random.uniform(-spread, spread, len(setup.q0))
        q = setup.q0 + away.clip(-MOST_AWAY, MOST_AWAY)
        qd = 2.0 * random.uniform(-spread, spread, len(q))
        state = scene.evaluate(0.0, q, qd)
        pixels = state.pixels.position
        if (np.abs(pixels) > half).any():
            continue
        now = measured(Observation(0.0, 0, q, qd, pixels, 0.0, state.camera, True))
        to_goal = state.camera.inverse @ goal
        J = state.pixels.J.reshape(-1, len(q))
        beyond = np.concatenate((pixels - half, -pixels - half)).ravel()
        twist = np.concatenate((to_goal.t, pin.log3(to_goal.R)))
        focal = np.array(scene.camera.focal)
        error = (pixels - setup.task.goals[0].pixels) / focal
        states.append(
            {name: np.asarray(value).tolist() for name, value in now.items()}
            | {
                "tip_goal": matrix(goal @ scene.camera.mount),
                "sigma": beyond.tolist(),
                "sigma_J": np.concatenate((J, -J)).tolist(),
                "depth": state.depth.tolist(),
                "twist": twist.tolist(),
                "error": error.ravel().tolist(),
                "error_J": (state.pixels.J / focal[:, None]).reshape(J.shape).tolist(),
            }
        )
    return setup_message(describe(setup, USES), {}), states


def answers_of(command, setup, states):
    """The answers of a stack to recorded states, by the protocol alone."""
    lines = b"\n".join(map(encode, (setup, *states))) + b"\n"
    done = subprocess.run(command, input=lines, capture_output=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr.decode()
    declared, *replies = map(json.loads, done.stdout.splitlines())
    assert set(declared["uses"]) <= set(USES)
    assert len(replies) == len(states)
    none = [math.nan] * len(setup["joints"])
    return np.array([reply.get(declared["output"], none) for reply in replies])


def literal_of(adapter, name):
    """The tuple or dict that an adapter assigns to a name; its package need not be installed."""
    tree = ast.parse((ADAPTERS / f"{adapter}_stack.py").read_text(encoding="utf-8"))
    (value,) = (
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign)
        and ast.unparse(node.targets[0]) == name
        and isinstance(node.value, ast.Tuple | ast.Dict)
    )
    return ast.literal_eval(value)


def entries():
    """Entries of comparisons/stacks.toml that are adapters, with each arm and feature of theirs."""
    suite = tomllib.loads(SUITE.read_text(encoding="utf-8"))
    cases = []
    for name, entry in suite["controllers"].items():
        adapter = entry.get("adapter")
        if adapter is None:
            continue
        own = SETTINGS[adapter]
        own = own | {key: value for key, value in entry.items() if key in own}
        for case in product(("ur5", "panda"), literal_of(adapter, "features")):
            cases.append(pytest.param(adapter, own, *case, id="-".join((name, *case))))
    return cases


@pytest.mark.slow
@pytest.mark.parametrize(("adapter", "settings", "robot", "feature"), entries())
def test_an_adapter_answers_what_a_direct_call_gives(adapter, settings, robot, feature, tmp_path):
    python = python_of(adapter)
    setup, states = recorded(feature, scenario=narrow(robot), spread=0.25)
    setup["settings"] = settings
    file = tmp_path / "recorded.json"
    file.write_bytes(encode({"setup": setup, "states": states}))
    answers = answers_of([python, ADAPTERS / f"{adapter}_stack.py"], setup, states)
    call = [python, Path(__file__).with_name("direct_peers.py"), adapter, file]
    done = subprocess.run(call, capture_output=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr.decode()
    direct = np.array(json.loads(done.stdout.splitlines()[-1]))
    assert np.isfinite(direct).all(axis=1).sum() > len(states) // 2
    largest = np.nanmax(np.abs(direct))
    assert largest > 0.1
    share = TOLERANCE.get(adapter, TOLERANCE.get(f"{adapter}-{robot}", EXACT))
    np.testing.assert_allclose(answers, direct, rtol=0.0, atol=share * largest)
    if settings.get("acceleration_limit"):
        # from each answer to the next; the first one starts from the measured speeds
        change = np.diff(answers, axis=0, prepend=[states[0]["qd"]]) / setup["period"]
        # OInK's solver meets limits to 1e-4
        assert np.isclose(np.abs(change), ACCELERATION, rtol=1e-3).sum() > 5
        # OInK gives way a little where its limits of range and acceleration exclude each other
        assert np.nanmax(np.abs(change)) < 1.05 * ACCELERATION


@pytest.mark.parametrize("adapter", adapters())
def test_an_adapter_states_its_packages(adapter):
    assert "numpy" in requirements(adapter)
    assert any("==" in package for package in requirements(adapter))


@pytest.mark.parametrize("adapter", adapters())
def test_an_adapter_describes_its_settings(adapter):
    tree = ast.parse((ADAPTERS / f"{adapter}_stack.py").read_text(encoding="utf-8"))
    named = re.findall(r"^(\w+(?:, \w+)*)$", ast.get_docstring(tree), re.MULTILINE)
    described = ", ".join(named).split(", ")
    assert set(literal_of(adapter, "DEFAULTS")) == set(described) - {"Settings"}


def test_a_setting_that_an_adapter_does_not_have_is_named(monkeypatch):
    monkeypatch.syspath_prepend(ADAPTERS)
    from servoing import settings_of

    defaults = {"gain": 2.0, "view_gain": 5.0}
    assert settings_of({"settings": {"gain": 1.0}}, defaults) == {"gain": 1.0, "view_gain": 5.0}
    with pytest.raises(SystemExit, match="unknown setting 'gian': there are gain, view_gain"):
        settings_of({"settings": {"gian": 1.0}}, defaults)


@pytest.mark.parametrize("adapter", adapters())
def test_an_adapter_declares_the_features_of_the_documentation(adapter):
    table = Path(__file__).parents[1].joinpath("docs", "stacks.md").read_text(encoding="utf-8")
    (features,) = re.findall(rf"^\| `{adapter}` \|[^|]*\|([^|]*)\|", table, re.MULTILINE)
    words = {"camera-pose": "pose", "image-points": "points"}
    assert ", ".join(words[name] for name in literal_of(adapter, "features")) == features.strip()


@pytest.mark.parametrize("feature", ["line", "polar", "my:Feature", "image-points"])
def test_a_feature_by_which_an_adapter_does_not_servo_is_named(monkeypatch, feature):
    monkeypatch.syspath_prepend(ADAPTERS)
    from servoing import Scene

    setup, _ = recorded(count=0)
    assert Scene(setup, ("camera-pose",)).feature == "camera-pose"
    with pytest.raises(SystemExit, match=f"the feature {feature}, only by camera-pose"):
        Scene({**setup, "feature": feature}, ("camera-pose",))


def test_a_goal_without_a_pose_ends_an_adapter_that_needs_one(monkeypatch):
    monkeypatch.syspath_prepend(ADAPTERS)
    from servoing import Scene

    setup, (state,) = recorded("image-points", 1)
    scene = Scene({**setup, "goals": [WITHOUT_A_POSE]}, ("image-points",))
    error, _ = scene.image_error(state)
    assert len(error) == 8
    with pytest.raises(SystemExit, match="needs goals with a pose"):
        scene.tip_goal(state, np.eye(4))
    with pytest.raises(SystemExit, match="needs goals with a pose"):
        scene.depth(WITHOUT_A_POSE)


@pytest.mark.slow
@pytest.mark.parametrize("adapter", adapters())
def test_an_adapter_refuses_another_feature(adapter):
    setup, _ = recorded(count=0)
    known = " or ".join(literal_of(adapter, "features"))
    command = [python_of(adapter), ADAPTERS / f"{adapter}_stack.py"]
    reason = refusal_of(command, {**setup, "feature": "line"})
    assert f"the feature line, only by {known}" in reason


def refusal_of(command, setup, state=None):
    """The last messages of a stack that ends before its first answer."""
    lines = b"\n".join((encode(setup), b"" if state is None else encode(state))) + b"\n"
    done = subprocess.run(command, input=lines, capture_output=True, check=False, timeout=300)
    assert done.returncode != 0
    assert len(done.stdout.splitlines()) == 1  # the declaration alone
    return done.stderr.decode()


def with_visp(source, folder):
    """A program of ViSP, compiled into a folder; skips the test where that is not possible."""
    compiler = shutil.which("c++")
    program = folder / source.stem
    libraries = ["-lvisp_core", "-lvisp_visual_features", "-lvisp_vs", "-lvisp_robot"]
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    probe = [compiler, "-x", "c++", "-fsyntax-only", "-include", "visp3/vs/vpServo.h", os.devnull]
    if subprocess.run(probe, capture_output=True, check=False).returncode:
        pytest.skip("ViSP is not installed: Debian's libvisp-vs-dev")
    subprocess.run([compiler, "-O2", "-std=c++17", source, "-o", program, *libraries], check=True)
    return program


@pytest.fixture(scope="module")
def visp(tmp_path_factory):
    return with_visp(VISP, tmp_path_factory.mktemp("visp"))


@pytest.fixture(scope="module")
def visp_direct(tmp_path_factory):
    return with_visp(ROOT / "tests" / "data" / "visp_direct.cpp", tmp_path_factory.mktemp("direct"))


#: Defaults of controllers/visp; those of the avoidance are ViSP's own.
VISP_DEFAULTS = {
    "gain": 1.0,
    "gain_at_zero": 0.0,
    "slope": 30.0,
    "avoidance": 0.0,
    "rho": 0.1,
    "rho1": 0.3,
    "lambda_tune": 0.7,
    "saturation": 1.0,
    "desired": 0.0,
}

OWN_AVOIDANCE = {"rho": 0.2, "rho1": 0.4, "lambda_tune": 0.5}


def numbers_for_visp(setup, states):
    """The numbers that tests/data/visp_direct.cpp reads, with the tip's Jacobian by Pinocchio."""
    own = VISP_DEFAULTS | setup["settings"]
    model = pin.buildModelFromXML(setup["urdf"])
    tip = model.getFrameId(setup["tip"])
    camera = setup["camera"]
    (goal,) = setup["goals"]
    markers = setup["target"]["markers"]
    limits = setup["limits"]
    yield setup["feature"] == "image-points", own["desired"]
    yield own["gain_at_zero"] or own["gain"], own["gain"], own["slope"]
    yield own["avoidance"], own["rho"], own["rho1"], own["lambda_tune"], own["saturation"]
    yield model.nv, *limits["lower"], *limits["upper"], *limits["velocity"]
    yield from (camera["intrinsics"], camera["camera_in_tip"])
    yield from (len(markers), markers, np.linalg.inv(goal["camera_in_target"]), goal["pixels"])
    yield len(states)
    for state in states:
        q = np.array(state["q"])
        yield q
        yield pin.computeFrameJacobian(model, model.createData(), q, tip, pin.LOCAL)
        yield from (np.linalg.inv(state["camera_in_target"]), state["pixels"])


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["ur5", "panda"])
@pytest.mark.parametrize("feature", ["image-points", "camera-pose"])
@pytest.mark.parametrize(
    "settings",
    [
        {"saturation": 0.0},
        {"gain": 0.3, "desired": 1.0},
        {"gain": 0.4, "gain_at_zero": 4.0, "saturation": 0.0},
        {"gain": 0.2, "avoidance": 1.0},
        {"gain": 0.2, "gain_at_zero": 0.3, "slope": 20.0, "avoidance": 1.0, **OWN_AVOIDANCE},
    ],
    ids=["current", "desired", "adaptive", "avoidance", "own-avoidance"],
)
def test_visp_answers_what_a_direct_call_gives(visp, visp_direct, robot, feature, settings):
    setup, states = recorded(feature, scenario=narrow(robot), spread=0.25)
    setup["settings"] = settings
    random = np.random.default_rng(6)
    for state in states:  # measured pixels, which are not quite those of the pose
        noise = random.normal(size=np.shape(state["pixels"]))
        state["pixels"] = (np.array(state["pixels"]) + noise).tolist()
    answers = answers_of([visp], setup, states)
    numbers = np.concatenate([np.ravel(part) for part in numbers_for_visp(setup, states)])
    done = subprocess.run(
        [visp_direct],
        input=" ".join(map(str, numbers.tolist())).encode(),
        capture_output=True,
        check=True,
        timeout=300,
    )
    direct = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
    largest = np.abs(direct).max()
    assert largest > 0.1
    np.testing.assert_allclose(answers, direct, rtol=0.0, atol=EXACT * largest)


@pytest.mark.slow
@pytest.mark.parametrize("feature", ["image-points", "camera-pose"])
def test_visp_answers_its_control_law(visp, feature):
    """q̇ = −λ (L J)† e by NumPy, from ViSP's documentation: ViSP has no binding to call directly."""
    setup, states = recorded(feature)
    setup["settings"] = {"saturation": 0.0, "gain": 0.7}
    answers = answers_of([visp], setup, states)
    f = np.array(setup["camera"]["intrinsics"][:2])
    c = np.array(setup["camera"]["intrinsics"][2:])
    goal = setup["goals"][0]
    for state, answer in zip(states, answers, strict=True):
        J = np.array(state["jacobian"])
        if feature == "image-points":
            x = (np.array(state["pixels"]) - c) / f
            error = (x - (np.array(goal["pixels"]) - c) / f).ravel()
            L_J = (np.array(state["sigma_J"])[: 2 * len(x)].reshape(-1, 2, 6) / f[:, None]).reshape(
                -1, 6
            )
        else:
            moved = np.linalg.inv(goal["camera_in_target"]) @ np.array(state["camera_in_target"])
            turn = pin.log3(moved[:3, :3])
            error = np.concatenate((moved[:3, 3], turn))
            # L_θu of cdRc, and R for the translation of the camera in its frame at the goal
            L = np.zeros((6, 6))
            L[:3, :3] = moved[:3, :3]
            L[3:, 3:] = np.linalg.inv(pin.Jexp3(turn))
            L_J = L @ J
        assert (
            np.abs(answer + 0.7 * np.linalg.pinv(L_J) @ error).max() < 1e-9 * np.abs(answer).max()
        )


WITHOUT_A_POSE = {"from": 0.0, "pixels": [[300.0, 200.0]] * 4, "camera_in_target": None}
LENS = {"model": "plumb_bob", "coefficients": [0.1, 0.0, 0.0, 0.0]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("section", "changed", "reason"),
    [
        ("settings", {"gain": 1.0, "gian": 4.0}, "unknown setting 'gian': there are gain, gain_at"),
        ("settings", {"avoidance": True}, "the setting avoidance must be a number"),
        ("feature", "line", "the feature line, only by camera-pose or image-points"),
        ("feature", "my:Feature", "the feature my:Feature, only by"),
        ("camera", {"distortion": LENS}, "cameras without distortion, not plumb_bob"),
        ("goals", [WITHOUT_A_POSE], "needs goals with a pose of the camera"),
    ],
)
def test_visp_refuses_what_it_would_not_servo_as_it_says(visp, section, changed, reason):
    setup, (state,) = recorded("image-points", 1)
    if section == "camera":
        changed = setup["camera"] | changed
    assert reason in refusal_of([visp], {**setup, section: changed}, state)


@pytest.mark.slow
def test_visp_avoids_a_limit_unless_the_primary_task_is_fast(visp):
    """The report visp#1946: avoidance vanishes where it is needed most."""
    setup, states = recorded("camera-pose", 1)
    q = np.array(states[0]["q"])
    upper = q + 1.0
    upper[2] = q[2] + 0.02  # the primary task moves joint 3 towards this limit
    limits = {**setup["limits"], "lower": (q - 1.0).tolist(), "upper": upper.tolist()}
    speeds = {}
    for gain in (2.0, 4.0):
        for avoidance in (0.0, 1.0):
            own = {"saturation": 0.0, "gain": gain, "avoidance": avoidance}
            task = {**setup, "limits": limits, "settings": own}
            speeds[gain, avoidance] = answers_of([visp], task, states)[0, 2]
    assert speeds[2.0, 0.0] > 0.7
    assert speeds[2.0, 1.0] < -0.5
    assert speeds[4.0, 1.0] == speeds[4.0, 0.0] > 1.4


@pytest.mark.slow
def test_the_example_in_c_compiles_and_answers_as_the_one_in_python(tmp_path):
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    examples = Path(__file__).parents[1] / "examples" / "stacks"
    program = tmp_path / "image_based"
    subprocess.run(
        [compiler, "-O2", "-std=c++17", examples / "image_based.cpp", "-o", program], check=True
    )
    setup, states = recorded("image-points")
    ours = answers_of([sys.executable, examples / "image_based.py"], setup, states)
    theirs = answers_of([program], setup, states)
    distorted = {**setup, "camera": setup["camera"] | {"distortion": LENS}}
    for command in ([sys.executable, examples / "image_based.py"], [program]):
        assert "without distortion" in refusal_of(command, distorted, states[0])
    # damped by 1e-8 in C++, the pseudoinverse in Python
    assert np.abs(ours - theirs).max() < 1e-4 * np.abs(ours).max()
