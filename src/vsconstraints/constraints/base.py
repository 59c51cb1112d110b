"""Base classes of constraints, and the construction of rows from values and gradients.

A constraint gives σ ≤ 0 and ∂σ/∂y in its coordinates y: marker pixels, robot points or joints. The
chain rule to joint space is in :mod:`vsconstraints.compiled.constraint_rows`; for custom
constraints in NumPy it is here:

    φ = σ + K σ̇,  σ̇ = g·ẏ,  L_gφ = K g J,  L_fφ = g·ẏ + K (g·J̇q̇ + ẏᵀ H ẏ)

with g = ∂σ/∂y and H = ∂²σ/∂y².
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from numbers import Integral, Real
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np

from ..errors import ConfigurationError, InvalidInput, format_value
from ..robots.kinematics import RobotPoint
from ..rows import Array, IntArray
from ..rows.readable import amount, enumerated, in_one_line
from ..vision.motion import Motion
from ..vision.scene import PointMotion, Scene, State
from .by_formula import ByFormula, CompiledRowSpec, curvature_by_differences, require_own_curvature
from .meshes import Mesh

if TYPE_CHECKING:
    from ..compiled.constraint_rows import RowTemplate

#: Methods that follow from a formula; a class that overrides one of them may compute anything.
FOLLOWING = ("sigma", "gradient", "curvature", "rows", "relative", "chain_rule")


class RowBlock(NamedTuple):
    """Rows of one constraint: σ, φ and L_fφ (r,), L_gφ (r, n)."""

    sigma: Array
    phi: Array
    Lg: Array
    Lf: Array


@dataclass(frozen=True, slots=True)
class Trace:
    """Coordinates at T samples, for scoring.

    The fields are times t (T,) [s], q and q̇ (T, n), markers (T, m, 2) from the image's centre
    [px], robot points of the scene (T, k, 3) in the base frame [m], image size (W, H) [px], and the
    scene. The scene is None if no clearance needs it.
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
    #: Characteristic length of all rows, unless :meth:`characteristic_length` is overridden.
    length: float

    def __init__(self, *, K: float, switching_gain: float) -> None:
        for name, value in (("K", K), ("switching_gain", switching_gain)):
            require_positive(value, f"{name} of {self.kind}")
        self.K = float(K)
        self.switching_gain = float(switching_gain)

    @in_one_line
    def __repr__(self) -> str:
        attributes = vars(self)
        facts = []
        for which in ("markers", "joints"):
            numbers = attributes.get(which)
            if numbers:
                facts.append(f"{which} {enumerated(numbers, 8)}")
        facts.append(f"K = {amount(self.K)} s")
        facts.append(f"u⁺ = {amount(self.switching_gain)} per s")
        if "length" in attributes:
            facts.append(f"L = {amount(attributes['length'])} {self.unit}")
        if attributes.get("motion") is not None:
            facts.append("moving")
        title = f"{type(self).__name__} {self.kind}"
        if attributes.get("name"):
            title += f" {attributes['name']}"
        return f"<{title}: {', '.join(facts)}>"

    @abstractmethod
    def labels(self, scene: Scene) -> tuple[str, ...]:
        """Return the labels of the rows, in their order."""

    def units(self, scene: Scene) -> tuple[str, ...]:
        """Return the natural unit of each row's clearance: :attr:`unit`, unless rows differ."""
        return (self.unit,) * len(self.labels(scene))

    def rows(self, state: State, points: slice) -> RowBlock:
        """Return the current rows of a constraint without compiled form.

        ``points`` is the range of the constraint's robot points among those of the scene.
        """
        raise NotImplementedError(f"{self.kind} needs rows, or a compiled form")

    def scaled(self, K: float, switching_gain: float) -> Self:
        """Return a copy with these factors on K and u⁺."""
        other = copy(self)
        other.K = self.K * K
        other.switching_gain = self.switching_gain * switching_gain
        return other

    @abstractmethod
    def clearance(self, trace: Trace, points: slice) -> Array:
        """Return the clearance (T, r): the signed distance to each row's boundary.

        It is given in the natural unit and positive where the row is satisfied.
        """

    def characteristic_length(self, scene: Scene) -> Array:
        """Return the characteristic length L (r,) of each row, by which usage is 1 − clearance/L.

        It is half of an allowed range, or the radius of an obstacle; by default ``length`` for all
        rows.
        """
        return np.full(len(self.labels(scene)), self.length)

    def refusal(self, sigma: Array, labels: tuple[str, ...]) -> str:
        """Return the reason why a run cannot start with σ (r,) of rows with these labels.

        It is empty if the run can start, which most constraints permit even if they are violated.
        """
        return ""

    def compiled_form(self, scene: Scene, points: slice) -> CompiledRowSpec | None:
        """Return the description from which the compiled step computes the rows.

        It is None if :meth:`rows` computes them in NumPy.
        """
        return None

    def meshes(self, t: float, reach: float = np.inf) -> list[Mesh]:
        """Return meshes of the forbidden region at ``t`` [s], in the base frame.

        For an unbounded region it is a part with half side ``reach`` [m].
        """
        return []

    def declares(self, word: str, methods: Sequence[str]) -> bool:
        """True if no class overrides these methods below the class that sets ``word``.

        Such an attribute describes all of these methods.
        """
        for parent in type(self).__mro__:
            if word in vars(parent):
                return True
            if any(method in vars(parent) for method in methods):
                return False
        return False

    def sampling_band(self, scene: Scene, Ts: float) -> Array:
        """Return the violation depth (r,) caused by sampling with ``Ts`` [s], in each row's unit.

        It is zero to first order, unless a subclass overrides it.
        """
        return np.zeros(len(self.labels(scene)))

    def block(self, sigma: Array, sigma_dot: Array, gradient: Array, drift: Array) -> RowBlock:
        """Return rows from σ, σ̇, ∂σ/∂q (r, n), and σ̈ for q̈ = 0 (eqs. 17 to 19)."""
        phi = sigma + self.K * sigma_dot
        Lg = self.K * gradient
        Lf = sigma_dot + self.K * drift
        return RowBlock(sigma, phi, Lg, Lf)


