"""Robots against independent kinematics: matrix products, Pinocchio called directly, and published
parameters.
"""

from __future__ import annotations

from importlib.metadata import distribution
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

from scenes import (
    arm_with_prismatic_joints,
    random_configuration,
    robot,
    robot_names,
    rotation_matrix,
)
from vsconstraints import Robot, RobotPoint
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.robots import READY_MADE, ready_made
from vsconstraints.rows import Array

PI = np.pi


# --- DH tables ---


def homogeneous(R: Array, t: Array) -> Array:
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t
    return T


def about_z(angle: float) -> Array:
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_x(angle: float) -> Array:
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def standard_dh(table: Array, prismatic: set[int], q: Array) -> list[Array]:
    """Poses (4, 4) of all link frames: products of Rz(θ) Tz(d) Tx(a) Rx(α)."""
    frames = []
    T = np.eye(4)
    for i, (theta, d, a, alpha) in enumerate(np.asarray(table, dtype=float)):
        slides = i + 1 in prismatic
        turn = homogeneous(about_z(theta + (0.0 if slides else q[i])), np.zeros(3))
        shift = homogeneous(np.eye(3), np.array([0.0, 0.0, d + (q[i] if slides else 0.0)]))
        reach = homogeneous(np.eye(3), np.array([a, 0.0, 0.0]))
        T = T @ turn @ shift @ reach @ homogeneous(about_x(alpha), np.zeros(3))
        frames.append(T)
    return frames


def modified_dh(table: Array, q: Array) -> Array:
    """Pose (4, 4) of the last frame in Craig's convention: products of Rx(α) Tx(a) Rz(θ) Tz(d)."""
    T = np.eye(4)
    for (a, d, alpha), angle in zip(table, q, strict=True):
        T = T @ homogeneous(about_x(alpha), np.array([a, 0.0, 0.0]))
        T = T @ homogeneous(about_z(angle), np.array([0.0, 0.0, d]))
    return T


PAPER_TABLES = {
    # Tables 1 to 3 of the paper: θ offset, d, a, α
    "planar-3r": [[0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 0, -PI]],
    "viper-s650": [
        [0, 0.335, 0.075, -PI / 2],
        [0, 0, 0.27, 0],
        [0, 0, 0.09, PI / 2],
        [0, -0.295, 0, -PI / 2],
        [0, 0, 0, PI / 2],
        [-PI / 2, -0.08, 0, PI],
    ],
    "kuka-kr6": [
        [0, -0.400, 0.025, PI / 2],
        [0, 0, -0.455, 0],
        [0, 0, -0.035, -PI / 2],
        [0, -0.420, 0, PI / 2],
        [0, 0, 0, -PI / 2],
        [0, -0.080, 0, PI],
    ],
}


@pytest.mark.parametrize("name", PAPER_TABLES)
def test_the_papers_arms_are_the_product_of_their_dh_matrices(name: str) -> None:
    arm = robot(name)
    rng = np.random.default_rng(1)
    for _ in range(10):
        q = rng.uniform(-PI, PI, arm.n)
        frames = standard_dh(np.array(PAPER_TABLES[name]), set(), q)
        pose = arm.pose(q)
        np.testing.assert_allclose(homogeneous(pose.R, pose.t), frames[-1], atol=1e-13)


