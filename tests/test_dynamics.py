"""Arms with mass: their mechanics against Pinocchio, MuJoCo and laws of conservation, their
controllers by hand.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from checks import physics

from vsconstraints import Robot
from vsconstraints.compiled.memory import Workspace
from vsconstraints.controllers import HierarchicalQP, SlidingMode
from vsconstraints.dynamics import (
    ArmDynamics,
    DynamicPlant,
    Friction,
    MujocoDynamics,
    Payload,
    Rods,
)
from vsconstraints.dynamics.equivalent import Equivalent, lagged
from vsconstraints.dynamics.figure import draw_disturbance
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.reports.figures.view import View
from vsconstraints.robots import ready_made
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, simulate

RODS = {"mass_per_length": 20.0, "radius": 0.05}
ARMS = ("viper-s650", "ur5", "panda")
REFUSED = (ConfigurationError, InvalidInput)


def plant(
    name: str, *, Ts: float = 0.002, q: Any = None, qd: Any = None, **settings: Any
) -> DynamicPlant:
    robot = ready_made(name)
    if name == "viper-s650":
        settings.setdefault("rods", Rods(**RODS))
    kind = settings.pop("kind", ArmDynamics)
    middle = np.where(np.isfinite(robot.q_min), 0.5 * (robot.q_min + robot.q_max), 0.0)
    q = middle + 0.3 * np.sin(np.arange(1.0, robot.n + 1.0)) if q is None else np.array(q)
    qd = np.zeros(robot.n) if qd is None else np.array(qd)
    settings.setdefault("effort", 1e6)
    settings.setdefault("speed", 1e6)
    return DynamicPlant(robot, kind(**settings), q, qd, Ts)


def free(there: DynamicPlant) -> DynamicPlant:
    """The same arm without any torque."""
    drive = there.arm.drive._replace(effort=np.full(there.robot.n, 1e-300))
    there.arm = there.arm._replace(drive=drive)
    there.arm.memory.torque[:] = 0.0
    there.arm.memory.under_way[:] = 0.0
    there.workspace = Workspace(there.arm)
    there.mover = there.mover[0], there.workspace.address
    return there


def energy(there: DynamicPlant) -> tuple[float, float]:
    """Total and kinetic energy, by Pinocchio."""
    data = there.model.createData()
    kinetic = pin.computeKineticEnergy(there.model, data, there.q, there.qd)
    return kinetic + pin.computePotentialEnergy(there.model, data, there.q), kinetic


def case(name: str = "case-study-6r", duration: float = 1.0, **settings: Any) -> Setup:
    table = {"type": "dynamics", **({"rods": RODS} if name == "case-study-6r" else {}), **settings}
    return (
        Scenario.load(name)
        .with_override("duration", duration)
        .with_override("plant", table)
        .setup()
    )


def held(there: DynamicPlant, periods: int, qdd: Any = 0.0) -> tuple[Array, Array]:
    """Q and q̇ (N, n) of periods with the same command."""
    states = []
    for _ in range(periods):
        there.begin(np.broadcast_to(qdd, there.robot.n))
        there.follow()
        states.append((there.q, there.qd))
    q, qd = zip(*states, strict=True)
    return np.array(q), np.array(qd)


# --- mechanics ---


@pytest.mark.parametrize("name", ARMS)
def test_inertia_and_bias_are_pinocchios(name: str) -> None:
    """The compiled recursion gives crba and nonLinearEffects, with payload and rotors, at any
    state.
    """
    rng = np.random.default_rng(4)
    ball = Payload(1.3, (0.02, -0.03, 0.1), 0.05)
    compiled = free(
        plant(name, payload=ball, rotor_inertia=0.1, substeps=1, integrator="runge-kutta")
    )
    for _ in range(5):
        compiled.x[:2] = rng.uniform(-1.5, 1.5, size=(2, compiled.robot.n))
        compiled.follow()
        data = compiled.model.createData()
        M = np.tril(np.triu(pin.crba(compiled.model, data, compiled.q)).T)
        h = pin.nonLinearEffects(compiled.model, data, compiled.q, compiled.qd)
        np.testing.assert_allclose(np.tril(compiled.arm.motion.M), M, atol=1e-12 * np.abs(M).max())
        np.testing.assert_allclose(compiled.arm.motion.bias, h, atol=1e-11 * np.abs(h).max())


@pytest.mark.parametrize(
    ("integrator", "least"),
    # twice what the Panda's light wrist makes of the second order
    [("runge-kutta", 1e-6), ("verlet", 5e-4)],
)
@pytest.mark.parametrize("name", ARMS)
def test_the_energy_of_a_free_arm_is_kept(name: str, integrator: str, least: float) -> None:
    """It falls and swings for 2 s, without torque and friction; relative to the greatest kinetic
    energy.
    """
    there = free(plant(name, integrator=integrator))
    begun = energy(there)[0]
    most = 0.0
    worst = 0.0
    for _ in range(100):
        for _ in range(10):
            there.follow()
        now, kinetic = energy(there)
        most = max(most, kinetic)
        worst = max(worst, abs(now - begun))
    assert most > 5.0
    assert worst < least * most


def test_a_rod_swings_as_by_hand() -> None:
    """One rod about a horizontal axis: M = m l²/3 + m r²/4, h = m g l/2 cos q; q̈ of the first
    moment.
    """
    arm = Robot.from_dh([[0.0, 0.0, 0.8, 0.0]], name="rod")
    rods = Rods(mass_per_length=5.0, radius=0.02)
    settings = ArmDynamics(rods=rods, gravity=(0.0, -9.81, 0.0), substeps=1)
    there = free(DynamicPlant(arm, settings, np.array([0.3]), np.zeros(1), 1e-4))
    there.follow()
    m = 5.0 * 0.8
    M = m * 0.8**2 / 3.0 + m * 0.02**2 / 4.0
    assert there.qd[0] == pytest.approx(-1e-4 * m * 9.81 * 0.4 * np.cos(0.3) / M, rel=1e-6)


# --- controllers ---


@pytest.mark.parametrize("law", [SlidingMode(), HierarchicalQP()], ids=lambda law: law.name)
@pytest.mark.parametrize("name", ["case-study-6r", "ur5-fov", "panda-fov"])
def test_computed_torque_with_the_exact_model_is_the_acceleration_plant(
    name: str, law: Any
) -> None:
    """As long as no torque is at its limit: those of ur5-fov are, in its first milliseconds."""
    there = case(name, effort=1e6, speed=1e6)
    plain = simulate(Scenario.load(name).with_override("duration", 1.0).setup(), law)
    run = simulate(there, law)
    assert len(run.t) == len(plain.t)
    np.testing.assert_allclose(run.q, plain.q, atol=1e-6)
    np.testing.assert_allclose(run.qd, plain.qd, atol=1e-6)


def test_a_wrong_model_is_felt_as_much_as_it_is_wrong() -> None:
    """Without feedback to speak of: M q̈ = M̂ q̈_c + ĥ − h at the first moment, from Pinocchio."""
    q = [0.2, -1.0, 0.8, 0.3, 0.5, 0.1]
    there = plant("ur5", q=q, mass_factor=1.2, bandwidth=1e-6, substeps=1, Ts=1e-5)
    command = np.array([1.0, -2.0, 0.5, 1.0, -1.0, 2.0])
    _, qd = held(there, 1, command)
    model = Robot.from_urdf(there.robot.source.path, tip="tool0").model  # type: ignore[union-attr]
    data = model.createData()
    M = pin.crba(model, data, np.array(q))
    M = np.triu(M) + np.triu(M, 1).T
    weight = pin.computeGeneralizedGravity(model, data, np.array(q))
    np.testing.assert_allclose(
        qd[-1] / 1e-5, np.linalg.solve(M, 1.2 * M @ command + 0.2 * weight), rtol=1e-3
    )


@pytest.mark.parametrize(
    ("controller", "holds"), [("position", True), ("speed", False), ("computed-torque", False)]
)
def test_only_the_position_loop_comes_back_under_an_unknown_payload(
    controller: str, holds: bool
) -> None:
    """After 2 s at rest: the integral in it holds the payload; the others hold it by staying
    below.
    """
    settings: dict[str, Any] = {"payload": Payload(1.0), "payload_factor": 0.0}
    q, qd = held(
        plant("ur5", controller=controller, q=[0.0, -0.8, 1.2, 0.0, 0.5, 0.0], **settings), 1000
    )
    assert np.abs(qd[-1]).max() < 1e-3
    away = np.abs(q[-1] - [0.0, -0.8, 1.2, 0.0, 0.5, 0.0]).max()
    assert away < 1e-4 if holds else 1e-4 < away < 0.1


def test_torques_come_late_as_stated() -> None:
    """A dead time of 3 substeps: the first command shows in the fourth; a lag is an exponential."""
    q = [0.0, -1.5, 0.0, 0.0, 0.0, 0.0]
    there = plant(
        "ur5", q=q, Ts=0.001, substeps=1, dead_time=0.003, gravity=(0, 0, 0), bandwidth=1e-6
    )
    _, qd = held(there, 5, 1.0)
    assert np.abs(qd[2]).max() < 1e-9
    np.testing.assert_allclose(qd[3], 0.001, rtol=1e-2)
    late = plant("ur5", q=q, Ts=0.001, substeps=10, lag=0.01, gravity=(0, 0, 0), bandwidth=1e-6)
    _, qd = held(late, 20, 1.0)
    t = 0.02
    np.testing.assert_allclose(qd[-1], t - 0.01 * (1.0 - np.exp(-t / 0.01)), rtol=2e-2)


def test_torques_and_references_are_limited() -> None:
    there = plant("ur5", q=[0.0, -1.5, 0.0, 0.0, 0.0, 0.0], effort=60.0, speed=0.1)
    held(there, 100, 50.0)
    assert (np.abs(there.arm.memory.torque) <= 60.0).all()
    assert there.remarks()
    assert "more torque than its 60 Nm" in there.remarks()[0]
    np.testing.assert_allclose(there.arm.memory.qd_c, 0.1)


# --- friction ---


def test_friction_slows_a_joint_as_by_hand() -> None:
    """One joint without gravity: I q̈ = −f_c − f_v q̇, until it stops, where it stays."""
    arm = Robot.from_dh([[0.0, 0.0, 0.5, 0.0]], name="rod")
    friction = Friction(viscous=0.2, coulomb=0.5)
    settings = ArmDynamics(rods=Rods(10.0, 0.05), friction=friction, gravity=(0, 0, 0))
    there = free(DynamicPlant(arm, settings, np.zeros(1), np.array([1.0]), 0.002))
    inertia = pin.crba(there.model, there.model.createData(), np.zeros(1))[0, 0]
    a = 0.2 / inertia
    b = 0.5 / inertia
    q, qd = held(there, 500)
    stops = np.log(1.0 + a / b) / a
    t = 0.002 * np.arange(1, 501)
    expected = np.where(t < stops, (1.0 + b / a) * np.exp(-a * t) - b / a, 0.0)
    np.testing.assert_allclose(qd[:, 0], expected, atol=1e-3)
    assert 0.1 < stops < 0.9
    assert np.abs(qd[t > stops + 0.002]).max() < 1e-12
    assert q[-1, 0] == q[-100, 0]


def test_static_friction_holds_up_to_its_limit_and_gives_way_with_stribecks_curve() -> None:
    """An arm without torque sticks while its weight is below f_s, and falls where it is above."""
    arm = Robot.from_dh([[0.0, 0.0, 0.5, 0.0]], name="rod")
    weight = 10.0 * 0.5 * 9.81 * 0.25
    for static, sticks in ((1.01 * weight, True), (0.99 * weight, False)):
        friction = Friction(coulomb=0.1 * weight, static=static, stribeck_speed=0.05)
        settings = ArmDynamics(rods=Rods(10.0, 0.05), friction=friction, gravity=(0, -9.81, 0))
        there = free(DynamicPlant(arm, settings, np.zeros(1), np.zeros(1), 0.002))
        q, _ = held(there, 100)
        assert bool(np.abs(q).max() < 1e-12) is sticks
        if not sticks:
            # far beyond v_s only Coulomb's is left
            inertia = pin.crba(there.model, there.model.createData(), np.zeros(1))[0, 0]
            left = weight * np.cos(q[-1, 0]) - 0.1 * weight
            before = there.qd[0]
            there.follow()
            assert (before - there.qd[0]) / 0.002 == pytest.approx(left / inertia, rel=2e-2)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_friction_only_takes_energy_away(name: str) -> None:
    rng = np.random.default_rng(1)
    friction = Friction(viscous=2.0, coulomb=3.0, static=4.0)
    n = ready_made(name).n
    there = free(plant(name, friction=friction, qd=rng.uniform(-1.0, 1.0, n), gravity=(0, 0, 0)))
    kinetic = [energy(there)[1]]
    for _ in range(300):
        there.follow()
        kinetic.append(energy(there)[1])
    assert (np.diff(kinetic) <= 1e-9).all()
    assert kinetic[-1] < 0.2 * kinetic[0]


# --- the closed loop ---


def test_a_run_that_loses_all_bounds_fails_and_says_so() -> None:
    run = simulate(case("ur5-fov", controller="speed", bandwidth=1e5, effort=1e9), HierarchicalQP())
    assert run.status == "failed"
    assert "the arm's motion has no bounds: joint" in run.reason


def test_clearances_between_samples_are_looked_at() -> None:
    """The cubic through both ends is within 1e-7 of the motion that substeps give."""
    coarse = case(duration=0.2)
    fine = case(duration=0.2)
    run = simulate(coarse, HierarchicalQP())
    assert np.isfinite(run.between_clearance).any() or (run.clearance > 0.0).all()
    there = fine.plant()
    states = np.zeros((2, 4, 6))
    half = DynamicPlant(fine.scene.robot, fine.dynamics, fine.q0, fine.qd0, 0.001)  # type: ignore[arg-type]
    for one in (there, half):
        one.begin(np.full(6, 2.0))
    states[0] = there.x
    there.follow()
    half.follow()
    states[1] = there.x
    q, qd = there.within(states, np.array([0]), 0.5)
    np.testing.assert_allclose(q[0], half.q, atol=1e-7)
    np.testing.assert_allclose(qd[0], half.qd, atol=1e-4)


# --- MuJoCo ---


@pytest.mark.parametrize("name", ARMS)
def test_mujoco_moves_the_same_arm(name: str) -> None:
    """A URDF loaded directly, and a chain built body by body: falling with a payload, and driven
    with friction.
    """
    pytest.importorskip("mujoco")
    ball = Payload(0.7, (0.0, 0.02, 0.05), 0.03)
    for settings in (
        {"integrator": "runge-kutta"},
        {"controller": "position", "friction": Friction(0.2, 0.5)},
    ):
        ours, theirs = (
            plant(name, kind=kind, payload=ball, **settings)
            for kind in (ArmDynamics, MujocoDynamics)
        )
        for there in (ours, theirs):
            if "integrator" in settings:
                free(there)
                held(there, 10)
            else:
                held(there, 10, 2.0)
        assert np.abs(ours.qd).max() > 0.03
        np.testing.assert_allclose(
            theirs.q, ours.q, atol=1e-7 if "integrator" in settings else 1e-4
        )


# --- bad input ---


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"type": "dynamic"}, "type in case-study-6r.plant 'dynamic'.*Did you mean 'dynamics'"),
        ({"controller": "torque"}, "controller in case-study-6r.plant 'torque'"),
        ({"integrator": "euler"}, "integrator in case-study-6r.plant 'euler'"),
        ({"bandwith": 3.0}, "key in case-study-6r.plant 'bandwith'.*Did you mean 'bandwidth'"),
        ({"bandwidth": 0.0}, "plant: bandwidth must be positive"),
        ({"substeps": 0}, "plant: substeps must be a whole number from 1 to"),
        ({"substeps": 2.5}, "substeps must be an integer"),
        ({"mass_factor": 0.0}, "plant: mass_factor must be positive"),
        ({"payload_factor": -1.0}, "plant: payload_factor must be zero or more"),
        ({"payload": {"mass": -1.0}}, "plant.payload: mass must be zero or more"),
        (
            {"payload": {"centre": [0, 0, 0]}},
            "case-study-6r.plant.payload: the key 'mass' is missing",
        ),
        ({"friction": {"coulomb": -1.0}}, "plant: friction: coulomb must be zero or more"),
        (
            {"friction": {"coulomb": 2.0, "static": 1.0}},
            "plant.friction: static must not be less than coulomb",
        ),
        ({"friction": {"viscous": [1.0, 2.0]}}, "plant: friction: viscous must be one number or 6"),
        ({"friction": {"dry": 1.0}}, "key in case-study-6r.plant.friction 'dry'"),
        (
            {"dead_time": 0.0003},
            "plant: dead_time must be a multiple of the substep, 0.0002 s, not 0.0003",
        ),
        ({"lag": -0.1}, "plant: lag must be zero or more"),
        ({"effort": [1.0]}, "plant: effort must be one number or 6"),
        ({"rods": {"radius": 0.1}}, "plant.rods: the key 'mass_per_length' is missing"),
        (
            {"rods": {"radius": 0.1, "mass_per_length": 0.0}},
            "plant.rods: mass_per_length must be positive",
        ),
        ({"gravity": [0.0, 0.0]}, "gravity must be 3 numbers"),
        (
            {"effort": 5.0},
            r"torques \[Nm or N\] cannot hold 6R \(Viper s650\) at its start: joint 2 .* has 5",
        ),
    ],
)
def test_plants_of_nonsense_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(REFUSED, match=words):
        case(**settings)


def test_an_arm_without_inertias_is_refused_until_rods_are_given() -> None:
    bare = Scenario.load("case-study-6r")
    with pytest.raises(
        ConfigurationError, match=r"links of 6R .Viper s650. have no masses.*<inertial>.*plant.rods"
    ):
        bare.with_override("plant", {"type": "dynamics"}).setup()
    with pytest.raises(
        ConfigurationError, match="rods replace missing inertias, but the URDF of UR5 has inertias"
    ):
        case("ur5-fov", rods=RODS)
    with pytest.raises(ConfigurationError, match=r"moves nothing with inertia.*rotor_inertia"):
        Scenario.load("free-camera").with_override(
            "plant", {"type": "dynamics", "rods": RODS}
        ).setup()


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("actuation", "position", 'actuation = "position" applies to an arm without mass'),
        (
            "disturbances.acceleration",
            [0.1],
            "disturbances.acceleration applies to an arm without mass",
        ),
        (
            "disturbances.time_constant",
            0.1,
            "disturbances.time_constant applies to an arm without mass",
        ),
        (
            "disturbances.command_delay",
            0.1,
            "disturbances.command_delay applies to an arm without mass",
        ),
    ],
)
def test_an_arm_has_one_plant(key: str, value: Any, words: str) -> None:
    table = {"type": "dynamics", "rods": RODS}
    with pytest.raises(ConfigurationError, match=words):
        Scenario.load("case-study-6r").with_override("plant", table).with_override(
            key, value
        ).setup()


# --- eq. (6) ---


def test_what_a_lag_and_a_push_amount_to_is_found_again() -> None:
    """Runs of the arm without mass, whose C and d_c are known."""
    scenario = Scenario.load("case-study-6r").with_override("duration", 1.0)
    for key, value in (("time_constant", 0.02), ("acceleration", [0.1, -0.2, 0.0, 0.1, 0.0, 0.0])):
        scenario = scenario.with_override(f"disturbances.{key}", value)
    found = Equivalent.of(simulate(scenario.setup(), HierarchicalQP()))
    np.testing.assert_allclose(found.time_constant, 0.02, rtol=0.1)
    np.testing.assert_allclose(
        found.disturbance.mean(axis=0), [0.1, -0.2, 0.0, 0.1, 0.0, 0.0], atol=0.02
    )
    assert np.abs(found.disturbance - found.disturbance.mean(axis=0)).max() < 0.2
    assert lagged(np.ones((2000, 1)), 0.02, 0.002)[-1, 0] == pytest.approx(1.0)
    assert lagged(np.ones((1, 1)), 0.02, 0.002)[0, 0] == pytest.approx(
        1.0 - 0.02 / 0.002 * (1.0 - np.exp(-0.1))
    )


def test_an_exact_arm_disturbs_nothing_and_a_wrong_model_does() -> None:
    exact, wrong = (
        Equivalent.of(simulate(case(**one), HierarchicalQP())) for one in ({}, {"mass_factor": 1.2})
    )
    assert np.abs(exact.disturbance).max() < 1e-6
    assert (exact.time_constant == 0.0).all()
    assert wrong.rms.max() > 0.01


def test_the_figure_of_the_disturbance_is_for_arms_with_mass_alone() -> None:
    there = case(duration=0.3, mass_factor=1.2)
    plain = Scenario.load("case-study-6r").setup()
    record = SimpleNamespace(
        trajectory=simulate(there, HierarchicalQP()), goal_begins=there.goal_begins
    )
    view = View(there, {"hierarchical-qp": record}, ["hierarchical-qp"])  # type: ignore[dict-item]
    assert draw_disturbance(view) is not None
    assert draw_disturbance(replace(view, setup=plain)) is None


def test_mujoco_and_this_package_run_the_case_study_alike() -> None:
    """All of its 10 s, with a wrong model; fewer substeps than usual, for the sake of time."""
    pytest.importorskip("mujoco")
    settings = {
        **physics.PLANTS["computed torque, wrong model"],
        "substeps": 2,
        "integrator": "runge-kutta",
    }
    assert physics.difference("case-study-6r", settings) < physics.MOST
