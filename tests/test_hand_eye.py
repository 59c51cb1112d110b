"""Where a camera is mounted: as OpenCV's hand–eye calibration has it, in every form in which it may
be given.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vsconstraints import Camera
from vsconstraints.errors import (
    CalibrationWarning,
    ConfigurationError,
    InvalidInput,
    VsconstraintsError,
)
from vsconstraints.robots import ur5
from vsconstraints.robots.geometry import Pose, distance
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.scene import Scene

CAMERA_IN_TIP = Pose(
    Rotation.from_rotvec([0.1, -0.2, 1.5]).as_matrix(), np.array([0.02, 0.07, -0.05])
)
EYE = Camera((600.0, 600.0), (640.0, 480.0))
BOARD = Pose(Rotation.from_rotvec([0.2, 0.1, 0.4]).as_matrix(), np.array([0.5, 0.1, 0.02]))


def homogeneous(pose: Pose) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3] = pose.R
    matrix[:3, 3] = pose.t
    return matrix


def configurations() -> Array:
    rng = np.random.default_rng(0)
    found: Array = np.array([0.3, -1.7, 1.7, -1.7, -1.6, 0.1]) + rng.uniform(-0.4, 0.4, (15, 6))
    return found


@pytest.mark.parametrize(
    "method", [cv2.CALIB_HAND_EYE_TSAI, cv2.CALIB_HAND_EYE_PARK, cv2.CALIB_HAND_EYE_DANIILIDIS]
)
def test_what_opencv_calls_cam2gripper_is_the_camera_in_the_tip(method: int) -> None:
    """OpenCV is told poses of the arm, by Pinocchio, and what its own solvePnP finds in images of
    this package.
    """
    arm = ur5()
    corners = (
        np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0.5, 0, 0], [0, 0.7, 0]])
        * 0.05
    )
    scene = Scene(arm, EYE.mounted(camera_in_tip=CAMERA_IN_TIP), BOARD.act(corners))
    K = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
    tips = []
    boards = []
    for q in configurations():
        pixels = EYE.to_corner(scene.project(scene.camera_pose(q)), "centres")
        found, turn, away = cv2.solvePnP(corners, pixels, K, np.zeros(4), flags=cv2.SOLVEPNP_SQPNP)
        assert found
        tips.append(arm.pose(q))
        boards.append((cv2.Rodrigues(turn)[0], away.ravel()))
    R, t = cv2.calibrateHandEye(
        [tip.R for tip in tips],
        [tip.t for tip in tips],
        [R for R, _ in boards],
        [t for _, t in boards],
        method=method,
    )
    assert max(distance(Pose(R, t.ravel()), CAMERA_IN_TIP)) < 1e-6
    again = EYE.mounted(camera_in_tip=Pose.from_matrix(np.column_stack((R, t))))
    assert max(distance(again.mount.inverse, CAMERA_IN_TIP)) < 1e-6


def test_a_camera_that_is_fixed_is_what_opencv_finds_from_the_arm_reversed() -> None:
    """As its documentation says of eye-to-hand: given base-in-tip, it gives cam2base."""
    arm = ur5()
    camera_in_base = Pose(
        Rotation.from_rotvec([3.0, 0.2, 0.1]).as_matrix(), np.array([0.4, 0.1, 1.3])
    )
    board_in_tip = Pose(
        Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix(), np.array([0.01, 0.02, 0.1])
    )
    eye = EYE.mounted(camera_in_base=camera_in_base)
    assert eye.fixed is not None
    tips = [arm.pose(q) for q in configurations()]
    boards = [eye.fixed.inverse @ tip @ board_in_tip for tip in tips]
    R, t = cv2.calibrateHandEye(
        [tip.inverse.R for tip in tips],
        [tip.inverse.t for tip in tips],
        [b.R for b in boards],
        [b.t for b in boards],
    )
    assert max(distance(Pose(R, t.ravel()), camera_in_base)) < 1e-6


def test_each_way_says_the_same_of_a_camera() -> None:
    ways = [
        EYE.mounted(camera_in_tip=CAMERA_IN_TIP),
        EYE.mounted(tip_in_camera=CAMERA_IN_TIP.inverse),
    ]
    for eye in ways:
        assert eye.fixed is None
        np.testing.assert_allclose(
            homogeneous(eye.mount), np.linalg.inv(homogeneous(CAMERA_IN_TIP)), atol=1e-15
        )
    fixed = [EYE.mounted(camera_in_base=BOARD), EYE.mounted(base_in_camera=BOARD.inverse)]
    for eye in fixed:
        assert eye.fixed is not None
        np.testing.assert_allclose(homogeneous(eye.fixed), homogeneous(BOARD), atol=1e-15)
        assert max(distance(eye.mount, Pose.identity())) == 0.0
    for wrong in ({}, {"camera_in_tip": BOARD, "tip_in_camera": BOARD}):
        with pytest.raises(InvalidInput, match="one of camera_in_tip, tip_in_camera"):
            EYE.mounted(**wrong)


# --- in files ---

R = Rotation.from_matrix(CAMERA_IN_TIP.R)
XYZ = CAMERA_IN_TIP.t.tolist()
FORMS: dict[str, dict[str, Any]] = {
    "matrix": {"matrix": homogeneous(CAMERA_IN_TIP).tolist()},
    "rounded matrix": {"matrix": np.round(homogeneous(CAMERA_IN_TIP), 4).tolist()},
    "xyzw": {"xyz": XYZ, "quaternion_xyzw": R.as_quat().tolist()},
    "wxyz": {"xyz": XYZ, "quaternion_wxyz": np.roll(R.as_quat(), 1).tolist()},
    "rpy": {"xyz": XYZ, "rpy": R.as_euler("xyz").tolist()},
    "rotation vector": {"xyz": XYZ, "rotation_vector": R.as_rotvec().tolist()},
}


def camera_of(**tables: Any) -> Camera:
    there = Scenario.load("ur5-fov")
    del there.tables["camera"]["mount"]
    there.tables["camera"].update(tables)
    return there.setup().scene.camera


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_every_form_of_a_pose_is_the_same_mount(form: dict[str, Any]) -> None:
    typed = 1e-12 if "matrix" not in form or form == FORMS["matrix"] else 1e-4
    for key in ("tip_in_camera", "mount"):
        assert max(distance(camera_of(**{key: form}).mount, CAMERA_IN_TIP)) < typed
    eye = camera_of(camera_in_tip=form)
    assert max(distance(eye.mount.inverse, CAMERA_IN_TIP)) < typed
    np.testing.assert_allclose(eye.mount.R @ eye.mount.R.T, np.eye(3), atol=1e-12)


TURNED = homogeneous(CAMERA_IN_TIP)
STRETCHED = TURNED * (1.02, 1.0, 1.0, 1.0)
MIRRORED = TURNED * (1.0, 1.0, -1.0, 1.0)


@pytest.mark.parametrize(
    ("form", "words"),
    [
        (
            {"matrix": STRETCHED.tolist()},
            r"not a rotation: an entry is 0\.0.* \(columns of length 1\.02, 1, 1\), which is \[\[",
        ),
        ({"matrix": MIRRORED.tolist()}, "determinant -1 is a mirror"),
        ({"matrix": TURNED.T.tolist()}, "last row .* must be 0 0 0 1, .* is it transposed"),
        ({"matrix": TURNED[:3].tolist()}, "matrix must be 4 rows of 4 numbers"),
        ({"matrix": np.zeros((4, 4)).tolist()}, "last row .* must be 0 0 0 1"),
        ({"matrix": TURNED.tolist(), "xyz": XYZ}, "with matrix must not have xyz"),
        (
            {"xyz": XYZ, "quaternion_xyzw": [0.0, 0.0, 0.9, 0.1]},
            r"length 1, not 0\.905539, .*: \[.*\] has length 1",
        ),
        ({"xyz": XYZ, "quaternion_xyzw": [0.0] * 4}, "length 1, not 0"),
        ({"xyz": XYZ, "quaternion_xyzw": [0.0] * 3}, "quaternion_xyzw must be 4 numbers"),
        (
            {"xyz": XYZ, "quaternion": [0.0] * 4},
            "key in ur5-fov.camera.camera_in_tip 'quaternion'.*quaternion_wxyz",
        ),
        (
            {"xyz": XYZ, "rotation_vector": [0, 0, 90]},
            r"no longer than a turn .* not \[0.*90.*\]: are these degrees",
        ),
        ({"xyz": XYZ, "file": "eMc.yaml"}, "with file must not have xyz"),
        ({"rpy": [0, 0, 0], "file": "eMc.yaml"}, "one of rpy, .*, matrix and file"),
        (
            {"xyz": XYZ, "rpy": [0, 0, 90]},
            r"are radians, up to a turn \(6\.283\), not \[.*90.*\]: are these degrees",
        ),
        (
            {"rpy": [0, 0, 0], "quaternion_xyzw": [0, 0, 0, 1]},
            "one of rpy, quaternion_wxyz, quaternion_xyzw, rotation_vector, matrix and file",
        ),
    ],
)
def test_what_is_no_pose_says_how_far_it_is_from_one(form: dict[str, Any], words: str) -> None:
    with pytest.raises(VsconstraintsError, match=words) as no:
        camera_of(camera_in_tip=form)
    assert "ur5-fov.camera" in str(no.value)


def test_the_nearest_rotation_that_is_told_is_the_right_one() -> None:
    wrong = TURNED.copy()
    wrong[:3, :3] = TURNED[:3, :3] @ (np.eye(3) + np.diag([0.03, -0.02, 0.01]))
    with pytest.raises(InvalidInput) as no:
        Pose.from_matrix(wrong)
    told = np.array(eval(str(no.value).partition("which is ")[2]))
    # the polar factor of R S, with S symmetric and positive
    np.testing.assert_allclose(told, CAMERA_IN_TIP.R, atol=1e-6)


def test_a_camera_is_in_one_place() -> None:
    with pytest.raises(
        ConfigurationError,
        match="give only one key for the camera's pose, not camera_in_tip and tip_in_camera",
    ):
        camera_of(camera_in_tip=FORMS["rpy"], tip_in_camera=FORMS["rpy"])
    with pytest.raises(ConfigurationError, match="for the camera's pose, not mount and fixed"):
        camera_of(mount=FORMS["rpy"], fixed=FORMS["rpy"])


def test_quaternions_are_given_in_one_of_two_orders() -> None:
    for told in ({}, {"wxyz": [1.0, 0, 0, 0], "xyzw": [0, 0, 0, 1.0]}):
        with pytest.raises(InvalidInput, match="as wxyz or as xyzw"):
            Pose.from_quaternion((0.0, 0.0, 0.0), **told)


# --- files that tools write ---

QX, QY, QZ, QW = R.as_quat().tolist()
TX, TY, TZ = XYZ
QUATERNION = f"qw: {QW}\n  qx: {QX}\n  qy: {QY}\n  qz: {QZ}\n  x: {TX}\n  y: {TY}\n  z: {TZ}\n"
TRANSFORM = (
    f"  translation:\n    x: {TX}\n    y: {TY}\n    z: {TZ}\n  rotation:\n    x: {QX}\n   "
    f" y: {QY}\n    z: {QZ}\n"
)
TRANSFORM += f"    w: {QW}\n"
FRAMES = (
    "  robot_base_frame: base_link\n  robot_effector_frame: tool0\n  tracking_base_frame: "
    "camera_optical_frame\n"
)
THETA_U = "\n".join(f"  - [{number}]" for number in (*XYZ, *R.as_rotvec()))
ROWS = homogeneous(CAMERA_IN_TIP).tolist()
OPTIONS = {"x": TX, "y": TY, "z": TZ, "qx": QX, "qy": QY, "qz": QZ, "qw": QW}
LAUNCH_PY = (
    '""" EYE-IN-HAND: tool0 -> camera_optical_frame """\n'
    'Node(package="tf2_ros", executable="static_transform_publisher",\n'
    'arguments=["--frame-id", "tool0", "--child-frame-id", "camera_optical_frame",\n'
    + "\n".join(f'"--{name}",\n"{value}",' for name, value in OPTIONS.items())
    + '\n# "--roll",\n# "0.1",\n])\n'
)
LAUNCH = (
    '<launch>\n  <!-- EYE-IN-HAND: tool0 -> camera_optical_frame -->\n  <!-- xyz="0 0 0" rpy="0 0 '
    '0" -->\n'
    '  <node pkg="tf2_ros" type="static_transform_publisher" name="camera_link_broadcaster"\n'
    f'      args="{TX} {TY} {TZ}   {QX} {QY} {QZ} {QW} tool0 camera_optical_frame" />\n</launch>\n'
)
IN_HAND = {
    "easy_handeye": f"parameters:\n  eye_on_hand: true\n{FRAMES}transformation:\n  {QUATERNION}",
    "easy_handeye of 2016": f"eye_on_hand: true\ntracking_base_frame: camera\ntransformation:\n  "
    f"{QUATERNION}",
    "easy_handeye2": f"parameters:\n  name: own\n  calibration_type: "
    f"eye_in_hand\n{FRAMES}transform:\n{TRANSFORM}",
    "MoveIt, ROS 1": LAUNCH,
    "MoveIt, ROS 2": LAUNCH_PY,
}
SILENT = {
    "qw … qz": QUATERNION.replace("\n  ", "\n"),
    "geometry_msgs/Transform": TRANSFORM,
    "visp_hand2eye_calibration": f"effector_camera:\n{TRANSFORM}",
    "geometry_msgs/Pose": TRANSFORM.replace("translation", "position").replace(
        "rotation", "orientation"
    ),
    "ViSP, vpPoseVector": f"rows: 6\ncols: 1\ndata: \n{THETA_U}\n",
    "ViSP, vpHomogeneousMatrix": "rows: 4\ncols: 4\ndata: \n"
    + "".join(f"  - {row}\n" for row in ROWS),
    "ViSP, text": "\n".join("  ".join(map(str, row)) for row in ROWS) + "\n",
    "rvec and tvec": f"rvec: {R.as_rotvec().tolist()}\ntvec: {XYZ}\n",
}


def opencv_file(folder: Path) -> Path:
    storage = cv2.FileStorage(str(folder / "opencv.yaml"), cv2.FILE_STORAGE_WRITE)
    storage.write("R_cam2gripper", CAMERA_IN_TIP.R)
    storage.write("t_cam2gripper", CAMERA_IN_TIP.t.reshape(3, 1))
    storage.release()
    return folder / "opencv.yaml"


@pytest.mark.parametrize("form", {**IN_HAND, **SILENT}.values(), ids=[*IN_HAND, *SILENT])
def test_files_of_tools_are_read_by_one_key_in_scenarios_and_python(
    tmp_path: Path, form: str
) -> None:
    file = tmp_path / "hand_eye.yaml"
    file.write_text(form)
    for eye in (EYE.mounted(camera_in_tip=file), camera_of(camera_in_tip={"file": str(file)})):
        assert eye.fixed is None
        assert max(distance(eye.mount.inverse, CAMERA_IN_TIP)) < 1e-12
    assert (
        max(distance(EYE.mounted(camera_in_tip=opencv_file(tmp_path)).mount.inverse, CAMERA_IN_TIP))
        < 1e-12
    )


@pytest.mark.parametrize("name", IN_HAND)
def test_a_file_that_says_where_the_camera_is_must_fit_its_key(tmp_path: Path, name: str) -> None:
    file = tmp_path / "hand_eye.yaml"
    in_hand = IN_HAND[name]
    beside = (
        in_hand.replace("eye_on_hand: true", "eye_on_hand: false")
        .replace("eye_in_hand", "eye_on_base")
        .replace("EYE-IN-HAND", "EYE-TO-HAND")
    )
    assert beside != in_hand
    file.write_text(beside)
    eye = EYE.mounted(camera_in_base=file)
    assert eye.fixed is not None
    assert max(distance(eye.fixed, CAMERA_IN_TIP)) < 1e-12
    with pytest.raises(
        ConfigurationError,
        match=r"beside the arm .*: give it as camera_in_base, not as camera_in_tip",
    ):
        EYE.mounted(camera_in_tip=file)
    file.write_text(in_hand)
    with pytest.raises(
        ConfigurationError, match=r"in the hand .*: give it as camera_in_tip, not as base_in_camera"
    ):
        EYE.mounted(base_in_camera=file)


def test_a_scenario_keeps_the_file_of_its_hand_eye_calibration_among_its_files(
    tmp_path: Path,
) -> None:
    (tmp_path / "hand_eye.yaml").write_text(IN_HAND["easy_handeye2"])
    (tmp_path / "own.toml").write_text(
        'extends = "ur5-fov"\n[camera.camera_in_tip]\nfile = "hand_eye.yaml"\n'
    )
    scenario = Scenario.load(tmp_path / "own.toml")
    assert [file.name for file in scenario.files] == ["hand_eye.yaml"]
    assert max(distance(scenario.setup().scene.camera.mount.inverse, CAMERA_IN_TIP)) < 1e-12


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\n", r"no pose in a form that is known: .*easy_handeye2.*MoveIt.*ViSP.*OpenCV"),
        ("just words\n", "no pose in a form that is known"),
        (
            "rows: 5\ncols: 1\ndata: [1, 2, 3, 4, 5]\n",
            r"6 numbers \(a translation, then θu\) or 4 × 4, not 5",
        ),
        ("rvec: [0, 0, 90]\ntvec: [0, 0, 1]\n", "are these degrees"),
        ("rvec: [0, 0]\ntvec: [0, 0, 1]\n", r"tvec must have 3 numbers and rvec 3 .* not 3 and 2"),
        (
            IN_HAND["easy_handeye"].replace(f"qw: {QW}", "qw: 0.9"),
            "quaternion that is a rotation has length 1",
        ),
        (IN_HAND["easy_handeye"].replace(f"x: {TX}", "x: left"), "xyz must be finite"),
        (
            IN_HAND["easy_handeye2"].replace("eye_in_hand", "sideways"),
            "calibration_type must be eye_in_hand or",
        ),
        (
            LAUNCH.replace(f"{QX} {QY} {QZ} {QW}", "0.1 0.2 0.3"),
            r"has 6 numbers; 7 are read: .* are ambiguous",
        ),
        ("a: [1", r"cannot read the hand–eye calibration .*it is not valid YAML"),
    ],
)
def test_a_file_without_a_pose_says_what_is_read(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "hand_eye.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=words) as error:
        EYE.mounted(camera_in_tip=file)
    assert "hand_eye.yaml" in str(error.value)
    with pytest.raises(ConfigurationError, match="cannot read the hand–eye calibration"):
        EYE.mounted(camera_in_tip=tmp_path / "none.yaml")


COMPUTED = LAUNCH_PY.replace(f'"{TX}"', "str(x)")
WITHOUT_ROTATION = LAUNCH_PY.replace('"--q', '"--other-')
POSITIONAL = (
    'Node(executable="static_transform_publisher", arguments=["0.1", "0", "0.2", "0", "0", "0", '
    '"tool0", "camera"])\n'
)
TWO_NODES = LAUNCH.replace("</launch>", LAUNCH[LAUNCH.index("<node") :])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (COMPUTED, "must be a list of texts, as in .*; they are computed or missing"),
        (
            WITHOUT_ROTATION,
            r"must have \"--x\".* or --roll, --pitch and --yaw .*; it has x, y, z",
        ),
        (LAUNCH_PY.replace('"--z"', '"--zz"'), "it has x, y, zz, qx"),
        (POSITIONAL, "has 6 numbers; 7 are read"),
        (TWO_NODES, "has 2 nodes of the type static_transform_publisher"),
        (LAUNCH_PY + LAUNCH_PY, "has 2 nodes of the type static_transform_publisher"),
        (LAUNCH.replace(' args="', ' other="'), "has 0 numbers; 7 are read"),
        (f"<!DOCTYPE launch>{LAUNCH}", "has a document type"),
        ("a: 1  # for a static_transform_publisher\n", "no pose in a form that is known"),
    ],
)
def test_a_launch_file_without_a_complete_pose_is_refused(
    tmp_path: Path, text: str, words: str
) -> None:
    file = tmp_path / "launch"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        EYE.mounted(camera_in_tip=file)


OTHER_NODE = '<node pkg="own" type="own" name="own" args="9 9 9 0 0 0 1 a b" />\n  <node'
IN_ROS_2 = " ".join(f"--{name} {value}" for name, value in OPTIONS.items())


@pytest.mark.parametrize(
    "text",
    [
        f"# for a static_transform_publisher\n{IN_HAND['easy_handeye']}",
        LAUNCH.replace("<node", f'<!-- args="9 9 9 0 0 0 1 a b" -->\n  {OTHER_NODE}'),
        f'<launch><node exec="static_transform_publisher" args="{IN_ROS_2}"/></launch>',
    ],
    ids=["the word in a comment", "another node", "ROS 2"],
)
def test_only_the_publisher_of_a_launch_file_is_read(tmp_path: Path, text: str) -> None:
    file = tmp_path / "launch"
    file.write_text(text)
    mount = EYE.mounted(camera_in_tip=file).mount
    assert max(distance(mount.inverse, CAMERA_IN_TIP)) < 1e-12


IN_BASE = f"R_cam2base: {CAMERA_IN_TIP.R.ravel().tolist()}\nt_cam2base: {XYZ}\n"


def test_keys_of_opencv_say_where_the_camera_is(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"in the hand .*: give it as camera_in_tip"):
        EYE.mounted(camera_in_base=opencv_file(tmp_path))
    file = tmp_path / "base.yaml"
    file.write_text(IN_BASE)
    fixed = EYE.mounted(camera_in_base=file).fixed
    assert fixed is not None
    assert max(distance(fixed, CAMERA_IN_TIP)) < 1e-12
    with pytest.raises(ConfigurationError, match=r"beside the arm .*: give it as camera_in_base"):
        EYE.mounted(camera_in_tip=file)
    file.write_text(f"calibration_type: eye_in_hand\n{IN_BASE}")
    with pytest.raises(ConfigurationError, match="contradicts itself: "):
        EYE.mounted(camera_in_tip=file)


@pytest.mark.parametrize(
    "text",
    [
        IN_BASE.replace("t_cam2base", "t_cam2gripper"),
        IN_BASE.replace("t_cam2base", "tvec"),
        IN_BASE + IN_BASE.replace("cam2base", "cam2gripper"),
        f"tvec: {XYZ}\n",
    ],
    ids=["mixed", "half general", "both", "no rotation"],
)
def test_a_pose_is_one_translation_with_its_own_rotation(tmp_path: Path, text: str) -> None:
    file = tmp_path / "pair.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match="exactly one translation with its rotation"):
        EYE.mounted(camera_in_base=file)


def test_a_mount_in_millimetres_is_doubted(tmp_path: Path) -> None:
    file = tmp_path / "mm.yaml"
    file.write_text("rvec: [0, 0, 0]\ntvec: [20, 70, -50]\n")
    far = r"the camera is mounted 88\.3 m from the arm's tip: are its coordinates in mm, not m\?"
    with pytest.warns(CalibrationWarning, match=far):
        eye = EYE.mounted(camera_in_tip=file)
    assert len(eye.doubts) == 1
    with pytest.warns(CalibrationWarning, match=r"fixed 88\.3 m from the robot's base"):
        EYE.mounted(camera_in_base=file)