def test_any_dh_table_with_prismatic_joints_is_the_product_of_its_matrices() -> None:
    rng = np.random.default_rng(2)
    for trial in range(20):
        n = int(rng.integers(1, 9))
        table = rng.uniform(-2.0, 2.0, (n, 4))
        prismatic = {int(i) + 1 for i in np.flatnonzero(rng.random(n) < 0.4)}
        arm = Robot.from_dh(table, prismatic=sorted(prismatic))
        q = rng.uniform(-2.0, 2.0, n)
        offset = rng.uniform(-1.0, 1.0, 3)
        points = [RobotPoint(f"link {i + 1}", tuple(offset)) for i in range(n)]
        found = arm.kinematics(q, np.zeros(n), points)
        # one joint too has a matrix for its Jacobian
        assert (found.J.shape, found.point_J.shape, found.drift.shape) == ((6, n), (n, 3, n), (6,))
        np.testing.assert_allclose(arm.jacobian(q)[:3], found.tip.R @ found.J[:3], atol=1e-14)
        frames = standard_dh(table, prismatic, q)
        expected = np.array([T[:3, :3] @ offset + T[:3, 3] for T in frames])
        np.testing.assert_allclose(found.points, expected, atol=1e-12, err_msg=f"trial {trial}")
        np.testing.assert_allclose(found.tip.R, frames[-1][:3, :3], atol=1e-12)
        assert arm.n == n
        assert arm.links == ("tip", *(f"link {i + 1}" for i in range(n)))
        assert np.isneginf(arm.q_min).all()
        assert np.isposinf(arm.q_max).all()
        assert np.isposinf(arm.qd_max).all()


def test_ranges_and_speeds_of_the_papers_arms_are_the_manufacturers() -> None:
    """Data sheets [°, °/s], in the angles of the paper's tables: a joint counted backwards swaps
    its limits.
    """
    viper = robot("viper-s650")
    sheet = np.array([[-170, 170], [-190, 45], [-29, 256], [-190, 190], [-120, 120], [-360, 360]])
    table = sheet + np.array([0, 0, -180, 0, 0, 0])[:, None]
    np.testing.assert_allclose(np.rad2deg(viper.q_min), table[:, 0])
    np.testing.assert_allclose(np.rad2deg(viper.q_max), table[:, 1])
    np.testing.assert_allclose(np.rad2deg(viper.qd_max), [328, 300, 375, 375, 375, 600])
    kuka = robot("kuka-kr6")
    sheet = np.array([[-170, 170], [-190, 45], [-120, 156], [-185, 185], [-120, 120], [-350, 350]])
    table = sheet + np.array([0, 180, -90, 0, 0, 0])[:, None]
    np.testing.assert_allclose(np.rad2deg(kuka.q_min), table[:, 0])
    np.testing.assert_allclose(np.rad2deg(kuka.q_max), table[:, 1])
    np.testing.assert_allclose(np.rad2deg(kuka.qd_max), [360, 300, 360, 381, 388, 615])
    for arm in (viper, kuka):
        np.testing.assert_array_equal(arm.qd_min, -arm.qd_max)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ([[0, 0, 1]], "(1, 3)"),
        ([0, 0, 1, 0], "(4,)"),
        (np.empty((0, 4)), "(0, 4)"),
        ([[0, 0, 1, 0], [1]], "rows of four numbers"),
        ([["a", 0, 0, 0]], "rows of four numbers"),
        ([[0, np.nan, 1, 0]], "finite"),
        ([[0, 0, np.inf, 0]], "finite"),
    ],
)
def test_a_dh_table_that_is_none_is_refused(table: object, words: str) -> None:
    with pytest.raises(InvalidInput) as error:
        Robot.from_dh(table)
    assert words in str(error.value)
    assert "DH table" in str(error.value)


@pytest.mark.parametrize("limit", ["q_min", "q_max", "qd_max"])
@pytest.mark.parametrize("value", [[1.0], [1.0, 2.0, 3.0], [1.0, np.nan], ["a", "b"], 1.0])
def test_a_limit_of_the_wrong_shape_is_refused_by_name(limit: str, value: object) -> None:
    with pytest.raises(InvalidInput, match=f"^{limit} must be 2 numbers"):
        Robot.from_dh([[0, 0, 1, 0], [0, 0, 1, 0]], **{limit: value})


