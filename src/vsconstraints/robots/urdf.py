"""Serial arms from URDF files.

Pinocchio parses the file's links and joints. Errors name the joint or the link.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError, unknown_name
from ..plugins.regular_files import read_regular
from ..rows import Array
from .geometry import vector
from .meshes import Purpose, mesh_folders, with_whole_paths
from .urdf_checks import require_sound

#: Coordinate or speed [rad, m, rad/s, m/s] beyond which a limit counts as infinite.
UNBOUNDED = 1e9
#: Elements that describe the arm; others are for simulators, drivers and controllers.
OF_URDF = ("link", "joint", "material")
#: Words in the name of a gripper's link or joint; such a link is the tip only if it is named.
OF_GRIPPERS = ("finger", "gripper", "jaw", "claw", "thumb", "knuckle")


@dataclass(frozen=True)
class UrdfSource:
    """Source of a robot's links, for reading their collision geometry later."""

    path: Path  #: The URDF file.
    #: Folders that ``package://`` paths of meshes start from, including those of the environment.
    package_dirs: tuple[str, ...]
    model: pin.Model  #: Model of the whole file.
    locked: tuple[int, ...]  #: Indices of its locked joints.
    positions: Array  #: Its coordinates with these joints locked.


class UrdfArm(NamedTuple):
    """Arm of a URDF file with n driven joints; limits are infinite where there is none."""

    model: pin.Model
    tip_frame: int  #: Index of the tip's frame in the model.
    source: UrdfSource
    q_min: Array  #: (n,) lower coordinates [rad or m].
    q_max: Array  #: (n,) upper coordinates [rad or m].
    qd_max: Array  #: (n,) speeds [rad/s or m/s].
    effort: Array  #: (n,) torques or forces [Nm or N].


def read_urdf(
    path: str | Path,
    tip: str | None,
    locked: Mapping[str, float],
    package_dirs: Sequence[str | Path] | None,
) -> UrdfArm:
    """Read the arm of a URDF file; see :meth:`.Robot.from_urdf`."""
    source = Path(path)
    file = _urdf_file(source)
    try:
        model = pin.buildModelFromXML(file.text)
    except (RuntimeError, ValueError, RecursionError) as error:
        raise ConfigurationError(
            f"{str(source)!r} cannot be read as a URDF: {error} Its parser prints a reason on "
            f"stderr, if it has one"
        ) from error
    bodies = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
    if tip is None:
        tip = _only_tip(file, model, locked, source.name)
    elif tip not in bodies:
        raise unknown_name(f"link in {source.name}", tip, bodies)
    chain = set(_joints_of(model, tip))
    positions = _locked_positions(model, locked, file.mimics, source.name)
    freeze = []
    for joint in range(1, model.njoints):
        if joint not in chain or model.names[joint] in locked:
            freeze.append(joint)
    own_names = _distinguish_joints(model, bodies)
    folders = tuple(map(str, mesh_folders(source, package_dirs, os.environ)))
    whole = UrdfSource(source, folders, model, tuple(freeze), positions)
    model = pin.buildReducedModel(model, freeze, positions)
    for i, joint_name in enumerate(model.names):
        model.names[i] = own_names.get(joint_name, joint_name)
    if model.nv == 0:
        raise ConfigurationError(f"no joint of {source.name} moves the link {tip!r}")
    _require_driven(model, file.mimics, source.name)
    lower = np.array(model.lowerPositionLimit)
    upper = np.array(model.upperPositionLimit)
    lower[lower <= -UNBOUNDED] = -np.inf
    upper[upper >= UNBOUNDED] = np.inf
    return UrdfArm(
        model=model,
        tip_frame=model.getFrameId(tip),
        source=whole,
        q_min=lower,
        q_max=upper,
        qd_max=_stated_limits(model.upperVelocityLimit),
        effort=_stated_limits(model.effortLimit),
    )


def _stated_limits(limits: Array) -> Array:
    """Return limits of speed or effort (n,), infinite where the file states none.

    A missing or zero attribute of the limit element means that there is no limit.
    """
    stated = np.array(limits)
    is_unlimited = (stated <= 0.0) | (stated >= UNBOUNDED)
    return np.where(is_unlimited, np.inf, stated)


def _require_driven(model: pin.Model, mimics: Mapping[str, Mimic], file: str) -> None:
    """Raise ConfigurationError unless every joint has one coordinate and follows no other joint."""
    for joint, name in zip(model.joints[1:], model.names[1:], strict=True):
        if joint.nq != 1 or joint.nv != 1:
            raise ConfigurationError(
                f"joint {name!r} of {file} is a {joint.shortname()}: "
                "only revolute, continuous and prismatic joints can be driven; lock it with "
                "locked={…}"
            )
        if name in mimics:
            raise ConfigurationError(
                f"joint {name!r} of {file} mimics another one and moves the tip: "
                "every joint of an arm must be driven by itself; lock it with locked={…}"
            )


