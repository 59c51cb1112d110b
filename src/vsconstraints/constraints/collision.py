"""Distances of a robot's bodies to an obstacle and to each other, without characteristic points.

See section 4.3.6.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from itertools import combinations, product
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError, SceneError, unknown_name
from ..formulas.vectors import cross
from ..robots.geometry import Pose
from ..robots.robot import Robot
from ..rows import Array
from ..vision.scene import Scene, State
from .base import Constraint, RowBlock, Trace, require_margin, require_positive
from .bodies import Body, disabled_pairs
from .by_formula import differences_along
from .meshes import Mesh, mesh_of

#: Tolerances of coal's iterations [m]; a looser one is used if they fail with a tighter one.
TOLERANCES = (1e-9, 1e-6, 1e-4)
UNFINISHED = 1e6  #: Distance [m] from which on an iteration of coal counts as failed.
STEP = 3e-5  #: Step of q along q̇ for the differences of a gradient [rad or m].


class _Placed(NamedTuple):
    """Solid at its pose in the base frame."""

    solid: coal.CollisionGeometry
    pose: coal.Transform3s


class _Nearest(NamedTuple):
    """Signed distance of solids a and b [m].

    ``direction`` (3,) is the unit vector from a to b, and ``point`` (3,) the point of a nearest to
    b, both in the base frame.
    """

    distance: float
    direction: Array
    point: Array


class BodyDistance(Constraint):
    """Constraint margin − d ≤ 0 for pairs of bodies, one row each.

    d is the signed distance of a pair as computed by coal. It is negative where the bodies
    penetrate each other: its absolute value is then the length of the shortest way out. The
    gradient follows from the nearest points p_a and p_b and the direction n from the first to the
    second body: ∂d/∂q = nᵀ (J_b − J_a). Where the nearest points are not unique, d has kinks, and
    the gradient is that of one side. The curvature is computed by differences of the gradient along
    q̇, and is thus smoothed at a kink.

    ``pairs`` are the first and second body of each row. ``margin`` and the characteristic
    ``length`` are in metres, K is the approach time constant [s] and ``switching_gain`` is u⁺
    [m/s].
    """

    unit = "m"

    def __init__(
        self,
        robot: Robot,
        pairs: Sequence[tuple[Body, Body]],
        *,
        K: float,
        switching_gain: float,
        margin: float,
        length: float,
    ) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        self.scale = self.length = require_positive(length, f"length of {self.kind}")
        self.robot = robot
        self.pairs = tuple(pairs)
        self.margin = require_margin(margin, self.kind)
        self._model = robot.model
        self._data = robot.model.createData()
        # unique bodies, compared by identity because solids of coal cannot be compared
        self._bodies: dict[int, Body] = {}
        motion = []
        joints = np.arange(robot.n)
        for first, second in self.pairs:
            self._bodies[id(first)] = first
            self._bodies[id(second)] = second
            # joint j moves a body if the body's joint comes after it
            moves_first = np.where(joints < first.joint, 1.0, 0.0)
            moves_second = np.where(joints < second.joint, 1.0, 0.0)
            motion.append(moves_second - moves_first)
        #: (r, n) 1 where a joint moves the second body of a pair alone, −1 for the first one alone.
        self._motion = np.array(motion)
        self._requests = []
        for tolerance in TOLERANCES:
            request = coal.DistanceRequest()
            request.gjk_tolerance = request.epa_tolerance = tolerance
            request.gjk_max_iterations = request.epa_max_iterations = 512
            self._requests.append(request)

    @abstractmethod
    def pair_label(self, first: Body, second: Body) -> str:
        """Return the label of the row for a pair."""

    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels, one per pair."""
        return tuple(self.pair_label(first, second) for first, second in self.pairs)

    def distances(self, q: Array) -> Array:
        """Return the signed distances (r,) [m] at q (n,)."""
        return self._measure(q)[0]

    def gradient(self, q: Array) -> Array:
        """Return ∂σ/∂q = −∂d/∂q (r, n) at q (n,)."""
        return self._measure(q)[1]

    def curvature(self, q: Array, qd: Array) -> Array:
        """Return q̇ᵀ (∂²σ/∂q²) q̇ (r,) by central differences of the gradient along q̇."""
        return differences_along(self.gradient, q, qd, STEP)

    def rows(self, state: State, points: slice) -> RowBlock:
        """Return rows from the distances and their gradients.

        Raises SceneError if coal finds no distance of two bodies.
        """
        q = state.robot.q
        qd = state.robot.qd
        distance, g = self._measure(q)
        sigma = self.margin - distance
        sigma_dot = g @ qd
        return self.block(sigma, sigma_dot, g, self.curvature(q, qd))

    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return the distances minus the margin [m]."""
        distances = np.array([self.distances(q) for q in trace.q])
        return distances.reshape(-1, len(self.pairs)) - self.margin

    def _placed(self, body: Body) -> list[_Placed]:
        """Return the solids of a body with their poses, for the joint Jacobians computed last."""
        placed = []
        for placement, solid in body.parts:
            placement_in_base = self._data.oMi[body.joint] * placement
            pose = coal.Transform3s(placement_in_base.rotation, placement_in_base.translation)
            placed.append(_Placed(solid, pose))
        return placed

    def _measure(self, q: Array) -> tuple[Array, Array]:
        """Return the signed distances (r,) at q and −∂d/∂q (r, n)."""
        jacobian = pin.computeJointJacobians(self._model, self._data, q)
        J = np.asarray(jacobian).reshape(6, -1)
        placed = {}
        for key, body in self._bodies.items():
            placed[key] = self._placed(body)
        count = len(self.pairs)
        distances = np.empty(count)
        wrenches = np.empty((count, 6))
        for i, (first, second) in enumerate(self.pairs):
            solids = product(placed[id(first)], placed[id(second)])
            found = [self._nearest(a, b, i) for a, b in solids]
            nearest = min(found, key=attrgetter("distance"))
            distances[i] = nearest.distance
            # n · (v + ω × p) for a twist (v, ω) at the base frame's origin
            wrenches[i, :3] = nearest.direction
            wrenches[i, 3:] = cross(nearest.point, nearest.direction)
        return distances, -(wrenches @ J) * self._motion

    def _nearest(self, a: _Placed, b: _Placed, row: int) -> _Nearest:
        """Return the distance of two solids of a pair.

        Raises SceneError if coal's iterations fail with all tolerances.
        """
        for request in self._requests:
            result = coal.DistanceResult()
            distance = float(coal.distance(a.solid, a.pose, b.solid, b.pose, request, result))
            point = np.array(result.getNearestPoint1())
            direction = np.array(result.normal)
            # a failed iteration yields the largest double, or NaN
            is_finite = np.isfinite(point).all() and np.isfinite(direction).all()
            if is_finite and abs(distance) < UNFINISHED:
                if direction @ direction <= 0.5:
                    # the centres coincide, and every direction leads out
                    direction = np.array([0.0, 0.0, 1.0])
                return _Nearest(distance, direction, point)
        raise SceneError(f"coal finds no distance for {self.pair_label(*self.pairs[row])}")


class Collision(BodyDistance):
    """Collision avoidance between bodies of the robot and an obstacle.

    Bodies are those of the URDF, capsules, or given ones. ``bodies`` are those of the robot, for
    example ``link_bodies(robot)``; those that no joint moves are omitted. The obstacle is a body
    such as ``fixed_body("table", coal.Box(1, 1, 0.1), pose)``. ``links`` are the names of the
    bodies concerned, all if None. The other arguments are those of :class:`BodyDistance`.
    """

    kind = "collision"

    def __init__(
        self,
        robot: Robot,
        bodies: Sequence[Body],
        obstacle: Body,
        *,
        K: float,
        switching_gain: float,
        links: Sequence[str] | None = None,
        margin: float = 0.0,
        length: float = 0.1,
    ) -> None:
        by_name = _by_name(bodies, self.kind)
        moving = {name: body for name, body in by_name.items() if body.joint > 0}
        names = moving if links is None else links
        chosen = [_named(moving, name, self.kind) for name in names]
        if not chosen:
            raise ConfigurationError(
                f"{self.kind}: {robot.name} has no body that a joint moves: does its URDF have "
                "collision geometry? With link_radius, links are capsules"
            )
        pairs = [(body, obstacle) for body in chosen]
        super().__init__(
            robot, pairs, K=K, switching_gain=switching_gain, margin=margin, length=length
        )

    def meshes(self, t: float, reach: float = np.inf) -> list[Mesh]:
        """Return the meshes of the obstacle's solids."""
        _, obstacle = self.pairs[0]
        meshes = []
        for placement, solid in obstacle.parts:
            mesh = mesh_of(solid, reach)
            if mesh is not None:
                pose = Pose.of(placement)
                meshes.append(mesh.moved(pose))
        return meshes

    def pair_label(self, first: Body, second: Body) -> str:
        """Return a label such as ``collision[table, forearm_link]``."""
        if not second.name:
            return f"{self.kind}[{first.name}]"
        return f"{self.kind}[{second.name}, {first.name}]"


