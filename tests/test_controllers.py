"""One contract for every registered controller and every file of the folder controllers, and what distinguishes each law."""

from __future__ import annotations

import faulthandler
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any, cast, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from folder_laws import EVERY_LAW, FOLDER_LAWS, make
from scenes import Straight
from vsconstraints import compiled
from vsconstraints.control import Model
from vsconstraints.controllers import (
    CONTROLLERS,
    DEMANDS,
    NAMED,
    RESOLVERS,
    VELOCITY_LAWS,
    Barrier,
    Controller,
    HierarchicalQP,
    Law,
    PotentialField,
    SlidingMode,
    Tracking,
    VelocityController,
    make_controller,
)
from vsconstraints.controllers.base import restart
from vsconstraints.errors import ConfigurationError, InvalidInput, SolverError
from vsconstraints.formulas.curves import superellipse
from vsconstraints.rows import Array, Command, Rows, Status, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

VARIANTS: dict[str, list[dict[str, Any]]] = {
    "sliding-mode": [{}],
    "potential-field": [
        {"blend": "additive"},
        {"blend": "additive", "exponent": 2.0, "strength": 3.0},
        {"blend": "priority"},
        {"blend": "priority", "region": 0.7, "exponent": 0.5},
    ],
    "hierarchical-qp": [
        {"rows": "barrier"},
        {"rows": "active"},
        {"rows": "barrier", "max_acceleration": 5.0},
    ],
    "tracking": [{}],
    "implicit-switch": [{}, {"periods": 1.0, "max_acceleration": 5.0}],
    "implicit-switch-with-drift": [{}],
    "boundary-layer": [{}],
    "sliding-mode-ahead": [{}],
    "robust-hierarchical-qp": [{}],
    "predictive": [{"horizon": 3}, {"horizon": 1, "block": 1}, {"horizon": 2, "block": 4}],
    "robust-predictive": [{"horizon": 3}],
    "super-twisting": [{}],
    "implicit-super-twisting": [{}],
    "cbf-filter": [{}],
    "law": [
        *({"demand": demand.name, "resolver": "hierarchy"} for demand in DEMANDS),
        *({"demand": "implicit-switch", "resolver": resolver.name} for resolver in RESOLVERS),
    ],
    "mppi": [{}, {"samples": 8, "horizon": 1, "block": 1}],
    "resolved-rate": [{}, {"gain_at_zero": 4.0, "gain": 0.4}],
    "resolved-rate-avoidance": [{}, {"avoids": "all"}],
    "velocity-qp": [{}, {"max_acceleration": 20.0}, {"solver": "daqp"}],
    "velocity-hierarchical-qp": [{}, {"max_acceleration": 20.0}],
    "velocity-damper": [{}],
    "goal-governor": [{}, {"demand": "switch"}],
    "barrier-governor": [{}, {"demand": "switch"}],
    "cautious": [{}],
    "gradual": [{}],
    "careful": [{}],
}
"""Options with which each registered controller and each of the folder controllers is put through the contract; all pairs: see
tests/test_laws.py.
"""

GOVERNORS = "goal-governor", "barrier-governor"
BARE = [name for name in EVERY_LAW if name not in GOVERNORS]
"""Controllers that need no scene, and so answer any rows and task; for governors see
tests/test_goal_governor.py.
"""

LAWS = [
    pytest.param(
        name, options, id="-".join([name, *(f"{key}={value}" for key, value in options.items())])
    )
    for name in BARE
    for options in VARIANTS.get(name, [{}])
]


@pytest.mark.parametrize("name", EVERY_LAW)
def test_every_registered_controller_has_variants(name: str) -> None:
    assert name in VARIANTS, (
        f"the controller {name!r} is registered in CONTROLLERS: list the options it is to be "
        f"tested with in VARIANTS"
    )


@pytest.mark.parametrize("name", GOVERNORS)
def test_governors_ask_for_a_model(name: str) -> None:
    for options in VARIANTS[name]:
        with pytest.raises(InvalidInput, match=rf"{name} uses a model: .*reset\(model="):
            make(name, options).command(*sound())


def ready(
    name: str, options: dict[str, Any] | None = None, given: tuple[Rows, Task] | None = None
) -> Controller:
    """The controller of that name, told the sampling period, and a model of what it is given if it
    uses one.
    """
    law = make(name, options)
    restart(
        law, 0.01, (lambda: cast(Model, Straight(*(given or sound())))) if name in BARE else None
    )
    return law


# --- problems ---


@dataclass(frozen=True)
class Size:
    """How a random problem is made: n joints, m rows, k task equations, and how large its numbers
    are.
    """

    seed: int
    n: int
    m: int
    k: int
    rows_scale: float = 1.0
    task_scale: float = 1.0
    singular: bool = False


def problem(size: Size) -> tuple[Rows, Task]:
    """Rows and task of random numbers; ``singular`` puts zeros, repetitions and opposites among
    them.
    """
    rng = np.random.default_rng(size.seed)
    n = size.n
    m = size.m
    k = size.k
    Lg = rng.normal(size=(m, n))
    J = rng.normal(size=(k, n))
    if size.singular:
        for i in range(m):
            Lg[i] = (Lg[i], np.zeros(n), Lg[i - 1], -Lg[i - 1], Lg[i] * 1e-9)[int(rng.integers(5))]
        for i in range(k):
            J[i] = (J[i], np.zeros(n), J[i - 1])[int(rng.integers(3))]
    sigma, sigma_dot, K = *rng.normal(size=(2, m)) * size.rows_scale, rng.uniform(0.1, 2.0, m)
    rows = Rows(
        phi=sigma + K * sigma_dot,
        Lg=Lg * size.rows_scale,
        Lf=rng.normal(size=m) * size.rows_scale,
        switching_gain=rng.uniform(0.1, 10.0, m) * size.rows_scale,
        labels=tuple(f"row[{i}]" for i in range(m)),
        scale=rng.uniform(0.1, 2.0, m) * size.rows_scale,
        sigma=sigma,
        sigma_dot=sigma_dot,
        K=K,
    )
    b, error, error_rate = rng.normal(size=(3, k)) * size.task_scale
    qd = rng.normal(size=n)
    return rows, Task(J * size.task_scale, b, error, error_rate, qd=qd)