def link_geometry(source: UrdfSource, purpose: Purpose = "collision") -> pin.GeometryModel:
    """Return the geometry of a URDF's links for a purpose, in the reduced model's frames.

    Raises ConfigurationError, which names the mesh, if one is missing or cannot be read.
    """
    file = _urdf_file(source.path)
    text = with_whole_paths(file.text, source.path, source.package_dirs, purpose)
    kind = pin.GeometryType.COLLISION if purpose == "collision" else pin.GeometryType.VISUAL
    try:
        geometry = pin.buildGeomFromUrdfString(source.model, text, kind)
    except (RuntimeError, ValueError) as error:
        raise ConfigurationError(
            f"{purpose} geometry of {source.path} cannot be read: {error}"
        ) from error
    _, reduced = pin.buildReducedModel(
        source.model, geometry, list(source.locked), source.positions
    )
    return reduced


def _joint_of(model: pin.Model, link: str) -> int:
    """Return the index of the joint that carries a link; 0 for the base."""
    return int(model.frames[model.getFrameId(link, pin.FrameType.BODY)].parentJoint)


def _joints_of(model: pin.Model, link: str) -> list[int]:
    """Return the indices of the joints that move a link."""
    return [i for i in model.supports[_joint_of(model, link)] if i > 0]


def _only_tip(file: UrdfFile, model: pin.Model, locked: Mapping[str, float], name: str) -> str:
    """Return the last link that a joint moves.

    Raises ConfigurationError if there are several, or if it may be a finger.
    """
    last = file.last_links()
    moved = []
    for link in last:
        joints = [model.names[i] for i in _joints_of(model, link)]
        if any(joint not in locked for joint in joints):
            moved.append(link)
    if len(moved) > 1:
        shared = set.intersection(*(set(file.above(link)) for link in moved))
        branch = next(link for link in file.above(moved[0]) if link in shared)
        raise ConfigurationError(
            f"{name} has several links that may be the tip: {', '.join(moved)}; they branch off "
            f'{branch!r}. Say which link carries the camera: tip = "…"'
        )
    tip = moved[0] if moved else last[0]
    carrier = file.parent.get(tip, tip)
    joint = model.names[_joint_of(model, tip)]
    names = f"{tip} {joint}".lower()
    grips = any(word in names for word in OF_GRIPPERS)
    if grips and _joint_of(model, tip) != _joint_of(model, carrier):
        raise ConfigurationError(
            f"the last link of {name}, {tip!r}, seems to be a part of a gripper that joint "
            f"{joint!r} moves. Say which link carries the camera: "
            f'tip = "{carrier}", or "{tip}" if it is that one'
        )
    return tip


def _locked_positions(
    model: pin.Model, locked: Mapping[str, float], mimics: Mapping[str, Mimic], file: str
) -> Array:
    """Return the coordinates with joints locked.

    They are the given ones, else neutral. A joint that mimics another one follows it. Raises
    ConfigurationError if that one does not exist.
    """
    positions: Array = pin.neutral(model)
    index_of = {name: model.joints[i].idx_q for i, name in enumerate(model.names) if i > 0}
    for joint, value in locked.items():
        if joint not in index_of:
            raise unknown_name(f"joint in {file}", joint, list(index_of))
        positions[index_of[joint]] = vector([value], 1, f"locked {joint}")[0]

    def position(joint: str, following: tuple[str, ...]) -> float:
        if joint in mimics and joint not in locked:
            leader, factor, offset = mimics[joint]
            if leader in following:
                raise ConfigurationError(
                    f"joint {joint!r} of {file} mimics {leader!r}, which mimics it; lock it with "
                    f"locked={{…}}"
                )
            if leader not in index_of and not model.existFrame(leader, pin.FrameType.FIXED_JOINT):
                raise ConfigurationError(
                    f"joint {joint!r} of {file} mimics {leader!r}, and there is no such joint: "
                    f"name one in its mimic element, or lock {joint!r} with locked={{…}}"
                )
            if leader in index_of:
                return factor * position(leader, (*following, leader)) + offset
        return float(positions[index_of[joint]])

    for joint in mimics:
        if joint in index_of:
            positions[index_of[joint]] = position(joint, (joint,))
    return positions


def _distinguish_joints(model: pin.Model, bodies: Sequence[str]) -> dict[str, str]:
    """Rename joints that have a link's name, since Pinocchio looks up both by name.

    Returns the old names by the new ones.
    """
    own_names = {f"{name} (joint)": name for name in model.names if name in bodies}
    for i, name in enumerate(model.names):
        if name in bodies:
            model.names[i] = f"{name} (joint)"
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY and frame.name in bodies:
            frame.name += " (joint)"
    return own_names


# --- the file's XML ---


class Mimic(NamedTuple):
    """Coupling of a joint: its coordinate is factor · that of the leader + offset."""

    leader: str
    factor: float
    offset: float


class UrdfFile(NamedTuple):
    """Content of a URDF file that describes an arm."""

    #: Its links and joints as XML. Every joint has a limit. A continuous joint is written as a
    #: revolute one without bounds, so that it has one coordinate.
    text: str
    mimics: Mapping[str, Mimic]  #: Couplings by the names of the joints that follow.
    links: tuple[str, ...]  #: Names of the links, in the file's order.
    parent: Mapping[str, str]  #: Name of the parent link by the name of a link.

    def above(self, link: str) -> list[str]:
        """Return a link and those that carry it, up to the base."""
        above = [link]
        while self.parent.get(above[-1], link) not in above:
            above.append(self.parent[above[-1]])
        return above

    def last_links(self) -> list[str]:
        """Return the links that carry no other link."""
        carrying = set(self.parent.values())
        return [link for link in self.links if link not in carrying]


