"""The rules of claims about studies, on made-up numbers: every one just inside or just outside."""

from __future__ import annotations

from math import inf, nan

import pytest

from told import NO, PARTLY, YES
from vsconstraints.paper.studies import StudyResult
from vsconstraints.paper.studies.tables import Numbers
from vsconstraints.paper.verdicts import CLAIMS, Finding

ONE = "example-2d-fov"
OTHER = "case-study-6r"


def verdict(key: str, numbers: Numbers) -> str:
    (name,) = CLAIMS[key].needs
    return CLAIMS[key].check({name: StudyResult("made up", numbers, (), (), ())}).verdict


def pareto(**changed: float) -> Numbers:
    """In each scenario: 1 % left by the sliding mode and by both fields."""
    found = {}
    for scenario, short in ((ONE, "one"), (OTHER, "other")):
        found[(scenario, "printed", "kept")] = changed.get(f"{short}_printed", 1.0)
        found[(scenario, "printed", "unused")] = changed.get(f"{short}_left", 1.0)
        found[(scenario, "sliding-mode", "kept")] = 3.0
        found[(scenario, "sliding-mode", "least_unused")] = changed.get(f"{short}_left", 1.0)
        found[(scenario, "potential-field", "least_unused")] = changed.get(f"{short}_field", 1.0)
        found[(scenario, "potential-field-priority", "least_unused")] = changed.get(
            f"{short}_priority", 1.0
        )
    return found


@pytest.mark.parametrize("key", ["7a", "7c"])
@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, YES),
        ({"one_left": 1.01, "one_field": 2.0, "one_priority": 2.0}, PARTLY),
        ({"other_left": 1.01, "other_field": 2.0, "other_priority": 2.0}, PARTLY),
        ({"one_left": 1.01, "other_left": 1.01}, NO),
        ({"one_field": 0.99}, PARTLY),
        ({"other_priority": 0.99}, PARTLY),
        ({"one_field": nan, "other_field": nan}, YES),
        (
            {"one_field": 0.5, "one_priority": 0.5, "other_field": 0.5, "other_priority": 0.5},
            PARTLY,
        ),
    ],
)
def test_7a_and_7c(key: str, changed: dict[str, float], expected: str) -> None:
    assert verdict(key, pareto(**changed)) == expected


def test_7a_compares_only_what_keeps_its_boundaries() -> None:
    assert verdict("7a", pareto(one_printed=0.0)) == PARTLY
    assert verdict("7a", pareto(one_printed=0.0, other_printed=0.0)) == NO
    assert verdict("7c", pareto(one_printed=0.0, other_printed=0.0)) == YES


def shrinking(
    floor: float = 0.1, far: float = 1.0, near: float = 0.2, falls: float = 1.0
) -> Numbers:
    found = {}
    for scenario in (ONE, OTHER):
        own = (floor, far, near, falls) if scenario == OTHER else (0.1, 1.0, 0.1, 1.0)
        found[(scenario, "sampling_distance")] = own[0]
        found[(scenario, "priority", "distance_largest_region")] = own[1]
        found[(scenario, "priority", "distance_smallest_region")] = own[2]
        found[(scenario, "priority", "distance_falls")] = own[3]
        found[(scenario, "priority", "region_largest")] = 0.5
        found[(scenario, "priority", "region_smallest")] = 1e-3
    return found


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, YES),
        ({"near": 0.201}, PARTLY),
        ({"falls": 0.0}, PARTLY),
        ({"near": 0.2, "far": 0.2, "falls": 0.0}, NO),
        ({"near": 1.1, "far": 1.0}, NO),
    ],
)
def test_8a(changed: dict[str, float], expected: str) -> None:
    assert verdict("8a", shrinking(**changed)) == expected


@pytest.mark.parametrize(
    ("depth", "converged", "expected"),
    [(0.0, 1.0, YES), (1e-6, 1.0, PARTLY), (1.0, 1.0, PARTLY), (1.01, 1.0, NO), (0.0, 0.0, NO)],
)
def test_9b(depth: float, converged: float, expected: str) -> None:
    at = ("sliding-mode", 0.3)
    found = {(ONE, *at, "violation"): 0.0, (ONE, *at, "converged"): 1.0}
    found |= {(OTHER, *at, "violation"): depth, (OTHER, *at, "converged"): converged}
    assert verdict("9b", found) == expected


