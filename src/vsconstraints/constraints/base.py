"""What a constraint is, and how its value and gradient become rows.

A constraint gives σ ≤ 0 and ∂σ/∂y in the coordinates y it is about: marker pixels, robot points or
joints. The chain rule to joint space is in :mod:`vsconstraints.compiled.constraint_rows`, and here
for own constraints in NumPy:

    φ = σ + K σ̇,  σ̇ = g·ẏ,  L_gφ = K g J,  L_fφ = g·ẏ + K (g·J̇q̇ + ẏᵀ H ẏ),   g = ∂σ/∂y, H =
    ∂²σ/∂y²
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from numbers import Integral, Real
from typing import ClassVar, NamedTuple, Self

import numpy as np

from ..errors import ConfigurationError, InvalidInput, shown
from ..robots.kinematics import RobotPoint
from ..rows import Array, IntArray
from ..rows.readable import amount, enumerated, in_one_line
from ..vision.motion import Motion
from ..vision.scene import PointMotion, Scene, State
from .by_formula import ByFormula, Form, curvature_by_differences, demand_own_curvature
from .meshes import Mesh

#: Methods that follow from a formula; a class that gives one of them may compute anything.
FOLLOWING = ("sigma", "gradient", "curvature", "rows", "relative", "chain_rule")


class RowBlock(NamedTuple):
    """The rows of one constraint: σ, φ and L_fφ (r,), L_gφ (r, n)."""

    sigma: Array
    phi: Array
    Lg: Array
    Lf: Array


@dataclass(frozen=True, slots=True)
class Trace:
    """Coordinates at T samples, for scoring.

    Times t (T,) [s], q and q̇ (T, n), markers (T, m, 2) from the image's centre [px], the scene's
    robot points (T, k, 3) in the base frame [m], (W, H) of the image [px], and the scene, None if
    nothing is asked that needs it.
    """

    t: Array
    q: Array
    qd: Array
    pixels: Array
    points: Array
    image_size: tuple[float, float]
    scene: Scene | None = None


class Constraint(ABC):
    """A constraint with one or more rows."""

    kind: ClassVar[str]  #: First part of the labels, for example ``"fov"``.
    unit: ClassVar[str]  #: Natural unit of its clearance.
    scale: float = 1.0  #: Size of the allowed range in units of φ: 1 for normalised constraints.
    points: Sequence[RobotPoint] = ()  #: Robot points whose motion the rows need.
    length: float  #: Of all rows, where :meth:`characteristic_length` says nothing else.

    def __init__(self, *, K: float, switching_gain: float) -> None:
        for name, value in (("K", K), ("switching_gain", switching_gain)):
            demand_positive(value, f"{name} of {self.kind}")
        self.K = float(K)
        self.switching_gain = float(switching_gain)

    @in_one_line
    def __repr__(self) -> str:
        said = vars(self)
        facts = [
            f"{what} {enumerated(said[what], 8)}"
            for what in ("markers", "joints")
            if said.get(what)
        ]
        facts += [f"K = {amount(self.K)} s", f"u⁺ = {amount(self.switching_gain)} per s"]
        facts += [f"L = {amount(said['length'])} {self.unit}"] if "length" in said else []
        facts += ["moving"] if said.get("motion") is not None else []
        name = said.get("name")
        return (
            f"<{type(self).__name__} {self.kind}{f' {name}' if name else ''}: {', '.join(facts)}>"
        )

    @abstractmethod
    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Names of the rows, in their order."""

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Natural unit of each row's clearance; :attr:`unit` for all unless rows differ."""
        return (self.unit,) * len(self.labels(scene))

    def rows(self, state: State, points: slice) -> RowBlock:
        """The rows now, where there is no compiled form; ``points``: where its robot points stand
        among the scene's.
        """
        raise NotImplementedError(f"{self.kind} needs rows, or a compiled form")

    def scaled(self, K: float, switching_gain: float) -> Self:
        """The same with these factors on K and u⁺."""
        other = copy(self)
        other.K = self.K * K
        other.switching_gain = self.switching_gain * switching_gain
        return other

    @abstractmethod
    def clearance(self, trace: Trace, points: slice) -> Array:
        """(T, r) signed distance to each row's boundary in the natural unit; positive where
        allowed.
        """

    def characteristic_length(self, scene: Scene) -> Array:
        """(r,) L by which usage is 1 − clearance/L: half an allowed range, an obstacle's radius;
        ``length`` for all.
        """
        return np.full(len(self.labels(scene)), self.length)

    def refusal(self, sigma: Array, labels: tuple[str, ...]) -> str:
        """Why a run cannot start with σ (r,) of rows of these labels; empty if it can, as outside
        most constraints.
        """
        return ""

    def compiled_form(self, scene: Scene, points: slice) -> Form | None:
        """What the compiled step needs to make the rows itself; None if :meth:`rows` makes them in
        NumPy.
        """
        return None

    def meshes(self, t: float, reach: float = np.inf) -> list[Mesh]:
        """What it forbids at ``t`` [s], in the base frame; of what is unbounded a part of half side
        ``reach`` [m].
        """
        return []

    def says(self, word: str, methods: Sequence[str]) -> bool:
        """Whether an attribute speaks for all of these methods: no class that gives one derives
        from who says it.
        """
        for c in type(self).__mro__:
            if word in vars(c):
                return True
            if any(method in vars(c) for method in methods):
                break
        return False

    def sampling_band(self, scene: Scene, Ts: float) -> Array:
        """(r,) how far outside sampling with ``Ts`` [s] puts each row, in its natural unit;
        nothing, to first order.
        """
        return np.zeros(len(self.labels(scene)))

    def block(self, sigma: Array, sigma_dot: Array, gradient: Array, drift: Array) -> RowBlock:
        """Rows from σ, σ̇, ∂σ/∂q (r, n), and σ̈ when q̈ = 0 (eqs. 17 to 19)."""
        return RowBlock(
            sigma, sigma + self.K * sigma_dot, self.K * gradient, sigma_dot + self.K * drift
        )


