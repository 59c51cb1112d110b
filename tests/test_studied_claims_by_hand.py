"""The rules of claims about studies, on made-up numbers: every one just inside or just outside."""

from __future__ import annotations

from math import nan

import pytest

from told import NO, PARTLY, YES
from vsconstraints.reproduction.verdicts import CLAIMS
from vsconstraints.studies import StudyResult

ONE, OTHER = "example-2d-fov", "case-study-6r"


def verdict(key: str, numbers: dict[str, float]) -> str:
    (name,) = CLAIMS[key].needs
    return CLAIMS[key].check({name: StudyResult("made up", numbers, (), (), ())}).verdict


def pareto(**changed: float) -> dict[str, float]:
    """In each scenario: 1 % left by the sliding mode and by both fields."""
    found = {}
    for scenario, short in ((ONE, "one"), (OTHER, "other")):
        found[f"{scenario}.printed.kept"] = changed.get(f"{short}_printed", 1.0)
        found[f"{scenario}.printed.unused"] = changed.get(f"{short}_left", 1.0)
        found[f"{scenario}.sliding-mode.kept"] = 3.0
        found[f"{scenario}.sliding-mode.least_unused"] = changed.get(f"{short}_left", 1.0)
        found[f"{scenario}.potential-field.least_unused"] = changed.get(f"{short}_field", 1.0)
        found[f"{scenario}.potential-field-priority.least_unused"] = changed.get(f"{short}_priority", 1.0)
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
        ({"one_field": 0.5, "one_priority": 0.5, "other_field": 0.5, "other_priority": 0.5}, PARTLY),
    ],
)
def test_7a_and_7c(key: str, changed: dict[str, float], expected: str) -> None:
    assert verdict(key, pareto(**changed)) == expected


def test_7a_compares_only_what_keeps_its_boundaries() -> None:
    assert verdict("7a", pareto(one_printed=0.0)) == PARTLY
    assert verdict("7a", pareto(one_printed=0.0, other_printed=0.0)) == NO
    assert verdict("7c", pareto(one_printed=0.0, other_printed=0.0)) == YES


def shrinking(floor: float = 0.1, far: float = 1.0, near: float = 0.2, falls: float = 1.0) -> dict[str, float]:
    found = {}
    for scenario in (ONE, OTHER):
        own = (floor, far, near, falls) if scenario == OTHER else (0.1, 1.0, 0.1, 1.0)
        found[f"{scenario}.sampling_distance"] = own[0]
        found[f"{scenario}.priority.distance_largest_region"] = own[1]
        found[f"{scenario}.priority.distance_smallest_region"] = own[2]
        found[f"{scenario}.priority.distance_falls"] = own[3]
        found[f"{scenario}.priority.region_largest"], found[f"{scenario}.priority.region_smallest"] = 0.5, 1e-3
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
    at = "sliding-mode.0.3."
    found = {f"{ONE}.{at}violation": 0.0, f"{ONE}.{at}converged": 1.0}
    found |= {f"{OTHER}.{at}violation": depth, f"{OTHER}.{at}converged": converged}
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
    found = {f"Kp0={Kp0}.bound_12": float(v) for Kp0, v in zip((9, 20, 100), bounds, strict=True)}
    found |= {f"Kp0={Kp0}.smallest_in_band": float(v) for Kp0, v in zip((9, 20, 100), gains, strict=True)}
    assert verdict("10a", found) == expected


def test_10a_needs_two_speeds() -> None:
    found = {"Kp0=9.bound_12": 1.0, "Kp0=9.smallest_in_band": 1.0}
    assert verdict("10a", found) == "not measured"
    assert verdict("10a", found | {"Kp0=20.bound_12": 2.0, "Kp0=20.smallest_in_band": 2.0}) == YES


@pytest.mark.parametrize(("band", "expected"), [(0.02, YES), (0.0201, NO)])
def test_10d(band: float, expected: str) -> None:
    bands = {f"{ONE}.band.10ms": 9.0, f"{ONE}.band.2ms": band, f"{OTHER}.band.1ms": 9.0}
    assert verdict("10d", bands) == expected
    assert verdict("10d", {f"{OTHER}.band.1ms": 0.0}) == "not measured"
