"""Results of hand–eye calibration tools: pose of a camera on an arm or beside it.

The formats are files of easy_handeye and easy_handeye2, launch files of MoveIt Calibration, poses
and matrices of ViSP, and common forms of OpenCV results. Rotations are quaternions, rotation
vectors (θu) or matrices; translations are in metres.
"""

from __future__ import annotations

import ast
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError, InvalidInput
from ..robots.geometry import Pose
from ..rows import Array
from .calibration_files import (
    Calibrated,
    number_of,
    numbers_of,
    read_text,
    root_of_xml,
    said,
    table_of,
)

#: Node that publishes a pose in launch files; below, its options in ROS 2.
PUBLISHER = "static_transform_publisher"
OPTIONS = '"--x", "0.1", and so on for --y, --z, --qx, --qy, --qz and --qw'
#: Values for a camera that the arm carries.
CARRIED = ("eye_in_hand", "eye_on_hand", "true")
#: Values for a camera that stands beside the arm.
BESIDE = ("eye_on_base", "eye_to_hand", "false")
#: Keys that state which of the two holds: easy_handeye2, easy_handeye.
SAYS_WHERE = ("calibration_type", "eye_on_hand")
#: Keys of the table that holds the pose, if it is nested.
INNER = ("transformation", "transform", "effector_camera", "pose")


class Pair(NamedTuple):
    """Keys of a translation and a rotation in one table."""

    translation: str
    #: Key of a rotation vector or matrix.
    rotation: str
    #: True if the keys state that the arm carries the camera, False if not, None if they do not.
    carried: bool | None


#: Keys of poses in files of OpenCV and in others.
PAIRS = (
    Pair("t_cam2gripper", "R_cam2gripper", carried=True),
    Pair("t_cam2base", "R_cam2base", carried=False),
    Pair("tvec", "rvec", carried=None),
    Pair("tvec", "rotation_matrix", carried=None),
    Pair("translation_vector", "rotation_vector", carried=None),
    Pair("translation_vector", "rotation_matrix", carried=None),
    Pair("translation", "rotation_vector", carried=None),
    Pair("translation", "rotation_matrix", carried=None),
    Pair("translation", "rotation", carried=None),
)


class HandEye(NamedTuple):
    """Pose from a calibration file."""

    pose: Pose
    #: True if the file states that the arm carries the camera, False if not, None if unknown.
    carried: bool | None


def read_hand_eye(path: str | Path) -> HandEye:
    """Read the pose of a camera from a hand–eye calibration file.

    Tools write the pose of the camera in the frame of the arm's tip (eye in hand) or of its base.

    Raises
    ------
    ConfigurationError
        if the file cannot be read, or holds no pose in a known form; the message lists the
        known forms.
    """
    where = os.fspath(path)
    text = read_text(path, "hand–eye calibration")
    try:
        return _published(text) or _of_table(text, where)
    except InvalidInput as error:
        raise ConfigurationError(f"{where}: {error}") from error


# --- launch files ---


def _published(text: str) -> HandEye | None:
    """Return the pose from a launch file of MoveIt Calibration; None for other files.

    The launch file, in XML or Python, publishes the pose by a ``static_transform_publisher``.
    """
    if PUBLISHER not in text:
        return None
    publishers = _in_xml(text) if text.lstrip().startswith("<") else _in_python(text)
    if not publishers:
        return None
    if len(publishers) > 1:
        raise InvalidInput(
            f"it has {len(publishers)} nodes of the type {PUBLISHER}: keep the one of the camera"
        )
    said_where = re.search(r"EYE-(IN|TO)-HAND", text)
    carried = None if said_where is None else said_where.group(1) == "IN"
    words = publishers[0]
    if any(word.startswith("--") for word in words):
        return HandEye(_of_options(words), carried)
    return HandEye(_of_arguments(words), carried)


def _in_xml(text: str) -> list[list[str]]:
    """Return the arguments of each publisher in an XML launch file; none if it is no XML."""
    try:
        root = root_of_xml(text)
    except ValueError:  # raised again, with the name of the file, when it is read as a table
        return []
    return [
        node.get("args", "").split()
        for node in root.iter("node")
        if PUBLISHER in (node.get("type"), node.get("exec"))
    ]