sizes = st.builds(
    Size,
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 8),
    m=st.integers(0, 12),
    k=st.integers(0, 8),
    rows_scale=st.sampled_from([1.0, 1.0, 1e-6, 1e6]),
    task_scale=st.sampled_from([1.0, 1.0, 1e-6, 1e6]),
    singular=st.booleans(),
)


def far_inside(rows: Rows) -> Rows:
    """The same rows with φ so far below zero that none can act."""
    phi = -1e16 * np.maximum(1.0, rows.scale)
    return replace(rows, phi=phi, sigma=phi, sigma_dot=np.zeros(len(phi)))


# --- the contract ---


def assert_is_an_answer(command: Command, rows: Rows, task: Task) -> None:
    assert command.qdd.shape == (task.J.shape[1],)
    assert np.isfinite(command.qdd).all()
    assert command.status in get_args(Status)
    assert (command.status == "ok") == (command.reason == "")
    assert command.labels == rows.labels
    assert command.acted.shape == (len(rows.labels),)
    assert command.acted.dtype == np.bool_
    assert set(command.active) <= set(rows.labels)
    assert set(command.slacks) <= set(rows.labels)
    if command.status == "failed":
        np.testing.assert_array_equal(command.qdd, 0.0)


@pytest.mark.parametrize(("name", "options"), LAWS)
@given(size=sizes)
def test_any_finite_problem_has_a_finite_answer(
    name: str, options: dict[str, Any], size: Size
) -> None:
    rows, task = problem(size)
    command = ready(name, options, (rows, task)).command(rows, task)
    assert_is_an_answer(command, rows, task)
    if size.rows_scale == size.task_scale == 1.0 and not size.singular:
        assert command.status != "failed", command.reason


VELOCITY = [law.name for law in VELOCITY_LAWS]


@pytest.mark.parametrize(
    ("name", "options"),
    # laws of the folder may be random, and others command speeds
    [law for law in LAWS if law.values[0] not in (*FOLDER_LAWS, *VELOCITY)],
)
@given(size=sizes)
def test_rows_that_do_not_act_leave_the_tracking_command_as_it_is(
    name: str, options: dict[str, Any], size: Size
) -> None:
    """Bit by bit, so that differences between controllers in a report are differences between
    laws.
    """
    rows, task = problem(replace(size, rows_scale=1.0, task_scale=1.0))
    rows = far_inside(rows)
    expected = Tracking().command(rows, task).qdd
    limit = options.get("max_acceleration", np.inf)
    distant = options.get("rows") == "barrier" or name in ("law", *(law.name for law in NAMED))
    if np.abs(expected).max() > limit or (distant and np.abs(expected).max() > 1e6):
        return  # the box acts, or a singular task asks for more than even distant rows allow
    command = ready(name, options, (rows, task)).command(rows, task)
    assert command.status == "ok"
    assert command.active == ()
    np.testing.assert_array_equal(command.qdd, expected)
    without = ready(name, options, (Rows.none(size.n), task)).command(Rows.none(size.n), task)
    np.testing.assert_array_equal(without.qdd, expected)


@pytest.mark.parametrize(("name", "options"), LAWS)
@given(size=sizes)
def test_answers_are_repeatable_and_leave_the_question_alone(
    name: str, options: dict[str, Any], size: Size
) -> None:
    rows, task = problem(size)
    kept = [
        array.copy()
        for array in (rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.scale, task.J, task.b)
    ]
    law = ready(name, options, (rows, task))
    first = law.command(rows, task)
    law.reset()
    again = law.command(rows, task)
    np.testing.assert_array_equal(first.qdd, again.qdd)
    np.testing.assert_array_equal(first.acted, again.acted)
    assert first.status == again.status
    now = (rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.scale, task.J, task.b)
    for before, after in zip(kept, now, strict=True):
        np.testing.assert_array_equal(before, after)


def sound() -> tuple[Rows, Task]:
    rows, task = problem(Size(seed=1, n=6, m=3, k=6))
    return replace(rows, labels=("fov[marker 2]", "range[joint 6].upper", "sphere[tip]")), task


def with_entry(array: Array, value: float, at: int) -> Array:
    changed = array.copy()
    changed.reshape(len(changed), -1)[at, -1] = value
    return changed


@pytest.mark.parametrize(("name", "options"), LAWS)
def test_a_row_that_is_not_finite_is_named(name: str, options: dict[str, Any]) -> None:
    rows, task = sound()
    law = ready(name, options)
    for what, value in product(
        ("phi", "Lg", "Lf", "switching_gain", "scale"), (np.nan, np.inf, -np.inf)
    ):
        broken = replace(rows, **{what: with_entry(getattr(rows, what), value, 1)})
        with pytest.raises(
            InvalidInput, match=rf"rows\.{what} is not finite for range\[joint 6\]\.upper$"
        ):
            law.command(broken, task)


@pytest.mark.parametrize(("name", "options"), LAWS)
def test_a_task_that_is_not_finite_is_named(name: str, options: dict[str, Any]) -> None:
    rows, task = sound()
    law = ready(name, options)
    with pytest.raises(InvalidInput, match=r"task\.b is not finite in row 4"):
        law.command(rows, replace(task, b=with_entry(task.b, np.nan, 4)))
    with pytest.raises(InvalidInput, match=r"task\.J is not finite in row 2"):
        law.command(rows, replace(task, J=with_entry(task.J, np.inf, 2)))


