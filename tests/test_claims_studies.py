"""Claims that rest on studies alone, measured on made-up numbers.

Every number is just inside or just outside the claim's limit, and expected numbers are worked out
by hand.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest

from made_runs import FAILS, HOLDS, NOT_MEASURED, PARTLY, Expected, assert_finds, case, check
from vsconstraints.paper.studies import StudyResult
from vsconstraints.paper.studies.tables import Numbers

FOV = "example-2d-fov"
CASE = "case-study-6r"


def study(numbers: Numbers, *failures: str) -> tuple[StudyResult]:
    return (StudyResult("made up", numbers, (), (), failures),)


# --- 7a, 7c: how much space a law leaves unused, beside potential fields ---


def pareto(**changed: float) -> Numbers:
    """Sliding mode and both fields leave 1 % in both scenarios, but for what is changed.

    Names begin with ``fov`` or ``case``: ``left`` is by the sliding mode, ``field`` and
    ``priority`` by the fields; ``kept`` is the share of runs within their boundaries.
    """
    numbers: Numbers = {}
    for scenario, short in ((FOV, "fov"), (CASE, "case")):
        left = changed.get(f"{short}_left", 1.0)
        numbers[scenario, "printed", "kept"] = changed.get(f"{short}_kept", 1.0)
        numbers[scenario, "printed", "unused"] = left
        numbers[scenario, "sliding-mode", "kept"] = 3.0
        numbers[scenario, "sliding-mode", "least_unused"] = left
        numbers[scenario, "potential-field", "least_unused"] = changed.get(f"{short}_field", 1.0)
        numbers[scenario, "potential-field-priority", "least_unused"] = changed.get(
            f"{short}_priority", 1.0
        )
    return numbers


def unused(
    fov: tuple[float, float, float], case_study: tuple[float, float, float]
) -> dict[str, float]:
    """Values by the sliding mode, the field, and the field with priorities."""
    laws = ("sliding-mode", "potential-field", "potential-field-priority")
    return {
        f"{scenario}/{law}": value
        for scenario, values in ((FOV, fov), (CASE, case_study))
        for law, value in zip(laws, values, strict=True)
    }


SPACE_IS_USED = [
    *(
        case(key, source, study(pareto(**changed)), verdict)
        for key in ("7a", "7c")
        for source, changed, verdict in (
            ("1 % left", {}, HOLDS),
            (
                "more than 1 % left in the first",
                {"fov_left": 1.01, "fov_field": 2.0, "fov_priority": 2.0},
                PARTLY,
            ),
            (
                "more than 1 % left in the second",
                {"case_left": 1.01, "case_field": 2.0, "case_priority": 2.0},
                PARTLY,
            ),
            ("more than 1 % left in both", {"fov_left": 1.01, "case_left": 1.01}, FAILS),
            ("a field leaves less in the first", {"fov_field": 0.99}, PARTLY),
            ("a field leaves less in the second", {"case_priority": 0.99}, PARTLY),
            ("fields never keep their boundaries", {"fov_field": nan, "case_field": nan}, HOLDS),
            (
                "both fields leave less in both",
                {
                    "fov_field": 0.5,
                    "fov_priority": 0.5,
                    "case_field": 0.5,
                    "case_priority": 0.5,
                },
                PARTLY,
            ),
            # each scenario has fields of its own
            (
                "fields of both leave less than the second's law",
                {"fov_left": 0.5, "case_left": 0.75, "case_field": 0.5, "fov_field": 0.5},
                PARTLY,
            ),
            ("1.5 % in the first", {"fov_left": 1.5, "case_left": 0.75}, PARTLY),
            ("1.5 % in the second", {"fov_left": 0.75, "case_left": 1.5}, PARTLY),
        )
    ),
    # 7a compares only what keeps its boundaries with the printed gains
    case("7a", "the first does not keep its boundaries", study(pareto(fov_kept=0.0)), PARTLY),
    case("7a", "neither does", study(pareto(fov_kept=0.0, case_kept=0.0)), FAILS),
    case("7c", "neither does", study(pareto(fov_kept=0.0, case_kept=0.0)), HOLDS),
    case("7a", "twice as many are kept", study(pareto(fov_kept=2.0)), PARTLY),
    case(
        "7a",
        "numbers",
        study(
            pareto(fov_left=0.5, fov_field=0.75, fov_priority=2.0, case_kept=0.5, case_field=nan)
        ),
        PARTLY,
        unused((0.5, 0.75, 2.0), (nan, nan, 1.0)),
        f"{FOV}: sliding-mode leaves 0.5 %; potential-field leaves 0.75 %, "
        "potential-field-priority leaves 2 % at best. "
        f"{CASE}: sliding-mode does not keep its boundaries (5d), so that it is not compared; "
        "potential-field has no such run, potential-field-priority leaves 1 % at best",
    ),
    case(
        "7c",
        "numbers",
        study(pareto(fov_left=0.5, fov_field=0.25, fov_kept=0.0, case_left=1.5, case_priority=nan)),
        PARTLY,
        unused((0.5, 0.25, 1.0), (1.5, 1.0, nan)),
        f"{FOV} (the printed gains break (12): 5d): sliding-mode leaves 0.5 %, potential-field "
        "leaves 0.25 %, potential-field-priority leaves 1 %, so that it holds partly there; "
        f"{CASE}: sliding-mode leaves 1.5 %, potential-field leaves 1 %, "
        "potential-field-priority has no such run, so that it does not hold there",
    ),
]


def test_7c_gives_no_reason_where_it_holds() -> None:
    assert "so that" not in check("7c", study(pareto())).text


def test_a_missing_number_is_not_measured() -> None:
    """The text says which, and the first failure of the study."""
    numbers = pareto()
    del numbers[CASE, "sliding-mode", "kept"]
    text = f"the study made up has no {CASE}.sliding-mode.kept"
    assert check("7c", study(numbers)).text == text
    found = check("7c", study(numbers, "one: lost", "two: lost"))
    assert (found.verdict, found.text) == (NOT_MEASURED, f"{text}: one: lost")
    assert not found.values


# --- 8a: with a shrinking region the potential field becomes the law ---


def shrinking(
    floor: float = 0.1, far: float = 1.0, near: float = 0.2, falls: float = 1.0
) -> Numbers:
    """Distances between trajectories [rad]: these in the case study, others in the first example.

    ``floor`` is that between two sampling times, ``far`` and ``near`` are those with the largest
    and the smallest region; ``falls`` is 1 if the distance never rises in between.
    """
    numbers: Numbers = {}
    for scenario, values in ((FOV, (0.1, 1.0, 0.1, 1.0)), (CASE, (floor, far, near, falls))):
        numbers[scenario, "sampling_distance"] = values[0]
        numbers[scenario, "priority", "distance_largest_region"] = values[1]
        numbers[scenario, "priority", "distance_smallest_region"] = values[2]
        numbers[scenario, "priority", "distance_falls"] = values[3]
        numbers[scenario, "priority", "region_largest"] = 0.5
        numbers[scenario, "priority", "region_smallest"] = 1e-3
    return numbers


FIELD_BECOMES_THE_LAW = [
    *(
        case("8a", source, study(shrinking(**changed)), verdict)
        for source, changed, verdict in (
            ("a fifth is left, twice the floor", {}, HOLDS),
            ("more than a fifth", {"near": 0.201}, PARTLY),
            ("the distance rises in between", {"falls": 0.0}, PARTLY),
            ("no less at last", {"near": 0.2, "far": 0.2, "falls": 0.0}, FAILS),
            ("more at last", {"near": 1.1, "far": 1.0}, FAILS),
            ("twice a greater floor", {"floor": 0.125, "near": 0.25}, HOLDS),
            ("2 is not 1", {"floor": 0.125, "near": 0.25, "falls": 2.0}, PARTLY),
            ("0.5 is not 1", {"floor": 0.125, "near": 0.25, "falls": 0.5}, PARTLY),
        )
    ),
    case(
        "8a",
        "numbers",
        study(shrinking(floor=0.125, far=2.0, near=0.25, falls=0.0)),
        PARTLY,
        {
            f"{FOV}/far": 1.0,
            f"{FOV}/near": 0.1,
            f"{FOV}/floor": 0.1,
            f"{CASE}/far": 2.0,
            f"{CASE}/near": 0.25,
            f"{CASE}/floor": 0.125,
        },
        f"{FOV}: 1e+03 mrad rms with a region of 0.5, 100 mrad with 0.001 (never rising by more "
        "than the 100 mrad between T_s and T_s/2 explain); "
        f"{CASE}: 2e+03 mrad rms with a region of 0.5, 250 mrad with 0.001 (rising in between by "
        "more than the 125 mrad between T_s and T_s/2 explain)",
    ),
]

# --- 9b: first derivatives may be off by c_e = 0.3 ---


def off(*scenes: tuple[str, float, float]) -> Numbers:
    """Violation [% of L] and share of converged runs by scene; only the first has a deviation."""
    law = ("sliding-mode", 0.3)
    numbers: Numbers = {}
    for name, violation, converged in scenes:
        numbers[(name, *law, "violation")] = violation
        numbers[(name, *law, "converged")] = converged
    for name, _, _ in scenes[:1]:
        numbers[(name, *law, "deviation_px")] = 3.0
    return numbers


DERIVATIVES_MAY_BE_OFF = [
    *(
        case(
            "9b",
            f"violation {violation}, converged {converged} in one of two",
            study(off((first, 0.0, 1.0), (second, violation, converged))),
            verdict,
        )
        for first, second in ((FOV, CASE), (CASE, FOV))
        for violation, converged, verdict in (
            (0.0, 1.0, HOLDS),
            (1e-6, 1.0, PARTLY),
            (0.5, 1.0, PARTLY),
            (1.0, 1.0, PARTLY),
            (1.01, 1.0, FAILS),
            (2.0, 1.0, FAILS),
            (0.0, 0.0, FAILS),
            (0.0, 2.0, FAILS),
        )
    ),
    case(
        "9b",
        "numbers",
        study(off(("a", 0.5, 1.0), ("b", 0.0, 1.0), ("c", 0.25, 0.5))),
        FAILS,
        {"a": 0.5, "b": 0.0, "c": 0.25},
        "a: converges, violates 0.5 % of L, tracks deviate by 3 px; b: converges, violates "
        "nothing, tracks deviate by nan px; c: does not converge, violates 0.25 % of L, tracks "
        "deviate by nan px",
    ),
    case(
        "9b",
        "no run",
        study({}),
        NOT_MEASURED,
        text="the study gradient-error has no run of the sliding mode with c_e = 0.3",
    ),
]

# --- 10a: the gain must rise with the speed ---

SPEEDS = (9, 20, 100)
"""K_T,p(0): by number, not by letter, 9 comes before 20 and 100."""


def gains(
    bounds: tuple[float, ...], smallest: tuple[float, ...], speeds: tuple[int, ...] = SPEEDS
) -> Numbers:
    """Bounds (12) on u⁺ and smallest gains that keep φ in its band, by speed; nan is left out."""
    numbers: Numbers = {}
    for speed, bound, gain in zip(speeds, bounds, smallest, strict=True):
        numbers[speed, "bound_12"] = float(bound)
        numbers[speed, "smallest_in_band"] = float(gain)
    return numbers


def without_the_last_gain(smallest_at_9: float) -> Numbers:
    numbers = gains((1, 2, 3), (smallest_at_9, 8, nan))
    del numbers[100, "smallest_in_band"]
    return numbers


GAIN_RISES_WITH_SPEED = [
    *(
        case("10a", f"bounds {bounds}, gains {smallest}", study(gains(bounds, smallest)), verdict)
        for bounds, smallest, verdict in (
            ((1, 2, 3), (5, 5, 6), HOLDS),
            ((1, 2, 2), (5, 5, 6), PARTLY),
            ((1, 3, 2), (5, 5, 6), PARTLY),
            ((1, 2, 3), (5, 5, 5), PARTLY),
            ((1, 2, 3), (5, 7, 6), PARTLY),
            ((1, 2, 3), (5, 6, nan), HOLDS),
            ((1, 2, 3), (nan, 6, 7), PARTLY),
            ((3, 2, 1), (7, 6, 5), FAILS),
            ((1, 1, 1), (nan, nan, nan), FAILS),
        )
    ),
    case("10a", "one speed", study(gains((1,), (1,), (9,))), NOT_MEASURED),
    case("10a", "two speeds", study(gains((1, 2), (1, 2), (9, 20))), HOLDS),
    case(
        "10a",
        "numbers: no gain is enough at last",
        study(without_the_last_gain(8)),
        HOLDS,
        {"9": 8.0, "20": 8.0, "100": inf},
        "K_T,p(0) = 9: (12) asks for 1, 8 is enough; K_T,p(0) = 20: (12) asks for 2, 8 is enough; "
        "K_T,p(0) = 100: (12) asks for 3, no gain tried is enough",
    ),
    case("10a", "rises anywhere", study(without_the_last_gain(4)), HOLDS),
]

# --- 10d: with a short sampling time chattering is negligible ---

CHATTERING = [
    *(
        case(
            "10d",
            f"band {band} with the shortest sampling time of the first example",
            study({(FOV, "band", 10): 9.0, (FOV, "band", 2): band, (CASE, "band", 1): 9.0}),
            verdict,
        )
        for band, verdict in ((0.02, HOLDS), (0.0201, FAILS))
    ),
    case(
        "10d",
        "numbers",
        study({(FOV, "band", 10): 0.5, (FOV, "band", 2.5): 0.02, (CASE, "band", 1): 9.0}),
        HOLDS,
        {"10": 0.5, "2.5": 0.02},
        "band of φ: 0.500 at 10 ms, 0.020 at 2.5 ms",
    ),
    *(
        case(
            "10d",
            source,
            study(numbers),
            NOT_MEASURED,
            text="the study sampling-time has no band of the first example",
        )
        for source, numbers in (
            ("a band of the case study alone", {(CASE, "band", 1): 0.0}),
            ("no band", {}),
        )
    ),
]

# --- all of them ---


@pytest.mark.parametrize(
    ("key", "needs", "expected"),
    [
        *SPACE_IS_USED,
        *FIELD_BECOMES_THE_LAW,
        *DERIVATIVES_MAY_BE_OFF,
        *GAIN_RISES_WITH_SPEED,
        *CHATTERING,
    ],
)
def test_claim(key: str, needs: tuple[Any, ...], expected: Expected) -> None:
    assert_finds(check(key, needs), expected)