def _in_python(text: str) -> list[list[str]]:
    """Return the arguments of each publisher in a Python launch file; none if it is no Python.

    The file is parsed, not executed.
    """
    try:
        with warnings.catch_warnings(action="ignore"):  # about escapes in texts
            tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    publishers = []
    for call in ast.walk(tree):
        if not isinstance(call, ast.Call):
            continue
        given = {keyword.arg: keyword.value for keyword in call.keywords}
        executable = given.get("executable", given.get("node_executable"))
        if isinstance(executable, ast.Constant) and executable.value == PUBLISHER:
            publishers.append(_literal_words(given.get("arguments")))
    return publishers


def _literal_words(arguments: ast.expr | None) -> list[str]:
    """Return the arguments of a publisher in Python; raise InvalidInput unless they are literal."""
    entries = arguments.elts if isinstance(arguments, ast.List | ast.Tuple) else []
    words = [str(entry.value) for entry in entries if isinstance(entry, ast.Constant)]
    if not entries or len(words) < len(entries):
        raise InvalidInput(
            f"the arguments of its {PUBLISHER} must be a list of texts, as in {OPTIONS}; they are "
            f"computed or missing"
        )
    return words


def _of_options(words: Sequence[str]) -> Pose:
    """Return the pose in the options of ROS 2's publisher: a name and a value each."""
    options: dict[str, float] = {}
    for name, value in pairwise(words):
        if name.startswith("--"):
            options[name.removeprefix("--")] = number_of(value)
    quaternion = [name for name in ("qx", "qy", "qz", "qw") if name in options]
    angles = [name for name in ("roll", "pitch", "yaw") if name in options]
    has_rotation = (len(quaternion), len(angles)) in ((4, 0), (0, 3))
    if not has_rotation or not {"x", "y", "z"} <= options.keys():
        given = [name for name in options if name not in ("frame-id", "child-frame-id")]
        raise InvalidInput(
            f"its {PUBLISHER} must have {OPTIONS}, or --roll, --pitch and --yaw in place of the "
            f"quaternion; it has {', '.join(given) or 'none of them'}"
        )
    xyz = [options[name] for name in ("x", "y", "z")]
    rotation = [options[name] for name in (*quaternion, *angles)]
    return _of_quaternion(xyz, rotation) if quaternion else Pose.from_xyz_rpy(xyz, rotation)


def _of_arguments(words: Sequence[str]) -> Pose:
    """Return the pose in the arguments of ROS 1's publisher: x y z qx qy qz qw, and two frames."""
    numbers = [number_of(word) for word in words[:-2]]
    if len(numbers) != 7:
        raise InvalidInput(
            f"its static_transform_publisher has {len(numbers)} numbers; 7 are read: x y z qx qy "
            f"qz qw, then the two frames (three angles "
            "are ambiguous: tools write them in different orders)"
        )
    return _of_quaternion(numbers[:3], numbers[3:])


# --- tables and matrices ---


def _of_table(text: str, where: str) -> HandEye:
    table = table_of(text, where, "hand–eye calibration")
    if isinstance(table, str):  # a matrix as ViSP writes it
        numbers = [number_of(word) for word in table.split()]
        if len(numbers) == 16:
            return HandEye(Pose.from_matrix(np.array(numbers).reshape(4, 4)), None)
    found = _found_in(table, where) if isinstance(table, Mapping) else None
    if found is None or not isinstance(table, Mapping):
        raise ConfigurationError(
            f"{where} holds no pose in a form that is known: transformation with x, y, z, qx, qy, "
            f"qz, qw "
            "(easy_handeye), transform with translation and rotation (easy_handeye2), a "
            "static_transform_publisher "
            "(MoveIt), 6 or 4 × 4 numbers as data (ViSP), or R_cam2gripper and t_cam2gripper "
            "(OpenCV)"
        )
    carried = _carried(table, where)
    if carried is None:
        return found
    if found.carried not in (None, carried):
        raise ConfigurationError(
            f"{where} contradicts itself: {' or '.join(SAYS_WHERE)} and the keys of the pose "
            "disagree on whether the arm carries the camera"
        )
    return HandEye(found.pose, carried)