def test_limits_that_contradict_themselves_are_refused_with_the_joints_name() -> None:
    table = [[0, 0, 1, 0], [0, 0, 1, 0]]
    with pytest.raises(ConfigurationError, match="joint 2"):
        Robot.from_dh(table, q_min=[-1, 1], q_max=[1, -1])
    with pytest.raises(ConfigurationError, match="joint 1"):
        Robot.from_dh(table, qd_max=[0, 1])
    with pytest.raises(InvalidInput, match=r"numbers from 1 to 2, not \[3, 0\]"):
        Robot.from_dh(table, prismatic=[3, 1, 0])
    half_limited = Robot.from_dh(table, q_min=[-np.inf, -1], q_max=[np.inf, 1])
    assert half_limited.outside_ranges(np.array([50.0, 0.0])) == []


# --- arms of example-robot-data ---


def urdf_of(path: str) -> Path:
    package = distribution("example-robot-data")
    return Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots"))) / path


URDFS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0", 0),
    "panda": ("panda_description/urdf/panda.urdf", "panda_hand", 2),
}
"""File, link at the tip, and how many finger joints follow the arm's."""


@pytest.mark.parametrize("name", URDFS)
def test_urdf_arms_agree_with_pinocchio_called_directly(name: str) -> None:
    path, tip, fingers = URDFS[name]
    model = pin.buildModelFromUrdf(str(urdf_of(path)))
    data = model.createData()
    frame = model.getFrameId(tip)
    arm = robot(name)
    rng = np.random.default_rng(3)
    assert model.nv == arm.n + fingers
    assert arm.joint_names == tuple(model.names[1 : arm.n + 1])
    for _ in range(10):
        q = random_configuration(arm, rng)
        qd = rng.uniform(-2.0, 2.0, arm.n)
        full_q, full_qd = (np.concatenate((x, np.zeros(fingers))) for x in (q, qd))
        pin.forwardKinematics(model, data, full_q, full_qd)
        pin.computeJointJacobiansTimeVariation(model, data, full_q, full_qd)
        pin.computeJointJacobians(model, data, full_q)
        pin.updateFramePlacements(model, data)
        local = pin.ReferenceFrame.LOCAL
        J = pin.getFrameJacobian(model, data, frame, local)[:, : arm.n]
        J_dot = pin.getFrameJacobianTimeVariation(model, data, frame, local)[:, : arm.n]
        now = arm.kinematics(q, qd)
        np.testing.assert_allclose(now.tip.R, data.oMf[frame].rotation, atol=1e-13)
        np.testing.assert_allclose(now.tip.t, data.oMf[frame].translation, atol=1e-13)
        np.testing.assert_allclose(now.J, J, atol=1e-13)
        np.testing.assert_allclose(now.drift, J_dot @ qd, atol=1e-12)


@pytest.mark.parametrize("name", URDFS)
def test_ranges_and_speeds_are_the_urdfs(name: str) -> None:
    arm = robot(name)
    joints = {
        j.get("name"): j
        for j in ElementTree.parse(urdf_of(URDFS[name][0])).getroot().findall("joint")
    }
    for i, joint_name in enumerate(arm.joint_names):
        limit = joints[joint_name].find("limit")
        assert limit is not None
        assert arm.q_min[i] == float(limit.get("lower", "nan"))
        assert arm.q_max[i] == float(limit.get("upper", "nan"))
        assert arm.qd_max[i] == float(limit.get("velocity", "nan"))
        assert arm.qd_min[i] == -arm.qd_max[i]


def test_ur5_has_the_dimensions_that_universal_robots_publishes() -> None:
    """Universal Robots' DH parameters of the UR5: how far the flange is from the base in any
    configuration.
    """
    published = [
        [0, 0.089159, 0, PI / 2],
        [0, 0, -0.425, 0],
        [0, 0, -0.39225, 0],
        [0, 0.10915, 0, PI / 2],
        [0, 0.09465, 0, -PI / 2],
        [0, 0.0823, 0, 0],
    ]
    arm = robot("ur5")
    rng = np.random.default_rng(4)
    half_turn = about_z(PI)  # the base frame of the tables is turned against base_link
    for _ in range(10):
        q = rng.uniform(-PI, PI, 6)
        flange = standard_dh(np.array(published), set(), q)[-1]
        pose = arm.pose(q)
        np.testing.assert_allclose(pose.t, half_turn @ flange[:3, 3], atol=1e-6)
        np.testing.assert_allclose(pose.R, half_turn @ flange[:3, :3], atol=1e-6)