@pytest.mark.parametrize("value", [0.0, -1.0])
@pytest.mark.parametrize("what", ["switching_gain", "scale"])
def test_gains_and_scales_must_be_positive(what: str, value: float) -> None:
    rows, task = sound()
    broken = replace(rows, **{what: with_entry(getattr(rows, what), value, 2)})
    with pytest.raises(InvalidInput, match=r"positive; they are not for sphere\[tip\]"):
        SlidingMode().command(broken, task)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"phi": np.zeros(2)}, r"rows\.phi has the shape \(2,\)"),
        ({"Lg": np.zeros((3, 5))}, r"rows\.Lg has the shape \(3, 5\).*\(3, 6\)"),
        ({"Lg": np.zeros((2, 6))}, r"rows\.Lg has the shape \(2, 6\)"),
        ({"Lf": np.zeros((3, 1))}, r"rows\.Lf has the shape"),
        ({"switching_gain": np.ones(4)}, r"rows\.switching_gain has the shape"),
        ({"scale": np.ones(1)}, r"rows\.scale has the shape"),
        ({"labels": ("a", "b")}, "with 2 labels"),
    ],
)
def test_rows_of_the_wrong_shape_are_refused(changes: dict[str, Any], words: str) -> None:
    rows, task = sound()
    for name in EVERY_LAW:
        with pytest.raises(InvalidInput, match=words):
            ready(name).command(replace(rows, **changes), task)


WRONG_TASKS = [
    (np.ones(6), np.ones(1)),
    (np.ones((2, 6)), np.ones(3)),
    (np.ones((2, 6)), np.ones((2, 1))),
]


@pytest.mark.parametrize(("J", "b"), WRONG_TASKS)
def test_tasks_of_the_wrong_shape_are_refused(J: Array, b: Array) -> None:
    rows, _ = sound()
    for name in EVERY_LAW:
        with pytest.raises(InvalidInput, match=r"task\.J must be \(k, n\) and task\.b \(k,\)"):
            ready(name).command(rows, Task(J, b))


@pytest.mark.parametrize(("name", "options"), LAWS)
@pytest.mark.parametrize("size", [1.7e308, 1e200])
def test_finite_numbers_whose_products_are_not_end_in_time(
    name: str, options: dict[str, Any], size: float
) -> None:
    """LAPACK never returns from a matrix that holds an infinity; an alarm is all that ends it."""
    ready(name, options).command(*sound())  # compiling is not what is timed
    for what in ("J", "b", "Lg", "Lf", "phi", "switching_gain"):
        rows, task = problem(Size(seed=2, n=6, m=3, k=6))
        rows = with_active(rows, 3)
        huge = size * np.where(np.arange(18).reshape(3, 6) % 2 == 0, 1.0, -1.0)
        whole = {"J": np.tile(huge, (2, 1)), "b": np.full(6, size), "Lg": huge}.get(
            what, np.full(3, size)
        )
        rows = replace(rows, **{what: whole}) if hasattr(rows, what) else rows
        rows = replace(rows, scale=whole) if what == "phi" else rows  # else it is refused
        task = replace(task, **{what: whole}) if hasattr(task, what) else task
        law = ready(name, options, (rows, task))
        for answer in (law.command, law.define):
            with ends_within(60.0):
                command = answer(rows, task)
            assert_is_an_answer(command, rows, task)


@pytest.mark.parametrize(
    "law", [SlidingMode(), PotentialField(blend="priority")], ids=lambda law: law.name
)
def test_what_the_null_space_makes_infinite_is_not_decomposed(law: Controller) -> None:
    """Of these J, with entries of 1.7e308 among usual ones, the 34th kept LAPACK for ever with
    OpenBLAS 0.3.
    """
    law.command(*sound())  # compiling is not what is timed
    with ends_within(60.0):
        for seed in range(60):
            rng = np.random.default_rng(seed)
            n = int(rng.integers(2, 8))
            k = int(rng.integers(1, 8))
            m = int(rng.integers(1, n))
            J = rng.normal(size=(k, n))
            huge = rng.random((k, n)) < rng.choice((0.1, 0.5, 1.0))
            J[huge] = 1.7e308 * rng.choice((1.0, 1.0, -1.0), huge.sum())
            Lg = (
                np.eye(n)[:m] + 0.3 * np.abs(rng.normal(size=(m, n)))
                if rng.random() >= 0.5
                else rng.normal(size=(m, n))
            )
            rows = Rows(
                np.ones(m), Lg, np.zeros(m), np.ones(m), tuple(f"row[{i}]" for i in range(m))
            )
            for answer in (law.command, law.define):
                assert_is_an_answer(answer(rows, Task(J, np.ones(k))), rows, Task(J, np.ones(k)))


