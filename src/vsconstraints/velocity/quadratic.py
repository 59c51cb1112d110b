"""Laws ``velocity-qp`` and ``velocity-hierarchical-qp``: quadratic programs over joint speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..controllers.demand import Demand
from ..controllers.law import Law
from ..controllers.least_norm import RANK_TOLERANCE
from ..controllers.ranges import positive_number
from ..controllers.resolver import Resolver
from ..controllers.resolvers import AUTO, Filter, Hierarchy
from ..errors import ConfigurationError, InvalidInput, SolverError, format_value
from ..formulas import where
from ..formulas.row import Row
from ..formulas.velocity import UNBOUNDED
from ..rows import UNKNOWN, Array, Command, Rows, Task
from .compiled import reason_of
from .gain import VelocityLaw

#: Damping of the inner program, of no effect: its task contains the damping of the law already.
TO_ROUNDING = 1e-14


@dataclass(frozen=True)
class VelocityBound(Demand):
    """Demand G q̇ ≤ h of the inner program, whose rows have L_gφ = G and φ = −h."""

    name = "velocity-bound"
    everywhere = True

    @staticmethod
    def formula(row: Row) -> Any:
        """Return h; infinity where it is ``UNBOUNDED``."""
        return where(row.phi > -0.5 * UNBOUNDED, -row.phi, np.inf)


def _limit(value: object) -> float | Literal["limits"] | None:
    if value is None:
        return None
    if value == "limits":
        return "limits"
    if isinstance(value, str):
        raise ConfigurationError(
            f'max_acceleration is a number, "limits" or nothing, not {format_value(value)}'
        )
    return positive_number("max_acceleration", value)


class QuadraticVelocity(VelocityLaw):
    """Velocity law that a resolver of accelerations answers, with speeds in their place.

    :class:`.Filter` and :class:`.Hierarchy` compute the x that violates A x ≤ c least and then
    meets J x = b best: here x = q̇, A = G, c = h, b = v. Therefore a command exists whatever the
    rows demand, and says which rows it exceeds by how much.
    """

    def __init__(
        self,
        resolver: Resolver,
        gains: Mapping[str, Any],
        max_acceleration: float | Literal["limits"] | None,
    ) -> None:
        super().__init__(**gains)
        self.max_acceleration = _limit(max_acceleration)
        self._program = Law(VelocityBound(), resolver)

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        box = () if self.max_acceleration is None else ("T_s", "memory")
        return (*super().uses, *box)

    def program(self) -> tuple[Demand, Resolver]:
        """See :class:`.VelocityLaw`."""
        return self._program.demand, self._program.resolver

    def compiled_options(self, rows: Rows, n: int) -> dict[str, Any]:
        """See :class:`.VelocityLaw`."""
        limit = self.max_acceleration
        options = super().compiled_options(rows, n)
        if limit is None:
            return options
        of_rows = limit == "limits"
        joints = 0 if of_rows and not len(rows.qdd_max) else n
        options["acceleration"] = np.nan if of_rows else limit
        options["least"] = np.empty(joints)
        options["greatest"] = np.empty(joints)
        return options

    def reset(self, period: float | None = None) -> None:
        """See :class:`.VelocityController`."""
        super().reset(period)
        self._program.reset()

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`.Controller`."""
        return self._program.remark(labels)

    def bounds(self, rows: Rows, task: Task) -> tuple[Array, Array]:
        """Return G (m, n) and h (m,) of the rows G q̇ ≤ h."""
        return rows.velocity_form(task.qd)

    def weighted_task(self, task: Task) -> tuple[Array, Array]:
        """Return J (k, n) and v (k,) of the program's task."""
        return self.task_of(task)

    def box(self, rows: Rows, task: Task) -> tuple[Array, Array]:
        """Return the least and greatest q̇ (n,) within the limit of accelerations for a period.

        They begin at the last command, or at the present q̇ if there is none. They are (0,) each
        without a limit.
        """
        limit = self.max_acceleration
        if limit is None or (limit == "limits" and not len(rows.qdd_max)):
            return UNKNOWN, UNKNOWN
        before = self.speed_before(task)
        assert self.period is not None
        if limit == "limits":
            return before + self.period * rows.qdd_min, before + self.period * rows.qdd_max
        return before - self.period * limit, before + self.period * limit

    def solve(self, rows: Rows, task: Task) -> Command:
        """See :class:`.VelocityController`."""
        G, h = self.bounds(rows, task)
        J, v = self.weighted_task(task)
        least, greatest = self.box(rows, task)
        no_drift = np.zeros(len(h))
        program = Rows(
            -h, G, no_drift, rows.switching_gain, rows.labels, rows.scale, qdd_min=least,
            qdd_max=greatest,
        )  # fmt: skip
        try:
            answer = self._program.command(program, Task(J, v))
        except InvalidInput as error:
            raise SolverError(f"beyond the range of floating point: {error}") from error
        if answer.status == "failed":
            return answer
        return replace(answer, qd=answer.qdd, reason=reason_of(answer, self.unit_of_excess))


