"""Interface between a scene and a controller: rows, a task, and the command that answers them.

Every constraint, whatever its kind, becomes rows φ ≤ 0 with φ̇ = L_fφ + L_gφ q̈ (eqs. 9, 17 and
18). Every visual task becomes one equality J q̈ = b (eq. 14). A controller sees only these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from .readable import amount, counted, enumerated, in_one_line

Array = NDArray[np.floating[Any]]  #: Floats; the docstring states the shape.
BoolArray = NDArray[np.bool_]  #: Booleans; the docstring states the shape.
IntArray = NDArray[np.int64]  #: Integers; the docstring states the shape.
#: Accepted array classes. In others, such as a matrix, operators mean something else.
ARRAYS = (np.ndarray, np.memmap)
UNKNOWN: Array = np.empty(0)  #: Placeholder for a missing field.
NOT_LIMITED: BoolArray = np.empty(0, dtype=np.bool_)  #: No joint has bounds.

Status = Literal["ok", "relaxed", "suboptimal", "rank-loss", "failed"]
"""Status of a command.

``ok``: every row that the law handles meets its demand. ``relaxed``: the rows contradict each
other; the command violates them least, and its reason names the violated rows and by how much.
``suboptimal``: every row is met, but rounding prevents the optimum of the levels below the rows;
the reason gives details. ``rank-loss``: the active rows have lost full row rank, so that their
fulfilment is not guaranteed and the operation should be aborted (section 5.2). ``failed``: no
command could be computed; ``qdd`` is zero.
"""


@dataclass(slots=True)
class Rows:
    """Constraint rows at one instant: m rows for a robot with n joints."""

    #: (m,) constraint functions φ = σ + K σ̇ (eq. 19), or φ directly for speeds; allowed where φ ≤
    #: 0.
    phi: Array
    Lg: Array  #: (m, n) L_gφ = ∂φ/∂q̇ (eq. 17).
    #: (m,) known part of L_fφ + ∂φ/∂t (eq. 18, section 5.4), in units of φ per second.
    Lf: Array
    switching_gain: Array  #: (m,) u⁺ of each row (eq. 11), in units of φ per second.
    labels: tuple[str, ...]  #: m names such as ``"fov[marker 2]"``.
    #: (m,) size of the allowed range in units of φ: 1 for normalised constraints, an obstacle's
    #: radius for distances. Ones if not given.
    scale: Array = field(default_factory=lambda: UNKNOWN)
    #: (m,) σ, σ̇ with ∂σ/∂t [units of φ per second], and K [s]; (0,) where they are not given, for
    #: laws that do not use them. Of a row on φ itself, such as a speed, σ = φ.
    sigma: Array = field(default_factory=lambda: UNKNOWN)
    sigma_dot: Array = field(default_factory=lambda: UNKNOWN)
    K: Array = field(default_factory=lambda: UNKNOWN)
    #: (n,) bounds of the present box of q̈, infinite where there is no bound; (0,) without a box.
    #: Braking may require a box without zero. Commands of laws that ignore the box are clipped to
    #: it joint by joint.
    qdd_min: Array = field(default_factory=lambda: UNKNOWN)
    qdd_max: Array = field(default_factory=lambda: UNKNOWN)

    def __post_init__(self) -> None:
        try:
            if len(self.scale) == 0:
                self.scale = np.ones(len(self.labels))
        except TypeError as error:
            raise InvalidInput(
                f"rows need a tuple of labels and an array of scales: {error}"
            ) from error

    @in_one_line
    def __repr__(self) -> str:
        if not len(self.labels):
            return "<Rows: none>"
        worst = int(np.argmax(self.phi))
        reached = [self.labels[i] for i in np.flatnonzero(self.phi >= 0.0)]
        n = np.shape(self.Lg)[-1]
        size = f"{counted(len(self.labels), 'row')} of {counted(n, 'joint')}"
        greatest = f"greatest φ {amount(self.phi[worst])} ({self.labels[worst]})"
        return f"<Rows: {size}, {greatest}, φ ≥ 0: {enumerated(reached) or 'none'}>"

    def velocity_form(self, qd: Array) -> tuple[Array, Array]:
        """Return the same rows as bounds on the joint speeds: G (m, n) and h (m,), G q̇ ≤ h.

        φ is linear in q̇. Of φ = σ + K σ̇ ≤ 0 this is K ∇σᵀ q̇ ≤ −σ − K ∂σ/∂t; a bound on speeds is
        one already. Both are G = L_gφ and h = L_gφ q̇ − φ at the present q̇, ``qd`` (n,).
        """
        h = self.Lg @ qd - self.phi
        return self.Lg, h

    @classmethod
    def none(cls, n: int) -> Rows:
        """Create an empty set of rows for a robot with n joints."""
        empty = np.empty(0)
        return cls(empty, np.empty((0, n)), empty, empty, ())


@dataclass(slots=True)
class Task:
    """Tracking equality J q̈ = b of eq. (41), and the rest acceleration of the free joints.

    Of all q̈ that rows and task leave, laws choose the nearest to ``rest``.
    """

    J: Array  #: (k, n) Jacobian J_s of the visual features.
    b: Array  #: (k,) s̈_c − J̇_s q̇ − ∂ṡ/∂t.
    #: (k,) e; (0,) for laws that do not use it.
    error: Array = field(default_factory=lambda: UNKNOWN)
    error_rate: Array = field(default_factory=lambda: UNKNOWN)  #: (k,) ė; (0,) as above.
    #: (n,) q̈₀ [rad/s² or m/s²]; (0,) for zero.
    rest: Array = field(default_factory=lambda: UNKNOWN)
    #: (n,) present q̇ [rad/s or m/s]; (0,) for laws that do not use it.
    qd: Array = field(default_factory=lambda: UNKNOWN)

    @in_one_line
    def __repr__(self) -> str:
        k, n = np.shape(self.J)
        error = ""
        if len(self.error):
            error = f", ‖e‖ = {amount(np.linalg.norm(self.error))}"
        size = f"{counted(k, 'feature')} of {counted(n, 'joint')}"
        return f"<Task: {size}{error}, ‖b‖ = {amount(np.linalg.norm(self.b))}>"

    def velocity_form(self, gain: float) -> tuple[Array, Array]:
        """Return the task of the joint speeds: J (k, n) and v (k,), J q̇ = v.

        With it the error decays as ė = −λ e, ``gain`` being λ [1/s]: v = −λ e − ∂s/∂t, and ∂s/∂t
        = ė − J q̇ contains everything that moves the error but the joints. Needs ``error``,
        ``error_rate`` and ``qd``.
        """
        v = self.J @ self.qd - self.error_rate - gain * self.error
        return self.J, v


@dataclass(slots=True)
class Command:
    """Answer of a controller: joint accelerations, their status, and the rows that shaped them."""

    qdd: Array  #: (n,) commanded joint accelerations q̈_c, always finite [rad/s² or m/s²].
    status: Status  #: See :data:`Status`.
    acted: BoolArray  #: (m,) true for rows that shaped the command.
    labels: tuple[str, ...]  #: The m labels of the rows.
    reason: str = ""  #: Why the status is not ``ok``; names the rows concerned. Empty otherwise.
    #: (m,) violation of each row's demand [units of φ per second]; None if the law has no demand
    #: to measure.
    slack: Array | None = None
    #: QP solver that gave the answer, and its iterations; empty and 0 for closed forms.
    solver: str = ""
    iterations: int = 0
    #: Reason why another solver than the requested one gave the answer. Empty otherwise.
    fallback: str = ""
    #: Remark for the user, such as on an option that affects none of the rows. Empty otherwise.
    remark: str = ""
    #: (n,) joints whose acceleration is at an end of the box of the rows; (0,) where none is
    #: stated.
    saturated: BoolArray = field(default_factory=lambda: NOT_LIMITED)
    #: (n,) commanded joint speeds [rad/s or m/s] of a law that commands these; (0,) of others.
    #: ``qdd`` is then the change from the speeds of the command before, per second.
    qd: Array = field(default_factory=lambda: UNKNOWN)

    @in_one_line
    def __repr__(self) -> str:
        joint = int(np.argmax(np.abs(self.qdd)))
        size = f"greatest |q̈| {amount(abs(self.qdd[joint]))} rad/s² or m/s² (joint {joint + 1})"
        if len(self.qd):
            joint = int(np.argmax(np.abs(self.qd)))
            size = f"greatest |q̇| {amount(abs(self.qd[joint]))} rad/s or m/s (joint {joint + 1})"
        why = f" ({self.reason})" if self.reason else ""
        return f"<Command {self.status}{why}: {size}, acted: {enumerated(self.active) or 'none'}>"

    @property
    def active(self) -> tuple[str, ...]:
        """Labels of the rows that shaped the command."""
        return tuple(self.labels[i] for i in np.flatnonzero(self.acted))

    @property
    def slacks(self) -> dict[str, float]:
        """Unmet demand by label, for the rows that have any."""
        if self.slack is None:
            return {}
        return {self.labels[i]: float(self.slack[i]) for i in np.flatnonzero(self.slack > 0.0)}


GIVEN = ("phi", "Lg", "Lf", "switching_gain", "scale")  #: Required fields of rows, m of each.
OPTIONAL = ("sigma", "sigma_dot", "K")  #: Optional fields of rows, (m,) each.
BOX = ("qdd_min", "qdd_max")  #: Optional bounds of q̈, (n,) each.
#: Tolerance for being at an end of a box, as a fraction of the acceleration.
AT_END = 1e-9


def at_end(qdd: Any, least: Any, greatest: Any) -> Any:
    """True where an acceleration is at an end of its box, elementwise."""
    rounding = AT_END * abs(qdd)
    is_at_least = qdd - least <= rounding
    is_at_greatest = greatest - qdd <= rounding
    return is_at_least | is_at_greatest


def in_box(rows: Rows, qdd: Array) -> Array:
    """Clip q̈ (n,) to the box of the rows, if they have one."""
    return np.clip(qdd, rows.qdd_min, rows.qdd_max) if len(rows.qdd_max) else qdd


def keep_box(rows: Rows, command: Command) -> None:
    """Clip a command of accelerations to the box of the rows, if they have one.

    Records the joints at an end of the box. A command of speeds stays as it is: the arm that
    follows it keeps its own limits.
    """
    has_box = len(rows.qdd_max) > 0
    commands_speeds = len(command.qd) > 0
    if has_box and not commands_speeds and command.status != "failed":
        command.qdd = in_box(rows, command.qdd)
        command.saturated = at_end(command.qdd, rows.qdd_min, rows.qdd_max)