@contextmanager
def ends_within(seconds: float) -> Iterator[None]:
    """Kill the process if this takes longer: nothing else stops a loop in a library."""
    faulthandler.dump_traceback_later(seconds, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


@pytest.mark.parametrize(("name", "options"), LAWS)
def test_without_joints_there_is_nothing_to_command(name: str, options: dict[str, Any]) -> None:
    law = ready(name, options)
    for rows in (Rows.none(0), replace(sound()[0], Lg=np.empty((3, 0)))):
        for k in (0, 2):
            with pytest.raises(InvalidInput, match=r"task\.J has no column: there is no joint"):
                law.command(rows, Task(np.empty((k, 0)), np.zeros(k)))


NO_ARRAYS: list[Any] = [
    None, 1.0, "phi", [1.0, 2.0, 3.0], np.zeros(3, dtype=complex), np.zeros(3, dtype=object), np.zeros(3, dtype=int),
    np.zeros(3, dtype=np.float32), np.array(1.0),
    np.eye(3).view(np.matrix),
]  # fmt: skip


@pytest.mark.parametrize(("name", "options"), LAWS)
def test_what_is_no_array_of_floats_is_refused(name: str, options: dict[str, Any]) -> None:
    rows, task = sound()
    law = ready(name, options)
    for what, value in product(("phi", "Lg", "Lf", "switching_gain", "J", "b"), NO_ARRAYS):
        changed = {what: value}
        pair = (
            (rows, replace(task, **changed))
            if what in ("J", "b")
            else (replace(rows, **changed), task)
        )
        with pytest.raises(InvalidInput, match=what):
            law.command(*pair)


@pytest.mark.parametrize("what", ["sigma", "sigma_dot", "K"])
def test_what_rows_need_not_say_is_nothing_or_an_array_of_floats(what: str) -> None:
    rows, task = sound()
    assert Tracking().define(replace(rows, **{what: np.empty(0)}), task).status == "ok"
    for value in NO_ARRAYS:
        with pytest.raises(InvalidInput, match=rf"rows\.{what}"):
            Tracking().define(replace(rows, **{what: value}), task)


@pytest.mark.parametrize("name", EVERY_LAW)
def test_what_is_no_rows_and_no_task_is_refused(name: str) -> None:
    rows, task = sound()
    law: Any = ready(name)
    for pair in ((None, task), (rows, None), (task, rows), (rows, (task.J, task.b))):
        with pytest.raises(InvalidInput, match="Rows and a Task"):
            law.command(*pair)
    for labels in ((1, 2, 3), (None, None, None)):
        broken = replace(rows, labels=labels, phi=np.full(3, np.nan))
        with pytest.raises(InvalidInput, match="tuple of names"):
            law.command(broken, task)
    for scale in (None, 1.0, np.array(1.0)):
        with pytest.raises(InvalidInput, match="array of scales"):
            replace(rows, scale=scale)


def test_rows_without_a_scale_have_ones() -> None:
    rows, _ = sound()
    plain = Rows(rows.phi, rows.Lg, rows.Lf, rows.switching_gain, rows.labels)
    np.testing.assert_array_equal(plain.scale, np.ones(3))
    assert Rows.none(4).Lg.shape == (0, 4)


# --- own controllers ---


class Own(Controller):
    """A controller whose answer or failure a test decides."""

    name = "own"

    def __init__(self, answer: object) -> None:
        self.answer = answer

    def solve(self, rows: Rows, task: Task) -> Command:
        if isinstance(self.answer, Exception):
            raise self.answer
        return Command(
            np.asarray(self.answer), "ok", np.ones(len(rows.labels), dtype=np.bool_), rows.labels
        )


class Says(Controller):
    """A controller that answers anything."""

    name = "says"

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def solve(self, rows: Rows, task: Task) -> Command:
        answer: Command = self.answer
        return answer


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (np.full(6, np.nan), "not finite"),
        (np.array([0, 0, 0, 0, 0, np.inf]), "not finite"),
        (np.linalg.LinAlgError("SVD did not converge"), "LinAlgError: SVD did not converge"),
        (SolverError("no solver agrees"), "SolverError: no solver agrees"),
    ],
)
def test_a_law_that_goes_wrong_fails_with_its_reason_and_rests(answer: object, words: str) -> None:
    rows, task = sound()
    command = Own(answer).command(rows, task)
    assert command.status == "failed"
    assert words in command.reason
    assert command.active == ()
    np.testing.assert_array_equal(command.qdd, np.zeros(6))
    assert_is_an_answer(command, rows, task)


@pytest.mark.parametrize(
    "slack", [np.full(3, np.inf), np.full(3, np.nan), np.zeros(2), [0.0, 0.0, 0.0]]
)
def test_slack_that_is_none_is_a_failure(slack: Any) -> None:
    rows, task = sound()
    given = replace(SlidingMode().command(rows, task), slack=slack)
    command = Says(given).command(rows, task)
    assert command.status == "failed"
    assert command.reason.startswith("slack must be None or 3 finite numbers, not ")


def test_a_demand_beyond_floating_point_is_no_slack() -> None:
    rows, task = sound()
    rows = replace(
        rows, phi=np.array([1e300, -1.0, -1.0]), Lg=np.zeros((3, 6)), scale=np.full(3, 1e300)
    )
    command = HierarchicalQP(alpha=1e100).command(rows, task)
    assert (command.status, "finite numbers" in command.reason) == ("failed", True)


def test_a_law_that_answers_is_believed() -> None:
    rows, task = sound()
    command = Own(np.arange(6.0)).command(rows, task)
    assert (command.status, command.active) == ("ok", rows.labels)
    np.testing.assert_array_equal(command.qdd, np.arange(6.0))


def test_a_slip_in_an_own_law_is_not_hidden() -> None:
    rows, task = sound()
    with pytest.raises(KeyError):
        Own(KeyError("typo")).command(rows, task)


# --- by name ---


def test_controllers_are_made_by_name() -> None:
    assert isinstance(make_controller("sliding-mode"), SlidingMode)
    field = make_controller("potential-field", {"blend": "priority", "region": 0.3})
    assert isinstance(field, PotentialField)
    assert (field.blend, field.region) == ("priority", 0.3)
    assert {law.name for law in CONTROLLERS.values()} == set(CONTROLLERS)


#: Modules that compile in less than a second.
SMALL = {
    "compiler",
    "parts",
    "observer",
    "delay",
    "from_state",
    "follower",
    "vsconstraints.prediction.kernels.plan_arrays",
    "vsconstraints.prediction.kernels.predictive_arrays",
}


@pytest.mark.parametrize(
    "law",
    [*CONTROLLERS.values(), *(partial(Law, Barrier(), each()) for each in RESOLVERS)],
    ids=lambda law: str(law()),
)
def test_laws_name_what_takes_long_to_compile(
    law: Callable[[], Controller], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, "loaded", {})
    made = law()
    scenario = Scenario.load("example-2d-fov").with_override("duration", 0.05)
    if isinstance(made, VelocityController):
        scenario = scenario.with_override("arm", {"command": "velocity", "lag": 0.02})
    simulate(scenario.setup(), made)
    assert {*compiled.loaded} - {*compiled.MODULES} - SMALL == {*made.kernels} - {*compiled.MODULES}


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("sliding", {}, "unknown controller 'sliding'. Did you mean 'sliding-mode'"),
        (
            "sliding-mode",
            {"rank_tol": 1e-3},
            "option of sliding-mode 'rank_tol'. Did you mean 'rank_tolerance'",
        ),
        ("potential-field", {"blend": "add"}, "unknown blend 'add'.*additive, priority"),
        ("potential-field", {"region": 0.0}, "region of a potential field must be positive"),
        ("potential-field", {"region": np.nan}, "region of a potential field must be positive"),
        ("potential-field", {"exponent": -1.0}, "exponent of a potential field must be positive"),
        ("potential-field", {"strength": np.inf}, "strength of a potential field must be positive"),
        ("hierarchical-qp", {"rows": "soft"}, "soft.*barrier"),
        ("hierarchical-qp", {"solver": "daqq"}, "Did you mean 'daqp'"),
        ("sliding-mode", {"rank_tolerance": 0.0}, "rank_tolerance must be between 0 and 1"),
        ("tracking", {"rank_tolerance": 1.0}, "rank_tolerance must be between 0 and 1"),
    ],
)
def test_names_and_options_that_are_none_are_refused(
    name: str, options: dict[str, Any], words: str
) -> None:
    with pytest.raises((ConfigurationError, InvalidInput), match=words):
        make_controller(name, options)


