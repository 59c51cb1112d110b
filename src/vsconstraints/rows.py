"""The language between a scene and a controller: rows, a task, and the command that answers them.

Every constraint, whatever its kind, becomes rows φ ≤ 0 with φ̇ = L_fφ + L_gφ q̈ (eqs. 9, 17 and 18); every
visual task becomes one equality J q̈ = b (eq. 14). A controller sees nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidInput, shown
from .formulas.limits import at_end
from .readable import amount, counted, enumerated, in_one_line

Array = NDArray[np.floating[Any]]
"""Floats; the docstring says of what shape."""

BoolArray = NDArray[np.bool_]
"""Booleans, likewise."""

IntArray = NDArray[np.int64]
"""Integers, likewise."""

ARRAYS = (np.ndarray, np.memmap)
"""What an array may be: in other kinds, such as a matrix, operators mean something else."""

UNKNOWN: Array = np.empty(0)
"""What is not given."""

NOT_LIMITED: BoolArray = np.empty(0, dtype=np.bool_)
"""No joint has bounds."""

Status = Literal["ok", "relaxed", "suboptimal", "rank-loss", "failed"]
"""What a controller says of its command.

``ok``: every row it handles is met as its law demands. ``relaxed``: the rows contradict each other; the command
violates them least and says which, by how much. ``suboptimal``: every row is met, but rounding keeps the law from what
it defines below them; the reason says what. ``rank-loss``: the active rows have lost full row rank, so that
their fulfilment is not guaranteed and the operation should be aborted (section 5.2). ``failed``: no command could
be computed; ``qdd`` is zero.
"""


@dataclass(slots=True)
class Rows:
    """Constraint rows at one instant: m rows for a robot with n joints.

    Attributes
    ----------
    phi
        (m,) constraint functions φ = σ + K σ̇ (eq. 19), or φ directly for speeds; allowed where φ ≤ 0.
    Lg
        (m, n) L_gφ = ∂φ/∂q̇ (eq. 17).
    Lf
        (m,) what is known of L_fφ + ∂φ/∂t (eq. 18, section 5.4), in units of φ per second.
    switching_gain
        (m,) u⁺ of each row (eq. 11), in units of φ per second.
    labels
        m names such as ``"fov[marker 2]"``.
    scale
        (m,) size of the allowed range in units of φ: 1 for normalised constraints, an obstacle's radius for
        distances. Ones if not given.
    sigma, sigma_dot, K
        (m,) σ, σ̇ with ∂σ/∂t [units of φ per second], and K [s]; (0,) where they are not given, for laws that do not
        use them. Of a row on φ itself, such as a speed, σ = φ.
    qdd_min, qdd_max
        (n,) box that q̈ must be in now, infinite where there is no bound; (0,) where none is stated. Braking may demand
        a box without zero. No command leaves it: a law that does not keep it is brought back joint by joint.
    """

    phi: Array
    Lg: Array
    Lf: Array
    switching_gain: Array
    labels: tuple[str, ...]
    scale: Array = field(default_factory=lambda: UNKNOWN)
    sigma: Array = field(default_factory=lambda: UNKNOWN)
    sigma_dot: Array = field(default_factory=lambda: UNKNOWN)
    K: Array = field(default_factory=lambda: UNKNOWN)
    qdd_min: Array = field(default_factory=lambda: UNKNOWN)
    qdd_max: Array = field(default_factory=lambda: UNKNOWN)

    def __post_init__(self) -> None:
        try:
            if len(self.scale) == 0:
                self.scale = np.ones(len(self.labels))
        except TypeError as error:
            raise InvalidInput(f"rows need a tuple of labels and an array of scales: {error}") from error

    @in_one_line
    def __repr__(self) -> str:
        if not len(self.labels):
            return "<Rows: none>"
        worst, reached = int(np.argmax(self.phi)), [self.labels[i] for i in np.flatnonzero(self.phi >= 0.0)]
        size = f"{counted(len(self.labels), 'row')} of {counted(np.shape(self.Lg)[-1], 'joint')}"
        greatest = f"greatest φ {amount(self.phi[worst])} ({self.labels[worst]})"
        return f"<Rows: {size}, {greatest}, φ ≥ 0: {enumerated(reached) or 'none'}>"

    @classmethod
    def none(cls, n: int) -> Rows:
        """No constraint at all, for a robot with n joints."""
        empty = np.empty(0)
        return cls(empty, np.empty((0, n)), empty, empty, ())


@dataclass(slots=True)
class Task:
    """The tracking equality J q̈ = b of eq. (41).

    Attributes
    ----------
    J
        (k, n) Jacobian J_s of the visual features.
    b
        (k,) s̈_c − J̇_s q̇ − ∂ṡ/∂t.
    error, error_rate
        (k,) e of the visual features, and ė; (0,) where they are not given, for laws that do not use them.
    """

    J: Array
    b: Array
    error: Array = field(default_factory=lambda: UNKNOWN)
    error_rate: Array = field(default_factory=lambda: UNKNOWN)

    @in_one_line
    def __repr__(self) -> str:
        k, n = np.shape(self.J)
        error = f", ‖e‖ = {amount(np.linalg.norm(self.error))}" if len(self.error) else ""
        size = f"{counted(k, 'feature')} of {counted(n, 'joint')}"
        return f"<Task: {size}{error}, ‖b‖ = {amount(np.linalg.norm(self.b))}>"


@dataclass(slots=True)
class Command:
    """A controller's answer.

    Attributes
    ----------
    qdd
        (n,) commanded joint accelerations q̈_c, always finite [rad/s² or m/s²].
    status
        See :data:`Status`.
    acted
        (m,) which rows shaped the command.
    labels
        The m labels of the rows it was given.
    reason
        Why the status is not ``ok``; names the rows concerned. Empty otherwise.
    slack
        (m,) by how much the command leaves each row's demand unmet [units of φ per second]; None if the law has
        no demand to measure.
    solver, iterations
        The QP solver that gave the answer and how often it iterated; empty and 0 for closed forms.
    fallback
        Why another solver than the one asked for gave the answer. Empty otherwise.
    remark
        What else should be known, such as an option that concerns none of the rows. Empty otherwise.
    saturated
        (n,) joints whose acceleration is at an end of the box of the rows; (0,) where none is stated.
    """

    qdd: Array
    status: Status
    acted: BoolArray
    labels: tuple[str, ...]
    reason: str = ""
    slack: Array | None = None
    solver: str = ""
    iterations: int = 0
    fallback: str = ""
    remark: str = ""
    saturated: BoolArray = field(default_factory=lambda: NOT_LIMITED)

    @in_one_line
    def __repr__(self) -> str:
        joint = int(np.argmax(np.abs(self.qdd)))
        size = f"greatest |q̈| {amount(abs(self.qdd[joint]))} rad/s² or m/s² (joint {joint + 1})"
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


ROUNDING = 2.0**-53
"""Largest relative error of one operation in floating point."""


def beyond_rounding(rows: Rows, qdd: Array) -> str:
    """Say which row cannot be told met from unmet at these accelerations, and how far outside it is; empty if none.

    Rounding of L_gφ q̈ alone, ε‖L_gφ‖‖q̈‖, is then more than u⁺, which is what the row can demand.
    """
    largest = float(np.abs(qdd).max(initial=0.0))
    size = largest * float(np.linalg.norm(qdd / largest)) if largest > 0.0 else 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        lost = ROUNDING * np.linalg.norm(rows.Lg, axis=1) * size > rows.switching_gain
    if not lost.any():
        return ""
    names = ", ".join(rows.labels[i] for i in np.flatnonzero(lost))
    return (
        f"accelerations of {size:.1e} are beyond what rows can be checked at: rounding exceeds the gain of {names} "
        f"(φ up to {rows.phi[lost].max():.1e})"
    )


GIVEN = ("phi", "Lg", "Lf", "switching_gain", "scale")
"""What rows say, m of each."""

OPTIONAL = ("sigma", "sigma_dot", "K")
"""What rows need not say, (m,) each."""

BOX = ("qdd_min", "qdd_max")
"""Bounds of q̈, (n,) each, likewise."""


def in_box(rows: Rows, qdd: Array) -> Array:
    """What is nearest to q̈ (n,) in the box of the rows, if they have one."""
    return np.clip(qdd, rows.qdd_min, rows.qdd_max) if len(rows.qdd_max) else qdd


def keep_box(rows: Rows, command: Command) -> None:
    """Bring a command into the box of the rows, if they have one, and say which joints are at an end of it."""
    if len(rows.qdd_max) and command.status != "failed":
        command.qdd = in_box(rows, command.qdd)
        command.saturated = at_end(command.qdd, rows.qdd_min, rows.qdd_max)


def check(rows: Rows, task: Task) -> None:
    """Raise InvalidInput unless shapes agree and every number is finite; names the row or entry at fault."""
    if not (isinstance(rows, Rows) and isinstance(task, Task)):
        raise InvalidInput(f"a law needs Rows and a Task, not {shown(rows)} and {shown(task)}")
    if not (isinstance(rows.labels, tuple) and all(isinstance(label, str) for label in rows.labels)):
        raise InvalidInput(f"rows.labels must be a tuple of names, not {shown(rows.labels)}")
    for name, array in (
        ("task.J", task.J),
        ("task.b", task.b),
        *((f"rows.{name}", getattr(rows, name)) for name in (*GIVEN, *OPTIONAL, *BOX)),
        ("task.error", task.error),
        ("task.error_rate", task.error_rate),
    ):
        if not (type(array) in ARRAYS and array.dtype == np.float64):
            raise InvalidInput(f"{name} must be an array of floats, not {shown(array)}")
    if task.J.ndim != 2 or task.b.shape != task.J.shape[:1]:
        raise InvalidInput(
            f"task.J must be (k, n) and task.b (k,): they have the shapes {task.J.shape} and {task.b.shape}"
        )
    m, n = len(rows.labels), task.J.shape[1]
    if n == 0:
        raise InvalidInput("task.J has no column: there is no joint to command")
    for name, array, shape in (
        ("phi", rows.phi, (m,)),
        ("Lg", rows.Lg, (m, n)),
        ("Lf", rows.Lf, (m,)),
        ("switching_gain", rows.switching_gain, (m,)),
        ("scale", rows.scale, (m,)),
        *((name, getattr(rows, name), (m,)) for name in OPTIONAL if getattr(rows, name).shape != (0,)),
    ):
        if array.shape != shape:
            raise InvalidInput(
                f"rows.{name} has the shape {array.shape}; with {m} labels and {n} joints it must be {shape}"
            )
        if not np.isfinite(array).all():
            at = np.unique(np.argwhere(~np.isfinite(array))[:, 0])
            raise InvalidInput(f"rows.{name} is not finite for {', '.join(rows.labels[i] for i in at)}")
    if len(rows.qdd_min) or len(rows.qdd_max):
        _check_box(rows, n)
    k = len(task.b)
    for name, array in (("error", task.error), ("error_rate", task.error_rate)):
        if array.shape not in ((0,), (k,)):
            raise InvalidInput(f"task.{name} has the shape {array.shape}; with {k} features it must be {(k,)}")
    for name, array in (("J", task.J), ("b", task.b), ("error", task.error), ("error_rate", task.error_rate)):
        if not np.isfinite(array).all():
            at = np.unique(np.argwhere(~np.isfinite(array))[:, 0])
            raise InvalidInput(f"task.{name} is not finite in row {', '.join(map(str, at))}")
    if (rows.switching_gain <= 0.0).any() or (rows.scale <= 0.0).any():
        at = np.flatnonzero((rows.switching_gain <= 0.0) | (rows.scale <= 0.0))
        raise InvalidInput(f"switching gain and scale must be positive: {', '.join(rows.labels[i] for i in at)} is not")


def _check_box(rows: Rows, n: int) -> None:
    low, high = rows.qdd_min, rows.qdd_max
    if low.shape != (n,) or high.shape != (n,):
        raise InvalidInput(
            f"rows.qdd_min and rows.qdd_max must both be {(n,)}, or neither be given: they have the shapes {low.shape} "
            f"and {high.shape}"
        )
    at = np.flatnonzero(~((low <= high) & (low < np.inf) & (high > -np.inf)))
    if len(at):
        boxes = "; ".join(f"joint {j + 1}: [{low[j]:g}, {high[j]:g}]" for j in at)
        raise InvalidInput(f"rows.qdd_min and rows.qdd_max leave no acceleration: {boxes}")
