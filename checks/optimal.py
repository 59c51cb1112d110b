"""Time-optimal control of a scene by CasADi and IPOPT, subject to all rows.

States are q and q̇; accelerations are constant in each of :data:`INTERVALS` equal intervals, whose
length is free. Rows are implemented here a second time, as symbols, from a setup's numbers; the
package shares nothing else, and its own rows judge the motion afterwards. Between its nodes, each
interval is checked only in its middle, so that rows have a margin. After the goal is reached, a
moving target is followed until the end of the run; otherwise the arm stands still.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from vsconstraints.constraints import (
    FieldOfView,
    ForbiddenHalfSpace,
    ForbiddenSphere,
    JointRange,
    JointSpeed,
    Occlusion,
)
from vsconstraints.robots.geometry import Pose
from vsconstraints.robots.robot import Robot
from vsconstraints.rows import Array
from vsconstraints.simulation import Setup
from vsconstraints.vision.features import CameraPose
from vsconstraints.vision.motion import Motion

#: Number of intervals until the goal is reached, and afterwards if the target moves.
INTERVALS = 40
FOLLOWING = 16
INSIDE = 0.95  #: Share of the goal's tolerances within which motions end.
#: Cost of the mean of (q̈/limit)², in seconds: selects the calmest of equally fast motions.
CALM = 1e-3
#: five times as fast, after 20 s of compilation
COMPILED = {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O1"]}}
DEPTH = 0.05  #: Smallest depth of a marker in front of the camera [m].
OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-5,
    "ipopt.constr_viol_tol": 1e-7,
    "ipopt.acceptable_tol": 1e-3,
    "ipopt.acceptable_constr_viol_tol": 1e-7,
    "ipopt.mu_init": 1e-2,
    "ipopt.max_iter": 300,
}


class NotCovered(Exception):
    """A scene has a part that is not implemented here."""


class Guess(NamedTuple):
    """Initial guess: times (S,) [s], q and q̇ (S, n), and time at which the goal is reached [s]."""

    t: Array
    q: Array
    qd: Array
    T: float

    def states(self, after: int, end: float) -> tuple[Array, Array, Array]:
        """Return q and q̇ at all nodes, and q̈ between them.

        ``after`` intervals follow the goal, until ``end``.
        """
        T = min(self.T, 0.8 * end) if after else self.T
        nodes = np.concatenate(
            (np.linspace(0.0, T, INTERVALS + 1), np.linspace(T, end, after + 1)[1:])
        )
        q, qd = (
            np.stack([np.interp(nodes, self.t, x) for x in of.T], axis=1)
            for of in (self.q, self.qd)
        )
        return q, qd, np.diff(qd, axis=0) / np.diff(nodes)[:, None]


class Plan(NamedTuple):
    """Accelerations (K, n), each held for an interval (K,) [s]."""

    intervals: Array
    qdd: Array


class Numbers:
    """Numbers of a scene as symbols, so that a program for one scene also serves similar ones."""

    def __init__(self) -> None:
        self.symbols: list[Any] = []
        self.values: list[Array] = []

    def __call__(self, value: Any) -> Any:
        """Return the symbol of a number, a vector or a matrix."""
        array = np.asarray(value, dtype=np.float64)
        symbol = ca.SX.sym(f"p{len(self.symbols)}", *(array.shape or (1,)))
        self.symbols.append(ca.vec(symbol))
        self.values.append(array.ravel(order="F"))
        return symbol

    def pose(self, pose: Pose) -> tuple[Any, Any]:
        """Return symbols of R and t."""
        return self(pose.R), self(pose.t)


def placements(robot: Robot, q: Any) -> list[tuple[Any, Any]]:
    """R and t of each joint's frame in the base frame, the base first.

    They are computed from the placements of the robot's model.
    """
    model = robot.model
    placed = [(ca.SX.eye(3), ca.SX.zeros(3))]
    for i in range(1, model.njoints):
        kind = re.fullmatch("JointModel([RP])([XYZ])", model.joints[i].shortname())
        if kind is None or model.parents[i] != i - 1:
            raise NotCovered(f"joint {model.joints[i].shortname()}")
        M = model.jointPlacements[i]
        R, t = placed[-1]
        R, t, axis = R @ M.rotation, t + R @ M.translation, "XYZ".index(kind[2])
        if kind[1] == "P":
            placed.append((R, t + R[:, axis] * q[i - 1]))
        else:
            c = ca.cos(q[i - 1])
            s = ca.sin(q[i - 1])
            turn = ca.SX.eye(3)
            j = (axis + 1) % 3
            k = (axis + 2) % 3
            turn[j, j] = c
            turn[j, k] = -s
            turn[k, j] = s
            turn[k, k] = c
            placed.append((R @ turn, t))
    return placed


def moved(motion: Motion | None, t: Any, number: Numbers) -> Any:
    """Displacement of a moving object at time t; 0 without motion."""
    if motion is None:
        return 0.0
    rate = number(motion.rate)
    phase = number(motion.phase)
    return number(motion.velocity) * t + number(motion.amplitude) * (
        ca.sin(rate * t + phase) - ca.sin(phase)
    )


class Written(NamedTuple):
    """Setup in symbols: rows in their natural units, and squared goal errors in tolerances.

    ``which`` are the rows' places among the setup's. ``rows`` and ``goal`` are functions of q, t
    and the ``numbers``. Setups with the same ``likeness`` differ only in their numbers.
    """

    likeness: str
    which: tuple[int, ...]
    rows: Any
    goal: Any
    numbers: Array


def written(setup: Setup) -> Written:
    """Return rows and goal of a setup with one goal, in symbols; raises NotCovered."""
    scene = setup.scene
    number = Numbers()
    camera = scene.camera
    robot = scene.robot
    if camera.distortion is not None or len(setup.task.goals) != 1:
        raise NotCovered("distortion or several goals")
    q = ca.SX.sym("q", robot.n)
    t = ca.SX.sym("t")
    placed = placements(robot, q)

    def at(frame: int) -> tuple[Any, Any]:
        of = robot.model.frames[frame]
        R, p = placed[robot.model.frames[frame].parentJoint]
        return R @ of.placement.rotation, p + R @ of.placement.translation

    tip_R, tip_t = at(robot.frame_id("tip"))
    if camera.fixed is not None:
        R, p = number.pose(camera.fixed)
        R = tip_R.T @ R
        p = tip_R.T @ (p - tip_t)
    else:
        R, p = number.pose(camera.mount.inverse)
        R = tip_R @ R
        p = tip_R @ p + tip_t
    if scene.motion is not None:
        if scene.motion.angular_velocity.any():
            raise NotCovered("a target that turns")
        p = p - moved(scene.motion.translation, t, number)
    seen = R.T @ (number(scene.markers.T) - p)
    focal = number(np.array(camera.focal))
    offset = number(camera.offset)
    pixels = [focal * seen[:2, i] / seen[2, i] + offset for i in range(len(scene.markers))]

    def apart(y: Any, radius: Any) -> Any:
        return (radius**2 - ca.sumsqr(y)) / (2.0 * radius)

    rows = []
    which = []
    like = [robot.name]
    first = 0
    for constraint, count, _ in setup.constraints.blocks():
        numbers = range(first, first + count)
        first = first + count
        if isinstance(constraint, JointRange | JointSpeed):
            continue
        like.append(f"{count} {constraint.kind} {getattr(constraint, 'n', '')} {numbers.start}")
        which += numbers
        away = moved(getattr(constraint, "motion", None), t, number)
        markers = [i - 1 for i in getattr(constraint, "markers", None) or range(1, len(pixels) + 1)]
        if type(constraint) is FieldOfView:
            half = number(constraint.half_size)
            n = constraint.n
            size = number(constraint.half_size.min())
            for i in markers:
                x = ca.fabs(pixels[i] - away) / half
                rows.append(size * ((x[0] ** n + x[1] ** n + 1e-12) ** (1.0 / n) - 1.0))
        elif isinstance(constraint, Occlusion) and constraint.curve.shape.name == "circle":
            radius = number(constraint.curve.shape.radius * np.sqrt(1.0 + constraint.margin))
            centre = number(constraint.curve.centre)
            rows += [apart(pixels[i] - centre - away, radius) for i in markers]
        elif isinstance(constraint, ForbiddenSphere | ForbiddenHalfSpace):
            region_R, centre = number.pose(constraint.pose)
            size = number(getattr(constraint, "radius", 0.0) + constraint.margin)
            for point in constraint.points:
                frame_R, frame_t = at(robot.frame_id(point.link))
                y = frame_t + frame_R @ number(np.array(point.offset)) - centre - away
                flat = isinstance(constraint, ForbiddenHalfSpace)
                rows.append(size - ca.dot(region_R[:, 2], y) if flat else apart(y, size))
        else:
            raise NotCovered(constraint.kind)
    rows += [number(DEPTH) - seen[2, i] for i in range(len(pixels))]

    goal = setup.task.goals[0]
    tolerance = setup.goal_tolerances[0]
    if isinstance(setup.task.feature, CameraPose):
        goal_R, goal_t = number.pose(goal.camera)
        E = goal_R.T @ R
        turn = 0.5 * ca.vertcat(E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1])
        left = [
            ca.sumsqr((p - goal_t) / number(tolerance[0])),
            ca.sumsqr(turn / number(tolerance[1])),
        ]
        left.append(2.0 - ca.trace(E))  # excludes a rotation error of half a turn
    else:
        wanted = number(goal.pixels.T)
        left = [
            ca.sumsqr((uv - wanted[:, i]) / number(tolerance[2])) for i, uv in enumerate(pixels)
        ]
    arguments = [q, t, ca.vertcat(*number.symbols)]
    functions = [
        ca.Function(name, arguments, [ca.vertcat(*of)])
        for name, of in (("rows", rows), ("goal", left))
    ]
    like += [f"{len(pixels)} {len(left)} {arguments[2].numel()} {scene.motion is not None}"]
    return Written("; ".join(like), tuple(which), *functions, np.concatenate(number.values))


def boxes(setup: Setup, margin: Array) -> Array:
    """Bounds (4, n) on q and q̇ by the rows of joints, less a margin (m,)."""
    box = np.tile([[-np.inf], [np.inf]] * 2, setup.scene.robot.n)
    first = 0
    for constraint, count, _ in setup.constraints.blocks():
        less = margin[first : first + count]
        first = first + count
        if isinstance(constraint, JointRange | JointSpeed):
            at, upper, lower = np.array(constraint.joints) - 1, *np.split(less, 2)
            pair = box[:2] if isinstance(constraint, JointRange) else box[2:]
            mid = (
                0.5 * (constraint.lower + constraint.upper)
                if isinstance(constraint, JointRange)
                else 0.0
            )
            share = 1.0 - constraint.margin
            pair[0, at] = np.maximum(pair[0, at], mid + share * (constraint.lower - mid) + lower)
            pair[1, at] = np.minimum(pair[1, at], mid + share * (constraint.upper - mid) - upper)
    return box


class Program:
    """Optimal control program of similar scenes, such as those of a family."""

    def __init__(
        self, scene: Written, n: int, follows: bool, seconds: float, compiled: bool
    ) -> None:
        N = INTERVALS
        K = INTERVALS + (FOLLOWING if follows else 0)
        self.n = n
        self.K = K
        self.follows = follows
        T = ca.MX.sym("T")
        Q = ca.MX.sym("q", n, K + 1)
        V = ca.MX.sym("v", n, K + 1)
        A = ca.MX.sym("a", n, K)
        p = ca.MX.sym("p", len(scene.numbers))
        limit = ca.MX.sym("limit", n)
        end = ca.MX.sym("end")
        h = ca.repmat(T / N, 1, N)
        if follows:
            h = ca.horzcat(h, ca.repmat((end - T) / FOLLOWING, 1, FOLLOWING))
        H = ca.repmat(h, n, 1)
        dynamics = ca.horzcat(
            Q[:, 1:] - Q[:, :-1] - H * V[:, :-1] - 0.5 * H**2 * A, V[:, 1:] - V[:, :-1] - H * A
        )
        begins = ca.horzcat(0.0, ca.cumsum(h, 1))
        middles = Q[:, :-1] + 0.5 * H * V[:, :-1] + 0.125 * H**2 * A
        at = ca.horzcat(Q[:, 1:], middles)
        t = ca.horzcat(begins[1:], begins[:-1] + 0.5 * h)
        rows = scene.rows.map("rows", "serial", 2 * K, [2], [])(at, t, p)
        there = [N - 1, *range(N, K), *range(K + N, 2 * K)]
        goal = scene.goal.map("goal", "serial", len(there), [2], [])(at[:, there], t[there], p)
        cost = T + CALM * ca.sumsqr(A / ca.repmat(limit, 1, K)) / (n * K)
        self.rows = rows.numel()
        self.goal = goal.numel()
        self._solve = ca.nlpsol(
            "plan",
            "ipopt",
            {
                "x": ca.veccat(T, Q, V, A),
                "p": ca.vertcat(p, limit, end),
                "f": cost,
                "g": ca.veccat(dynamics, rows, goal),
            },
            {
                **OPTIONS,
                "ipopt.max_wall_time": seconds,
                **(COMPILED if compiled else {"expand": not follows}),
            },
        )

    def __call__(
        self, setup: Setup, scene: Written, limit: Array, margin: Array, guess: Guess
    ) -> Plan | None:
        """Return a motion from the setup's start; None if IPOPT reports failure.

        ``limit`` (n,) bounds |q̈|; ``margin`` (m,) is that of each of the setup's rows, in its
        natural unit.
        """
        n = self.n
        K = self.K
        N = INTERVALS
        end = (setup.samples - 1) * setup.Ts
        low_q, high_q, low_v, high_v = boxes(setup, margin)
        start = [setup.q0, setup.qd0]
        Q, V, A = guess.states(K - N, end)
        bounds = []
        for box_q, box_v, side in ((low_q, low_v, -1.0), (high_q, high_v, 1.0)):
            q = np.tile(box_q, (K + 1, 1))
            v = np.tile(box_v, (K + 1, 1))
            q[0], v[0] = start
            if not self.follows:
                v[-1] = 0.0
            time = (
                0.05
                if side < 0.0
                else (end - setup.tolerances.dwell_s if self.follows else 4.0 * guess.T + 2.0)
            )
            bounds.append(np.concatenate(([time], q.ravel(), v.ravel(), np.tile(side * limit, K))))
        above = np.tile(
            np.append(-margin[list(scene.which)], np.zeros(len(setup.scene.markers))), 2 * K
        )
        found = self._solve(
            x0=np.concatenate(([guess.T], Q.ravel(), V.ravel(), A.ravel())),
            p=np.concatenate((scene.numbers, limit, [end])),
            lbx=bounds[0],
            ubx=bounds[1],
            lbg=np.concatenate((np.zeros(2 * n * K), np.full(self.rows + self.goal, -np.inf))),
            ubg=np.concatenate((np.zeros(2 * n * K), above, np.full(self.goal, INSIDE**2))),
        )
        if not self._solve.stats()["success"]:
            return None
        x = np.asarray(found["x"]).ravel()
        T = x[0]
        h = np.concatenate((np.full(N, T / N), np.full(K - N, (end - T) / FOLLOWING)))
        return Plan(h, x[-n * K :].reshape(K, n))