@pytest.mark.parametrize(
    ("name", "option", "value"),
    [
        *(
            (name, "rank_tolerance", value)
            for name in BARE
            # the others have a damping, and custom laws need no such option
            if name not in FOLDER_LAWS and hasattr(make_controller(name), "rank_tolerance")
            for value in (np.nan, 0.0, 1.0, "1e-6", None)
        ),
        *(
            ("potential-field", name, value)
            for name in ("region", "exponent", "strength")
            for value in (np.nan, 0, "1")
        ),
        ("potential-field", "blend", "add"),
        ("potential-field", "blend", np.array(["additive"])),
        ("potential-field", "region", 10**400),
        ("potential-field", "region", True),
    ],
)
def test_an_option_is_checked_whenever_it_is_set(name: str, option: str, value: object) -> None:
    law = make_controller(name)
    before = getattr(law, option)
    with pytest.raises((ConfigurationError, InvalidInput, AttributeError)):
        setattr(law, option, value)
    assert getattr(law, option) == before
    with pytest.raises((ConfigurationError, InvalidInput), match=option):
        make_controller(name, {option: value})


def test_messages_print_numbers_as_they_are_written() -> None:
    for name, options in (
        ("sliding-mode", {"rank_tolerance": np.float64(0.0)}),
        ("potential-field", {"region": np.float64(0.0)}),
        ("hierarchical-qp", {"alpha": np.float64(0.0)}),
        ("hierarchical-qp", {"weights": [np.float64(0.0)]}),
    ):
        with pytest.raises((ConfigurationError, InvalidInput), match=r"not \[?0\.0\]?$"):
            make_controller(name, options)
    rows, task = sound()
    command = Own(np.zeros(6)).command(rows, task)
    status: Any = np.float64(0.0)
    assert (
        Says(replace(command, status=status))
        .command(rows, task)
        .reason.startswith("the law gave the status 0.0,")
    )
    assert Says(status).command(rows, task).reason == "the law gave 0.0, not a Command"


# --- tracking ---


@given(size=sizes)
def test_tracking_is_the_pseudoinverse(size: Size) -> None:
    rows, task = problem(replace(size, singular=False, task_scale=1.0))
    expected = np.linalg.pinv(task.J, rcond=1e-6) @ task.b if size.k else np.zeros(size.n)
    found = Tracking().command(rows, task).qdd
    np.testing.assert_allclose(
        found, expected, rtol=1e-6, atol=1e-8 * max(1.0, np.abs(expected).max())
    )


def test_tracking_leaves_singular_directions_alone() -> None:
    J = np.diag([1.0, 1e-3, 1e-8])
    rows = Rows.none(3)
    np.testing.assert_allclose(Tracking().command(rows, Task(J, np.ones(3))).qdd, [1.0, 1e3, 0.0])
    finer = Tracking(rank_tolerance=1e-10)
    np.testing.assert_allclose(finer.command(rows, Task(J, np.ones(3))).qdd, [1.0, 1e3, 1e8])
    np.testing.assert_array_equal(
        Tracking().command(rows, Task(np.zeros((2, 3)), np.ones(2))).qdd, 0.0
    )


# --- the sliding mode ---


def equation_15(rows: Rows, task: Task) -> Array:
    """q̈ = A₁† b₁ + (A₂(I − A₁†A₁))† (b₂ − A₂A₁†b₁), with a tolerance that keeps rounding out of
    it.
    """
    active = rows.phi >= 0.0
    A1 = rows.Lg[active]
    b1 = -rows.switching_gain[active]
    A2 = task.J
    b2 = task.b
    A1_inverse = np.linalg.pinv(A1)
    first = A1_inverse @ b1
    null_space = np.eye(A2.shape[1]) - A1_inverse @ A1
    # what A₂(I − A₁†A₁) loses by construction is rounding of ‖A₂‖, not of its own largest singular
    # value
    projected = A2 @ null_space
    own = np.linalg.norm(projected, 2)
    tolerance = 1e-8 * np.linalg.norm(A2, 2) / own if own > 0.0 else 0.0
    second = (
        np.linalg.pinv(projected, rcond=tolerance)
        if tolerance < 1.0
        else np.zeros(projected.T.shape)
    )
    return first + second @ (b2 - A2 @ first)


well_posed = st.builds(
    Size,
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(2, 8),
    m=st.integers(1, 12),
    k=st.integers(1, 8),
)


def with_active(rows: Rows, count: int) -> Rows:
    """The same rows with φ ≥ 0 for the first ``count`` of them."""
    signs = np.where(np.arange(len(rows.labels)) < count, 1.0, -1.0)
    return replace(rows, phi=signs * (np.abs(rows.phi) + 0.1))


def condition(rows: Rows) -> float:
    return float(np.linalg.cond(rows.Lg[rows.phi >= 0.0]))


