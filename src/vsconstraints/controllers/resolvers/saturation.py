"""Saturation in the null space: rows that would exceed their demands are held at them, one after another.

It works on matrices of the rows that are held, decomposed by LAPACK; :mod:`vsconstraints.compiled.saturation` works on
arrays that are there beforehand. ``test_both_forms_agree_to_nine_digits`` in ``tests/test_resolvers.py`` holds the pair
together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from ...errors import ConfigurationError, shown
from ...formulas.row import BOUND
from ...qp import SolverChain
from ...qp.lexicographic import MET, STRICT, ZERO_GRADIENT
from ...rows import Array, Command, IntArray, Rows, Task
from ..least_norm import least_norm, track
from ..task_priority import resolve
from .base import Asked
from .hierarchy import Hierarchy


class Bounds(NamedTuple):
    """W q̈ ≤ sides, rows of W (w, n) of unit norm, (w,)."""

    W: Array
    sides: Array


class Saturated(NamedTuple):
    """Accelerations (n,) within all bounds, and the bounds that are saturated, by their numbers."""

    qdd: Array
    held: list[int]


@dataclass(frozen=True, kw_only=True)
class Saturation(Hierarchy):
    """Saturation in the null space (SNS), at the level of accelerations, with rows beside joints.

    Whatever would exceed its bound is saturated: held at it, L_gφ q̈ = c, or q̈ⱼ at the side of the box. The task has the
    null space that is left. With the saturated rows A

        q̈(s) = A†c + (J(I − A†A))† (s b − J A†c).

    At first there are none, and s = 1. As long as a bound is exceeded, the most critical one is saturated too: that
    which allows the least s. If that depends on those that are, the task is scaled as little as necessary: of all sets
    on the way, the one that allows the largest s in [0, 1] is taken. Where demands ask for braking, it can be that none
    allows any s: then the command is that of :class:`Hierarchy`, with its statuses.

    So the task keeps its direction, J q̈ = s b, wherever q̈ = 0 meets all demands: scaling is part of the algorithm. An
    arm without redundancy, n = k, has no null space and is slowed down as a whole: where no demand asks for braking,
    this is then :class:`Scaling`.

    With ``scales=False``, which is not SNS but a variant of it, a task that the null space is too small for is met in
    the least-squares sense instead, and loses its direction. It is then never scaled as long as q̈ = 0 meets all
    demands: each row is saturated at the s up to which it allowed the task, and what is within all bounds there still
    is.

    Nothing that is saturated is let go again. Where that would be better, the task is met less well than by
    :class:`Hierarchy`; where it pulls against all that is saturated, as against one row, they are the same.

    Reference: Flacco, De Luca, Khatib, "Control of redundant robots under hard joint constraints: saturation in the
    null space", IEEE Transactions on Robotics 31(3), 2015; at the level of accelerations also ICRA 2012.

    Parameters
    ----------
    scales
        Whether a task that cannot be met whole any more is scaled, as published.
    rank_tolerance
        Singular values below this fraction of the largest one count as zero, of J and of the saturated rows.
    solver, weights, max_acceleration, damping
        See :class:`vsconstraints.controllers.HierarchicalQP`; all but the box concern the hierarchy alone.
    """

    scales: bool = True

    name = "saturation"
    kernel: ClassVar[tuple[str, str]] = ("saturation", "saturation")
    otherwise: ClassVar[tuple[str, str] | None] = Hierarchy.kernel

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.scales, bool):
            raise ConfigurationError(f"scales must be true or false, not {shown(self.scales)}")

    @property
    def options(self) -> Array:
        """See :class:`.Resolver`."""
        return np.append(super().options, float(self.scales))

    def solve(self, rows: Rows, task: Task, asked: Asked, tracks: bool, solvers: SolverChain | None) -> Command:
        """See :class:`.Resolver`."""
        c = asked(BOUND, track(task, self.rank_tolerance) if tracks else None)
        which, bounds = self._bounds(rows, c)
        found = saturate(bounds, task, self.rank_tolerance, self.scales)
        if found is None:
            return super().solve(rows, task, lambda purpose, tracking: c, tracks, solvers)
        acted = np.zeros(len(rows.labels), dtype=np.bool_)
        acted[[which[i] for i in found.held if i < which.size]] = True
        return Command(found.qdd, "ok", acted, rows.labels, slack=np.zeros(acted.size))

    def _bounds(self, rows: Rows, c: Array) -> tuple[IntArray, Bounds]:
        """The rows that ask for something, and their bounds, with those of the box behind them.

        One that no acceleration influences becomes zero: it is none, or depends on any others.
        """
        norms = np.linalg.norm(rows.Lg, axis=1)
        influenced = norms > ZERO_GRADIENT * rows.scale
        which = np.flatnonzero((c < np.inf) & (influenced | (c < 0.0)))
        norms = np.where(influenced, norms, np.inf)[which]
        W, sides = rows.Lg[which] / norms[:, None], c[which] / np.where(norms < np.inf, norms, 1.0)
        lower, upper = self.box(rows, W.shape[1])
        one, ends = np.eye(W.shape[1]), np.concatenate((upper, -lower))
        bounded = np.isfinite(ends)
        return which, Bounds(np.vstack((W, np.vstack((one, -one))[bounded])), np.concatenate((sides, ends[bounded])))


def saturate(bounds: Bounds, task: Task, rank_tolerance: float, scales: bool) -> Saturated | None:
    """Accelerations within the bounds, by saturating; None if there is no share of the task that any set allows."""
    W, sides = bounds
    held: list[int] = []
    best, largest = None, -1.0
    tracking = whole = track(task, rank_tolerance)
    none: Array = np.zeros(whole.size)
    if len(task.rest):
        none = least_norm(task.J, np.zeros_like(task.b), rank_tolerance, task.rest).qdd
    while True:
        free = np.ones(sides.size, dtype=np.bool_)
        free[held] = False
        at_one, at_zero = (np.where(free, room(W, sides, qdd), np.inf) for qdd in (whole, none))
        if (at_one >= 0.0).all():
            return Saturated(whole, held)
        # the room is linear in s: up to where it lasts, and from where it begins
        with np.errstate(divide="ignore", invalid="ignore"):
            gained = at_zero - at_one
            crossing = at_zero / gained
        exceeded = at_one < 0.0
        lasting = np.where(exceeded, np.where(gained > 0.0, crossing, -np.inf), 1.0)
        most = lasting.min()
        least = np.where(~exceeded & (at_zero < 0.0), crossing, 0.0).max()
        if max(least, largest) <= most and most > largest:
            best, largest = Saturated(none + most * (whole - none), list(held)), most
        held.append(int(np.argmin(lasting)))
        A, b = W[held], sides[held]
        whole, dependent = resolve(A, b, task.J, task.b, rank_tolerance, task.rest)
        if dependent.shape[1] or (scales and missed(task.J, whole - tracking)):
            return best
        none, _ = resolve(A, b, task.J, np.zeros_like(task.b), rank_tolerance, task.rest)


def missed(J: Array, way: Array) -> bool:
    """Whether J has more than rounding of this way from the command that tracks."""
    return bool(np.linalg.norm(J @ way) > STRICT * np.linalg.norm(J) * np.linalg.norm(way))


def room(W: Array, sides: Array, qdd: Array) -> Array:
    """Sides − W q̈ (w,), 0 within rounding of its terms."""
    left = sides - W @ qdd
    return np.where(np.abs(left) <= MET * (np.linalg.norm(qdd) + np.abs(sides)), 0.0, left)
