"""From where to where laws are worth searching: one contract for every registered law and every
pair.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from folder_laws import FOLDER_LAWS
from vsconstraints.bench.tuning.problem import Searched
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.controllers import (
    CONTROLLERS,
    DEMANDS,
    RESOLVERS,
    VELOCITY_LAWS,
    Barrier,
    Choices,
    Hierarchy,
    Range,
    law_ranges,
    make_controller,
)
from vsconstraints.controllers.base import innermost
from vsconstraints.controllers.ranges import ROWS, Declared, default_of
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows.factors import FACTORS
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

LAWS: list[Any] = [
    *(pytest.param(name, {}, id=name) for name in CONTROLLERS),
    *(pytest.param(file, {}, id=name) for name, file in FOLDER_LAWS.items()),
    *(
        pytest.param("law", {"demand": d.name, "resolver": r.name}, id=f"{d.name}-{r.name}")
        for d in DEMANDS
        for r in RESOLVERS
        if d is Barrier or r is Hierarchy
    ),
]
"""Every name, every file of the folder controllers, every demand and every resolver."""

COSTLY = ("goal-governor", "barrier-governor", "mppi")
"""Laws whose runs take longer than those of all others together."""

VELOCITY_ARM = {"command": "velocity", "lag": 0.02, "acceleration": 20.0}
MODEL = ("predictive", "robust-predictive", *FOLDER_LAWS.values())
SCENE = Scenario.load("example-2d-fov").with_override("duration", 0.1)


def scene_for(name: str, scenario: Scenario) -> Scenario:
    """Return a scenario whose arm takes the commands of a law."""
    if name in [law.name for law in VELOCITY_LAWS]:
        return scenario.with_override("arm", VELOCITY_ARM)
    return scenario


def drawn(ranges: Mapping[str, Range | Choices], rng: np.random.Generator) -> dict[str, Any]:
    """A value inside each range."""
    values: dict[str, Any] = {}
    for option, one in ranges.items():
        if isinstance(one, Choices):
            values[option] = one.values[rng.integers(len(one.values))]
        elif one.integer:
            values[option] = int(rng.integers(one.least, one.greatest + 1))
        else:
            ends = np.log([*one]) if one.logarithmic else np.array([*one])
            value = rng.uniform(*ends)
            values[option] = float(np.exp(value) if one.logarithmic else value)
    return values


@pytest.mark.parametrize(("name", "options"), LAWS)
def test_ends_of_ranges_are_options_and_defaults_lie_inside(
    name: str, options: dict[str, Any]
) -> None:
    law = innermost(make_controller(name, options))
    ranges = law_ranges(name, options)
    for option, one in ranges.items():
        assert default_of(law, option) in one
        for end in one:
            made = make_controller(name, {**options, option: end})
            assert default_of(innermost(made), option) == end
    for side in (0, -1):
        make_controller(
            name, {**options, **{option: [*one][side] for option, one in ranges.items()}}
        )


@pytest.mark.parametrize(("name", "options"), LAWS)
def test_any_values_inside_make_a_law_that_answers(name: str, options: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    ranges = law_ranges(name, options)
    for _ in range(1 if name in MODEL else 3):
        law = make_controller(name, {**options, **drawn(ranges, rng)})
        run = simulate(scene_for(name, SCENE).setup(), law)
        assert run.status != "failed", run.reason
        assert np.isfinite(run.qdd_command).all()
        assert len(run.t) > 2


def test_what_is_searched_of_each_law() -> None:
    """By hand: of laws what their rows may have, where that changes anything; pairs have those of
    both parts.
    """
    searched = {name: set(law_ranges(name)) for name in CONTROLLERS}
    searched |= {name: set(law_ranges(file)) for name, file in FOLDER_LAWS.items()}
    gains = {"K", "switching_gain", "speed_gain"}
    barrier = {"K", "margin"}
    rows = gains | {"margin"}
    assert searched == {
        "sliding-mode": gains,
        "sliding-mode-ahead": rows,
        "tracking": set(),
        "law": rows,
        "potential-field": {"region", "exponent", "strength"} | rows,
        "boundary-layer": {"region", "exponent", "strength"} | rows,
        "hierarchical-qp": {"alpha"} | barrier,
        "robust-hierarchical-qp": {"alpha"} | barrier,
        "implicit-switch": {"periods"} | rows,
        "implicit-switch-with-drift": {"periods"} | rows,
        "super-twisting": {"rate"} | rows,
        "implicit-super-twisting": {"rate"} | rows,
        "cbf-filter": {"alpha", "metric", "damping"} | barrier,
        "predictive": {"horizon", "block", "approach", "damping", "margin"},
        "robust-predictive": {"horizon", "block", "approach", "damping", "margin"},
        "mppi": {"samples", "horizon", "block", "temperature", "noise", "penalty", "margin"},
        "goal-governor": {"speed", "margin", "influence", "horizon"},
        "barrier-governor": {"speed", "margin", "alpha", "sharpness", "horizon"},
        "resolved-rate": {"gain"},
        "resolved-rate-avoidance": {"gain", "zone", "full", "tune"},
        "velocity-qp": {"gain", "K"},
        "velocity-hierarchical-qp": {"gain", "K"},
        "velocity-damper": {"gain", "speed", "influence"},
        "cautious": set(),
        "gradual": set(),
        "careful": set(),
    }
    pair = {"demand": "barrier", "resolver": "saturation", "K": 2.0, "margin": 0.1}
    assert law_ranges("law", pair) == {"alpha": Range(1.0, 200.0)}
    assert law_ranges("law", {"demand": "barrier", "resolver": "filter"}) == {
        "K": Range(0.3, 10.0),
        "margin": Range(0.0, 0.2, logarithmic=False),
        "alpha": Range(1.0, 200.0),
        "metric": Choices(("joint", "task")),
        "damping": Range(1e-8, 1.0),
    }
    assert set(law_ranges("hierarchical-qp", {"rows": "active"})) == rows


#: Laws that declare what is searched; those of the guides do not.
DECLARED = [
    pytest.param(*law.values, id=law.id, marks=pytest.mark.full) if law.id in COSTLY else law
    for law in LAWS
    if law.id not in ("cautious", "gradual", "careful")
]


@pytest.mark.parametrize(("name", "options"), DECLARED)
def test_what_is_not_searched_of_the_rows_changes_nothing(
    name: str, options: dict[str, Any]
) -> None:
    left = {key: 1.7 for key in FACTORS if key not in law_ranges(name, options)}
    scenario = Scenario.load("case-study-6r").with_override("duration", 0.7)
    setup = scene_for(name, scenario).setup()
    theirs, ours = (
        simulate(setup, make_controller(name, {**options, **factors})) for factors in ({}, left)
    )
    np.testing.assert_allclose(ours.q, theirs.q, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(("name", "options"), DECLARED)
def test_what_changes_nothing_is_said(name: str, options: dict[str, Any]) -> None:
    """Factors that no range is declared of are those that the law says it ignores."""
    law = make_controller(name, options)
    ranges = law_ranges(name, options)
    assert {factor for factor in FACTORS if factor not in ranges} == {*FACTORS} & {*law.ignores}
    assert law.unused() == ""
    told = make_controller(name, {**options, **dict.fromkeys(FACTORS, 1.5)}).unused()
    assert all((factor in told) == (factor in law.ignores) for factor in FACTORS)


@pytest.mark.parametrize("factor", FACTORS)
def test_each_factor_that_is_searched_acts(factor: str) -> None:
    setup = Scenario.load("case-study-6r").with_override("duration", 0.7).setup()
    theirs, ours = (
        simulate(setup, make_controller("sliding-mode", {factor: value})) for value in (1.0, 1.7)
    )
    assert np.abs(ours.q - theirs.q).max() > 1e-6


def test_what_is_given_stays() -> None:
    assert set(law_ranges("cbf-filter", {"metric": "task", "K": {"fov": 2.0}})) == {
        "alpha",
        "damping",
        "margin",
    }
    potential = {"region": 0.35, "strength": 5.0, "switching_gain": 1.0, "margin": 0.0}
    assert set(law_ranges("potential-field", potential)) == {"exponent", "K", "speed_gain"}


@pytest.mark.parametrize("name", ["cbf-filter", "predictive"])
def test_a_law_with_an_observer_is_searched_as_without(name: str) -> None:
    plain, observed = (
        Searched(ControllerSpec("law", name, own))
        for own in ({}, {"observer": 0.1, "dead_time": 0.02})
    )
    assert observed.ranges == plain.ranges != {}
    assert observed.default == plain.default
    assert observed.setting({"damping": 0.5}).options == {
        "observer": 0.1,
        "dead_time": 0.02,
        "damping": 0.5,
    }
    assert observed.setting({"damping": 0.5}).make().law.damping == 0.5  # type: ignore[attr-defined]


OWN = """
from dataclasses import dataclass