@given(size=well_posed, share=st.floats(0.0, 1.0))
def test_the_sliding_mode_is_equation_15(size: Size, share: float) -> None:
    rows, task = problem(size)
    rows = with_active(rows, min(size.m, 1 + int(share * (size.n - 1))))
    if condition(rows) > 1e3:
        return  # two correct programs differ by the condition number times rounding
    command = SlidingMode().command(rows, task)
    assert command.status == "ok"
    assert command.active == tuple(np.array(rows.labels)[rows.phi >= 0.0])
    expected = equation_15(rows, task)
    np.testing.assert_allclose(command.qdd, expected, atol=1e-7 * max(1.0, np.abs(expected).max()))


@given(size=well_posed, share=st.floats(0.0, 1.0), demand=st.sampled_from([1.0, 1e3, 1e6]))
def test_level_2_never_leaks_into_level_1(size: Size, share: float, demand: float) -> None:
    """A₁ q̈ = −u⁺ holds however much the task asks for, in a singular configuration too."""
    rows, task = problem(size)
    rows = with_active(rows, min(size.m, 1 + int(share * (size.n - 1))))
    if condition(rows) > 1e3:
        return
    repeated = np.repeat(task.J[:1], size.k, axis=0)
    fading = np.diag(10.0 ** -np.arange(size.n))[: size.k]
    for J in (task.J, repeated, fading):
        asking = Task(J, demand * np.ones(len(J)))
        qdd = SlidingMode().command(rows, asking).qdd
        A1 = rows.Lg[rows.phi >= 0.0]
        u = rows.switching_gain[rows.phi >= 0.0]
        # rounding of A₁ q̈
        allowed = (
            1e-13 * condition(rows) * np.linalg.norm(A1, 2) * max(np.linalg.norm(qdd), 1.0) + 1e-12
        )
        assert np.abs(A1 @ qdd + u).max() <= allowed


