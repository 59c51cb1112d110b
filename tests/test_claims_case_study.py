"""Claim 5, on the case study, measured on made-up runs with a phase of 4 s and a second one.

Every number is just inside or just outside the claim's limit, and expected numbers are worked out
by hand.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from made_runs import (
    FAILS,
    HOLDS,
    PARTLY,
    ROW,
    TWELVE_SECONDS,
    Expected,
    MadeRun,
    active_during,
    assert_finds,
    case,
    check,
    column,
)
from vsconstraints.paper import case_study, scenes
from vsconstraints.paper.claims import section_4_approach, section_9_case_study
from vsconstraints.rows import Array

TEN_SECONDS = 0.1 * np.arange(101)
BORDERS = [f"fov[marker {i}]" for i in (1, 2, 3, 4)]
RANGE = "range[joint 6].upper"
SPEED = "speed[joint 2].upper"
SPHERE = "sphere[tip]"

LABELS = {
    "marker1": BORDERS[0],
    "marker2": BORDERS[1],
    "marker3": BORDERS[2],
    "marker4": BORDERS[3],
    "range": RANGE,
    "speed": SPEED,
    "sphere": SPHERE,
    "lower": "range[joint 6].lower",
}


def two_phases(
    phi: Any = None, sigma: Any = None, t: Array = TWELVE_SECONDS, **columns: Any
) -> MadeRun:
    """A case study whose second goal holds from 4 s on."""
    goals = [None, SimpleNamespace(from_time=4.0)]
    setup = SimpleNamespace(task=SimpleNamespace(goals=goals))
    return MadeRun(phi, sigma, t=t, setup=setup, **columns)


Spans = list[tuple[float, float]]


def active(q6: float = 0.0999, qd2: float = 0.4, t: Array = TEN_SECONDS, **spans: Spans) -> MadeRun:
    """Rows are active in these intervals.

    The greatest position of the sixth joint and the speed of the second that is farthest from zero
    are given; those of other joints are nonsense.
    """
    phi = {label: active_during(*spans.get(name, ()), t=t) for name, label in LABELS.items()}
    q = np.full((len(t), 7), 9.0)
    qd = np.full((len(t), 7), 9.0)
    q[:, 5] = column({7: q6}, -3.0, t)
    qd[:, 1] = column({7: qd2, 9: 0.2}, 0.0, t)
    return two_phases(phi, t=t, q=q, qd=qd)


# --- 5a: errors vanish in both phases ---


def left_over(changed: dict[tuple[int, int], float]) -> MadeRun:
    """Errors of 1 and 2 begin the first phase, 3 and 4 the second; less than 1 % of them is left.

    Each key is a sample and a column.
    """
    error = np.full((101, 2), 7.0)
    start = {(0, 0): 1.0, (0, 1): 2.0, (40, 0): 3.0, (40, 1): 4.0}
    left = {(39, 0): 0.0099, (39, 1): 0.0199, (100, 0): 0.0299, (100, 1): 0.0399}
    for place, value in (start | left | changed).items():
        error[place] = value
    return two_phases(t=TEN_SECONDS, camera_error=error)


def left_of_seven() -> MadeRun:
    error = np.full((len(TWELVE_SECONDS), 2), 7.0)
    error[0] = (2.0, 4.0)
    error[39] = (0.01, 0.03)
    error[40] = (5.0, 8.0)
    error[-1] = (0.04, 0.4)
    return two_phases(camera_error=error)


def left_of_one() -> MadeRun:
    error = np.full((len(TWELVE_SECONDS), 2), 1.0)
    error[39] = error[-1] = 0.01
    return two_phases(camera_error=error)


ALL_LEFT = {(39, 0): 0.01, (39, 1): 0.0201, (100, 0): 0.0301, (100, 1): 0.0401}

ERRORS_VANISH = [
    case("5a", "less than 1 % of all", left_over({}), HOLDS),
    case("5a", "position in the first phase", left_over({(39, 0): 0.0101}), PARTLY),
    case("5a", "orientation in the first phase", left_over({(39, 1): 0.0201}), PARTLY),
    case("5a", "position in the second phase", left_over({(100, 0): 0.0301}), PARTLY),
    case("5a", "orientation in the second phase", left_over({(100, 1): 0.0401}), PARTLY),
    case("5a", "more than 1 % of all", left_over(ALL_LEFT), FAILS),
    case("5a", "exactly 1 % of all", left_of_one(), FAILS),
    case(
        "5a",
        "numbers",
        left_of_seven(),
        PARTLY,
        {
            "position_left_1": 0.005,
            "orientation_left_1": 0.0075,
            "position_left_2": 0.008,
            "orientation_left_2": 0.05,
        },
        part="phase 1: 2000 → 10.0 mm, 4.00 → 0.0300 rad; phase 2: 5000 → 40.0 mm",
    ),
]

# --- 5b, 5c: the second and the third marker reach the borders ---

SECOND, THIRD = BORDERS[1:3]


def nearest(second: float, third: float) -> MadeRun:
    clearance = {SECOND: column({5: second}, 1.0), THIRD: column({5: third}, 1.0)}
    return MadeRun(dict.fromkeys(BORDERS, -1.0), {}, clearance)


def sliding_in_turn() -> MadeRun:
    phi: dict[str, Any] = dict.fromkeys(BORDERS, -1.0)
    phi[SECOND] = active_during((0.1, 0.5))
    phi[THIRD] = active_during((0.5, 0.9))
    clearance = dict.fromkeys(BORDERS, 0.5) | {SECOND: 0.004, THIRD: 0.006}
    other = column({50: 2.0, 80: 0.15}, 0.0)
    speed = dict.fromkeys(BORDERS, other) | {SECOND: column({10: 4.0, 40: 0.2}, 0.0)}
    return MadeRun(phi, {}, clearance, speed=speed)


BORDERS_ARE_REACHED = [
    case("5b", "1 % of the length", nearest(0.01, 0.0), HOLDS),
    case("5b", "the second stays away", nearest(0.011, 0.0), PARTLY),
    case("5b", "the third stays away", nearest(0.0, 0.011), PARTLY),
    case(
        "5b", "numbers of no other marker", sliding_in_turn(), HOLDS, {SECOND: 0.004, THIRD: 0.006}
    ),
    case(
        "5c",
        "numbers of no other marker",
        sliding_in_turn(),
        HOLDS,
        {"share_left": 0.075},
        part=f": {SECOND} 4 → 0.2 px/s; {THIRD} 2 → 0.15 px/s",
    ),
]

# --- 5d: all constraints are fulfilled ---


def with_two_speeds(needed_share: float) -> MadeRun:
    """Two speeds, of which the second is exceeded more."""
    return two_phases(
        {
            ROW: column({5: 0.75}, -2.0, TEN_SECONDS),
            "speed[joint 2].lower": column({7: 0.125}, t=TEN_SECONDS),
            SPEED: column({8: 0.25, 9: 0.1}, t=TEN_SECONDS),
        },
        {ROW: column({5: -0.5}, -2.0, TEN_SECONDS)},
        t=TEN_SECONDS,
        bounds=dict.fromkeys([ROW, "speed[joint 2].lower", SPEED], 1.0),
        needed_shares=column({5: needed_share}, 0.0, TEN_SECONDS),
    )


WITH_HALF_THE_PERIOD = MadeRun(
    {
        ROW: column(dict.fromkeys(range(5), 1.0)),
        "speed[joint 2].lower": column({7: 0.0}),
        SPEED: -1.0,
    }
)

ALL_CONSTRAINTS = [
    case(
        "5d",
        f"(12) asks for {share} of the gain",
        (with_two_speeds(share), WITH_HALF_THE_PERIOD),
        PARTLY,
        {
            "phi_max": 0.75,
            "sigma_max": -0.5,
            "excess": 0.75,
            "longest": 2.0,
            "speed_excess": 0.25,
            "longest_halved": 5.0,
        },
        part=f"the printed gains {remark}: with half the period φ ≥ 0 for 5 samples in a row; the "
        "speed",
    )
    for share, remark in ((0.999, "keep (12)"), (1.0, "break (12): this is not sampling"))
]


@pytest.mark.parametrize("share", [0.999, 1.0])
def test_5d_ends_with_the_excess_of_the_speed(share: float) -> None:
    found = check("5d", (with_two_speeds(share), WITH_HALF_THE_PERIOD))
    assert found.text.endswith("25.00 % above its limit")


# --- 5e: the limits of two joints are active in the first phase ---

IN_FIRST: Spans = [(1.0, 2.0)]
IN_SECOND: Spans = [(5.0, 6.0)]
AT_LIMIT = section_9_case_study.Q6_LIMIT

JOINT_LIMITS = [
    case("5e", "until 3.9 s", active(range=IN_FIRST, speed=[(0.0, 3.9)]), HOLDS),
    case("5e", "until the second phase", active(range=IN_FIRST, speed=[(1.0, 4.0)]), FAILS),
    case("5e", "the speed is never active", active(range=IN_FIRST), FAILS),
    *(
        case("5e", source, active(range=IN_FIRST, speed=IN_FIRST, **greatest), verdict)
        for source, greatest, verdict in (
            ("q6 of 0.0881 rad", {"q6": 0.0881}, HOLDS),
            ("q6 of 0.0879 rad", {"q6": 0.0879}, PARTLY),
            ("q6 of 0.1001 rad", {"q6": 0.1001}, PARTLY),
            ("qd2 of -0.4039 rad/s", {"qd2": -0.4039}, HOLDS),
            ("qd2 of 0.4041 rad/s", {"qd2": 0.4041}, PARTLY),
            ("qd2 of 0.3961 rad/s", {"qd2": 0.3961}, HOLDS),
            ("qd2 of 0.3959 rad/s", {"qd2": 0.3959}, PARTLY),
        )
    ),
    case(
        "5e",
        "numbers: at the limit, of either sign",
        active(AT_LIMIT, -0.4, TWELVE_SECONDS, range=IN_FIRST, speed=[(2.5, 3.0)]),
        HOLDS,
        {"q6": 0.1, "qd2": 0.4},
        part="range[joint 6] at 1.00–2.00 s; speed[joint 2] at 2.50–3.00 s; q₆ up to 0.1000 rad",
    ),
    case(
        "5e",
        "the range is active in the second phase, too",
        active(AT_LIMIT, -0.4, TWELVE_SECONDS, range=IN_FIRST + IN_SECOND, speed=[(2.5, 3.0)]),
        FAILS,
    ),
    case(
        "5e",
        "by the lower side of the range",
        active(AT_LIMIT, -0.4, TWELVE_SECONDS, lower=IN_FIRST, speed=[(2.5, 3.0)]),
        HOLDS,
    ),
]

# --- 5f: the sphere is active from 6 to 8 s ---

SPHERE_ACTS = [
    case("5f", "as printed", active(sphere=[(6.0, 8.0)]), HOLDS),
    case("5f", "rounds to the printed", active(sphere=[(5.6, 8.4)]), HOLDS),
    case("5f", "begins at 5 s", active(sphere=[(5.4, 8.0)]), PARTLY),
    case("5f", "0.6 s apart is one interval", active(sphere=[(6.0, 6.4), (7.0, 8.0)]), HOLDS),
    case("5f", "0.7 s apart is two", active(sphere=[(6.0, 6.3), (7.0, 8.0)]), PARTLY),
    case("5f", "in the first phase, too", active(sphere=[(1.0, 1.0), (6.0, 8.0)]), PARTLY),
    case("5f", "in the first phase alone", active(sphere=IN_FIRST), FAILS),
    case(
        "5f",
        "numbers of two intervals",
        active(sphere=[(6.0, 6.5), (8.0, 9.0)]),
        PARTLY,
        {"from_0": 6.0, "to_0": 6.5, "from_1": 8.0, "to_1": 9.0},
    ),
    case(
        "5f",
        "numbers of the second phase alone",
        active(sphere=[(1.0, 2.0), (6.0, 8.0)]),
        PARTLY,
        {"from_0": 6.0, "to_0": 8.0},
        "active at 1.00–2.00 s and 6.00–8.00 s",
    ),
]

# --- 5g: markers 2 and 3 in the first phase, marker 2 in the second ---

ANY_PHASE = IN_FIRST + IN_SECOND

BORDERS_ACT = [
    case("5g", "as printed", active(marker2=ANY_PHASE, marker3=IN_FIRST), HOLDS),
    case(
        "5g",
        "marker 1 acts, too",
        active(marker2=ANY_PHASE, marker3=IN_FIRST, marker1=IN_FIRST),
        PARTLY,
    ),
    case(
        "5g",
        "marker 4 acts, too",
        active(marker2=ANY_PHASE, marker3=IN_FIRST, marker4=IN_SECOND),
        PARTLY,
    ),
    case("5g", "none in the second phase", active(marker2=IN_FIRST, marker3=IN_FIRST), FAILS),
    case("5g", "marker 3 never acts", active(marker2=ANY_PHASE), FAILS),
    case(
        "5g",
        "text",
        active(marker2=ANY_PHASE, marker4=[(7.0, 8.0)]),
        FAILS,
        {},
        "fov[marker 2] at 1.00–2.00 s and 5.00–6.00 s; fov[marker 4] at 7.00–8.00 s",
    ),
    case("5g", "text of nothing", active(), FAILS, text="no border ever acts"),
]

# --- 5h: up to three rows act at a time ---

AT_ONCE = [
    (
        "three intervals overlap",
        active(marker2=IN_FIRST, marker3=[(2.0, 3.0)], range=[(1.5, 2.5)]),
        3,
        HOLDS,
    ),
    (
        "two intervals overlap",
        active(marker2=[(1.0, 1.9)], marker3=[(2.0, 3.0)], range=[(1.5, 2.5)]),
        2,
        PARTLY,
    ),
    (
        "four intervals overlap",
        active(marker2=IN_FIRST, marker3=IN_FIRST, range=IN_FIRST, speed=IN_FIRST),
        4,
        PARTLY,
    ),
    ("one interval", active(marker2=IN_FIRST), 1, FAILS),
    ("no overlap", active(marker2=IN_FIRST, marker3=[(3.0, 3.5)]), 1, FAILS),
]

THREE_AT_A_TIME = [
    *(
        case("5h", source, run, verdict, {"most": most, "same_sample": most})
        for source, run, most, verdict in AT_ONCE
    ),
    case(
        "5h",
        "intervals overlap, of which at most two rows are active in one sample",
        active(
            marker2=[(1.0, 1.0), (1.5, 1.5)],
            marker3=[(1.1, 1.1), (1.6, 1.6)],
            range=[(1.2, 1.2), (1.5, 1.5)],
        ),
        HOLDS,
        {"most": 3.0, "same_sample": 2.0},
        "up to 3 intervals overlap (1.20–1.50 s); up to 2 rows have φ ≥ 0 in one sample",
    ),
]


@pytest.mark.parametrize(("run", "most"), [(run, most) for _, run, most, _ in AT_ONCE])
def test_greatest_number_of_intervals_at_once(run: Any, most: int) -> None:
    assert int(case_study.at_once(run).max()) == most


# --- 5i: the sphere is never entered ---

SPHERE_IS_NOT_ENTERED = [
    case(
        "5i",
        f"clearance {least}",
        MadeRun({SPHERE: column({5: 0.5})}, {}, {SPHERE: column({3: least}, 1.0)}),
        verdict,
        {"clearance_min": least, "phi_max": 0.5},
    )
    for least, verdict in ((0.0, HOLDS), (-1e-6, FAILS))
]

# --- 5j: the error follows (42) ---

GAIN_ROOTS = (1.7082039324993694, 11.70820393249937)
"""Roots of x² − 3√20 x + 20, with the signs of decay rates [1/s]."""


def decaying_error(t: Array) -> Array:
    """(N,) error with a constant gain, from 1e-6, left at three times itself per second.

    e = (e^(−at) (b e₀ + ė₀) − e^(−bt) (a e₀ + ė₀))/(b − a). For so small an error the slope of the
    gain does not matter.
    """
    a, b = GAIN_ROOTS
    growing = np.exp(-a * t) * (b + 3.0)
    falling = np.exp(-b * t) * (a + 3.0)
    return 1e-6 * (growing - falling) / (b - a)


def deviating(share: float) -> MadeRun:
    """One component deviates by a share of the start; after the first phase nothing counts."""
    t = 0.002 * np.arange(501)
    error = np.zeros((len(t), 6))
    error[:, 0] = decaying_error(t)
    error[300, 3] = share * 1e-6
    return two_phases(t=np.concatenate((t, [4.0, 4.1])), error=np.vstack((error, np.ones((2, 6)))))


ERROR_FOLLOWS = [
    case("5j", "deviates by less than 1 %", deviating(0.0099), HOLDS),
    case("5j", "deviates by more than 1 %", deviating(0.0101), FAILS),
]


def test_ideal_error() -> None:
    t = 0.002 * np.arange(501)
    start = np.array([1e-6, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = section_4_approach.ideal_error(start, 3.0 * start, t)
    np.testing.assert_allclose(found[:, 0], decaying_error(t), rtol=1e-4)
    np.testing.assert_array_equal(found[:, 1:], 0.0)
    # from 0.5 the gain is e^(−1.5) of that at first: ë = −20 e^(−1.5) 0.5, and e falls by half of
    # that times t²
    start = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    found = section_4_approach.ideal_error(start, np.zeros(6), np.array([0.0, 0.001]))
    assert found[1, 1] - 0.5 == pytest.approx(-1.1156508e-6, rel=5e-3)


def test_5j_numbers() -> None:
    """The error ends as (42) wants it, but for one sample of the first phase."""
    t = 0.002 * np.arange(2100)
    start = np.array([3e-6, 0.0, 0.0, 0.0, 0.0, 4e-6])
    error = section_4_approach.ideal_error(start, -3.0 * start, t)
    error[:, 3] += column({300: 0.006 * 5e-6, 301: 0.004 * 5e-6}, 0.0, t)
    error[t > 4.0 - 1e-9] = 1.0
    finding = check("5j", (two_phases(t=t, error=error),))
    assert finding.verdict == HOLDS
    assert finding.values == {"share": pytest.approx(0.006, rel=2e-3)}
    assert finding.text.endswith("in 2000 samples")


# --- all of them ---


@pytest.mark.parametrize(
    ("key", "needs", "expected"),
    [
        *ERRORS_VANISH,
        *BORDERS_ARE_REACHED,
        *ALL_CONSTRAINTS,
        *JOINT_LIMITS,
        *SPHERE_ACTS,
        *BORDERS_ACT,
        *THREE_AT_A_TIME,
        *SPHERE_IS_NOT_ENTERED,
        *ERROR_FOLLOWS,
    ],
)
def test_claim(key: str, needs: tuple[Any, ...], expected: Expected) -> None:
    assert_finds(check(key, needs), expected)


@pytest.mark.parametrize(("early", "is_second"), [(0.0, True), (1e-12, True), (1e-7, False)])
def test_the_second_phase_begins_with_its_goal_but_for_rounding(
    early: float, is_second: bool
) -> None:
    t = TWELVE_SECONDS.copy()
    t[40] = 4.0 - early
    run: Any = active(t=t, sphere=[(t[40], t[40])])
    first, second = case_study.phases(run, SPHERE)
    interval = [(t[40], t[40])]
    assert first == ([] if is_second else interval)
    assert second == (interval if is_second else [])


def test_scenes_of_the_case_study() -> None:
    """Half the period of 2 ms; tracking starts in motion."""
    assert scenes.CASE.load().setup().Ts == 0.002
    assert scenes.CASE_HALVED.load().setup().Ts == 0.001
    np.testing.assert_array_equal(
        scenes.TRACKING.load().setup().qd0, [0.2, -0.2, 0.2, 0.6, -0.6, 0.6]
    )