def _urdf_file(path: Path) -> UrdfFile:
    """Read a URDF file without namespaces and without elements that do not describe the arm.

    Elements for simulators, drivers and controllers are dropped. Raises ConfigurationError if the
    file is missing, cannot be read, is no URDF, or must be expanded by xacro first.
    """
    if not path.is_file():
        raise ConfigurationError(f"no URDF file at {str(path)!r}")
    try:
        return _completed(path, read_regular(path))
    except OSError as error:
        raise ConfigurationError(f"{str(path)!r} cannot be read: {error}") from error


@lru_cache(maxsize=16)
def _completed(path: Path, content: bytes) -> UrdfFile:
    """Parse the content of a file; cached, since many scenes share an arm."""
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise ConfigurationError(f"{str(path)!r} is not XML: {error}") from error
    except (ValueError, LookupError) as error:  # unknown encoding
        raise ConfigurationError(f"{str(path)!r} cannot be read: {error}") from error
    if _plain(root.tag) != "robot":
        raise ConfigurationError(
            f"{str(path)!r} is not a URDF: its root is <{_plain(root.tag)}>, not <robot>"
        )
    if path.suffix == ".xacro" or _unexpanded(root):
        name = path.name.removesuffix(".xacro").removesuffix(".urdf") + ".urdf"
        name = name if name != path.name else f"expanded-{name}"
        made = path.with_name(name)
        raise ConfigurationError(
            f"{str(path)!r} is a xacro file, of which xacro makes a URDF. With ROS set up: xacro "
            f"{path} -o {made}. "
            f"Without ROS: pip install xacrodoc, then xacrodoc {path} -d FOLDER -o {made}, where "
            f"FOLDER holds the "
            "packages that $(find …) names. Arguments that the file takes follow as NAME:=VALUE"
        )
    for element in root.iter():
        element.tag = _plain(element.tag)
    for element in list(root):
        if element.tag not in OF_URDF:
            root.remove(element)
    require_sound(root, path.name)
    for joint in root.findall("joint"):
        _complete_limit(joint, path.name)
    try:
        text = ElementTree.tostring(root, encoding="unicode")
    except RecursionError as error:
        raise ConfigurationError(f"{str(path)!r} cannot be read as a URDF: {error}") from error
    links = tuple(link.get("name", "") for link in root.findall("link"))
    parent = {_link(joint, "child"): _link(joint, "parent") for joint in root.findall("joint")}
    return UrdfFile(text, _mimics(root), links, parent)


def _mimics(root: ElementTree.Element) -> dict[str, Mimic]:
    mimics = {}
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        name = joint.get("name", "")
        if mimic is not None:
            try:
                factor = float(mimic.get("multiplier", "1"))
                offset = float(mimic.get("offset", "0"))
            except ValueError as error:
                raise ConfigurationError(
                    f"the mimic element of joint {name!r} must have numbers: {error}"
                ) from error
            if not math.isfinite(factor * offset):
                raise ConfigurationError(
                    f"the multiplier and offset in the mimic element of joint {name!r} must be "
                    "finite"
                )
            mimics[name] = Mimic(mimic.get("joint", ""), factor, offset)
    return mimics


def _link(joint: ElementTree.Element, role: str) -> str:
    named = joint.find(role)
    return "" if named is None else named.get("link", "")


def _plain(tag: object) -> str:
    """Return a tag without its namespace."""
    return str(tag).rpartition("}")[2]


def _unexpanded(root: ElementTree.Element) -> bool:
    """True if elements that describe the arm contain unexpanded xacro expressions.

    In other elements, such texts may be shell expressions.
    """
    if any("xacro" in str(element.tag).rpartition("}")[0] for element in root.iter()):
        return True
    parts = (inner for part in root if _plain(part.tag) in OF_URDF for inner in part.iter())
    return any("${" in text or "$(" in text for inner in parts for text in inner.attrib.values())


def _complete_limit(joint: ElementTree.Element, file: str) -> None:
    """Add the limits that the URDF parser requires to a joint; 0 means no speed limit."""
    kind = joint.get("type")
    limit = joint.find("limit")
    if kind not in ("continuous", "revolute", "prismatic"):
        return
    if limit is None:
        if kind != "continuous":
            raise ConfigurationError(
                f"the {kind} joint {joint.get('name')!r} of {file} has no limit element; only "
                "continuous joints may omit it"
            )
        limit = ElementTree.SubElement(joint, "limit")
    for attribute in ("effort", "velocity"):
        limit.attrib.setdefault(attribute, "0")
    if kind == "continuous":
        joint.set("type", "revolute")
        limit.set("lower", str(-UNBOUNDED))
        limit.set("upper", str(UNBOUNDED))