@pytest.mark.parametrize("seed", range(20))
def test_as_many_active_rows_as_joints_leave_the_task_nothing(seed: int) -> None:
    """A₂(I − A₁†A₁) is then all rounding, which a tolerance relative to itself would invert."""
    rows, task = problem(Size(seed=seed, n=6, m=6, k=6))
    rows = with_active(rows, 6)
    command = SlidingMode().command(rows, replace(task, b=1e3 * task.b))
    expected = np.linalg.solve(rows.Lg, -rows.switching_gain)
    np.testing.assert_allclose(command.qdd, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert command.status == "ok"


def test_a_row_on_its_boundary_is_active() -> None:
    """φ ≥ 0 as in eq. (9), not φ > 0 as in Appendix B."""
    rows, task = sound()
    rows = replace(rows, phi=np.array([0.0, -1e-12, -1.0]))
    command = SlidingMode().command(rows, task)
    assert command.active == ("fov[marker 2]",)
    assert rows.Lg[0] @ command.qdd == pytest.approx(-rows.switching_gain[0])


def test_l_f_phi_and_the_amount_of_phi_do_not_matter_to_the_sliding_mode() -> None:
    rows, task = sound()
    rows = with_active(rows, 2)
    other = replace(rows, Lf=100.0 * rows.Lf, phi=50.0 * rows.phi, scale=7.0 * rows.scale)
    np.testing.assert_array_equal(
        SlidingMode().command(rows, task).qdd, SlidingMode().command(other, task).qdd
    )


def test_rank_loss_names_the_dependent_rows_and_no_other() -> None:
    rng = np.random.default_rng(3)
    Lg = rng.normal(size=(5, 6))
    Lg[3] = 2.0 * Lg[0] - Lg[2]
    labels = ("a", "b", "c", "d", "e")
    rows = Rows(np.array([1.0, 1.0, 1.0, 1.0, -1.0]), Lg, np.zeros(5), np.ones(5), labels)
    task = Task(rng.normal(size=(6, 6)), rng.normal(size=6))
    command = SlidingMode().command(rows, task)
    assert command.status == "rank-loss"
    assert command.reason.endswith("dependent: a, c, d")
    # its demands are met in the least-squares sense
    A1 = Lg[:4]
    np.testing.assert_allclose(A1.T @ (A1 @ command.qdd + 1.0), 0.0, atol=1e-9)
    # an inactive row that depends on active ones is none of the law's business
    inactive = replace(rows, phi=np.array([1.0, 1.0, 1.0, -1.0, -1.0]))
    assert SlidingMode().command(inactive, task).status == "ok"


def test_opposite_rows_and_rows_without_gradient_are_named() -> None:
    Lg = np.zeros((3, 2))
    Lg[0] = [1.0, 0.0]
    Lg[1] = [-1.0, 0.0]
    rows = Rows(np.ones(3), Lg, np.zeros(3), np.ones(3), ("upper", "lower", "nowhere"))
    task = Task(np.eye(2), np.array([5.0, 7.0]))
    command = SlidingMode().command(rows, task)
    assert command.status == "rank-loss"
    assert command.reason.endswith("dependent: upper, lower, nowhere")
    # both sides cannot be met: the least squares stay in between, and the task has the rest
    np.testing.assert_allclose(command.qdd, [0.0, 7.0], atol=1e-12)
    alone = Rows(np.ones(1), np.zeros((1, 2)), np.zeros(1), np.ones(1), ("nowhere",))
    command = SlidingMode().command(alone, task)
    assert command.status == "rank-loss"
    assert "nowhere" in command.reason
    np.testing.assert_allclose(command.qdd, [5.0, 7.0])


def in_units(rows: Rows, units: Array) -> Rows:
    """The same rows, each φ measured in another unit."""
    return replace(
        rows,
        **{name: getattr(rows, name) * units for name in ("phi", "Lf", "switching_gain", "scale")},
        Lg=rows.Lg * units[:, None],
    )


LAWS_IN_PRIORITY = [SlidingMode(), PotentialField(blend="priority")]


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("law", LAWS_IN_PRIORITY, ids=lambda law: law.name)
def test_rows_in_other_units_are_no_more_and_no_less_dependent(
    law: Controller, compiled: bool
) -> None:
    answer = law.command if compiled else law.define
    orthogonal = np.array([[1e4, 0.0, 0.0], [0.0, 1e-3, 0.0]])
    task = Task(np.eye(3), np.array([5.0, 6.0, 7.0]))
    rows = Rows(np.ones(2), orthogonal, np.zeros(2), np.array([1e4, 2e-3]), ("px", "mm"))
    command = answer(rows, task)
    assert command.status == "ok", command.reason
    np.testing.assert_allclose(command.qdd, [-1.0, -2.0, 7.0], rtol=1e-12)
    # of rows that depend on each other all are named, however large or small
    rows = replace(rows, Lg=np.array([[1e4, 0.0, 0.0], [-1.0, 0.0, 0.0]]))
    command = answer(rows, task)
    assert command.status == "rank-loss"
    assert command.reason.endswith("dependent: px, mm")


@pytest.mark.parametrize("law", LAWS_IN_PRIORITY, ids=lambda law: law.name)
@pytest.mark.parametrize("dependent", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_the_unit_of_a_row_changes_no_command(law: Controller, dependent: bool, seed: int) -> None:
    rows, task = problem(Size(seed=seed, n=6, m=4, k=6))
    rows = with_active(rows, 4)
    if dependent:
        rows.Lg[3] = rows.Lg[0] - 3.0 * rows.Lg[2]
    units = 10.0 ** np.random.default_rng(seed).uniform(-4.0, 4.0, 4)
    here = law.command(rows, task)
    there = law.command(in_units(rows, units), task)
    assert (here.status, here.reason) == (there.status, there.reason)
    assert (here.status == "rank-loss") == dependent
    np.testing.assert_allclose(there.qdd, here.qdd, rtol=1e-8, atol=1e-8 * np.abs(here.qdd).max())


def test_more_active_rows_than_joints_are_a_loss_of_rank() -> None:
    rows, task = problem(Size(seed=5, n=3, m=5, k=3))
    command = SlidingMode().command(with_active(rows, 5), task)
    assert command.status == "rank-loss"
    assert all(label in command.reason for label in rows.labels)


# --- potential fields ---


@given(size=sizes, region=st.sampled_from([1e-9, 1e-3, 0.2]))
def test_the_priority_blend_is_the_sliding_mode_outside_its_region(
    size: Size, region: float
) -> None:
    """The limit of a shrinking region: where no φ is in (−δ, 0) the commands are the same, bit by
    bit.
    """
    rows, task = problem(replace(size, rows_scale=1.0))
    depth = region * rows.scale
    phi = np.where((rows.phi > -depth) & (rows.phi < 0.0), -2.0 * depth, rows.phi)
    rows = replace(rows, phi=phi)
    field = PotentialField(blend="priority", region=region).command(rows, task)
    sliding = SlidingMode().command(rows, task)
    np.testing.assert_array_equal(field.qdd, sliding.qdd)
    assert (field.status, field.active, field.reason) == (
        sliding.status,
        sliding.active,
        sliding.reason,
    )


def one_row(phi: float) -> tuple[Rows, Task]:
    rows, task = sound()
    only = Rows(
        np.array([phi]),
        rows.Lg[:1],
        rows.Lf[:1],
        rows.switching_gain[:1],
        rows.labels[:1],
        np.array([0.5]),
    )
    return only, task


@pytest.mark.parametrize("blend", ["additive", "priority"])
@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_repulsion_sets_in_continuously(blend: str, exponent: float) -> None:
    """At the entry of the region, of depth 0.2 × the row's scale, there is no jump; nor on the
    boundary.
    """
    law = PotentialField(blend=blend, exponent=exponent)
    free = Tracking().command(*one_row(-1.0)).qdd
    np.testing.assert_array_equal(law.command(*one_row(-0.1)).qdd, free)
    assert law.command(*one_row(-0.1)).active == ()
    entered = law.command(*one_row(-0.1 + 1e-9))
    assert entered.active == ("fov[marker 2]",)
    np.testing.assert_allclose(entered.qdd, free, atol=1e-6)
    below = law.command(*one_row(-1e-9)).qdd
    above = law.command(*one_row(1e-9)).qdd
    np.testing.assert_allclose(below, above, atol=1e-6)
    # and in between it is not constant
    assert np.abs(law.command(*one_row(-0.05)).qdd - free).max() > 1e-3
    phis = np.linspace(-0.12, 0.02, 1401)
    commands = np.array([law.command(*one_row(float(phi))).qdd for phi in phis])
    assert (
        np.abs(np.diff(commands, axis=0)).max()
        < 0.01 * np.abs(commands[-1] - commands[0]).max() * 2 * exponent
    )


def test_the_additive_blend_is_khatibs_sum() -> None:
    """q̈ = J†b − Σ ψ u⁺ L_gφ†, with ψ = (1 + φ/δ)^exponent, which goes on growing beyond the
    boundary.
    """
    rows, task = sound()
    rows = replace(rows, phi=np.array([-0.05, 0.3, -5.0]), scale=np.array([0.5, 1.0, 1.0]))
    law = PotentialField(blend="additive", region=0.2, exponent=2.0, strength=1.5)
    psi = np.array([(1.0 - 0.05 / 0.1) ** 2, (1.0 + 0.3 / 0.2) ** 2, 0.0])
    expected = np.linalg.pinv(task.J) @ task.b
    for i in range(3):
        expected = (
            expected
            - 1.5 * psi[i] * rows.switching_gain[i] * np.linalg.pinv(rows.Lg[i : i + 1])[:, 0]
        )
    found = law.command(rows, task)
    np.testing.assert_allclose(found.qdd, expected, rtol=1e-9)
    assert found.active == ("fov[marker 2]", "range[joint 6].upper")


def test_the_priority_blend_demands_a_share_of_the_switching_gain() -> None:
    """L_gφ q̈ goes from what tracking does to −u⁺ as ψ goes from 0 to 1, and stays there beyond the
    boundary.
    """
    law = PotentialField(blend="priority", region=0.2)
    rows, task = one_row(-0.025)
    free = float(rows.Lg[0] @ Tracking().command(rows, task).qdd)
    u = float(rows.switching_gain[0])
    for phi, psi in ((-0.1, 0.0), (-0.075, 0.25), (-0.025, 0.75), (0.0, 1.0), (3.0, 1.0)):
        rows, _ = one_row(phi)
        demand = (1.0 - psi) * free - psi * u
        assert float(rows.Lg[0] @ law.command(rows, task).qdd) == pytest.approx(demand, rel=1e-9)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("blend", ["additive", "priority"])
def test_no_region_is_so_small_that_a_row_is_dropped(blend: str, compiled: bool) -> None:
    """Where region times scale is zero in floating point, and so is φ."""
    rows, task = one_row(0.0)
    rows = replace(rows, scale=np.array([1e-200]))
    law = PotentialField(blend=blend, region=1e-200)
    usual = PotentialField(blend=blend)
    command = (law.command if compiled else law.define)(rows, task)
    assert command.active == rows.labels
    np.testing.assert_allclose(command.qdd, usual.command(*one_row(0.0)).qdd, rtol=1e-9)


def test_a_row_without_gradient_is_not_pushed() -> None:
    rows, task = sound()
    rows = replace(rows, phi=np.ones(3), Lg=np.zeros((3, 6)))
    command = PotentialField().command(rows, task)
    np.testing.assert_array_equal(command.qdd, Tracking().command(rows, task).qdd)


# --- the hierarchical QP: what it shares with the others; its own tests go deeper ---


def feasible(size: Size, form: str) -> tuple[Rows, Task]:
    """Rows that some acceleration meets with room to spare."""
    rows, task = problem(replace(size, rows_scale=1.0, task_scale=1.0, singular=False))
    rng = np.random.default_rng(size.seed + 1)
    target = rng.normal(size=size.n)
    alpha = HierarchicalQP().alpha
    bound = -rows.switching_gain if form == "active" else -alpha * rows.phi - rows.Lf
    # scale the gradients so that the target meets each bound: L_gφ target = bound − 0.1
    reached = rows.Lg @ target
    Lg = rows.Lg + np.outer((bound - 0.1 - reached) / (target @ target), target)
    return replace(rows, Lg=Lg), task


@pytest.mark.parametrize("form", ["barrier", "active"])
@given(size=sizes)
def test_demands_that_can_be_met_are_met(form: str, size: Size) -> None:
    rows, task = feasible(size, form)
    law = HierarchicalQP(rows=form)
    command = law.command(rows, task)
    assert command.status == "ok", command.reason
    if form == "active":
        demanding = rows.phi >= 0.0
        bound = -rows.switching_gain
    else:
        demanding = np.ones(size.m, dtype=bool)
        bound = -law.alpha * rows.phi - rows.Lf
    excess = (rows.Lg @ command.qdd - bound)[demanding]
    # the solvers' tolerance, relative to the terms of each row
    allowed = 1e-6 * (np.abs(rows.Lg) @ np.abs(command.qdd) + np.abs(bound) + 1.0)[demanding]
    assert (excess <= allowed).all()
    assert command.slacks == {}


def test_demands_that_contradict_each_other_are_relaxed_by_name() -> None:
    rows = Rows(
        np.ones(3),
        np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]]),
        np.zeros(3),
        np.ones(3),
        ("up", "down", "side"),
    )
    command = HierarchicalQP(rows="active").command(rows, Task(np.eye(2), np.array([5.0, 7.0])))
    assert command.status == "relaxed"
    assert set(command.slacks) == {"up", "down"}
    assert "up" in command.reason
    assert "side" not in command.reason
    np.testing.assert_allclose(command.qdd, [0.0, -1.0], atol=1e-6)