def _carried(table: Calibrated, where: str) -> bool | None:
    """Return True if a table states that the arm carries the camera, None if it does not state it.

    easy_handeye stores the information among its parameters.
    """
    parameters = table.get("parameters")
    for part in (table, parameters):
        for key in SAYS_WHERE:
            if isinstance(part, Mapping) and key in part:
                value = part[key]
                if not isinstance(value, str) or value.lower() not in (*CARRIED, *BESIDE):
                    known = " or ".join((*CARRIED[:2], *BESIDE[:2]))
                    raise ConfigurationError(f"{where}: {key} must be {known}, not {said(value)}")
                return value.lower() in CARRIED
    return None


def _found_in(table: Calibrated, where: str) -> HandEye | None:
    """Return the pose of a table or of one nested in it; None if its form is unknown."""
    for key in INNER:
        if isinstance(table.get(key), Mapping):
            return _found_in(table[key], where)
    pose = _pose_of(table, where)
    return _of_pair(table, where) if pose is None else HandEye(pose, None)


def _pose_of(table: Calibrated, where: str) -> Pose | None:
    """Return the pose of a table with a quaternion or ViSP's data; None if it has neither."""
    if {"x", "y", "z", "qx", "qy", "qz", "qw"} <= table.keys():
        return _of_quaternion(
            _named(table, "xyz"), [number_of(table[f"q{axis}"]) for axis in "xyzw"]
        )
    for position, turn in (("translation", "rotation"), ("position", "orientation")):
        xyz = table.get(position)
        quaternion = table.get(turn)
        if isinstance(xyz, Mapping) and isinstance(quaternion, Mapping) and "w" in quaternion:
            return _of_quaternion(_named(xyz, "xyz"), _named(quaternion, "xyzw"))
    if "data" in table:
        return _of_numbers(numbers_of(table, "data", where))
    return None


def _of_pair(table: Calibrated, where: str) -> HandEye | None:
    """Return the pose of the one pair of keys in a table; None if it has no key of a pair.

    Raises ConfigurationError if it has such keys, but not exactly one complete pair.
    """
    complete = [pair for pair in PAIRS if pair.translation in table and pair.rotation in table]
    if len(complete) != 1:
        keys = dict.fromkeys(key for pair in PAIRS for key in pair[:2] if key in table)
        if not keys:
            return None
        pairs = "; ".join(f"{pair.translation} with {pair.rotation}" for pair in PAIRS)
        raise ConfigurationError(
            f"{where}: a pose is exactly one translation with its rotation, not {', '.join(keys)}. "
            f"Pairs are {pairs}"
        )
    translation, rotation, carried = complete[0]
    t = numbers_of(table[translation], translation, where)
    R = numbers_of(table[rotation], rotation, where)
    if len(t) != 3 or len(R) not in (3, 9):
        raise ConfigurationError(
            f"{where}: {translation} must have 3 numbers and {rotation} 3 (a rotation vector) or "
            f"9 (a matrix), not "
            f"{len(t)} and {len(R)}"
        )
    if len(R) == 3:
        return HandEye(_of_numbers(np.concatenate((t, R))), carried)
    return HandEye(Pose.from_matrix(np.column_stack((R.reshape(3, 3), t))), carried)


def _named(table: Calibrated, names: str) -> list[float]:
    return [number_of(table.get(name)) for name in names]


def _of_numbers(numbers: Array) -> Pose:
    """Return the pose of 16 numbers (a matrix) or 6 (a translation and a rotation vector θu)."""
    if len(numbers) == 16:
        return Pose.from_matrix(numbers.reshape(4, 4))
    if len(numbers) != 6:
        raise InvalidInput(
            f"a pose is 6 numbers (a translation, then θu) or 4 × 4, not {len(numbers)}"
        )
    x, y, z, *vector = numbers.tolist()
    return Pose.from_rotation_vector((x, y, z), vector)


def _of_quaternion(xyz: Sequence[float], xyzw: Sequence[float]) -> Pose:
    x, y, z = xyz
    return Pose.from_quaternion((x, y, z), xyzw=xyzw)