@pytest.mark.parametrize(
    ("bounds", "gains", "expected"),
    [
        ((1, 2, 3), (5, 5, 6), YES),
        ((1, 2, 2), (5, 5, 6), PARTLY),
        ((1, 3, 2), (5, 5, 6), PARTLY),
        ((1, 2, 3), (5, 5, 5), PARTLY),
        ((1, 2, 3), (5, 7, 6), PARTLY),
        ((1, 2, 3), (5, 6, nan), YES),
        ((1, 2, 3), (nan, 6, 7), PARTLY),
        ((3, 2, 1), (7, 6, 5), NO),
        ((1, 1, 1), (nan, nan, nan), NO),
    ],
)
def test_10a(bounds: tuple[float, ...], gains: tuple[float, ...], expected: str) -> None:
    # by number, not by letter: 9 comes before 20 and 100
    found = {(Kp0, "bound_12"): float(v) for Kp0, v in zip((9, 20, 100), bounds, strict=True)}
    found |= {
        (Kp0, "smallest_in_band"): float(v) for Kp0, v in zip((9, 20, 100), gains, strict=True)
    }
    assert verdict("10a", found) == expected


def test_10a_needs_two_speeds() -> None:
    found = {(9, "bound_12"): 1.0, (9, "smallest_in_band"): 1.0}
    assert verdict("10a", found) == "not measured"
    assert verdict("10a", found | {(20, "bound_12"): 2.0, (20, "smallest_in_band"): 2.0}) == YES


@pytest.mark.parametrize(("band", "expected"), [(0.02, YES), (0.0201, NO)])
def test_10d(band: float, expected: str) -> None:
    bands = {(ONE, "band", 10): 9.0, (ONE, "band", 2): band, (OTHER, "band", 1): 9.0}
    assert verdict("10d", bands) == expected
    assert verdict("10d", {(OTHER, "band", 1): 0.0}) == "not measured"


# --- what they say ---


def found(key: str, numbers: Numbers, *failures: str) -> Finding:
    (name,) = CLAIMS[key].needs
    return CLAIMS[key].check({name: StudyResult("made up", numbers, (), (), failures)})


NONE = pytest.approx(nan, nan_ok=True)


def test_7a_says() -> None:
    """The second scenario does not keep its boundaries with the printed gains, and one of its
    fields never does.
    """
    of = found(
        "7a",
        pareto(one_left=0.5, one_field=0.75, one_priority=2.0, other_printed=0.5, other_field=nan),
    )
    assert of.values == {
        f"{ONE}/sliding-mode": 0.5, f"{ONE}/potential-field": 0.75, f"{ONE}/potential-field-priority": 2.0,
        f"{OTHER}/sliding-mode": NONE, f"{OTHER}/potential-field": NONE, f"{OTHER}/potential-field-priority": 1.0,
    }  # fmt: skip
    assert of.text == (
        f"{ONE}: sliding-mode leaves 0.5 %; potential-field leaves 0.75 %, "
        f"potential-field-priority leaves 2 % at "
        f"best. {OTHER}: sliding-mode does not keep its boundaries (5d), so that it is not "
        f"compared; potential-field "
        "has no such run, potential-field-priority leaves 1 % at best"
    )
    assert of.verdict == PARTLY
    assert found("7a", pareto(one_printed=2.0)).verdict == PARTLY


def test_7c_says() -> None:
    of = found(
        "7c",
        pareto(one_left=0.5, one_field=0.25, one_printed=0.0, other_left=1.5, other_priority=nan),
    )
    assert of.values == {
        f"{ONE}/sliding-mode": 0.5, f"{ONE}/potential-field": 0.25, f"{ONE}/potential-field-priority": 1.0,
        f"{OTHER}/sliding-mode": 1.5, f"{OTHER}/potential-field": 1.0, f"{OTHER}/potential-field-priority": NONE,
    }  # fmt: skip
    assert of.text == (
        f"{ONE} (the printed gains break (12): 5d): sliding-mode leaves 0.5 %, potential-field "
        f"leaves 0.25 %, "
        f"potential-field-priority leaves 1 %, so that it holds partly there; {OTHER}: "
        f"sliding-mode leaves 1.5 %, "
        "potential-field leaves 1 %, potential-field-priority has no such run, so that it does "
        "not hold there"
    )
    assert of.verdict == PARTLY
    assert "so that" not in found("7c", pareto()).text


@pytest.mark.parametrize("key", ["7a", "7c"])
def test_of_two_scenarios_each_has_fields_of_its_own(key: str) -> None:
    """Only the second's, or only the first's, leave less than the law: in both cases one scenario
    is left.
    """
    assert (
        verdict(key, pareto(one_left=0.5, other_left=0.75, other_field=0.5, one_field=0.5))
        == PARTLY
    )
    assert verdict(key, pareto(one_left=1.5, other_left=0.75)) == PARTLY
    assert verdict(key, pareto(one_left=0.75, other_left=1.5)) == PARTLY