class VelocityQP(QuadraticVelocity):
    """Weighted quadratic program over joint speeds, the form of Pink and mink.

    min ½‖W (J q̇ − v)‖² + ½ μ‖q̇‖² subject to G q̇ ≤ h, with v = −λ e − ∂s/∂t and the rows φ = σ +
    K σ̇ ≤ 0 as G q̇ ≤ h (:meth:`.Rows.velocity_form`). These are the barriers of Pink with h_b = −σ
    and the rate 1/K: factors on K of the rows (option ``K``) tune them. Rows that contradict each
    other are exceeded least, where Pink and mink have no solution. Caron et al., Pink: Python
    inverse kinematics based on Pinocchio; Escande, Mansard and Wieber, IJRR 33(7), 2014.

    Parameters
    ----------
    task_weights
        Diagonal of W, one positive number per feature; None for 1.
    damping
        μ: weight of the joint velocities [units of the task squared, s²].
    max_acceleration
        a: limit of the change of the command, |q̇ − q̇_last| ≤ a T_s [rad/s² or m/s²]; ``"limits"``
        for the limits of the arm, as far as the law knows them; None for no limit.
    weights
        Weights of violations, by the beginning of the rows' labels; see :class:`.Hierarchy`.
    solver
        See :class:`.Hierarchy`.
    """

    name = "velocity-qp"
    kernel = "quadratic"

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
        task_weights: Sequence[float] | None = None,
        damping: float = 1e-6,
        max_acceleration: float | Literal["limits"] | None = None,
        weights: Mapping[str, float] | None = None,
        solver: str = AUTO,
    ) -> None:
        gains = {"gain": gain, "gain_at_zero": gain_at_zero, "slope_at_zero": slope_at_zero}
        nearest = Filter(metric="task", damping=TO_ROUNDING, solver=solver, weights=weights)
        super().__init__(nearest, gains, max_acceleration)
        self.damping = positive_number("damping", damping)
        self.task_weights = task_weights
        if task_weights is not None:
            self.task_weights = tuple(
                positive_number("task_weights", each) for each in task_weights
            )
        self.weights = weights
        self.solver = solver

    def compiled_options(self, rows: Rows, n: int) -> dict[str, Any]:
        """See :class:`.VelocityLaw`."""
        options = super().compiled_options(rows, n)
        options["damping"] = self.damping
        if self.task_weights is not None:
            options["task_weights"] = np.array(self.task_weights)
        return options

    def weighted_task(self, task: Task) -> tuple[Array, Array]:
        """Return [W J; √μ I] and [W v; 0]: the square of this task's error is the cost."""
        J, v = self.task_of(task)
        if self.task_weights is not None:
            if len(self.task_weights) != len(v):
                raise InvalidInput(
                    f"{self.name} has {len(self.task_weights)} task_weights; the task has {len(v)} "
                    f"features"
                )
            w = np.array(self.task_weights)
            J, v = w[:, None] * J, w * v
        n = J.shape[1]
        return np.vstack((J, np.sqrt(self.damping) * np.eye(n))), np.append(v, np.zeros(n))


class VelocityHierarchicalQP(QuadraticVelocity):
    """Strict priorities of joint speeds: (1) rows G q̇ ≤ h, (2) the task J q̇ = v, (3) least ‖q̇‖.

    The levels of :class:`.Hierarchy` with speeds in place of accelerations. Escande, Mansard and
    Wieber, "Hierarchical quadratic programming", International Journal of Robotics Research 33(7),
    2014; for speeds also Kanoun, Lamiraux and Wieber, IEEE Transactions on Robotics 27(4), 2011.

    Parameters
    ----------
    max_acceleration
        As in :class:`VelocityQP`; the box always holds.
    weights, solver, damping, rank_tolerance
        See :class:`.Hierarchy`.
    """

    name = "velocity-hierarchical-qp"
    kernel = "quadratic"

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
        max_acceleration: float | Literal["limits"] | None = None,
        weights: Mapping[str, float] | None = None,
        solver: str = AUTO,
        damping: float = 1e-8,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        gains = {"gain": gain, "gain_at_zero": gain_at_zero, "slope_at_zero": slope_at_zero}
        levels = Hierarchy(
            solver=solver, weights=weights, damping=damping, rank_tolerance=rank_tolerance
        )
        super().__init__(levels, gains, max_acceleration)
        self.weights = weights
        self.solver = solver
        self.damping = damping
        self._rank_tolerance = rank_tolerance

    @property
    def rank_tolerance(self) -> float:
        """Tolerance that the law was made with; another one needs another law."""
        return self._rank_tolerance