def test_panda_has_the_dimensions_that_franka_publishes() -> None:
    """Franka's parameters in Craig's convention (a, d, α); the hand is turned by −45° about the
    flange's axis.
    """
    published = np.array(
        [
            [0, 0.333, 0],
            [0, 0, -PI / 2],
            [0, 0.316, PI / 2],
            [0.0825, 0, PI / 2],
            [-0.0825, 0.384, -PI / 2],
            [0, 0, PI / 2],
            [0.088, 0, PI / 2],
        ]
    )
    arm = robot("panda")
    rng = np.random.default_rng(5)
    hand = homogeneous(about_z(-PI / 4), np.array([0.0, 0.0, 0.107]))
    for _ in range(10):
        q = random_configuration(arm, rng)
        expected = modified_dh(published, q) @ hand
        pose = arm.pose(q)
        # the URDF writes right angles with 13 digits
        np.testing.assert_allclose(homogeneous(pose.R, pose.t), expected, atol=1e-9)


def test_a_ready_made_robot_that_is_none_names_the_closest() -> None:
    with pytest.raises(ConfigurationError, match=r"Did you mean 'panda'") as error:
        ready_made("pandas")
    assert all(name in str(error.value) for name in READY_MADE)


# --- own URDFs ---

LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="1"/>'


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    inside: str = LIMIT,
    xyz: str = "0 0 1",
    axis: str = "0 0 1",
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="0 0 0"/><axis xyz="{axis}"/>{inside}</joint>'
    )


def write_urdf(folder: Path, links: str, *joints: str) -> Path:
    path = folder / "arm.urdf"
    bodies = "".join(f'<link name="{name}"/>' for name in links.split())
    path.write_text(f'<?xml version="1.0"?><robot name="own">{bodies}{"".join(joints)}</robot>')
    return path


def test_continuous_joints_have_one_coordinate_and_no_range(tmp_path: Path) -> None:
    path = write_urdf(
        tmp_path,
        "base a b c",
        joint("j1", "continuous", "base", "a", ""),
        joint("j2", "continuous", "a", "b", '<limit velocity="2.5" effort="1"/>', axis="0 1 0"),
        joint("j3", "prismatic", "b", "c", axis="1 0 0"),
    )
    arm = Robot.from_urdf(path)
    assert (arm.name, arm.n, arm.joint_names) == ("own", 3, ("j1", "j2", "j3"))
    np.testing.assert_array_equal(arm.q_min, [-np.inf, -np.inf, -1.0])
    np.testing.assert_array_equal(arm.q_max, [np.inf, np.inf, 2.0])
    np.testing.assert_array_equal(arm.qd_max, [np.inf, 2.5, 3.0])
    q = np.array([0.3, -7.0, 0.4])
    turn = rotation_matrix(np.array([0, 0, q[0]])) @ rotation_matrix(np.array([0, q[1], 0]))
    pose = arm.pose(q)
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(pose.R, turn, atol=1e-14)
    np.testing.assert_allclose(
        pose.t, 2.0 * up + turn @ (up + np.array([q[2], 0.0, 0.0])), atol=1e-14
    )


def test_speed_limits_that_are_zero_or_absent_are_none(tmp_path: Path) -> None:
    path = write_urdf(
        tmp_path,
        "base a b",
        joint(
            "j1", "revolute", "base", "a", '<limit lower="-1" upper="1" velocity="0" effort="0"/>'
        ),
        joint("j2", "revolute", "a", "b", '<limit lower="-1" upper="1"/>'),
    )
    arm = Robot.from_urdf(path)
    np.testing.assert_array_equal(arm.qd_max, [np.inf, np.inf])
    np.testing.assert_array_equal(arm.q_max, [1.0, 1.0])