from vsconstraints.controllers import (
    Barrier, Choices, Controller, Demand, Filter, Hierarchy, Law, Range, RowFactors, Tracking,
)


class Bare(Tracking):
    name = "bare"

    def __init__(self):
        super().__init__()


class Pairs(Law):
    name = "pairs"

    def __init__(self, *, alpha=5.0):
        super().__init__(Barrier(alpha), Filter())


@dataclass(frozen=True)
class Push(Demand):
    gain: float = 1.0
    name = "push"
    ranges = {"gain": (0.1, 10.0)}

    @staticmethod
    def formula(row, gain):
        return -gain * row.switching_gain


class Explicit(Law):
    name = "explicit"

    def __init__(self, *, gain=1.0, margin=0.0):
        super().__init__(Push(gain, margin=margin), Hierarchy())


class ByKind(Pairs):
    factors = RowFactors(K={"fov": 3.0})


class Other(Law):
    name = "other"
    ranges = {"gain": (0.5, 8.0), "fast": Choices((True, False)), "steps": Range(1, 9, integer=True)}

    def __init__(self, *, gain=2.0, fast=True, steps=3):
        super().__init__(Barrier(gain), Hierarchy())


class Unknown(Tracking):
    ranges = {"rank_tolerances": (0.5, 8.0)}


