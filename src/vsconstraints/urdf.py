"""Reading serial arms from URDF files."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .errors import ConfigurationError, unknown_name
from .geometry import vector
from .rows import Array

UNBOUNDED = 1e9
"""A joint coordinate or speed [rad, m, rad/s, m/s] beyond which a limit counts as none."""


@dataclass(frozen=True)
class UrdfSource:
    """Where a robot's links come from, for what is read only when asked for: their collision geometry.

    Attributes
    ----------
    path
        The URDF file.
    package_dirs
        Folders that ``package://`` paths of meshes start from.
    model, locked, positions
        The file's model, the joints of it that are locked, and its coordinates then.
    """

    path: Path
    package_dirs: tuple[str, ...]
    model: pin.Model
    locked: tuple[int, ...]
    positions: Array


class UrdfArm(NamedTuple):
    """What a URDF file says of an arm: its model, the frame of its tip, its limits (n,), and where it comes from."""

    model: pin.Model
    tip_frame: int
    q_min: Array
    q_max: Array
    qd_max: Array
    source: UrdfSource
    effort: Array


def read_urdf(
    path: str | Path, tip: str | None, locked: Mapping[str, float], package_dirs: Sequence[str | Path] | None
) -> UrdfArm:
    """The arm of a URDF file; see :meth:`vsconstraints.Robot.from_urdf` for parameters and errors."""
    source = Path(path)
    if not source.is_file():
        raise ConfigurationError(f"no URDF file at {str(source)!r}")
    try:
        content = source.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{str(source)!r} cannot be read: {error}") from error
    completed, mimics = _completed(source, content)
    try:
        model = pin.buildModelFromXML(completed)
    except (RuntimeError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{str(source)!r} cannot be read as a URDF: {error}") from error
    bodies = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
    if tip is None:
        tip = bodies[-1]
    elif tip not in bodies:
        raise unknown_name(f"link in {source.name}", tip, bodies)
    positions = pin.neutral(model)
    for joint, value in locked.items():
        if not model.existJointName(joint):
            raise unknown_name(f"joint in {source.name}", joint, model.names[1:])
        positions[model.joints[model.getJointId(joint)].idx_q] = vector([value], 1, f"locked {joint}")[0]
    chain = set(model.supports[model.frames[model.getFrameId(tip, pin.FrameType.BODY)].parentJoint])
    freeze = [i for i in range(1, model.njoints) if i not in chain or model.names[i] in locked]
    own_names = _distinguish_joints(model, bodies)
    folders = source.resolve().parents if package_dirs is None else package_dirs
    origin = UrdfSource(source, tuple(map(str, folders)), model, tuple(freeze), positions)
    model = pin.buildReducedModel(model, freeze, positions)
    for i, joint_name in enumerate(model.names):
        model.names[i] = own_names.get(joint_name, joint_name)
    if model.nv == 0:
        raise ConfigurationError(f"no joint of {source.name} moves the link {tip!r}")
    for joint, joint_name in zip(model.joints[1:], model.names[1:], strict=True):
        if joint.nq != 1 or joint.nv != 1:
            raise ConfigurationError(
                f"joint {joint_name!r} of {source.name} is a {joint.shortname()}: "
                "only revolute, continuous and prismatic joints can be driven; lock it with locked={…}"
            )
        if joint_name in mimics:
            raise ConfigurationError(
                f"joint {joint_name!r} of {source.name} mimics another one and moves the tip: "
                "every joint of an arm must be driven by itself; lock it with locked={…}"
            )
    speed = np.array(model.upperVelocityLimit)
    # a URDF whose limit element has no velocity, or 0, sets no limit
    speed[(speed <= 0.0) | (speed >= UNBOUNDED)] = np.inf
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    lower[lower <= -UNBOUNDED], upper[upper >= UNBOUNDED] = -np.inf, np.inf
    effort = np.array(model.effortLimit)
    effort[(effort <= 0.0) | (effort >= UNBOUNDED)] = np.inf
    return UrdfArm(model, model.getFrameId(tip), lower, upper, speed, origin, effort)


@lru_cache(maxsize=16)
def _completed(source: Path, content: bytes) -> tuple[str, frozenset[str | None]]:
    """What a file holds, with all limits, and which joints mimic others: kept, since the scenes of one arm are many."""
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise ConfigurationError(f"{str(source)!r} is not XML: {error}") from error
    except (ValueError, LookupError) as error:  # in an unknown encoding
        raise ConfigurationError(f"{str(source)!r} cannot be read: {error}") from error
    if root.tag != "robot":
        raise ConfigurationError(f"{str(source)!r} is not a URDF: its root is <{root.tag}>, not <robot>")
    _complete_limits(root, source.name)
    mimics = frozenset(joint.get("name") for joint in root.iter("joint") if joint.find("mimic") is not None)
    try:
        return ElementTree.tostring(root, encoding="unicode"), mimics
    except RecursionError as error:
        raise ConfigurationError(f"{str(source)!r} cannot be read as a URDF: {error}") from error


def collision_geometry(source: UrdfSource) -> pin.GeometryModel:
    """The collision geometry of a URDF's links, in the reduced model's frames.

    Raises
    ------
    ConfigurationError
        if a mesh cannot be read; the message names the file.
    """
    try:
        geometry = pin.buildGeomFromUrdf(
            source.model, str(source.path), pin.GeometryType.COLLISION, package_dirs=list(source.package_dirs)
        )
    except (RuntimeError, ValueError) as error:
        raise ConfigurationError(f"collision geometry of {source.path} cannot be read: {error}") from error
    return pin.buildReducedModel(source.model, geometry, list(source.locked), source.positions)[1]


def mesh_files(path: Path) -> list[Path]:
    """The mesh files that a URDF's collision geometry names, where they are there; none if it cannot be read."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):
        return []
    names = {mesh.get("filename", "") for collision in root.iter("collision") for mesh in collision.iter("mesh")}
    found = []
    for name in sorted(names):
        scheme, _, rest = name.rpartition("://")
        folders = path.resolve().parents if scheme == "package" else (Path(),)
        found += [file for folder in folders if (file := folder / rest).is_file()][:1]
    return found


def _distinguish_joints(model: pin.Model, bodies: Sequence[str]) -> dict[str, str]:
    """Rename joints that have a link's name, since Pinocchio looks up both by name; returns old names by new ones."""
    own_names = {f"{name} (joint)": name for name in model.names if name in bodies}
    for i, name in enumerate(model.names):
        if name in bodies:
            model.names[i] = f"{name} (joint)"
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY and frame.name in bodies:
            frame.name += " (joint)"
    return own_names


def _complete_limits(root: ElementTree.Element, file: str) -> None:
    """Give every joint the limits the URDF parser insists on; 0 stands for no speed limit.

    Continuous joints become revolute ones without bounds, so that every joint has one coordinate.
    """
    for joint in root.iter("joint"):
        kind, limit = joint.get("type"), joint.find("limit")
        if kind not in ("continuous", "revolute", "prismatic"):
            continue
        if limit is None:
            if kind != "continuous":
                raise ConfigurationError(
                    f"the {kind} joint {joint.get('name')!r} of {file} has no limit element; "
                    "only continuous joints may have none"
                )
            limit = ElementTree.SubElement(joint, "limit")
        for attribute in ("effort", "velocity"):
            limit.attrib.setdefault(attribute, "0")
        if kind == "continuous":
            joint.set("type", "revolute")
            limit.set("lower", str(-UNBOUNDED))
            limit.set("upper", str(UNBOUNDED))