class PositionConstraint(ByFormula, Constraint):
    """σ as a function of coordinates y: what own constraints derive from, through a subclass.

    A formula says all about it, for arrays and for the compiled step: see :class:`.ByFormula`. A
    subclass that gives :meth:`sigma` and :meth:`gradient` instead may compute anything; its rows
    are made in NumPy.
    """

    margin: float = 0.0  #: σ is the formula's value plus this.
    motion: Motion | None = None  #: How what it forbids moves; None if it stands still.

    def __init__(self, *, K: float, switching_gain: float) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        if self.formula is None and type(self).sigma is PositionConstraint.sigma:
            raise ConfigurationError(f"{self.kind} needs a formula, or sigma and gradient")
        if self.formula is None and type(self).gradient is ByFormula.gradient:
            raise ConfigurationError(
                f"{type(self).__name__} ({self.kind}) gives sigma, but no gradient: give ∂σ/∂y as "
                f"gradient too, or "
                "both by a formula"
            )
        demand_own_curvature(type(self))

    def formula_form(self, rows: str, which: Sequence[int] | IntArray) -> Form | None:
        """The compiled form of rows of that kind for these markers or points, if the formula says
        all.
        """
        if self.formula is None or not self.says("formula", FOLLOWING):
            return None
        formulas = self.formula, self.curvature_formula
        return Form(rows, formulas, self.parameters, which, self.frame, self.margin, self.motion)

    def moving(self, motion: Motion) -> Self:
        """The same constraint, with what it forbids displaced by d(t): σ(y − d(t)).

        φ = σ + K σ̇ and L_fφ then contain ∂σ/∂t = −g·ḋ and what follows from it, if the motion is
        known; otherwise only σ knows where the thing is. Raises InvalidInput if the motion has not
        as many coordinates as y.
        """
        if motion.size != self.coordinates:
            raise InvalidInput(
                f"{self.kind} moves by {self.coordinates} coordinates, not {motion.size}"
            )
        self.motion = motion
        return self

    def relative(self, motion: PointMotion, state: State) -> PointMotion:
        """Motion of coordinates y (r, d) relative to what is forbidden, as far as a controller
        knows it.
        """
        if self.motion is None:
            return motion
        position = motion.position - self.motion.displacement(state.t)
        if state.believed and not self.motion.known:
            return PointMotion(position, motion.J, motion.velocity, motion.drift)
        velocity, acceleration = self.motion.rates(state.t)
        return PointMotion(
            position, motion.J, motion.velocity - velocity, motion.drift - acceleration
        )

    def displaced(self, y: Array, t: Array) -> Array:
        """Coordinates y (T, r, d) at times t (T,), relative to what is forbidden."""
        return y if self.motion is None else y - self.motion.displacement(t)[:, None, :]

    def sigma(self, y: Array) -> Array:
        """(...) σ at coordinates y (..., d): positive where forbidden."""
        return self.value(y) + self.margin

    def curvature(self, y: Array, velocity: Array) -> Array:
        """(...) ẏᵀ H ẏ; by central differences of the gradient along the velocity unless something
        better is known.
        """
        if self.formula is not None and self.says("formula", ("gradient",)):
            return super().curvature(y, velocity)
        return curvature_by_differences(self.gradient, y, velocity)

    def chain_rule(self, motion: PointMotion) -> RowBlock:
        """Rows from the motion of the coordinates y (r, d) relative to what is forbidden."""
        y = motion.position
        gradient = self.gradient(motion.position)
        along = (gradient[:, None, :] @ motion.J)[:, 0, :]
        drift = (gradient * motion.drift).sum(axis=1) + self.curvature(y, motion.velocity)
        return self.block(self.sigma(y), (gradient * motion.velocity).sum(axis=1), along, drift)


def to_first_order(value: Array, gradient: Array) -> Array:
    """(...) clearance −σ / ‖∂σ/∂y‖ where σ is 0 at the boundary: exact where σ is linear or a
    signed distance.
    """
    clearance: Array = -value / np.sqrt((gradient * gradient).sum(axis=-1))
    return clearance


def demand_margin(margin: float, kind: str) -> float:
    """The margin; raises ConfigurationError that names ``kind`` unless it is zero or more
    metres.
    """
    if not (np.isfinite(margin) and margin >= 0.0):
        raise ConfigurationError(f"margin of {kind} must be zero or more metres, not {margin}")
    return float(margin)


def demand_positive(value: object, what: str) -> float:
    """The value as a float; raises InvalidInput unless it is a positive finite number."""
    if not (isinstance(value, Real) and 0.0 < float(value) < np.inf):
        raise InvalidInput(f"{what} must be a positive number, not {shown(value)}")
    return float(value)


def demand_numbers(numbers: Sequence[int], what: str) -> tuple[int, ...]:
    """The numbers, if they count from 1 without repetition; else raises ConfigurationError that
    names ``what``.
    """
    given: list[object] = list(numbers)
    counted = [int(i) for i in given if isinstance(i, Integral) and int(i) >= 1]
    if not given or len(set(counted)) < len(given):
        raise ConfigurationError(f"{what} are counted from 1, without repetition, not {given}")
    return tuple(counted)