class Outside(Tracking):
    ranges = {"rank_tolerance": (0.5, 0.8)}


class NoRange(Tracking):
    ranges = {"rank_tolerance": 3.0}


class Backwards(Tracking):
    ranges = {"rank_tolerance": (2.0, 1.0)}
"""


def test_own_laws_declare_theirs(tmp_path: Path) -> None:
    (tmp_path / "my_laws.py").write_text(OWN, encoding="utf-8")
    assert law_ranges("my_laws:Bare", folder=tmp_path) == {}
    assert law_ranges("my_laws:Pairs", folder=tmp_path) == {
        "K": Range(0.3, 10.0),
        "alpha": Range(1.0, 200.0),
    }
    assert set(law_ranges("my_laws:Explicit", folder=tmp_path)) == {*ROWS, "gain"}
    assert law_ranges("my_laws:ByKind", folder=tmp_path) == {"alpha": Range(1.0, 200.0)}
    assert law_ranges("my_laws:Other", folder=tmp_path) == {
        "K": Range(0.3, 10.0),
        "gain": Range(0.5, 8.0),
        "fast": Choices((True, False)),
        "steps": Range(1, 9, integer=True),
    }


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("Unknown", "'rank_tolerances', which is not one of its options"),
        ("Outside", r"'rank_tolerance' that does not hold its default 1e-\d+: 0\.5–0\.8"),
        (
            "NoRange",
            r"'rank_tolerance': it must be a Range, Choices, or a pair of numbers, not 3\.0",
        ),
        ("Backwards", r"a range goes from a number to a greater one, not \(2\.0, 1\.0\)"),
    ],
)
def test_ranges_that_are_none_are_refused_by_name(tmp_path: Path, law: str, words: str) -> None:
    (tmp_path / "my_laws.py").write_text(OWN, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=f"my_laws:{law} declares a range of .*{words}"):
        law_ranges(f"my_laws:{law}", folder=tmp_path)


@pytest.mark.parametrize(
    "arguments",
    [
        (1.0, 1.0),
        (math.nan, 1.0),
        (1.0, math.inf),
        (0.0, 1.0),
        (-1.0, 1.0),
        (1.0, 2.5, True, True),
        ("1", 2.0),
    ],
)
def test_what_is_no_range(arguments: tuple[Any, ...]) -> None:
    with pytest.raises(ConfigurationError, match="range"):
        Range(*arguments)


@pytest.mark.parametrize("values", [(), (1,), (1, 1), [1, 2]])
def test_what_is_no_choice(values: Any) -> None:
    with pytest.raises(ConfigurationError, match="two values or more"):
        Choices(values)


def test_what_ranges_hold() -> None:
    assert 3 in Range(1, 9, integer=True)
    assert 3.0 not in Range(1, 9, integer=True)
    assert True not in Range(0.5, 9.0)
    assert 0.0 in Range(-1.0, 1.0, logarithmic=False)
    assert math.nan not in Range(0.5, 9.0)
    declared: Declared = Choices((None, 2.0))
    assert None in declared
