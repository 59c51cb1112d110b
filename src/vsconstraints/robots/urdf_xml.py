"""The XML of a URDF file: its links and joints alone, with the limits that parsers insist on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from ..errors import ConfigurationError

UNBOUNDED = 1e9
"""A joint coordinate or speed [rad, m, rad/s, m/s] beyond which a limit counts as none."""

OF_URDF = ("link", "joint", "material")
"""Elements that describe the arm; what else a file says is for simulators, drivers and controllers."""


class Mimic(NamedTuple):
    """How a joint follows another one: its coordinate is factor · that of the leader + offset."""

    leader: str
    factor: float
    offset: float


class UrdfFile(NamedTuple):
    """What a URDF file says of an arm.

    Attributes
    ----------
    text
        Its links and joints as XML. Every joint has a limit, and a continuous joint is a revolute one without bounds,
        so that it has one coordinate.
    mimics
        How joints follow others, by their names.
    links
        Names of the links, in the file's order.
    parent
        By the name of a link, that of the one that carries it.
    """

    text: str
    mimics: Mapping[str, Mimic]
    links: tuple[str, ...]
    parent: Mapping[str, str]

    def above(self, link: str) -> list[str]:
        """A link and those that carry it, up to the base."""
        above = [link]
        while self.parent.get(above[-1], link) not in above:
            above.append(self.parent[above[-1]])
        return above

    def last_links(self) -> list[str]:
        """Links that carry no other one."""
        carrying = set(self.parent.values())
        return [link for link in self.links if link not in carrying]


def urdf_file(path: Path) -> UrdfFile:
    """What a file says of an arm: without namespaces, and without what is for simulators, drivers and controllers.

    Raises
    ------
    ConfigurationError
        if the file is missing, cannot be read, is no URDF, or is one only after xacro has made it one.
    """
    if not path.is_file():
        raise ConfigurationError(f"no URDF file at {str(path)!r}")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{str(path)!r} cannot be read: {error}") from error
    return _completed(path, content)


@lru_cache(maxsize=16)
def _completed(path: Path, content: bytes) -> UrdfFile:
    """What a file with that content says: kept, since the scenes of one arm are many."""
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise ConfigurationError(f"{str(path)!r} is not XML: {error}") from error
    except (ValueError, LookupError) as error:  # in an unknown encoding
        raise ConfigurationError(f"{str(path)!r} cannot be read: {error}") from error
    if _plain(root.tag) != "robot":
        raise ConfigurationError(f"{str(path)!r} is not a URDF: its root is <{_plain(root.tag)}>, not <robot>")
    if path.suffix == ".xacro" or _unexpanded(root):
        made = path.name.removesuffix(".xacro").removesuffix(".urdf") + ".urdf"
        made = made if made != path.name else f"expanded-{made}"
        raise ConfigurationError(
            f"{str(path)!r} is a xacro file, of which xacro makes a URDF: xacro {path} -o {path.with_name(made)} "
            "(part of ROS; or pip install xacro), with the arguments that it takes as NAME:=VALUE"
        )
    for element in root.iter():
        element.tag = _plain(element.tag)
    for element in list(root):
        if element.tag not in OF_URDF:
            root.remove(element)
    for joint in root.findall("joint"):
        _complete_limit(joint, path.name)
    try:
        text = ElementTree.tostring(root, encoding="unicode")
    except RecursionError as error:
        raise ConfigurationError(f"{str(path)!r} cannot be read as a URDF: {error}") from error
    links = tuple(link.get("name", "") for link in root.findall("link"))
    parent = {_of(joint, "child"): _of(joint, "parent") for joint in root.findall("joint")}
    return UrdfFile(text, _mimics(root), links, parent)


def _mimics(root: ElementTree.Element) -> dict[str, Mimic]:
    found = {}
    for joint in root.findall("joint"):
        mimic, name = joint.find("mimic"), joint.get("name", "")
        if mimic is not None:
            try:
                factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
            except ValueError as error:
                raise ConfigurationError(f"the joint {name!r} mimics by no number: {error}") from error
            if not math.isfinite(factor * offset):
                raise ConfigurationError(f"by what the joint {name!r} mimics another one must be finite")
            found[name] = Mimic(mimic.get("joint", ""), factor, offset)
    return found


def _of(joint: ElementTree.Element, what: str) -> str:
    named = joint.find(what)
    return "" if named is None else named.get("link", "")


def _plain(tag: object) -> str:
    """A tag without its namespace."""
    return str(tag).rpartition("}")[2]


def _unexpanded(root: ElementTree.Element) -> bool:
    """Whether something is left for xacro to do."""
    tags = (str(element.tag) for element in root.iter())
    return any(tag.startswith("{") and "xacro" in tag.partition("}")[0] for tag in tags) or any(
        "${" in text or "$(" in text for text in _arm_texts(root)
    )


def _arm_texts(root: ElementTree.Element) -> Iterator[str]:
    """The attributes of what describes the arm; elsewhere such texts may be a shell's."""
    for element in root:
        if _plain(element.tag) in OF_URDF:
            for inner in element.iter():
                yield from inner.attrib.values()


def _complete_limit(joint: ElementTree.Element, file: str) -> None:
    """Give a joint the limits that the URDF parser insists on; 0 stands for no speed limit."""
    kind, limit = joint.get("type"), joint.find("limit")
    if kind not in ("continuous", "revolute", "prismatic"):
        return
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
