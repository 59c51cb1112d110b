"""The laws of the core, by name: pairs of a demand and a resolver, some with further options."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar, Literal

from ..errors import unknown_name
from ..rows.factors import AS_THEY_ARE, RowFactors
from . import demands
from .barriers import Barrier
from .demand import Demand
from .demands import DEMANDS, BoundaryLayer, Nothing, RampRepulsion, Switch
from .law import Law
from .least_norm import RANK_TOLERANCE
from .ranges import one_of
from .resolver import Additive, Priority, Resolver
from .resolvers import AUTO, RESOLVERS, Filter, Hierarchy


class Tracking(Law):
    """Unconstrained baseline: tracks the task and ignores the rows.

    It shows which rows a scenario challenges. The command is q̈ = q̈₀ + J† (b − J q̈₀): of all q̈
    with the least ‖J q̈ − b‖, the nearest to the q̈₀ of the task. In a singular configuration,
    directions below the tolerance are not used, so that the command stays finite and its status
    ``ok``. Near a singular configuration the command can be large.
    """

    name = "tracking"

    def __init__(self, *, rank_tolerance: float = RANK_TOLERANCE) -> None:
        super().__init__(Nothing(), Priority(rank_tolerance))


class SlidingMode(Law):
    """The paper's law: a sliding mode on the active rows, tracking in their null space.

    Eqs. (10), (11) and (15): the rows with φ ≥ 0 demand A₁ q̈ = −u⁺, and the task acts in the null
    space of A₁. If the active rows have lost full row rank, the status is ``rank-loss``: the
    command then meets their demands in the least-squares sense, and section 5.2 advises to abort.
    Among q̈ that are equally good for rows and task, the command is the nearest to q̈₀.
    """

    name = "sliding-mode"

    def __init__(self, *, rank_tolerance: float = RANK_TOLERANCE) -> None:
        super().__init__(Switch(), Priority(rank_tolerance))


#: Demand and resolver of each blend.
BLENDS: dict[str, tuple[type[BoundaryLayer | RampRepulsion], type[Priority]]] = {
    "additive": (RampRepulsion, Additive),
    "priority": (BoundaryLayer, Priority),
}


class PotentialField(Law):
    """Repulsion that grows continuously towards the boundary, inside an influence region.

    ψ = (1 + φ/δ)^exponent is 0 where the region −δ < φ begins, δ = ``region`` × the row's scale,
    and 1 on the boundary. ``additive`` is the classical sum q̈ = q̈_track − Σ ψᵢ u⁺ᵢ L_gφᵢ†, with
    the demand :class:`.RampRepulsion`: rows can be violated. ``priority`` gives the rows priority
    as in the paper's law, with the demand :class:`.BoundaryLayer`.

    Parameters
    ----------
    blend
        Combination of repulsion and task: ``"additive"`` (default) or ``"priority"``.
    """

    name = "potential-field"

    def __init__(
        self,
        *,
        blend: Literal["additive", "priority"] = "additive",
        region: float = 0.2,
        exponent: float = 1.0,
        strength: float = 1.0,
        ahead: bool = False,
        margin: float = 0.0,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        common = {"ahead": ahead, "margin": margin}
        super().__init__(*_blended(blend, (region, exponent, strength), common, rank_tolerance))

    @property
    def blend(self) -> str:
        """``"additive"`` or ``"priority"``."""
        return self.resolver.name

    @blend.setter
    def blend(self, blend: Any) -> None:
        self.demand, self.resolver = _blended(
            blend, self.demand.parameters, self.demand.common, self.rank_tolerance
        )


def _blended(
    blend: object, parameters: tuple[float, ...], common: Mapping[str, Any], rank_tolerance: float
) -> tuple[Demand, Resolver]:
    demand, resolver = one_of("blend", blend, BLENDS)
    return demand(*parameters, **common), resolver(rank_tolerance)


class HierarchicalQP(Law):
    """Strict priorities, by :class:`.Hierarchy`: (1) rows, (2) task, (3) q̈ nearest to q̈₀.

    With the demands A q̈ ≤ c of the rows, of all q̈ in the box |q̈| ≤ q̈_max (level 0, always met)

    1. those with the least ‖W max(0, A q̈ − c)‖;
    2. of these, those with the least ‖J q̈ − b‖;
    3. of these, the one with the least ‖q̈ − q̈₀‖, q̈₀ being the task's ``rest``.

    Where no row is active, the command is that of :class:`Tracking`, bit by bit. If rows contradict
    each other, the status is ``relaxed``, and the command lists the unmet demands and their
    violation. Level 1 measures every demand in the unit of its φ per second; ``weights`` change how
    rows of different kinds share a violation. Raises ConfigurationError if an option is invalid, or
    the solver is unknown or not installed.

    Parameters
    ----------
    rows
        Demands of the rows: ``"barrier"``, L_fφ + L_gφ q̈ ≤ −αφ for every row, or ``"active"``,
        L_gφ q̈ ≤ −u⁺ for the rows with φ ≥ 0 only, which is eq. (15) with inequalities.
    """

    name = "hierarchical-qp"

    def __init__(
        self,
        *,
        rows: Literal["barrier", "active"] = "barrier",
        alpha: float = 20.0,
        margin: float = 0.0,
        solver: str = AUTO,
        weights: Mapping[str, float] | None = None,
        max_acceleration: float | None = None,
        damping: float = 1e-8,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        demand = _demand(rows, alpha, {"margin": margin})
        self._alpha = alpha
        options: dict[str, Any] = {
            "solver": solver,
            "weights": weights,
            "max_acceleration": max_acceleration,
        }
        super().__init__(
            demand, Hierarchy(damping=damping, rank_tolerance=rank_tolerance, **options)
        )

    @property
    def rows(self) -> str:
        """Form of the demands: ``"barrier"`` or ``"active"``."""
        return "active" if isinstance(self.demand, Switch) else "barrier"

    @rows.setter
    def rows(self, rows: Any) -> None:
        self.demand = _demand(rows, self._alpha, self.demand.common)

    @property
    def alpha(self) -> float:
        """Rate α of the barrier [1/s]."""
        return self._alpha

    @alpha.setter
    def alpha(self, alpha: float) -> None:
        self.demand = _demand(self.rows, alpha, self.demand.common)
        self._alpha = Barrier(alpha).alpha


def _demand(rows: object, alpha: float, common: Mapping[str, Any]) -> Demand:
    forms: dict[str, Demand] = {"barrier": Barrier(alpha, **common), "active": Switch(**common)}
    return one_of("form of rows", rows, forms)


class Pair(Law):
    """Any demand with any resolver, by their names; by default those of the paper.

    ``options`` are the parameters of the demand and the options of the resolver, see
    :data:`.DEMANDS` and :data:`.RESOLVERS`.
    """

    def __init__(
        self, *, demand: str = "switch", resolver: str = "priority", **options: Any
    ) -> None:
        asks = one_of("demand", demand, {part.name: part for part in DEMANDS})
        shares = one_of("resolver", resolver, {part.name: part for part in RESOLVERS})
        super().__init__(*split_options(self.name, (asks, shares), options))


class Named(Law):
    """Pair of a demand and a resolver with a name; :func:`named` creates one."""

    parts: ClassVar[tuple[type[Demand], type[Resolver]]]
    defaults: ClassVar[Mapping[str, Any]]

    def __init__(self, **options: Any) -> None:
        super().__init__(*split_options(self.name, self.parts, {**self.defaults, **options}))

    def __reduce__(self) -> tuple[Any, ...]:
        return _without_state, (self.name,), self.__getstate__()


def named(
    name: str,
    demand: type[Demand],
    resolver: type[Resolver],
    line: str,
    factors: RowFactors = AS_THEY_ARE,
    **defaults: Any,
) -> type[Named]:
    """Create the class of a named law; its constructor takes the options of both parts.

    ``line`` is its docstring. ``defaults`` are options that differ from those of the parts,
    ``factors`` are those of the rows.
    """
    options = [
        inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=defaults.get(key, default))
        for key, default in options_of(demand, resolver).items()
    ]
    body = {
        "name": name,
        "parts": (demand, resolver),
        "defaults": defaults,
        "factors": factors,
        "__doc__": line,
    }
    return type(name, (Named,), {**body, "__signature__": inspect.Signature(options)})


def options_of(*parts: type[Demand] | type[Resolver]) -> dict[str, Any]:
    """Return the options of a demand and a resolver with their defaults.

    Keyword-only options are the last ones.
    """
    every = [field for part in parts for field in fields(part)]
    return {
        field.name: field.default
        for field in sorted(every, key=lambda field: field.kw_only is True)
    }


def split_options(
    law: str, parts: tuple[type[Demand], type[Resolver]], options: Mapping[str, Any]
) -> tuple[Demand, Resolver]:
    """Create a demand and a resolver from one set of options.

    Each gets the options that it declares. Raises ConfigurationError, with the candidates, if an
    option belongs to none of them.
    """
    demand, resolver = parts
    known = options_of(demand, resolver)
    own = options_of(demand)
    for key in options:
        if key not in known:
            raise unknown_name(f"option of {law}", key, known)
    return (
        demand(**{key: value for key, value in options.items() if key in own}),
        resolver(**{key: value for key, value in options.items() if key not in own}),
    )


def _without_state(name: str) -> Named:
    law = next(law for law in NAMED if law.name == name)
    return law.__new__(law)


#: Named pairs; other named laws are classes.
NAMED: tuple[type[Named], ...] = (
    named("sliding-mode-ahead", Switch, Priority,
          "The paper's law, with speeds judged one period ahead: before tracking takes them "
          "beyond.", ahead=True),
    named("implicit-switch", demands.ImplicitSwitch, Hierarchy,
          "The paper's switch without its chattering: solved for the end of the period, with "
          "strict priorities.",
          periods=5.0),
    named("implicit-switch-with-drift", demands.ImplicitSwitchWithDrift, Hierarchy,
          "The implicit switch, less the drift that was seen a sample ago.", periods=5.0),
    named("boundary-layer", demands.BoundaryLayer, Priority,
          "Sliding mode with a boundary layer, laid inside (the potential field with priority)."),
    named("super-twisting", demands.SuperTwisting, Priority,
          "Sliding mode of second order, which learns the drift."),
    named("implicit-super-twisting", demands.ImplicitSuperTwisting, Hierarchy,
          "Sliding mode of second order by the proper implicit Euler method, with strict "
          "priorities."),
    named("robust-hierarchical-qp", Barrier, Hierarchy,
          "The hierarchical QP for noise, delay and wrong models: rows act early, from a margin "
          "on.",
          RowFactors(K=3.0), alpha=12.0, margin=0.06),
    named("cbf-filter", Barrier, Filter,
          "The safety filter of control barrier functions: the command nearest to tracking that "
          "meets the barrier."),
)  # fmt: skip
