"""Checks of a URDF before it is parsed.

The parser drops elements that it cannot read, or reports only that the file is invalid. Errors from
these checks name the link or joint, the attribute and its value.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ..errors import ConfigurationError, format_value, unknown_name

#: Types of joints that move along or about an axis.
MOVING = ("revolute", "continuous", "prismatic", "planar")
TYPES = (*MOVING, "fixed", "floating")  #: Types of joints that a URDF may have.
NO_AXIS = 1e-9  #: Length below which an axis has no direction.


class Numbers(NamedTuple):
    """An attribute that holds numbers: its element below a joint or link, and their count."""

    element: str
    attribute: str
    how_many: int


OF_JOINTS = (
    Numbers("origin", "xyz", 3),
    Numbers("origin", "rpy", 3),
    Numbers("axis", "xyz", 3),
    Numbers("limit", "lower", 1),
    Numbers("limit", "upper", 1),
    Numbers("limit", "velocity", 1),
    Numbers("limit", "effort", 1),
)
#: Masses and solids, which the parser would drop with only a printed line.
OF_LINKS = (
    Numbers("inertial/mass", "value", 1),
    Numbers("inertial/origin", "xyz", 3),
    Numbers("inertial/origin", "rpy", 3),
    *(
        Numbers("inertial/inertia", entry, 1)
        for entry in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    ),
    Numbers("collision/origin", "xyz", 3),
    Numbers("collision/origin", "rpy", 3),
    Numbers("collision/geometry/box", "size", 3),
    Numbers("collision/geometry/cylinder", "radius", 1),
    Numbers("collision/geometry/cylinder", "length", 1),
    Numbers("collision/geometry/sphere", "radius", 1),
    Numbers("collision/geometry/mesh", "scale", 3),
    Numbers("visual/geometry/mesh", "scale", 3),
)


def require_sound(root: Element, file: str) -> None:
    """Raise ConfigurationError unless links and joints form a tree and numbers are valid.

    ``root`` has no namespaces. Joints of a moving type need an axis with a direction.
    """
    if root.get("name") is None:
        raise ConfigurationError(
            f'{file}: the robot has no name; its first line must be <robot name="…">'
        )
    links = _names(root, "link", file)
    joints = _names(root, "joint", file)
    for name, link in links.items():
        _require_numbers(link, OF_LINKS, f"the link {name!r} of {file}")
    carriers: dict[str, str] = {}
    for name, joint in joints.items():
        _require_joint(joint, f"the joint {name!r} of {file}")
        _require_connected(name, joint, links, carriers, file)
    parents = {child: _end(joints[name], "parent") for child, name in carriers.items()}
    _require_tree(list(links), parents, file)


def _names(root: Element, kind: str, file: str) -> dict[str, Element]:
    """Return the links or the joints by name."""
    named: dict[str, Element] = {}
    for number, element in enumerate(root.findall(kind), start=1):
        name = element.get("name")
        if name is None:
            raise ConfigurationError(
                f'{file}: {kind} number {number} has no name: <{kind} name="…">'
            )
        if name in named:
            raise ConfigurationError(
                f"{file} has two {kind}s of the name {name!r}: names must be different"
            )
        named[name] = element
    return named


def _require_joint(joint: Element, what: str) -> None:
    kind = joint.get("type")
    if kind is None:
        raise ConfigurationError(f"{what} has no type; it is one of {', '.join(TYPES)}")
    if kind not in TYPES:
        raise unknown_name(f"type of {what}", kind, TYPES)
    _require_numbers(joint, OF_JOINTS, what)
    axis = joint.find("axis")
    limit = joint.find("limit")
    if kind in MOVING and axis is not None:
        direction = [float(part) for part in axis.get("xyz", "1 0 0").split()]
        if math.hypot(*direction) < NO_AXIS:
            raise ConfigurationError(
                f"{what} is {kind}, but its axis {format_value(axis.get('xyz'))} has no "
                f"direction: it "
                f"must not be zero; "
                "a joint that does not move has the type fixed"
            )
    for attribute in ("velocity", "effort"):
        value = "0" if limit is None else limit.get(attribute, "0")
        if float(value) < 0.0:
            raise ConfigurationError(
                f'{what} has the limit {attribute}="{value}", which is negative: it is the '
                f"greatest amount in either "
                "direction; 0 stands for no limit"
            )


def _require_numbers(element: Element, attributes: tuple[Numbers, ...], what: str) -> None:
    """Raise ConfigurationError for an attribute that does not hold its count of finite numbers."""
    for path, attribute, count in attributes:
        for part in element.iterfind(path):
            text = part.get(attribute)
            if text is not None and not _are_numbers(text, count):
                comma = (
                    "; decimals are written with a point, and numbers separated by spaces"
                    if "," in text
                    else ""
                )
                numbers = "a finite number" if count == 1 else f"{count} finite numbers"
                tag = path.rpartition("/")[2]
                raise ConfigurationError(
                    f'{what}: <{tag} {attribute}="{text[:60]}"> must be {numbers}{comma}'
                )


def _are_numbers(text: str, count: int) -> bool:
    parts = text.split()
    try:
        return len(parts) == count and all(math.isfinite(float(part)) for part in parts)
    except ValueError:
        return False


def _require_connected(
    name: str, joint: Element, links: Mapping[str, Element], carriers: dict[str, str], file: str
) -> None:
    """Raise ConfigurationError unless a joint connects two links.

    No other joint may carry the second one. ``carriers`` are the previous joints by the links that
    they carry; this joint is added.
    """
    for role in ("parent", "child"):
        link = _end(joint, role)
        if not link:
            raise ConfigurationError(
                f'the joint {name!r} of {file} has no {role}: <{role} link="…"/>'
            )
        if link not in links:
            raise unknown_name(f"{role} link of the joint {name!r} of {file}", link, links)
    parent = _end(joint, "parent")
    child = _end(joint, "child")
    if parent == child:
        raise ConfigurationError(
            f"the joint {name!r} of {file} connects the link {child!r} to itself"
        )
    if child in carriers:
        raise ConfigurationError(
            f"the link {child!r} of {file} is the child of two joints, {carriers[child]!r} and "
            f"{name!r}: a link has "
            "one parent; a closed chain cannot be a URDF"
        )
    carriers[child] = name


def _end(joint: Element, role: str) -> str:
    end = joint.find(role)
    return "" if end is None else end.get("link", "")


def _require_tree(links: list[str], parents: Mapping[str, str], file: str) -> None:
    """Raise ConfigurationError unless exactly one link has no parent and carries all others."""
    roots = [link for link in links if link not in parents]
    if len(roots) > 1:
        raise ConfigurationError(
            f"{file} has {len(roots)} links without a parent: {', '.join(roots)}; only the base "
            f"has none: connect the "
            "others by joints of the type fixed, or leave them out"
        )
    for link in links:
        chain = list(_upwards(link, parents))
        if chain[-1] not in roots:
            raise ConfigurationError(
                f"links of {file} carry each other in a circle: {' → '.join(reversed(chain))}"
            )


def _upwards(link: str, parents: Mapping[str, str]) -> Iterator[str]:
    """Yield a link, its parent, and so on, up to the base or the first repeated link."""
    seen: set[str] = set()
    while link not in seen:
        yield link
        seen.add(link)
        if link not in parents:
            return
        link = parents[link]
    yield link