class PositionConstraint(ByFormula, Constraint):
    """Base class of constraints with σ as a function of coordinates y.

    Custom constraints derive from it through a subclass. A formula defines everything, for arrays
    and for the compiled step: see :class:`.ByFormula`. A subclass that defines :meth:`sigma` and
    :meth:`gradient` instead may compute anything; its rows are computed in NumPy.
    """

    margin: float = 0.0  #: σ is the formula's value plus this.
    motion: Motion | None = None  #: Motion of the forbidden region; None if it stands still.

    def __init__(self, *, K: float, switching_gain: float) -> None:
        super().__init__(K=K, switching_gain=switching_gain)
        if self.formula is None and type(self).sigma is PositionConstraint.sigma:
            raise ConfigurationError(f"{self.kind} needs a formula, or sigma and gradient")
        if self.formula is None and type(self).gradient is ByFormula.gradient:
            raise ConfigurationError(
                f"{type(self).__name__} ({self.kind}) gives sigma, but no gradient: give ∂σ/∂y as "
                "gradient too, or both by a formula"
            )
        require_own_curvature(type(self))

    def formula_form(
        self, template: RowTemplate, which: Sequence[int] | IntArray
    ) -> CompiledRowSpec | None:
        """Return the compiled form of the rows of these markers or points by a template.

        It is None unless the formula defines everything.
        """
        if self.formula is None or not self.declares("formula", FOLLOWING):
            return None
        formulas = self.formula, self.curvature_formula
        return CompiledRowSpec(
            template, formulas, self.parameters, which, self.frame, self.margin, self.motion
        )

    def moving(self, motion: Motion) -> Self:
        """Return this constraint after displacing the forbidden region by d(t): σ(y − d(t)).

        φ = σ + K σ̇ and L_fφ then contain ∂σ/∂t = −g·ḋ and its consequences if the motion is known.
        Otherwise only σ depends on the current position of the region. Raises InvalidInput if the
        motion does not have as many coordinates as y.
        """
        if motion.size != self.coordinates:
            raise InvalidInput(
                f"{self.kind} moves by {self.coordinates} coordinates, not {motion.size}"
            )
        self.motion = motion
        return self

    def relative(self, motion: PointMotion, state: State) -> PointMotion:
        """Return the motion of coordinates y (r, d) relative to the forbidden region.

        It contains the region's motion as far as the controller knows it.
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
        """Return coordinates y (T, r, d) at times t (T,), relative to the forbidden region."""
        if self.motion is None:
            return y
        return y - self.motion.displacement(t)[:, None, :]

    def sigma(self, y: Array) -> Array:
        """Return σ (...) at coordinates y (..., d): positive where forbidden."""
        return self.value(y) + self.margin

    def curvature(self, y: Array, velocity: Array) -> Array:
        """Return ẏᵀ H ẏ (...).

        By default it is computed by central differences of the gradient along the velocity, unless
        a formula gives the gradient.
        """
        if self.formula is not None and self.declares("formula", ("gradient",)):
            return super().curvature(y, velocity)
        return curvature_by_differences(self.gradient, y, velocity)

    def chain_rule(self, motion: PointMotion) -> RowBlock:
        """Return rows from the motion of coordinates y (r, d) relative to the forbidden region."""
        y = motion.position
        gradient = self.gradient(y)
        as_rows = gradient[:, None, :]
        gradient_q = (as_rows @ motion.J)[:, 0, :]
        sigma_dot = (gradient * motion.velocity).sum(axis=1)
        by_drift = (gradient * motion.drift).sum(axis=1)
        drift = by_drift + self.curvature(y, motion.velocity)
        return self.block(self.sigma(y), sigma_dot, gradient_q, drift)


def to_first_order(value: Array, gradient: Array) -> Array:
    """Return the clearance −σ / ‖∂σ/∂y‖ (...), for a σ that is 0 at the boundary.

    It is exact where σ is linear or a signed distance, and of first order elsewhere.
    """
    slope = np.linalg.norm(gradient, axis=-1)
    clearance: Array = -value / slope
    return clearance


def require_margin(margin: float, kind: str) -> float:
    """Return the margin; raise ConfigurationError unless it is zero or more metres.

    The message names ``kind``.
    """
    if not (np.isfinite(margin) and margin >= 0.0):
        raise ConfigurationError(f"margin of {kind} must be zero or more metres, not {margin}")
    return float(margin)


def require_positive(value: object, what: str) -> float:
    """Return the value as a float; raise InvalidInput unless it is a positive finite number."""
    if not (isinstance(value, Real) and 0.0 < float(value) < np.inf):
        raise InvalidInput(f"{what} must be a positive number, not {format_value(value)}")
    return float(value)


def require_numbers(numbers: Sequence[int], what: str) -> tuple[int, ...]:
    """Return the numbers; raise ConfigurationError unless they count from 1 without repetition.

    The message names ``what``.
    """
    given: list[object] = list(numbers)
    valid = [int(i) for i in given if isinstance(i, Integral) and int(i) >= 1]
    if not given or len(set(valid)) < len(given):
        raise ConfigurationError(f"{what} are counted from 1, without repetition, not {given}")
    return tuple(valid)