def test_joints_off_the_chain_are_locked_and_the_tip_can_be_chosen(tmp_path: Path) -> None:
    path = write_urdf(
        tmp_path,
        "base a b finger other",
        joint("j1", "revolute", "base", "a"),
        joint("j2", "revolute", "a", "b"),
        joint("grip", "prismatic", "b", "finger", axis="1 0 0"),
        joint(
            "grip2",
            "prismatic",
            "b",
            "other",
            f'{LIMIT}<mimic joint="grip" multiplier="-1"/>',
            axis="1 0 0",
        ),
    )
    arm = Robot.from_urdf(path, "b", name="gripper arm")
    assert (arm.name, arm.joint_names) == ("gripper arm", ("j1", "j2"))
    # what is locked can still carry points
    found = arm.kinematics(
        np.zeros(2), np.zeros(2), [RobotPoint("finger"), RobotPoint("tip", (0.1, 0.0, 0.0))]
    )
    np.testing.assert_allclose(found.points, [[0.0, 0.0, 3.0], [0.1, 0.0, 2.0]], atol=1e-14)
    assert Robot.from_urdf(path, "finger").joint_names == ("j1", "j2", "grip")


def test_joints_can_be_locked_where_they_are_wanted(tmp_path: Path) -> None:
    path = write_urdf(
        tmp_path,
        "base a b c",
        joint("j1", "revolute", "base", "a"),
        joint("j2", "revolute", "a", "b", axis="0 1 0"),
        joint("j3", "prismatic", "b", "c"),
    )
    arm = Robot.from_urdf(path, locked={"j2": 0.5})
    assert arm.joint_names == ("j1", "j3")
    pose = arm.pose([0.0, 0.25])
    np.testing.assert_allclose(
        pose.t, [1.25 * np.sin(0.5), 0.0, 2.0 + 1.25 * np.cos(0.5)], atol=1e-14
    )


def test_a_joint_may_have_the_name_of_its_link(tmp_path: Path) -> None:
    path = write_urdf(
        tmp_path,
        "base a b c",
        joint("a", "revolute", "base", "a"),
        joint("b", "revolute", "a", "b"),
        joint("c", "revolute", "b", "c"),
    )
    arm = Robot.from_urdf(path, "c", locked={"b": 0.0})
    assert arm.joint_names == ("a", "c")
    found = arm.kinematics(
        np.zeros(2), np.zeros(2), [RobotPoint("a"), RobotPoint("b"), RobotPoint("c")]
    )
    np.testing.assert_allclose(found.points[:, 2], [1.0, 2.0, 3.0], atol=1e-14)


@pytest.mark.parametrize(
    ("links", "joints", "words"),
    [
        (
            "base a b",
            [joint("j1", "floating", "base", "a", ""), joint("j2", "revolute", "a", "b")],
            ["'j1'", "lock"],
        ),
        (
            "base a b",
            [joint("j1", "planar", "base", "a", ""), joint("j2", "revolute", "a", "b")],
            ["'j1'", "lock"],
        ),
        ("base a", [joint("j1", "revolute", "base", "a", "")], ["revolute", "'j1'", "limit"]),
        (
            "base a b",
            [
                joint("j1", "revolute", "base", "a"),
                joint("j2", "revolute", "a", "b", f'{LIMIT}<mimic joint="j1" multiplier="2"/>'),
            ],
            ["'j2'", "mimic"],
        ),
        (
            "base a",
            [
                joint(
                    "j1",
                    "revolute",
                    "base",
                    "a",
                    '<limit lower="1" upper="-1" velocity="1" effort="1"/>',
                )
            ],
            ["j1"],
        ),
        ("base a", [joint("j1", "fixed", "base", "a", "")], ["no joint", "'a'"]),
        ("base", [], ["no joint", "'base'"]),
        ("", [], ["cannot be read as a URDF"]),
        (
            "base a",
            [joint("j1", "revolute", "elsewhere", "a")],
            ["parent", "'j1'", "'elsewhere'", "a, base"],
        ),
        (
            "base a",
            [joint("j1", "revolving", "base", "a")],
            ["type", "'j1'", "'revolving'", "revolute"],
        ),
    ],
)
def test_a_urdf_that_is_no_arm_is_refused(
    tmp_path: Path, links: str, joints: list[str], words: list[str]
) -> None:
    path = write_urdf(tmp_path, links, *joints)
    with pytest.raises(ConfigurationError) as error:
        Robot.from_urdf(path)
    assert "own" in str(error.value) or "arm.urdf" in str(error.value)
    assert all(word in str(error.value) for word in words), str(error.value)


