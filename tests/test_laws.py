"""Laws as demands and resolvers: one contract for every pair of them, and which of them are the
same.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from vsconstraints.compiled import load
from vsconstraints.controllers import (
    DEMANDS,
    NAMED,
    RESOLVERS,
    Additive,
    Barrier,
    BoundaryLayer,
    Controller,
    Demand,
    Filter,
    HierarchicalQP,
    Hierarchy,
    ImplicitSwitch,
    Law,
    Pair,
    PotentialField,
    Priority,
    RampRepulsion,
    Saturation,
    SlidingMode,
    Switch,
    Tracking,
    make_controller,
)
from vsconstraints.controllers.base import restart
from vsconstraints.controllers.demands import ImplicitSwitchWithDrift, Nothing
from vsconstraints.controllers.ranges import ROWS
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas import formula, where
from vsconstraints.formulas.row import Row
from vsconstraints.rows import Array, Command, Rows, Task

compiled = pytest.mark.skipif(load("laws") is None, reason="there is no compiler")


@formula
def not_faster(row: Row) -> Any:
    """−u⁺ where φ is at least what it was, nothing at first; what φ is."""
    return where(row.phi >= row.memory[0], -row.switching_gain, np.inf), row.phi


@dataclass(frozen=True)
class NotFaster(Demand):
    """Rows that come nearer brake."""

    name = "not-faster"
    formula = not_faster
    remembers: ClassVar[tuple[float, ...]] = (np.inf,)


@formula
def high_order(row: Row, alpha: float) -> Any:
    """K times the bound on σ̈ of the barrier function h = −σ with the rates 1/K and α, and then σ̇
    of φ̇ = σ̇ + K σ̈.
    """
    second = -alpha * (row.sigma_dot + row.sigma / row.K) - row.sigma_dot / row.K
    return row.K * second + row.sigma_dot - row.Lf


@dataclass(frozen=True)
class HighOrder(Demand):
    """A control barrier function of second order, from σ and σ̇."""

    alpha: float = 20.0

    name = "high-order"
    formula = high_order
    uses: ClassVar[tuple[str, ...]] = ("sigma", "sigma_dot", "K", "Lf")


ASKING = (*(demand() for demand in DEMANDS), RampRepulsion(exponent=2.0), NotFaster(), HighOrder())
"""Every registered demand, and own ones."""

SHARING = (*(resolver() for resolver in RESOLVERS), Filter(metric="task"), Saturation(scales=False))
"""Every registered resolver, and with other options."""

PAIRS = [pytest.param(d, r, id=f"{d.name}-{r.name}") for d in ASKING for r in SHARING]
EACH = [
    pair
    for pair in PAIRS
    if pair.id.startswith(("switch-", "barrier-")) or pair.id.endswith("-hierarchy")
]
"""Every demand and every resolver, for what does not depend on both together."""


def problem(seed: int, m: int = 5, n: int = 6, k: int = 6) -> tuple[Rows, Task]:
    rng = np.random.default_rng(seed)
    sigma = rng.normal(-0.5, 0.5, m)
    sigma_dot = rng.normal(0.0, 0.3, m)
    K = rng.uniform(0.2, 1.0, m)
    rows = Rows(
        sigma + K * sigma_dot,
        rng.normal(size=(m, n)),
        rng.normal(size=m),
        rng.uniform(0.5, 3.0, m),
        tuple(f"row[{i}]" for i in range(m)),
        rng.uniform(0.5, 1.5, m),
        sigma,
        sigma_dot,
        K,
    )
    return rows, Task(rng.normal(size=(k, n)), rng.normal(size=k), 0.2 * rng.normal(size=k))


def made(demand: Demand, resolver: Any) -> Law:
    law = Law(demand, resolver)
    law.reset(period=0.01)
    return law


FORMS = ("define", pytest.param("command", marks=compiled))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("factor", [1e-60, 1e-6, 1e6, 1e60])
@pytest.mark.parametrize("demand", ASKING, ids=lambda demand: demand.name)
def test_the_units_of_rows_change_no_law(demand: Demand, factor: float, form: str) -> None:
    for seed in range(6):
        rows, task = problem(seed, m=1 + seed % 5, k=1 + seed)
        lengths = ("phi", "Lg", "Lf", "switching_gain", "scale", "sigma", "sigma_dot")
        other = replace(rows, **{name: factor * getattr(rows, name) for name in lengths})
        expected, found = (
            getattr(made(demand, Hierarchy()), form)(asked, task) for asked in (rows, other)
        )
        assert found.status == expected.status, (seed, found.reason)
        np.testing.assert_allclose(found.qdd, expected.qdd, rtol=1e-6, atol=1e-9)
        assert found.active == expected.active


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("resolver", SHARING, ids=lambda resolver: resolver.name)
@pytest.mark.parametrize(
    "demand", [Switch(), Barrier(), RampRepulsion()], ids=lambda demand: demand.name
)
def test_rows_in_other_units_than_their_scale_are_refused_by_name(
    demand: Demand, resolver: Any, form: str
) -> None:
    """φ of 1e60 times the allowed range: no answer could be checked; and a φ that is as far inside
    harms nobody.
    """
    rows, task = problem(3)
    phi = np.array([-1.0, 1.0, -1.0, -1.0, 1.0])
    law = made(demand, resolver)
    with pytest.raises(
        InvalidInput,
        match=r"more than 1e\+30 times its scale, too large for any law: row\[1\] \(φ = 1\.0e\+60, scale .*row\[4\]",
    ):
        getattr(law, form)(replace(rows, phi=1e60 * phi), task)
    assert getattr(law, form)(replace(rows, phi=np.full(5, -1e60)), task).status in (
        "ok",
        "relaxed",
        "rank-loss",
    )


@compiled
@pytest.mark.parametrize(("demand", "resolver"), PAIRS)
def test_every_law_answers_alike_with_its_formula_in_numpy(demand: Demand, resolver: Any) -> None:
    answered = 0
    one = made(demand, resolver)
    other = made(demand, resolver)
    for seed in range(20):
        rows, task = problem(seed, k=6 if seed % 2 else 3)
        if seed % 4 < 2:
            task.rest = np.random.default_rng(seed).normal(size=6)
        expected = one.define(rows, task)
        found = other.compute(rows, task)
        assert np.isfinite(expected.qdd).all()
        if found is None:
            other.define(rows, task)
            assert expected.status in ("rank-loss", "failed")
            continue
        answered += 1
        assert found.status == expected.status
        scale = 1.0 + np.linalg.norm(expected.qdd)
        np.testing.assert_allclose(found.qdd, expected.qdd, rtol=0.0, atol=1e-9 * scale)
        # what is learnt from the command of the last sample has its rounding
        rounding = 1e-9 * scale if "last_rate" in demand.uses else 0.0
        np.testing.assert_allclose(one.memory, other.memory, rtol=0.0, atol=rounding)
    assert answered >= 15


@pytest.mark.parametrize(("demand", "resolver"), EACH)
def test_every_law_refuses_what_is_not_finite(demand: Demand, resolver: Any) -> None:
    rows, task = problem(0)
    law = made(demand, resolver)
    with pytest.raises(InvalidInput, match=r"rows\.phi is not finite for row\[4\]"):
        law.command(replace(rows, phi=np.array([0.0, 0.0, 0.0, 0.0, np.nan])), task)
    with pytest.raises(InvalidInput, match=r"task\.b is not finite in row 2"):
        law.command(rows, replace(task, b=np.array([0.0, 0.0, np.inf, 0.0, 0.0, 0.0])))


@pytest.mark.parametrize(("demand", "resolver"), EACH)
def test_every_law_tracks_without_rows(demand: Demand, resolver: Any) -> None:
    _, task = problem(0)
    none = Rows.none(6)
    bare = replace(none, sigma=none.phi, sigma_dot=none.phi, K=none.phi)
    expected = Tracking().define(none, task).qdd
    law = made(demand, resolver)
    for form in (law.define, law.command, law.define):
        np.testing.assert_allclose(form(bare, task).qdd, expected, rtol=1e-9, atol=1e-12)


def same(one: Controller, other: Controller, seeds: int = 20) -> None:
    for seed in range(seeds):
        rows, task = problem(seed)
        for form in ("command", "define"):
            mine = getattr(one, form)(rows, task)
            theirs = getattr(other, form)(rows, task)
            assert (mine.status, mine.active) == (theirs.status, theirs.active)
            np.testing.assert_array_equal(mine.qdd, theirs.qdd)


def test_named_laws_are_pairs() -> None:
    same(SlidingMode(), Law(Switch(), Priority()))
    same(PotentialField(region=0.3), Law(RampRepulsion(0.3), Additive()))
    same(PotentialField(blend="priority", region=0.3), Law(BoundaryLayer(0.3), Priority()))
    same(HierarchicalQP(), Law(Barrier(), Hierarchy()))
    same(HierarchicalQP(rows="active"), Law(Switch(), Hierarchy()))
    same(Tracking(), Law(Nothing(), Hierarchy()))


def test_laws_by_name_are_pairs_too() -> None:
    layer = make_controller("boundary-layer", {"region": 0.3})
    same(layer, PotentialField(blend="priority", region=0.3))
    same(make_controller("law"), SlidingMode())
    same(
        make_controller("law", {"demand": "barrier", "resolver": "hierarchy", "alpha": 7.0}),
        HierarchicalQP(alpha=7.0),
    )
    options = {
        "demand": "implicit-switch",
        "resolver": "hierarchy",
        "periods": 5,
        "max_acceleration": 2.0,
    }
    named = make_controller("implicit-switch", {"max_acceleration": 2.0})
    pair = make_controller("law", options)
    for law in (named, pair):
        restart(law, 0.01)
    same(named, pair)
    assert (named.periods, named.uses, pair.uses) == (5.0, ("T_s",), ("T_s",))  # type: ignore[attr-defined]
    assert repr(layer).startswith(
        "boundary-layer(region=0.3, exponent=1.0, strength=1.0, rank_tolerance="
    )
    assert repr(Pair(demand="nothing")).startswith(
        "Pair(demand=Nothing(ahead=False, margin=0.0), resolver=Priority("
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"demand": "barier"}, "unknown demand 'barier'. Did you mean 'barrier'"),
        ({"demand": None}, "unknown demand None. Available: .*barrier"),
        ({"resolver": "Filter"}, "unknown resolver 'Filter'. Did you mean 'filter'"),
        ({"demand": "barrier", "alfa": 1.0}, "unknown option of law 'alfa'. Did you mean 'alpha'"),
        (
            {"demand": "switch", "alpha": 1.0},
            "unknown option of law 'alpha'. Did you mean 'ahead'\\? Available: ahead, margin, "
            "rank_tolerance",
        ),
        ({"demand": "barrier", "alpha": -1.0}, "alpha must be a positive, finite number, not -1.0"),
        (
            {"demand": "implicit-switch", "periods": 0.5},
            "periods of implicit-switch must be at least 1, not 0.5",
        ),
    ],
)
def test_pairs_that_are_none_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        make_controller("law", options)


def test_named_laws_go_to_another_process() -> None:
    for kind in NAMED:
        law = kind()
        law.reset(period=0.01)
        copy = pickle.loads(pickle.dumps(law))
        assert (type(copy), copy.period, repr(copy)) == (kind, 0.01, repr(law))


def test_no_demand_and_no_resolver_share_a_name_for_an_option() -> None:
    """They stand flat beside each other, and beside what a law has."""
    of_demands = {field.name for demand in DEMANDS for field in fields(demand)}
    of_resolvers = {field.name for resolver in RESOLVERS for field in fields(resolver)}
    of_laws = {"demand", "resolver", "type", *vars(Law(Switch(), Priority())), *dir(Law)}
    assert not of_demands & of_resolvers
    assert not (of_demands | of_resolvers) & of_laws
    assert len({part.name for part in (*DEMANDS, *RESOLVERS)}) == len(DEMANDS) + len(RESOLVERS)


def test_an_option_that_is_set_makes_the_pair_anew() -> None:
    field = PotentialField()
    field.blend = "priority"
    field.exponent = 2
    same(field, PotentialField(blend="priority", exponent=2.0), 5)
    law = HierarchicalQP(alpha=3.0)
    law.rows = "active"
    same(law, HierarchicalQP(rows="active"), 5)
    law.rows = "barrier"
    same(law, HierarchicalQP(alpha=3.0), 5)
    assert repr(law).startswith("HierarchicalQP(rows='barrier', alpha=3.0")


def test_a_barrier_is_one_of_second_order_on_sigma() -> None:
    for seed in range(20):
        rows, task = problem(seed)
        # σ̈ when q̈ = 0 cancels in both: L_fφ is σ̇ + K σ̈
        ours, theirs = (
            made(demand, Hierarchy()).define(rows, task) for demand in (Barrier(), HighOrder())
        )
        np.testing.assert_allclose(ours.qdd, theirs.qdd, atol=1e-7 * (1.0 + np.abs(ours.qdd).max()))


@pytest.mark.parametrize("form", ["command", "define"])
def test_the_filter_is_the_nearest_command_that_meets_the_demands(form: str) -> None:
    cp = pytest.importorskip("cvxpy")
    for seed in range(10):
        rows, task = problem(seed, m=4, k=4)
        free = Tracking().command(rows, task).qdd
        x = cp.Variable(6)
        bound = -20.0 * rows.phi - rows.Lf
        cp.Problem(cp.Minimize(cp.sum_squares(x - free)), [rows.Lg @ x <= bound]).solve(
            solver="CLARABEL"
        )
        found = getattr(Law(Barrier(), Filter()), form)(rows, task)
        assert found.status == "ok"
        np.testing.assert_allclose(found.qdd, x.value, atol=1e-5 * (1.0 + np.abs(free).max()))


@pytest.mark.parametrize("form", ["command", "define"])
def test_a_demand_remembers(form: str) -> None:
    rows, task = problem(3, m=2)
    law = Law(NotFaster(), Priority())
    free = getattr(Tracking(), form)(rows, task)
    command = getattr(law, form)

    def acted(*phi: float) -> list[bool]:
        answer: Command = command(replace(rows, phi=np.array(phi)), task)
        return answer.acted.tolist()

    np.testing.assert_array_equal(
        command(replace(rows, phi=np.array([-1.0, -1.0])), task).qdd, free.qdd
    )
    tracked = rows.Lg @ free.qdd
    brakes = (tracked > -rows.switching_gain).tolist()
    assert acted(-0.9, -1.1) == [brakes[0], False]
    assert acted(-0.95, -1.0) == [False, brakes[1]]
    np.testing.assert_array_equal(law.memory, [[-0.95], [-1.0]])
    # what it remembers goes along, but no address
    assert pickle.loads(pickle.dumps(law)).memory.tolist() == law.memory.tolist()
    law.reset()
    assert acted(5.0, 5.0) == [False, False]


def test_a_law_says_what_it_lacks_before_anything_moves() -> None:
    rows, task = problem(0)
    law = Law(ImplicitSwitch(), Priority())
    with pytest.raises(
        InvalidInput, match="'implicit-switch' uses the sampling period: call reset"
    ):
        law.command(rows, task)
    refused: list[Any] = [0.0, float("nan"), float("inf"), "0.002", True, [0.01]]
    for period in refused:
        with pytest.raises(InvalidInput, match="positive number of seconds, not "):
            law.reset(period=period)
    assert law.period is None
    restart(law, 0.01)
    assert law.command(rows, task).status in ("ok", "rank-loss")
    bare = Rows(rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.labels)
    with pytest.raises(
        InvalidInput, match=r"'high-order' uses rows\.sigma, rows\.sigma_dot, rows\.K, which these"
    ):
        Law(HighOrder(), Filter()).command(bare, task)
    assert (law.uses, Law(NotFaster(), Priority()).uses) == (("T_s",), ("memory",))


@compiled
@pytest.mark.parametrize(
    ("demand", "resolver"),
    [pair for pair in PAIRS if pair.values[0].remembers],  # type: ignore[union-attr]
)
def test_a_reset_forgets_all_that_was_learnt(demand: Demand, resolver: Any) -> None:
    """Of rows that move on: what is answered first, after others, is answered again after a reset,
    and not before.
    """
    rows, task = problem(5)
    near = [
        replace(rows, phi=0.01 * rows.phi + 0.002 * k * rows.switching_gain) for k in (3, 0, 2, 1)
    ]
    for form in ("define", "command"):
        law = made(demand, resolver)

        def answers(form: str = form, law: Law = law) -> list[Array]:
            return [getattr(law, form)(one, task).qdd.copy() for one in near]

        first = answers()
        then = answers()
        law.reset()
        np.testing.assert_array_equal(answers(), first)
        assert any((one != other).any() for one, other in zip(first, then, strict=True))


@pytest.mark.parametrize("form", ["command", "define"])
def test_what_is_remembered_is_not_taken_for_that_of_other_rows(form: str) -> None:
    rows, task = problem(0)
    other = replace(rows, labels=("x", *rows.labels[1:]))
    for demand in (ImplicitSwitchWithDrift(), NotFaster()):
        law = made(demand, Priority())
        answer = getattr(law, form)
        answer(rows, task)
        for those in (other, Rows.none(6)):
            with pytest.raises(
                InvalidInput,
                match=rf"'{demand.name}' keeps the state of other rows, \('row\[0\]', .*reset\(\)",
            ):
                answer(those, task)
        law.reset()
        assert answer(other, task).labels == other.labels
    # laws that remember nothing take any
    law = made(Switch(), Priority())
    for those in (rows, other, Rows.none(6)):
        assert getattr(law, form)(those, task).labels == those.labels


@pytest.mark.parametrize("form", ["command", "define"])
def test_what_remembers_needs_no_row(form: str) -> None:
    _, task = problem(0)
    command = getattr(Law(NotFaster(), Priority()), form)(Rows.none(6), task)
    np.testing.assert_allclose(task.J @ command.qdd, task.b, atol=1e-9)


def test_a_controller_of_ones_own_is_reset_as_it_likes() -> None:
    class Old(Controller):
        name = "old"
        count = 0

        def solve(self, rows: Rows, task: Task) -> Command:
            raise AssertionError

        def reset(self) -> None:  # type: ignore[override]
            self.count += 1

    law = Old()
    restart(law, 0.01)
    assert law.count == 1


def test_parts_that_are_none_are_refused() -> None:
    nonsense: Any = 3
    with pytest.raises(ConfigurationError, match="a law needs a Demand, not 3"):
        Law(nonsense, Priority())
    with pytest.raises(ConfigurationError, match="a law needs a Resolver, not 3"):
        Law(Switch(), nonsense)
    with pytest.raises(InvalidInput, match="periods of implicit-switch must be positive, not 0"):
        ImplicitSwitch(periods=0)


def strange(row: Row) -> Any:
    """−u⁺ by what numba does not know."""
    return np.vectorize(lambda phi: -1.0 if phi >= 0.0 else np.inf)(row.phi)


@compiled
def test_a_formula_that_the_compiler_refuses_runs_in_numpy() -> None:
    @dataclass(frozen=True)
    class Strange(Demand):
        name = "strange"
        formula = strange
        everywhere: ClassVar[bool] = True

    rows, task = problem(1)
    rows = replace(rows, switching_gain=np.ones(5))
    law = Law(Strange(), Priority())
    with pytest.warns(
        RuntimeWarning, match=r"refuses a formula.*strange \(.*test_laws\.py, line \d+\).*in NumPy"
    ):
        found = law.command(rows, task)
    np.testing.assert_array_equal(found.qdd, SlidingMode().define(rows, task).qdd)


def test_demands_that_are_no_numbers_fail_by_name() -> None:
    @dataclass(frozen=True)
    class Never(Demand):
        name = "never"
        formula = lambda row: np.nan * row.phi  # noqa: E731

    rows, task = problem(1)
    command = Law(Never(), Hierarchy()).define(rows, task)
    assert (command.status, "'never' is not a number for row[0]" in command.reason) == (
        "failed",
        True,
    )


def ranges(demand: Demand) -> dict[str, Any]:
    return dict(demand.ranges)


@pytest.mark.parametrize("demand", [demand() for demand in DEMANDS], ids=lambda demand: demand.name)
def test_every_parameter_has_a_range_that_holds_its_default(demand: Demand) -> None:
    assert len({*ranges(demand)} - {*ROWS}) == len(demand.parameters)
    for name, (low, high, *_) in ranges(demand).items():
        assert low <= getattr(demand, name, 1.0) <= high  # factors on the scene's are 1 by default