@pytest.mark.parametrize(
    "law",
    [SlidingMode(), PotentialField(), HierarchicalQP(), HierarchicalQP(solver="daqp"), Tracking()],
)
@pytest.mark.parametrize("size", [1e10, 1e18, 1e100, 1e183])
def test_accelerations_at_which_rows_cannot_be_checked_are_no_answer(law, size):
    """A robot that diverges: finite, but so large that rounding of a row exceeds all that it may
    demand.
    """
    rows = Rows(np.array([-0.1, -0.2]), np.eye(2), np.zeros(2), np.full(2, 2.0), ("a", "b"))
    task = Task(np.array([[1.0, 0.0]]), np.array([-size]))
    command = law.command(rows, task)
    acted = np.empty(2, np.bool_)
    qdd = np.empty(2)
    bound = law.bind(rows, task, acted, qdd)
    if size < 1e15:
        assert command.status == "ok"
        assert bound is None or bound.solve() == 0
        return
    assert command.status == "failed"
    assert "rounding exceeds the gain of a, b (φ up to -1.0e-01)" in command.reason
    np.testing.assert_array_equal(command.qdd, np.zeros(2))
    assert bound is None or bound.solve() != 0


@pytest.mark.parametrize(
    "law", [SlidingMode(), PotentialField(blend="priority"), HierarchicalQP(), Tracking()]
)
def test_a_row_that_a_run_has_left_for_good_ends_it_with_its_phi(law):
    """A marker seven half axes from the centre: 7¹⁶ = 3.3e13, and 16 × 7¹⁵ = 7.6e13 per half axis,
    20 of them a rad.
    """
    marker = np.array([7.0, 0.0])
    sigma, gradient, _ = superellipse(*marker, 1.0, 1.0, 16.0)
    assert [sigma, gradient] == pytest.approx([3.3233e13, 7.596e13], rel=1e-4)
    rows = Rows(
        np.array([sigma]), np.array([[20.0 * gradient, 0.0]]), np.zeros(1), np.array([10.0]), ("a",)
    )
    # with accelerations of 10, rounding is 1.7, of 100 it is 17: more than u⁺ = 10
    for asked, failed in ((10.0, False), (100.0, True)):
        command = law.command(rows, Task(np.array([[0.0, 1.0]]), np.array([asked])))
        assert (command.status == "failed") == failed
        assert not failed or command.reason == (
            "the commanded accelerations (up to 1.0e+02) are too large for the rows to be "
            "verified: rounding exceeds the gain of a (φ up to 3.3e+13); is the goal reachable?"
        )