def test_a_floating_joint_that_is_locked_is_no_obstacle(tmp_path: Path) -> None:
    path = write_urdf(
        tmp_path,
        "base a b",
        joint("j1", "floating", "base", "a", ""),
        joint("j2", "revolute", "a", "b"),
    )
    assert Robot.from_urdf(path, locked={"j1": 0.0}).joint_names == ("j2",)


def test_names_that_a_urdf_does_not_have_are_refused_with_those_it_has(tmp_path: Path) -> None:
    path = write_urdf(tmp_path, "base flange", joint("shoulder", "revolute", "base", "flange"))
    with pytest.raises(ConfigurationError, match=r"'flang'.*Did you mean 'flange'"):
        Robot.from_urdf(path, "flang")
    with pytest.raises(ConfigurationError, match=r"'sholder'.*Did you mean 'shoulder'"):
        Robot.from_urdf(path, locked={"sholder": 0.0})
    with pytest.raises(ConfigurationError, match=r"no joint.*'flange'"):
        Robot.from_urdf(path, locked={"shoulder": 0.0})
    with pytest.raises(InvalidInput, match="shoulder"):
        Robot.from_urdf(path, locked={"shoulder": np.nan})
    arm = Robot.from_urdf(path)
    with pytest.raises(ConfigurationError, match=r"'flunge'.*Did you mean 'flange'"):
        arm.evaluator([RobotPoint("flunge")])
    with pytest.raises(InvalidInput, match=r"offset of nose"):
        arm.evaluator([RobotPoint("flange", (0.0, np.nan, 0.0), "nose")])


def test_files_that_are_no_urdf_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"no URDF file at .*nowhere"):
        Robot.from_urdf(tmp_path / "nowhere.urdf")
    with pytest.raises(ConfigurationError, match=r"no URDF file"):
        Robot.from_urdf(tmp_path)
    path = tmp_path / "other.urdf"
    path.write_text("hello")
    with pytest.raises(ConfigurationError, match=r"other.urdf' is not XML"):
        Robot.from_urdf(path)
    path.write_text("<sdf/>")
    with pytest.raises(ConfigurationError, match=r"other.urdf' is not a URDF: its root is <sdf>"):
        Robot.from_urdf(path)
    path.write_text("<robot name='xacro' xmlns:xacro='x'><xacro:arm/></robot>")
    with pytest.raises(ConfigurationError, match=r"other.urdf' cannot be read as a URDF"):
        Robot.from_urdf(path)


# --- what every robot does ---


@pytest.mark.parametrize("name", robot_names())
def test_configurations_are_checked(name: str) -> None:
    arm = robot(name)
    for wrong in (
        np.zeros(arm.n + 1),
        np.zeros((arm.n, 1)),
        [np.nan] * arm.n,
        ["a"] * arm.n,
        None,
        1.0,
    ):
        with pytest.raises(InvalidInput) as error:
            arm.configuration(wrong, "q0")
        assert "q0" in str(error.value)
        assert arm.name in str(error.value)
    with pytest.raises(InvalidInput, match="finite"):
        arm.pose([np.inf] * arm.n)
    given = np.zeros(arm.n)
    taken = arm.configuration(given)
    given[0] = 1.0
    assert taken[0] == 0.0