def test_a_number_that_is_not_there_is_not_measured() -> None:
    numbers = pareto()
    del numbers[(OTHER, "sliding-mode", "kept")]
    assert found("7c", numbers).text == f"the study made up has no {OTHER}.sliding-mode.kept"
    of = found("7c", numbers, "one: lost", "two: lost")
    assert of == Finding(
        "not measured", f"the study made up has no {OTHER}.sliding-mode.kept: one: lost"
    )


def test_8a_says() -> None:
    of = found("8a", shrinking(floor=0.125, far=2.0, near=0.25, falls=0.0))
    assert of.values == {
        f"{ONE}/far": 1.0, f"{ONE}/near": 0.1, f"{ONE}/floor": 0.1,
        f"{OTHER}/far": 2.0, f"{OTHER}/near": 0.25, f"{OTHER}/floor": 0.125,
    }  # fmt: skip
    assert of.text == (
        f"{ONE}: 1e+03 mrad rms with a region of 0.5, 100 mrad with 0.001 (never rising by more "
        f"than the 100 mrad "
        f"between T_s and T_s/2 explain); {OTHER}: 2e+03 mrad rms with a region of 0.5, 250 mrad "
        f"with 0.001 (rising in "
        "between by more than the 125 mrad between T_s and T_s/2 explain)"
    )
    assert of.verdict == PARTLY
    assert verdict("8a", shrinking(floor=0.125, near=0.25)) == YES
    assert verdict("8a", shrinking(floor=0.125, near=0.25, falls=2.0)) == PARTLY
    assert verdict("8a", shrinking(floor=0.125, near=0.25, falls=0.5)) == PARTLY


def off(*lines: tuple[str, float, float]) -> Numbers:
    """Scenario, violation and whether it converges."""
    at = ("sliding-mode", 0.3)
    numbers = {(name, *at, "violation"): depth for name, depth, _ in lines}
    numbers |= {(name, *at, "converged"): converged for name, _, converged in lines}
    return numbers | {(name, *at, "deviation_px"): 3.0 for name, _, _ in lines[:1]}


def test_9b_says() -> None:
    of = found("9b", off(("a", 0.5, 1.0), ("b", 0.0, 1.0), ("c", 0.25, 0.5)))
    assert of.values == {"a": 0.5, "b": 0.0, "c": 0.25}
    assert of.text == (
        "a: converges, violates 0.5 % of L, tracks deviate by 3 px; b: converges, violates "
        "nothing, tracks deviate by "
        "nan px; c: does not converge, violates 0.25 % of L, tracks deviate by nan px"
    )
    assert of.verdict == NO
    assert verdict("9b", off(("a", 0.5, 1.0), ("b", 0.0, 1.0))) == PARTLY
    assert verdict("9b", off(("a", 2.0, 1.0), ("b", 0.0, 1.0))) == NO
    assert verdict("9b", off(("a", 0.0, 1.0), ("b", 0.0, 2.0))) == NO
    assert (
        found("9b", {}).text
        == "the study gradient-error has no run of the sliding mode with c_e = 0.3"
    )


def test_10a_says() -> None:
    numbers = {(20, "bound_12"): 2.0, (20, "smallest_in_band"): 8.0, (100, "bound_12"): 3.0}
    of = found("10a", numbers | {(9, "bound_12"): 1.0, (9, "smallest_in_band"): 8.0})
    assert of.values == {"9": 8.0, "20": 8.0, "100": inf}
    assert of.text == (
        "K_T,p(0) = 9: (12) asks for 1, 8 is enough; K_T,p(0) = 20: (12) asks for 2, 8 is enough; "
        "K_T,p(0) = 100: (12) "
        "asks for 3, no gain tried is enough"
    )
    assert of.verdict == YES
    # it must be greater in the end than at first, wherever it rises
    assert verdict("10a", numbers | {(9, "bound_12"): 1.0, (9, "smallest_in_band"): 4.0}) == YES


def test_10d_says() -> None:
    of = found("10d", {(ONE, "band", 10): 0.5, (ONE, "band", 2.5): 0.02, (OTHER, "band", 1): 9.0})
    assert of == Finding(
        YES, "band of φ: 0.500 at 10 ms, 0.020 at 2.5 ms", {"10": 0.5, "2.5": 0.02}
    )
    assert found("10d", {}).text == "the study sampling-time has no band of the first example"
