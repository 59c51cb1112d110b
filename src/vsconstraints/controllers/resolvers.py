"""The resolvers that files can name: projections and quadratic programs.

For the formulas see :doc:`/laws`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from ..compiled import codes
from ..errors import ConfigurationError, format_value
from ..formulas.row import share_within
from ..qp import SolverChain
from ..rows import Array, BoolArray, Command, Rows, Task
from ..rows.tolerances import ZERO_GRADIENT
from .cascade import by_solvers
from .compiled import NO_SLACK, CompiledAnswer
from .demand import Demand
from .least_norm import RANK_TOLERANCE
from .ranges import Choices, Fixed, Range, one_of, option, positive_number, rank_tolerance
from .resolver import COMPILED, Additive, Priority, Resolver, row_weights, unmet


@dataclass(frozen=True)
class Projection(Additive):
    """Sum q̈ = q̈_track + P z, with a projector P that protects the norm of the task error.

    z = Σ min(0, cᵢ − L_gφᵢ q̈_track) L_gφᵢ† are the pushes of :class:`Additive`. P is the large
    projection operator of Marey and Chaumette (IROS 2010), and I where Jᵀe = 0: z does not change
    d²/dt² ½‖e‖². Where the error is small, rows may be violated.
    """

    closed: float = option(0.1, "norm of the task error ‖e‖ below which λ is 0", Range(0.01, 0.3))
    opened: float = option(0.7, "norm of the task error ‖e‖ above which λ is 1", Range(0.4, 4.0))

    name = "projection"
    kernel = ("projection", "projection")
    uses = ("error",)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("closed", "opened"):
            object.__setattr__(self, name, positive_number(name, getattr(self, name)))
        if self.closed >= self.opened:
            raise ConfigurationError(
                f"closed must be below opened, which is {self.opened:g}, not {self.closed:g}"
            )


AUTO = "auto"  #: Compiled descent; ``DEFAULT`` is its first fallback.
DEFAULT = "daqp"
#: Largest weight of a row, and the inverse of the smallest. The default weight is 1.
MAX_WEIGHT = 1e10
#: Codes of answers with unmet demands, and of those with levels 2 and 3 possibly unmet.
RELAXED = (codes.RELAXED_ROWS, codes.RELAXED_SHORT)
SHORT = (codes.SHORT, codes.RELAXED_SHORT)

UNPROVED = (
    "because of rounding, it cannot be proved that the task and the accelerations are the least "
    "that the rows allow"
)


@dataclass(frozen=True, kw_only=True)
class Hierarchy(Resolver):
    """Strict priorities as a lexicographic QP: (1) rows, (2) task, (3) least ‖q̈ − q̈₀‖.

    See :class:`vsconstraints.controllers.HierarchicalQP` for the levels and the options.

    Levels 2 and 3 are one strictly convex QP with hard rows, min ½Σⱼ(gⱼ² + damping)vⱼ². Its
    coordinates are v = Vᵀ(q̈ − q̈_track), of the singular vectors of J with relative gains g. Level
    1 is computed only if the rows are incompatible, and then exactly; the violated rows become
    equalities. Measurements showed that a large weight or soft rows give wrong answers instead.

    If J leaves directions free and the damping has cost the task more than a residual of 1e-6
    ‖J‖‖q̈ − q̈_track‖, level 2 is solved separately. Level 3 is then solved within level 2, with
    every direction whose gain is above ``rank_tolerance`` relative to J. Two exceptions apply to
    nearly singular tasks. Where J has a relative gain below 1e-3, level 2 uses only directions
    above √damping. Where J leaves no direction free, the minimiser of the QP is the answer. If
    rounding prevents the proof that levels 2 and 3 are met, the status is ``suboptimal``: the rows
    are met, and no known point that meets them has a smaller residual.
    """

    solver: str = option(
        AUTO,
        "auto, the compiled dual active-set method, or the name of a QP solver, see "
        "``vsconstraints list solvers``; if an answer violates the optimality conditions, other "
        "solvers are tried, and the command states this",
    )
    weights: Mapping[str, float] | None = option(
        None,
        'diagonal of W, 1e-10 to 1e10, by the beginning of the label, such as {"fov": 2.0, '
        '"range[joint 6]": 5.0}; the longest match counts, and rows without a match have weight '
        "1; entries that match no label are reported in Command.remark",
    )
    max_acceleration: float | None = option(
        None, "q̈_max: bound on |q̈| of every joint [rad/s² or m/s²]; none for no bound"
    )
    damping: float = option(
        1e-8, "weight of level 3 in the QP, relative to ‖J‖² in the Frobenius norm"
    )
    rank_tolerance: float = option(
        RANK_TOLERANCE, "singular values of J below this fraction of the largest one count as zero"
    )

    name = "hierarchy"
    kernel = ("hierarchical_qp", "descend")
    measures = True
    answers = codes.SOLVED, *RELAXED, codes.SHORT
    #: Code of the levels below the rows, see :mod:`vsconstraints.compiled.codes`.
    aim: ClassVar[int] = codes.STRICT
    #: Half the width of the box |q̈| ≤ q̈_max: ``max_acceleration``, or infinite.
    half_width: ClassVar[float] = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", positive_number("damping", self.damping))
        if self.max_acceleration is not None:
            most = positive_number("max_acceleration", self.max_acceleration)
            object.__setattr__(self, "max_acceleration", most)
            object.__setattr__(self, "half_width", most)
        if self.weights is not None:
            weights: object = self.weights
            if not (
                isinstance(weights, Mapping) and all(isinstance(prefix, str) for prefix in weights)
            ):
                raise ConfigurationError(
                    f"weights must map beginnings of labels to numbers, not {format_value(weights)}"
                )
            fixed = Fixed({prefix: _weight(prefix, weight) for prefix, weight in weights.items()})
            object.__setattr__(self, "weights", fixed)
        object.__setattr__(self, "rank_tolerance", rank_tolerance(self.rank_tolerance))
        object.__setattr__(self, "compiles", self.solver == AUTO)

    @property
    def options(self) -> Array:
        """See :class:`.Resolver`."""
        return np.array([self.rank_tolerance, self.half_width, self.damping, float(self.aim)])

    def solvers(self) -> SolverChain:
        """See :class:`.Resolver`."""
        return SolverChain(DEFAULT if self.solver == AUTO else self.solver)

    def row_weights(self, labels: tuple[str, ...]) -> Array:
        """See :class:`.Resolver`."""
        return row_weights(labels, self.weights) if self.weights else NO_SLACK

    def remark(self, labels: tuple[str, ...]) -> str:
        """Report the weights that match no label; empty if all match."""
        weights = self.weights or {}
        idle = [
            format_value(prefix)
            for prefix in weights
            if not any(label.startswith(prefix) for label in labels)
        ]
        if not idle or not labels:
            return ""
        return f"weights that match the beginning of no row's label: {', '.join(idle)}"

    def command(self, answer: CompiledAnswer, labels: tuple[str, ...]) -> Command | None:
        """See :class:`.Resolver`."""
        code, qdd, acted, slack, iterations = answer
        if code not in self.answers:
            return None
        solver = COMPILED if iterations else ""
        command = Command(qdd, "ok", acted, labels, "", slack, solver, iterations)
        if code:
            command.status = "relaxed" if code in RELAXED else "suboptimal"
            # q̈ has no influence on an unmet row that is not active
            fixed = np.flatnonzero(~acted & (slack > 0.0))
            reasons = unmet(labels, slack, fixed), UNPROVED if code in SHORT else ""
            command.reason = "; ".join(filter(None, reasons))
        return command

    def solve(self, rows: Rows, task: Task, c: Array, solvers: SolverChain | None) -> Command:
        """See :class:`.Resolver`.

        A QP solver is used if it is requested by name, or if the compiled form has no answer.
        """
        command = self.command_compiled(rows, task, c)
        # without iterations no row is active, or the rows leave no choice: no solver is needed
        if command is not None and (self.compiles or not command.iterations):
            return command
        assert solvers is not None
        return by_solvers(self, rows, task, c, solvers)

    def box(self, rows: Rows, n: int) -> Array:
        """Return the least and greatest q̈ (2, n): ``max_acceleration`` within the box of the rows.

        If the two boxes do not intersect, it is the nearest end of the box of the rows.
        """
        box: Array = np.array([[-self.half_width], [self.half_width]]) * np.ones(n)
        return np.clip(box, rows.qdd_min, rows.qdd_max) if len(rows.qdd_max) else box

    def center(self, rows: Rows, tracking: Array, c: Array, box: Array) -> tuple[Array, BoolArray]:
        """Return the target q̈ (n,) of the lower levels, and the rows (m,) that shape it."""
        return tracking, np.zeros(c.size, dtype=np.bool_)


#: Metrics of the distance to the tracking command.
METRICS = {"joint": codes.NEAREST, "task": codes.WEIGHED}


@dataclass(frozen=True, kw_only=True)
class Filter(Hierarchy):
    """Safety filter: the q̈ nearest to tracking among those that violate the demands least.

    Only q̈ in the box are considered. With the metric ``joint`` it is the safety filter of control
    barrier functions (Ames, Xu, Grizzle and Tabuada 2017). The metric ``task`` is that of
    task-consistent filters (Morton and Pavone 2025), ‖J(q̈ − q̈_track)‖² + damping ‖J‖² ‖q̈ −
    q̈_track‖² with the Frobenius norm. Other options: see
    :class:`vsconstraints.controllers.HierarchicalQP`.
    """

    damping: float = option(
        1e-8,
        "weight of the joint accelerations in the metric ``task``, relative to ‖J‖²",
        Range(1e-8, 1.0),
    )
    metric: Literal["joint", "task"] = option(
        "joint", "norm in which the distance to tracking is minimised", Choices(tuple(METRICS))
    )

    name = "filter"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "aim", one_of("metric", self.metric, METRICS))


@dataclass(frozen=True, kw_only=True)
class Scaling(Hierarchy):
    """Tracking scaled, q̈ = κ q̈_track, by the largest κ in [0, 1] that keeps κ L_gφ q̈_track ≤ c.

    A baseline. For a row with c < 0, κ is the largest value with which this row alone is exceeded
    least. Then the least correction is added that meets all demands, or violates them least. The
    box limits κ as rows do.
    """

    name = "scaling"
    aim = codes.SCALED

    def tracks(self, demand: Demand) -> bool:
        """See :class:`.Resolver`."""
        return True

    def center(self, rows: Rows, tracking: Array, c: Array, box: Array) -> tuple[Array, BoolArray]:
        """See :class:`.Hierarchy`."""
        influenced = np.linalg.norm(rows.Lg, axis=1) > ZERO_GRADIENT * rows.scale
        shares = np.where(influenced, share_within(c, rows.Lg @ tracking), 1.0)
        by_rows = shares.min(initial=1.0)
        by_upper_bounds = share_within(box[1], tracking).min()
        by_lower_bounds = share_within(-box[0], -tracking).min()
        kappa = min(by_rows, by_upper_bounds, by_lower_bounds)
        return kappa * tracking, (shares <= kappa) & (shares < 1.0)


@dataclass(frozen=True, kw_only=True)
class Saturation(Hierarchy):
    """Saturation in the null space (SNS) of accelerations, for rows as well as joints.

    A row or joint that would exceed its bound is saturated, L_gφ q̈ = c or q̈ⱼ at the end of the
    box, and is never released. The task, scaled by s, uses the remaining null space. Of all sets
    along the way, the one with the largest s in [0, 1] is used; if no set is feasible, the command
    is that of :class:`Hierarchy`. With ``scales=False`` the task is met in the least-squares sense
    instead, and its direction is not preserved.

    Flacco, De Luca, Khatib, IEEE Transactions on Robotics 31(3), 2015; at the level of
    accelerations also ICRA 2012.
    """

    scales: bool = option(
        True,
        "true to scale a task that cannot be met entirely, as published; false to meet it in the "
        "least-squares sense",
    )

    name = "saturation"
    kernel = ("saturation", "saturation")
    otherwise = ("hierarchical_qp", "descend")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.scales, bool):
            raise ConfigurationError(
                f"scales must be true or false, not {format_value(self.scales)}"
            )

    @property
    def options(self) -> Array:
        """See :class:`.Resolver`."""
        return np.append(super().options, float(self.scales))


@dataclass(frozen=True, kw_only=True)
class SaturationExact(Hierarchy):
    """Largest task scale s in [0, 1] that meets all demands in the box; then least ‖q̈ − q̈₀‖.

    Of all q̈ with J q̈ = s J J†b, it finds the optimum that saturation in the null space searches
    for (Opt-SNS of Flacco, De Luca, Khatib 2015). It uses the levels of :class:`Hierarchy` in the
    coordinates q̈ = s J†b + N z. If no s is feasible, the answer and its status are those of
    :class:`Hierarchy`.
    """

    name = "saturation-exact"
    otherwise = ("hierarchical_qp", "descend")
    kernel = ("saturation_exact", "saturation_exact")


#: Resolvers that files can name, by their ``name``.
RESOLVERS: tuple[type[Resolver], ...] = (
    Priority,
    Hierarchy,
    Filter,
    Additive,
    Saturation,
    SaturationExact,
    Projection,
    Scaling,
)


def _weight(prefix: str, value: object) -> float:
    """Return the weight as a float; raise ConfigurationError if it is out of range.

    Within the limits, neither the weight nor 1 is lost in rounding.
    """
    weight = positive_number(f"weights[{prefix!r}]", value)
    if not 1.0 / MAX_WEIGHT <= weight <= MAX_WEIGHT:
        raise ConfigurationError(
            f"weights[{prefix!r}] must be between {1.0 / MAX_WEIGHT:g} and {MAX_WEIGHT:g}, not "
            f"{format_value(value)}: beside "
            "rows of so much more weight, light ones are lost in rounding"
        )
    return weight