@pytest.mark.parametrize("name", robot_names())
def test_an_evaluation_does_not_change_the_results_of_another(name: str) -> None:
    arm = robot(name)
    rng = np.random.default_rng(6)
    points = [RobotPoint(link, (0.1, 0.2, 0.3)) for link in arm.links]
    evaluate = arm.evaluator(points)
    other = arm.evaluator(points[:1])

    def arrays(now) -> dict[str, Array]:
        names = ("q", "qd", "J", "drift", "points", "point_J", "point_drift")
        return {"R": now.tip.R, "t": now.tip.t, **{key: getattr(now, key) for key in names}}

    first = evaluate(random_configuration(arm, rng), rng.normal(size=arm.n))
    kept = {key: value.copy() for key, value in arrays(first).items()}
    second = evaluate(random_configuration(arm, rng), rng.normal(size=arm.n))
    other(random_configuration(arm, rng), rng.normal(size=arm.n))
    arm.pose(random_configuration(arm, rng))
    for key, value in arrays(first).items():
        np.testing.assert_array_equal(value, kept[key], err_msg=key)
        assert not np.array_equal(value, arrays(second)[key]), key
    again = evaluate(kept["q"], kept["qd"])
    for key, value in arrays(again).items():
        np.testing.assert_array_equal(value, kept[key], err_msg=f"{key} is not repeatable")


def test_a_joint_outside_its_range_is_named_with_its_range() -> None:
    arm = arm_with_prismatic_joints()
    inside = 0.5 * (arm.q_min + arm.q_max)
    assert arm.outside_ranges(inside) == []
    assert arm.outside_ranges(arm.q_min) == []
    assert arm.outside_ranges(arm.q_max) == []
    outside = inside.copy()
    half = 0.5 * (arm.q_max - arm.q_min)
    outside[1], outside[4] = arm.q_max[1] + 0.9e-5 * half[1], arm.q_min[4] - 0.9e-5 * half[4]
    assert arm.outside_ranges(outside) == []
    outside[1], outside[4] = arm.q_max[1] + 1.1e-5 * half[1], arm.q_min[4] - 1.0
    sentences = arm.outside_ranges(outside)
    assert [s.split(" is at ")[0] for s in sentences] == ["joint 2 (joint 2)", "joint 5 (joint 5)"]
    assert f"{arm.q_max[1]:.7g}" in sentences[0]
    assert f", {1.1e-5 * half[1]:.3g} " in sentences[0]
    assert ", 1 " in sentences[1]


def test_a_start_that_is_rounded_is_in_its_range_and_one_that_is_not_says_by_how_much() -> None:
    """A URDF has 3.14159 where a program has π, and 1.5708 where it has π/2."""
    arm = Robot.from_dh(
        [[0.0, 0.0, 1.0, 0.0]] * 2, q_min=[-3.14159, -np.pi / 2], q_max=[3.14159, np.pi / 2]
    )
    assert arm.outside_ranges(np.array([np.pi, 1.5708])) == []
    (sentence,) = arm.outside_ranges(np.array([3.142, 0.0]))
    assert sentence == "joint 1 (joint 1) is at 3.142, 0.00041 rad outside [-3.14159, 3.14159]"


def test_points_of_one_link_do_not_depend_on_their_order() -> None:
    arm = robot("panda")
    rng = np.random.default_rng(7)
    q = random_configuration(arm, rng)
    qd = rng.normal(size=arm.n)
    points = [RobotPoint(arm.links[i % 4 + 1], tuple(rng.normal(size=3))) for i in range(9)]
    together = arm.kinematics(q, qd, points)
    for i, point in enumerate(points):
        alone = arm.kinematics(q, qd, [point])
        np.testing.assert_allclose(together.points[i], alone.points[0], atol=1e-14)
        np.testing.assert_allclose(together.point_J[i], alone.point_J[0], atol=1e-14)
        np.testing.assert_allclose(together.point_drift[i], alone.point_drift[0], atol=1e-13)
    none = arm.kinematics(q, qd)
    assert none.points.shape == (0, 3)
    assert none.point_J.shape == (0, 3, arm.n)