class SelfCollision(BodyDistance):
    """Collision avoidance between bodies of the robot.

    Bodies are those of the URDF, capsules, or given ones. ``pairs`` are the names of the bodies of
    each pair. If None, they are all pairs except those of one joint or of neighbouring joints,
    which always touch, and those that the SRDF file disables. The other arguments are those of
    :class:`BodyDistance`.
    """

    kind = "self-collision"

    def __init__(
        self,
        robot: Robot,
        bodies: Sequence[Body],
        *,
        K: float,
        switching_gain: float,
        pairs: Sequence[Sequence[str]] | None = None,
        srdf: str | Path | None = None,
        margin: float = 0.0,
        length: float = 0.1,
    ) -> None:
        named = _by_name(bodies, self.kind)
        disabled = frozenset() if srdf is None else disabled_pairs(srdf)
        chosen = []
        if pairs is None:
            for a, b in combinations(bodies, 2):
                is_disabled = frozenset((a.name, b.name)) in disabled
                if abs(a.joint - b.joint) > 1 and not is_disabled:
                    chosen.append((b, a))
        else:
            if any(isinstance(pair, str) or len(pair) != 2 for pair in pairs):
                raise ConfigurationError(
                    f"pairs of {self.kind} must be pairs of names, not {pairs}"
                )
            for first, second in pairs:
                a = _named(named, first, self.kind)
                b = _named(named, second, self.kind)
                chosen.append((a, b))
        still = [f"{a.name} and {b.name}" for a, b in chosen if a.joint == b.joint]
        if still:
            raise ConfigurationError(
                f"{self.kind}: no joint moves {', '.join(still)} relative to each other"
            )
        if not chosen:
            raise ConfigurationError(
                f"{self.kind}: {robot.name} has no pair of bodies to keep apart"
            )
        super().__init__(
            robot, chosen, K=K, switching_gain=switching_gain, margin=margin, length=length
        )

    def pair_label(self, first: Body, second: Body) -> str:
        """Return a label such as ``self-collision[forearm_link, base_link]``."""
        return f"{self.kind}[{first.name}, {second.name}]"


def _by_name(bodies: Sequence[Body], kind: str) -> dict[str, Body]:
    """Return bodies by name; raise ConfigurationError if two have the same one."""
    named = {body.name: body for body in bodies}
    if len(named) < len(bodies):
        raise ConfigurationError(
            f"bodies of {kind} must have different names: {[body.name for body in bodies]}"
        )
    return named


def _named(bodies: dict[str, Body], name: str, kind: str) -> Body:
    """Return the body of that name; raise ConfigurationError, with candidates, if it is unknown."""
    if name not in bodies:
        raise unknown_name(f"body in {kind}", name, bodies)
    return bodies[name]
