"""The links of an arm as solids that a browser draws: those of the URDF, or bars along the joints' axes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from ...errors import ConfigurationError
from ...robots.robot import Robot
from ...robots.urdf import link_geometry
from ...rows import Array
from ..plots.arm import SLIDING, bars_of, joint_places, radii_of

MOST_TRIANGLES = 36_000
"""Of an arm: what has more is drawn more coarsely."""

FINEST = 1e-3
"""Distance below which corners of a mesh that has too many are one [m]."""

Triangles = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Solid:
    """Corners (V, 3) [m] and triangles (F, 3) of a surface."""

    corners: Array
    triangles: Triangles

    def moved(self, placement: pin.SE3) -> Solid:
        """The same, seen from the frame that the placement (of its own frame) is given in."""
        return Solid(
            self.corners @ np.asarray(placement.rotation).T + np.asarray(placement.translation), self.triangles
        )

    def within(self, depth: float) -> Solid:
        """The same with its surface this far further in [m]."""
        if depth == 0.0 or not len(self.triangles):
            return self
        # what is one corner of the body may be several of the mesh, one for each face that meets there
        places, own = np.unique(np.round(self.corners, 6), axis=0, return_inverse=True)
        triangles = np.asarray(own).reshape(-1)[self.triangles]
        a, b, c = places[triangles].transpose(1, 0, 2)
        faces = np.cross(b - a, c - a)
        # the volume is positive if faces look outwards
        outwards = np.sign(np.einsum("fi,fi->", a, faces)) or 1.0
        normals = np.zeros_like(places)
        for corner in triangles.T:
            np.add.at(normals, corner, outwards * faces)
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        moved = places - depth * normals / np.where(lengths > 0.0, lengths, 1.0)
        return Solid(moved[np.asarray(own).reshape(-1)], self.triangles)


class Links(NamedTuple):
    """Solids of an arm with n joints: of the base and of what each joint moves (n + 1), in that joint's frame."""

    solids: list[Solid]
    remark: str = ""

    def within(self, depth: float) -> Links:
        """The same with surfaces this far further in [m]."""
        return self._replace(solids=[solid.within(depth) for solid in self.solids])


def links_of(robot: Robot, size: float) -> Links:
    """The visual meshes of a robot's URDF; where it has none, or one is missing, bars, and a sentence that says so.

    ``size`` scales how thick bars are.
    """
    if robot.source is None:
        return Links(_bars(robot, size), f"{robot.name} has no meshes: bars follow the axes of its joints.")
    try:
        geometry = link_geometry(robot.source, "visual")
    except ConfigurationError as error:
        return Links(_bars(robot, size), f"Bars follow the axes of the joints instead of meshes: {error}.")
    bodies: list[list[Solid]] = [[] for _ in range(robot.n + 1)]
    for part in geometry.geometryObjects:
        bodies[part.parentJoint].append(_solid(part.geometry).moved(part.placement))
    if not any(bodies):
        return Links(_bars(robot, size), f"{robot.name} has no visual meshes: bars follow the axes of its joints.")
    return Links(_coarse([together(parts) for parts in bodies]))


def together(parts: list[Solid]) -> Solid:
    """Solids as one."""
    if not parts:
        return Solid(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64))
    ends = np.cumsum([0, *(len(part.corners) for part in parts)])
    triangles = [part.triangles + first for part, first in zip(parts, ends, strict=False)]
    return Solid(np.concatenate([part.corners for part in parts]), np.concatenate(triangles))


def ball(centre: Array, radius: float, subdivisions: int = 2) -> Solid:
    """A sphere."""
    import trimesh

    made = _of_trimesh(trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius))
    return Solid(made.corners + centre, made.triangles)


def bar(start: Array, end: Array, radius: float) -> Solid:
    """A round bar from one point to another."""
    import trimesh

    return _of_trimesh(trimesh.creation.cylinder(radius=radius, segment=np.array([start, end]), sections=20))


def _of_trimesh(mesh: Any) -> Solid:
    return Solid(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def _bars(robot: Robot, size: float) -> list[Solid]:
    """Drums for joints and bars between them, each in the frame of the joint that moves it."""
    zero = np.zeros(robot.n)
    places, axes = joint_places(robot, zero)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, zero)
    bodies: list[list[Solid]] = [[] for _ in range(robot.n + 1)]
    radii = radii_of(robot, size)
    if not robot.prismatic[0]:
        bodies[0].append(bar(np.array([0.0, 0.0, -0.005 * size]), np.array([0.0, 0.0, 0.04 * size]), 0.09 * size))
        if np.linalg.norm(places[0]) > 1e-6:
            bodies[0].append(bar(np.zeros(3), places[0], 0.8 * radii[0]))
    for i, corners in enumerate(bars_of(robot, zero)):
        slides, own = robot.prismatic[i], bodies[i + 1]
        if not slides:
            away = 1.35 * radii[i] * axes[i]
            own.append(bar(places[i] - away, places[i] + away, 1.25 * radii[i]))
        thickness = (SLIDING if slides else 0.8) * radii[i]
        for a, b in pairwise(corners):
            own += [bar(a, b, thickness), ball(b, thickness, 1)]
    return [together(parts).moved(data.oMi[i].inverse()) for i, parts in enumerate(bodies)]


def _solid(geometry: coal.CollisionGeometry) -> Solid:
    """A geometry that a URDF can name."""
    import trimesh

    if isinstance(geometry, coal.BVHModelBase):
        triangles = [tuple(geometry.tri_indices(k)[j] for j in range(3)) for k in range(geometry.num_tris)]
        return Solid(np.array(geometry.vertices()), np.array(triangles, dtype=np.int64).reshape(-1, 3))
    if isinstance(geometry, coal.Sphere):
        return ball(np.zeros(3), geometry.radius)
    if isinstance(geometry, coal.Cylinder | coal.Capsule):
        end = np.array([0.0, 0.0, geometry.halfLength])
        return bar(-end, end, geometry.radius)
    geometry.computeLocalAABB()
    low, high = np.array(geometry.aabb_local.min_), np.array(geometry.aabb_local.max_)
    return _of_trimesh(trimesh.creation.box(bounds=np.array([low, high])))


def _coarse(solids: list[Solid]) -> list[Solid]:
    """The same with fewer triangles where there are too many: corners that are close to each other become one."""
    cell = FINEST
    made = solids
    while sum(len(solid.triangles) for solid in made) > MOST_TRIANGLES:
        made = [_clustered(solid, cell) for solid in solids]
        cell *= 1.4
    return made


def _clustered(solid: Solid, cell: float) -> Solid:
    if not len(solid.corners):
        return solid
    _, first, own = np.unique(np.round(solid.corners / cell), axis=0, return_index=True, return_inverse=True)
    triangles = np.asarray(own).reshape(-1)[solid.triangles]
    a, b, c = triangles.T
    whole = (a != b) & (b != c) & (c != a)
    return Solid(solid.corners[first], triangles[whole])
