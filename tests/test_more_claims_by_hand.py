"""The rules of the other claims, on made-up runs and studies: every number just inside or just
outside.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, T, Told, at, during, found, verdict
from vsconstraints.paper import case_study
from vsconstraints.paper.claims import section_4_approach
from vsconstraints.paper.claims.section_10_experiments import CASES, in_unselected
from vsconstraints.paper.scenes import NOT_DIFFERENTIABLE, SCENES
from vsconstraints.paper.studies import StudyResult
from vsconstraints.paper.verdicts import CLAIMS, NotMeasured
from vsconstraints.rows import Array


def study(**numbers: float) -> StudyResult:
    return StudyResult(
        "made up", {tuple(name.split("__")): value for name, value in numbers.items()}, (), (), ()
    )


# --- claim 5: a phase of 4 s and one of 6 s ---

LONG = 0.1 * np.arange(101)
BORDERS = [f"fov[marker {i}]" for i in (1, 2, 3, 4)]
RANGE = "range[joint 6].upper"
SPEED = "speed[joint 2].upper"
SPHERE = "sphere[tip]"


class Phases(Told):
    """A case study whose second goal holds from 4 s on."""

    setup = SimpleNamespace(task=SimpleNamespace(goals=[None, SimpleNamespace(from_time=4.0)]))


def phased(q6: float = 0.0999, qd2: float = 0.4, **spans: Any) -> Phases:
    """Rows act in the intervals given, by the beginnings of their names; markers by number."""
    names = {
        "marker1": BORDERS[0],
        "marker2": BORDERS[1],
        "marker3": BORDERS[2],
        "marker4": BORDERS[3],
    }
    names |= {"range": RANGE, "speed": SPEED, "sphere": SPHERE}
    phi = {label: during(*spans.get(name, ()), t=LONG) for name, label in names.items()}
    q = np.full((len(LONG), 6), 9.0)
    qd = np.full((len(LONG), 6), 9.0)
    q[:, 5], qd[:, 1] = at({7: q6}, -3.0, LONG), at({7: qd2}, 0.0, LONG)
    return Phases(phi, t=LONG, q=q, qd=qd)


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, YES),
        ({(39, 0): 0.0101}, PARTLY),
        ({(39, 1): 0.0201}, PARTLY),
        ({(100, 0): 0.0301}, PARTLY),
        ({(100, 1): 0.0401}, PARTLY),
        ({(39, 0): 0.01, (39, 1): 0.0201, (100, 0): 0.0301, (100, 1): 0.0401}, NO),
    ],
)
def test_5a(changed: dict[tuple[int, int], float], expected: str) -> None:
    """1 and 2 at the start of the first phase, 3 and 4 at that of the second: a hundredth of them
    may be left.
    """
    error = np.full((101, 2), 7.0)
    start = {(0, 0): 1.0, (0, 1): 2.0, (40, 0): 3.0, (40, 1): 4.0}
    left = {(39, 0): 0.0099, (39, 1): 0.0199, (100, 0): 0.0299, (100, 1): 0.0399}
    for place, value in (start | left | changed).items():
        error[place] = value
    assert verdict("5a", Phases(t=LONG, camera_error=error)) == expected


@pytest.mark.parametrize(
    ("second", "third", "expected"), [(0.01, 0.0, YES), (0.011, 0.0, PARTLY), (0.0, 0.011, PARTLY)]
)
def test_5b(second: float, third: float, expected: str) -> None:
    clearance = {BORDERS[1]: at({5: second}, 1.0), BORDERS[2]: at({5: third}, 1.0)}
    assert verdict("5b", Told(dict.fromkeys(BORDERS, -1.0), {}, clearance)) == expected


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        (phased(range=[(1.0, 2.0)], speed=[(0.0, 3.9)]), YES),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 4.0)]), NO),
        (phased(range=[(1.0, 2.0)]), NO),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], q6=0.0881), YES),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], q6=0.0879), PARTLY),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], q6=0.1001), PARTLY),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], qd2=-0.4039), YES),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], qd2=0.4041), PARTLY),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], qd2=0.3961), YES),
        (phased(range=[(1.0, 2.0)], speed=[(1.0, 2.0)], qd2=0.3959), PARTLY),
    ],
)
def test_5e(run: Phases, expected: str) -> None:
    assert verdict("5e", run) == expected


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([(6.0, 8.0)], YES),
        ([(5.6, 8.4)], YES),
        ([(5.4, 8.0)], PARTLY),
        ([(6.0, 6.4), (7.0, 8.0)], YES),  # 0.6 s apart is one interval
        ([(6.0, 6.3), (7.0, 8.0)], PARTLY),
        ([(1.0, 1.0), (6.0, 8.0)], PARTLY),
        ([(1.0, 2.0)], NO),
    ],
)
def test_5f(spans: Any, expected: str) -> None:
    assert verdict("5f", phased(sphere=spans)) == expected


FIRST = [(1.0, 2.0)]
SECOND = [(5.0, 6.0)]


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        (phased(marker2=FIRST + SECOND, marker3=FIRST), YES),
        (phased(marker2=FIRST + SECOND, marker3=FIRST, marker1=FIRST), PARTLY),
        (phased(marker2=FIRST + SECOND, marker3=FIRST, marker4=SECOND), PARTLY),
        (phased(marker2=FIRST, marker3=FIRST), NO),
        (phased(marker2=FIRST + SECOND), NO),
    ],
)
def test_5g(run: Phases, expected: str) -> None:
    assert verdict("5g", run) == expected


@pytest.mark.parametrize(
    ("run", "most", "expected"),
    [
        (phased(marker2=[(1.0, 2.0)], marker3=[(2.0, 3.0)], range=[(1.5, 2.5)]), 3, YES),
        (phased(marker2=[(1.0, 1.9)], marker3=[(2.0, 3.0)], range=[(1.5, 2.5)]), 2, PARTLY),
        (phased(marker2=FIRST, marker3=FIRST, range=FIRST, speed=FIRST), 4, PARTLY),
        (phased(marker2=FIRST), 1, NO),
        (phased(marker2=FIRST, marker3=[(3.0, 3.5)]), 1, NO),
    ],
)
def test_5h(run: Phases, most: int, expected: str) -> None:
    assert verdict("5h", run) == expected
    found = CLAIMS["5h"].check(dict(zip(CLAIMS["5h"].needs, [run], strict=True)))
    assert found.values == {"most": most, "same_sample": most}
    assert int(case_study.at_once(run).max()) == most  # type: ignore[arg-type]


@pytest.mark.parametrize(("least", "expected"), [(0.0, YES), (-1e-6, NO)])
def test_5i(least: float, expected: str) -> None:
    run = Told({SPHERE: at({5: 0.5})}, {}, {SPHERE: at({3: least}, 1.0)})
    assert verdict("5i", run) == expected
    found = CLAIMS["5i"].check(dict(zip(CLAIMS["5i"].needs, [run], strict=True)))
    assert found.values == {"clearance_min": least, "phi_max": 0.5}


def test_5j() -> None:
    """A constant gain makes e = (e^(−at) (b e₀ + ė₀) − e^(−bt) (a e₀ + ė₀))/(b − a), a, b roots of
    x² − 3√20 x + 20.

    With an error as small as this the slope does not matter: a = 1.7082, b = 11.708.
    """
    a = 1.7082039324993694
    b = 11.70820393249937
    t = 0.002 * np.arange(501)
    v = 3.0  # the start is left at three times itself per second
    e = 1e-6 * (np.exp(-a * t) * (b + v) - np.exp(-b * t) * (a + v)) / (b - a)
    start = np.array([1e-6, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = section_4_approach.ideal_error(start, v * start, t)
    np.testing.assert_allclose(found[:, 0], e, rtol=1e-4)
    np.testing.assert_array_equal(found[:, 1:], 0.0)
    # with one of 0.5 the gain is e^(−1.5) of that at first: ë = −20 e^(−1.5) 0.5, and e falls by
    # half of that times t²
    found = section_4_approach.ideal_error(
        np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]), np.zeros(6), np.array([0.0, 0.001])
    )
    assert found[1, 1] - 0.5 == pytest.approx(-1.1156508e-6, rel=5e-3)
    for share, expected in ((0.0099, YES), (0.0101, NO)):
        error = np.zeros((len(t), 6))
        error[:, 0] = e
        error[300, 3] = share * 1e-6
        # what comes after the first phase does not count
        run = Phases(t=np.concatenate((t, [4.0, 4.1])), error=np.vstack((error, np.ones((2, 6)))))
        assert verdict("5j", run) == expected


# --- claim 6 ---


SCENARIOS = ("experiment-1-pbvs", "experiment-2-ibvs")
SHOWN = (
    "similar",
    "satisfactory",
    "little_speed",
    "applied",
    "track_px",
    "speed_share",
    "clearance_share",
)


def unselected(
    plus: float = 200.0,
    minus: float = 200.0,
    alone: float = 200.0,
    *,
    scenes: float = 200.0,
    **shipped: float,
) -> Any:
    """In how many of so many unselected scenes everything holds, and what does in the shipped one;
    there else 1.
    """
    found: dict[Any, float] = {}
    for scenario in SCENARIOS:
        for case, value in zip(CASES, (plus, minus, alone), strict=True):
            found |= {(scenario, case, what): value for what in SHOWN[:3]}
            found |= {(scenario, case, "scenes"): scenes, (scenario, case, "applied"): scenes}
            found |= {(scenario, case, "shipped", what): shipped.get(what, 1.0) for what in SHOWN}
    return StudyResult("made up", found, (), (), ())


def without(one: StudyResult, key: tuple[str, ...], value: float) -> StudyResult:
    assert key in one.numbers
    return StudyResult("made up", {**one.numbers, key: value}, (), (), ())


@pytest.mark.parametrize("what", SHOWN[:3])
@pytest.mark.parametrize(
    ("here", "counts", "expected"),
    [
        (True, (190, 190, 0), YES),
        (True, (189, 200, 0), PARTLY),
        (True, (200, 189, 0), PARTLY),
        (False, (200, 200, 0), PARTLY),
        (True, (100, 100, 0), PARTLY),
        (True, (0, 0, 100), PARTLY),
        (True, (99, 99, 99), NO),
        (False, (99, 99, 99), NO),
    ],
)
def test_unselected_scenes(
    what: str, here: bool, counts: tuple[float, float, float], expected: str
) -> None:
    found = in_unselected(unselected(*counts, **{what: float(here)}), SCENARIOS[0], what)
    assert found.verdict == expected
    assert found.text.startswith(
        f"{'holds' if here else 'does not hold'} in this scene; in {counts[0]} of 200"
    )


def test_unselected_scenes_must_be_enough_and_changed() -> None:
    everywhere = unselected(100, 100, 100, scenes=100.0)
    in_unselected(everywhere, SCENARIOS[0], "similar")
    for case in CASES:
        with pytest.raises(NotMeasured, match="has 99 scenes of experiment-1-pbvs, fewer than 100"):
            in_unselected(
                without(everywhere, (SCENARIOS[0], case, "scenes"), 99.0), SCENARIOS[0], "similar"
            )
        in_unselected(
            without(everywhere, (SCENARIOS[0], case, "applied"), 95.0), SCENARIOS[0], "similar"
        )
        for key, value in (
            ((SCENARIOS[0], case, "applied"), 94.0),
            ((SCENARIOS[0], case, "shipped", "applied"), 0.0),
        ):
            with pytest.raises(NotMeasured, match="was it applied"):
                in_unselected(without(everywhere, key, value), SCENARIOS[0], "similar")


def test_what_is_said_of_errors() -> None:
    one = without(
        unselected(190, 195, 50, track_px=12.5, clearance_share=0.25),
        (SCENARIOS[0], CASES[2], "shipped", "track_px"),
        3.0,
    )
    assert found("6d", one).text == (
        "holds in this scene; in 190 of 200 unselected scenes, with reversed signs in 195 of 200, "
        "with ∇σ_e in L_gφ "
        "alone, the other reading of (49), in 50 of 200. Here tracks differ by up to 12.50 px, "
        "0.25 % of L from the "
        "boundary; with ∇σ_e in L_gφ alone by 3.00 px, 0.25 %"
    )
    assert found("6j", unselected(speed_share=44.0)).text.endswith(
        ". Here by up to 44 % of the fastest joint's speed"
    )


@pytest.mark.parametrize(
    ("key", "scenario", "what"),
    [
        ("6d", SCENARIOS[0], "similar"),
        ("6h", SCENARIOS[1], "similar"),
        ("6j", SCENARIOS[0], "little_speed"),
        ("6k", SCENARIOS[1], "little_speed"),
    ],
)
def test_what_is_counted(key: str, scenario: str, what: str) -> None:
    for other in SCENARIOS:
        for name in SHOWN[:3]:
            expected = PARTLY if (other, name) == (scenario, what) else YES
            assert verdict(key, without(unselected(), (other, CASES[0], name), 189.0)) == expected
            assert (
                verdict(key, without(unselected(), (other, CASES[0], "shipped", name), 0.0))
                == expected
            )


def sampled(Ts: float) -> Told:
    run = Told()
    run.sampling_time = Ts
    return run


def test_6i() -> None:
    runs = [sampled(0.1), sampled(0.1)]
    assert verdict("6i", *runs, unselected()) == YES
    assert found("6i", *runs, unselected()).text.startswith(
        "T_s = 0.1 s. Experiment 1: holds in this scene"
    )
    for Ts in (0.09, 0.11):
        assert verdict("6i", sampled(Ts), sampled(0.1), unselected()) == PARTLY
        assert verdict("6i", sampled(0.1), sampled(Ts), unselected()) == PARTLY
    for scenario in SCENARIOS:
        assert (
            verdict(
                "6i",
                *runs,
                without(unselected(), (scenario, CASES[0], "shipped", "satisfactory"), 0.0),
            )
            == PARTLY
        )
        nowhere = unselected()
        for case in CASES:
            nowhere = without(nowhere, (scenario, case, "satisfactory"), 0.0)
        assert verdict("6i", *runs, nowhere) == PARTLY
    assert verdict("6i", *runs, unselected(0.0, 0.0, 0.0)) == NO


@pytest.mark.parametrize(
    ("fine", "expected"),
    [("nyny", YES), ("yyny", NO), ("nyyy", NO), ("nnny", PARTLY), ("nynn", PARTLY), ("ynyn", NO)],
)
def test_6l(fine: str, expected: str) -> None:
    """Experiment 1 at 0.1 and 0.01 s, experiment 2 at 0.1 and 0.01 s: which of them go well."""
    kinds = (
        "fov[marker 1]",
        "fov[marker 1]",
        "occlusion[area, marker 1]",
        "occlusion[area, marker 1]",
    )
    for broken in ({"status": "trapped"}, {"clearance": -0.001}):
        runs = [
            Told(
                {kind: -1.0},
                {},
                {kind: at({5: 0.0 if good == "y" else float(broken.get("clearance", 0.0))}, 1.0)},
                status="converged" if good == "y" else str(broken.get("status", "converged")),
            )
            for kind, good in zip(kinds, fine, strict=True)
        ]
        assert verdict("6l", *runs) == expected


def moving(off: float = 0.0, faster: float = 0.0) -> Told:
    """q̇ = 2 and q̈ = 10 for a period of 0.01 s: q rises by 0.0205 and q̇ by 0.1; but for what one
    sample is off.
    """
    t = 0.01 * np.arange(3)
    q = np.array([[1.0], [1.0205 + off], [1.042 + off]])
    qd = np.array([[2.0], [2.1 + faster], [2.1 + faster]])
    q[2] += 0.01 * faster - 0.0005
    return Told(t=t, q=q, qd=qd, qdd_command=np.array([[10.0], [0.0], [99.0]]))


def test_6m() -> None:
    good = moving()
    good.trajectory.q[2] = 1.0205 + 0.021
    assert verdict("6m", good, good) == YES
    for off, expected in ((0.9e-9, YES), (1.1e-9, NO)):
        for column in ("q", "qd"):
            bad = moving()
            bad.trajectory.q[2] = 1.0205 + 0.021
            getattr(bad.trajectory, column)[2] += off
            assert verdict("6m", bad, good) == expected
            assert verdict("6m", good, bad) == expected


# --- claims 7, 9, 11 and 12 ---


def decaying(tau: float, K: float) -> Told:
    speed = np.where(T >= 0.2, np.exp(-(T - 0.2) / tau), 77.0)
    speed[T > 0.2 + 2.0 * K + 1e-9] = 33.0
    return Told({ROW: during((0.2, 1.0))}, speed=speed, K=K)


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        ((1.24, 1.0, 1.0), YES),
        ((0.76, 1.0, 1.0), YES),
        ((1.26, 1.0, 1.0), PARTLY),
        ((1.0, 0.74, 1.0), PARTLY),
        ((1.0, 1.0, 1.26), PARTLY),
        ((2.1, 1.0, 1.0), NO),
        ((1.0, 1.0, 0.4), NO),
    ],
)
def test_7b(shares: tuple[float, float, float], expected: str) -> None:
    runs = [decaying(share * K, K) for share, K in zip(shares, (0.1, 0.2, 0.4), strict=True)]
    assert verdict("7b", *runs) == expected


def test_9a() -> None:
    def told(command: float = 0.0, place: float = 0.0, samples: int = 101) -> Told:
        t = T[:samples]
        q = at({50: place}, 0.0, t)[:, None]
        return Told(t=t, q=q, qdd_command=at({70: command}, 1.0, t)[:, None])

    assert verdict("9a", *[told()] * 4) == YES
    for bad in (told(command=1.0 - 1e-12), told(place=1e-12), told(samples=100)):
        assert verdict("9a", told(), told(), bad, told()) == NO
        assert verdict("9a", told(), told(), told(), bad) == NO


@pytest.mark.parametrize(
    ("bad", "some"),
    [
        (Told({ROW: 0.0, "speed[joint 1].upper": 5.0}), True),
        (Told({ROW: 0.0}, status="trapped"), False),
        (Told({ROW: 0.0}, {ROW: at({5: 0.001})}), False),
        (Told({ROW: -0.1}), False),
    ],
)
def test_11a(bad: Told, some: bool) -> None:
    good = Told({ROW: 0.0, "speed[joint 1].upper": 5.0})
    assert verdict("11a", good, good, bad) == (YES if some else PARTLY)
    assert verdict("11a", bad, good, good) == (YES if some else PARTLY)
    assert verdict("11a", bad, bad, bad) == (YES if some else NO)


@pytest.mark.parametrize(
    ("step", "rows", "expected"),
    [
        (12e-6, 8e-6, YES),
        (20e-6, 0.0, YES),
        (12e-6, 8.1e-6, PARTLY),
        (3e-3, 2e-3, PARTLY),
        (3e-3, 2.001e-3, NO),
    ],
)
def test_12a(step: float, rows: float, expected: str) -> None:
    """Of T_s = 10 ms, the first sample apart; a few slow ones do not matter."""
    step_time = at({0: 1.0, 1: 1.0, 2: 1.0}, step)
    assert (
        verdict("12a", Told(step_time=step_time, rows_time=at({0: 1.0}, rows), compiled=True))
        == expected
    )


# --- claim 10 ---

CORNER = [spec.name for spec in SCENES].index(NOT_DIFFERENTIABLE)


def scenes(changed: Told, good: Told, place: int = 0) -> list[Told]:
    return [changed if i == place else good for i in range(len(SCENES))]


class Shared(Told):
    """A run in which (12) asks for a share of u⁺."""

    asked = 0.5

    def needed_share(self) -> Array:
        return at({5: self.asked}, 0.0)


def above(phi: float = 1.0, clearance: float = 0.0, asked: float = 0.99) -> Shared:
    run = Shared(
        {ROW: at({5: phi, 6: 0.0}), "speed[joint 1].upper": -1.0},
        {},
        {ROW: clearance, "speed[joint 1].upper": -9.0},
    )
    run.asked = asked
    return run


@pytest.mark.parametrize(
    ("run", "place", "expected"),
    [
        (above(), 0, YES),
        (above(phi=1.01), 0, PARTLY),
        (above(phi=1.01, clearance=-0.001), 0, NO),
        (above(phi=1.01, clearance=-0.001, asked=1.0), 0, YES),
        (above(phi=1.01, clearance=-0.001), CORNER, YES),
    ],
)
def test_10b(run: Shared, place: int, expected: str) -> None:
    sweep = study(above_bound=3.0, above_bound_allowed=3.0, above_bound_in_band=3.0)
    assert verdict("10b", sweep, *scenes(run, above(), place)) == expected
    found = CLAIMS["10b"].check(
        dict(zip(CLAIMS["10b"].needs, (sweep, *scenes(run, above(), place)), strict=True))
    )
    left_out = run.asked >= 1.0 and place != CORNER
    assert found.values["above"] == 3 + len(SCENES) - 1 - left_out
    for lacking, verdict_then in (("above_bound_in_band", PARTLY), ("above_bound_allowed", YES)):
        changed = study(
            **(
                {"above_bound": 3.0, "above_bound_allowed": 3.0, "above_bound_in_band": 3.0}
                | {lacking: 2.0}
            )
        )
        if expected == YES:
            assert verdict("10b", changed, *scenes(run, above(), place)) == verdict_then


def test_10b_of_two_rows() -> None:
    """One that keeps its boundary does not make up for another that does not."""
    sweep = study(above_bound=3.0, above_bound_allowed=3.0, above_bound_in_band=3.0)
    two = Shared({ROW: at({5: 1.01}), "b": -1.0}, {}, {ROW: -0.001, "b": 1.0})
    assert verdict("10b", sweep, *scenes(two, above())) == NO


def sliding(width: float) -> Told:
    return Told({ROW: at({5: 0.0, 6: width, 7: 0.0})})


def test_10c_is_relative_to_the_period() -> None:
    """T_s u⁺ = 2 in a run with twice the period."""
    slow = Told({ROW: at({5: 0.0, 6: 2.0, 7: 0.0})}, t=2.0 * T)
    sweep = study(s__greatest_excess=1.0, s__exponent=1.0)
    assert verdict("10c", sweep, *scenes(slow, sliding(0.5))) == YES


@pytest.mark.parametrize(
    ("width", "excess", "power", "expected"),
    [
        (1.0, 1.0, 1.0, YES),
        (1.01, 1.0, 1.2, PARTLY),
        (1.0, 1.01, 0.8, PARTLY),
        (2.0, 1.0, 1.0, PARTLY),
        (2.01, 1.0, 1.0, NO),
        (1.0, 2.01, 1.0, NO),
        (1.5, 1.0, 1.21, NO),
        (1.5, 1.0, 0.79, NO),
    ],
)
def test_10c(width: float, excess: float, power: float, expected: str) -> None:
    sweep = study(s__greatest_excess=excess, s__exponent=power)
    assert verdict("10c", sweep, *scenes(sliding(width), sliding(0.5))) == expected
    # a scene in which no row acts has no band
    assert verdict("10c", sweep, *scenes(sliding(width), Told())) == expected


@pytest.mark.parametrize(
    ("first", "later", "push", "expected"),
    [
        (10, 2.0, 50.0, YES),
        (11, 2.0, 50.0, YES),
        (12, 2.0, 50.0, PARTLY),
        (10, 2.01, 50.0, PARTLY),
        (5, 2.0, 100.0, PARTLY),
    ],
)
def test_10e(first: int, later: float, push: float, expected: str) -> None:
    """φ starts at 5 and is pushed by u⁺ − L_fφ = 100 − 50: within 0.1 s, and one sample, it is
    below zero.
    """
    run = Told({ROW: at({**dict.fromkeys(range(first), 5.0), first + 9: later}, -1.0)})
    run.drift[first - 1, 0] = push
    run.drift[first + 5, 0] = 1e3
    assert verdict("10e", run) == expected


def test_10e_that_never_ends() -> None:
    assert verdict("10e", Told({ROW: 5.0})) == NO
    for phi in ({0: 0.0}, {0: 0.0, 1: 5.0}):
        found = CLAIMS["10e"].check(
            dict(zip(CLAIMS["10e"].needs, [Told({ROW: at(phi)})], strict=True))
        )
        assert found.verdict == "not measured"


def test_10e_is_relative_to_the_period() -> None:
    """T_s u⁺ = 2 in a run with twice the period: φ may be 4 later on."""
    run = Told({ROW: at({**dict.fromkeys(range(3), 5.0), 20: 4.0}, -1.0)}, t=2.0 * T)
    assert verdict("10e", run) == YES


class Directions(Told):
    """A run whose rows are (1, 0) and (1, angle) divided by its length: one of the two active, or
    both.
    """

    angle = 1.0

    @property
    def setup(self) -> Any:
        A = np.array([[5.0, 0.0], [1.0, self.angle]])
        rows = SimpleNamespace(Lg=A, phi=np.zeros(2))
        return SimpleNamespace(
            world=lambda: SimpleNamespace(evaluate=lambda t, q, qd: SimpleNamespace(rows=rows))
        )


def directions(angle: float, last: int = 100, both: bool = True, **changed: Any) -> Directions:
    """Both rows are active in one sample; the run ends ``100 − last`` samples later."""
    phi = {"a": at({last: 0.0}), "b": at({last if both else 3: 0.0})}
    run = Directions(phi, q=np.zeros((101, 2)), qd=np.zeros((101, 2)), **changed)
    run.angle = angle
    return run


ABORTED = {"status": "aborted", "reason": "dependent: a, b"}


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        (directions(1.2e-6, **ABORTED), YES),  # the smaller singular value is angle/√2
        (directions(1.6e-6, **ABORTED), NO),
        (directions(1.2e-6, last=99, **ABORTED), NO),
        (directions(1.2e-6, both=False, **ABORTED), NO),
        (directions(1.2e-6), NO),
        (directions(1.2e-6, status="aborted", reason="something else"), NO),
        (directions(1.0), YES),
    ],
)
def test_10f(run: Directions, expected: str) -> None:
    lost = directions(1e-7, **ABORTED)
    well = directions(1.0)
    assert verdict("10f", run, well, lost, well) == expected


def test_10f_needs_a_run_that_loses_its_rank() -> None:
    found = CLAIMS["10f"].check(dict(zip(CLAIMS["10f"].needs, [directions(1.0)] * 4, strict=True)))
    assert found.verdict == "not measured"
