"""Nodes of viser's scene: what moves, solids and their colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from ...robots.geometry import Pose
from ...rows import Array
from ..plots.mesh import Mesh
from .solids import Solid, together

UNCHANGED = 1e-6
"""What moves less from frame to frame is not told again."""


class Mover:
    """A thing in space, which is told where it is only where that changes."""

    def __init__(self, handle: Any) -> None:
        self.handle = handle
        self.at: dict[str, Array] = {}

    def set(self, name: str, value: Array) -> None:
        """Give it a ``position`` (3,), a ``wxyz`` (4,) or a ``scale`` (3,)."""
        before = self.at.get(name)
        if before is None or np.abs(value - before).max() > UNCHANGED:
            self.at[name] = value
            setattr(self.handle, name, tuple(value.tolist()) if name == "scale" else value)

    def place(self, pose: Pose) -> None:
        """Put it at a pose in its parent's frame."""
        self.set("position", pose.t)
        self.set("wxyz", wxyz_of(pose.R))


def add_solid(scene: Any, name: str, solid: Solid, color: tuple[int, int, int], **look: Any) -> Any:
    """Put a solid into viser's scene; returns its handle."""
    # a quarter of a millimetre nobody sees, and the file is much smaller
    corners = np.round(solid.corners * 4096.0) / 4096.0
    return scene.add_mesh_simple(
        name, corners, solid.triangles, color=color, side="double", cast_shadow=False, receive_shadow=False, **look
    )


def of_mesh(mesh: Mesh) -> Solid:
    """The polygons of a mesh as triangles."""
    parts = []
    for polygon in mesh.polygons:
        fan = np.array([[0, i, i + 1] for i in range(1, len(polygon) - 1)])
        parts.append(Solid(polygon, fan))
    return together(parts)


def wxyz_of(R: Array) -> Array:
    """(4,) the unit quaternion of a rotation (3, 3), its scalar part first."""
    x, y, z, w = pin.Quaternion(R).coeffs()
    return np.round(np.array([w, x, y, z]), 6)


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, up to 255, of ``#RRGGBB``."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def pale(colour: str, white: float = 0.45) -> str:
    """A colour with a part of white in it."""
    return "#" + "".join(f"{int((1.0 - white) * part + white * 255):02X}" for part in rgb(colour))
