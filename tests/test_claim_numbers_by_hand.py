"""The numbers that claims 3 and 4 give, and what several share: made-up runs in which no two of
them are alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isinf
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, Told, at, during, found, gives
from vsconstraints.paper.claims import boundary
from vsconstraints.paper.scenes import BOWL_ROW, HEART, OTHER_ROW
from vsconstraints.rows import Array

LONG = 0.1 * np.arange(121)
"""12 s with T_s = 0.1 s, so that T_s u⁺ = 10."""


class Scaled(Told):
    """Rows of different T_s u⁺ and lengths."""

    bounds: Mapping[str, float] = MappingProxyType({})
    lengths: Mapping[str, float] = MappingProxyType({})

    def bound(self, label: str) -> float:
        return self.bounds[label]

    def length(self, label: str) -> float:
        return self.lengths[label]


# --- what several claims share ---


def test_fulfilled() -> None:
    run: Any = Scaled(
        {ROW: at({5: 3.0, 7: 2.0, 8: 1.0}, -4.0)}, {ROW: at({9: -0.25}, -3.0)}, {ROW: 0.5}
    )
    run.bounds = {ROW: 4.0}
    finding = boundary.fulfilled(run, ROW)
    assert finding.verdict == YES
    assert finding.values == {
        "sigma_max": -0.25,
        "phi_max": 3.0,
        "bound": 4.0,
        "positive_samples": 2.0,
    }
    assert finding.text == "max σ = −0.25; max φ = 3 (T_s u⁺ = 4), positive for 2 samples in a row"


def test_never_positive() -> None:
    """φ is greatest in the first row, φ of T_s u⁺ in the second, and longest positive in the
    third.
    """
    other = "fov[marker 3]"
    speed = "speed[joint 2].upper"
    phi = {ROW: at({5: 6.0}, -1.0), other: at({5: 3.8}, -8.0), speed: at({5: 0.5, 6: 0.5}, -2.0)}
    sigma = {ROW: at({4: -0.25}, -3.0), other: at({3: -0.5}, -2.0), speed: at({3: 7.0}, -2.0)}

    def run(**clearance: float) -> Any:
        told = Scaled(
            phi,
            sigma,
            {ROW: clearance.get("first", 2.0), other: clearance.get("second", 3.0), speed: -9.0},
        )
        told.bounds = {ROW: 4.0, other: 2.0, speed: 1.0}
        told.drift[8, 2] = 7.0
        return told

    finding = boundary.phi_never_positive(run(), [ROW, other, speed])
    gives(finding, PARTLY, phi_max=6.0, sigma_max=-0.25, excess=1.9, longest=2.0)
    assert finding.text == (
        f"max σ = −0.25; max φ = 6, up to 1.90 T_s u⁺ ({other}), at or above zero for 2 samples "
        f"in a row ({speed}); "
        "(12) asks for u⁺ > 7 there, where u⁺ = 100"
    )
    assert boundary.phi_never_positive(run(first=-0.001), [ROW, other, speed]).verdict == NO
    assert boundary.phi_never_positive(run(second=-0.001), [ROW, other, speed]).verdict == NO


def test_fully_used() -> None:
    run: Any = Scaled(
        {ROW: -1.0, "b": -1.0}, {}, {ROW: at({7: 0.03}, 0.5), "b": at({9: 0.002}, 0.5)}
    )
    run.lengths = {ROW: 4.0, "b": 0.25}
    finding = boundary.fully_used(run, ROW, "b")
    gives(finding, YES, **{ROW: 0.0075, "b": 0.008})
    assert (
        f"{ROW} comes within 0.03 px of its boundary (0.75 % of L); b comes within 0.002 px"
        in finding.text
    )


def test_smoothly() -> None:
    """K = 0.1: the first row acts from 0.1 s on and the second from 0.5 s on."""
    run: Any = Told({ROW: during((0.1, 0.45)), "b": during((0.5, 0.85))})
    run.approach_speed = lambda label: at(
        {10: 4.0, 40: 0.2} if label == ROW else {50: 2.0, 80: -0.16}, 0.0
    )
    finding = boundary.smoothly(run, ROW, "b")
    gives(finding, YES, share_left=0.08)
    assert (
        finding.text
        == f"normal speed, at first and 3 K later: {ROW} 4 → 0.2 px/s; b 2 → -0.16 px/s"
    )
    assert [
        (one.start, one.first, one.later, one.greatest) for one in boundary.approaches(run, "b")
    ] == [(pytest.approx(0.5), 2.0, -0.16, 2.0)]
    # the sample 3 K later counts among the greatest
    run = Told({ROW: during((0.2, 0.6))}, speed=at({20: 2.0, 50: 5.0, 51: 6.0}, 1.0))
    (one,) = boundary.approaches(run, ROW)
    assert (one.later, one.greatest) == (5.0, 5.0)
    run = Told({ROW: during((0.2, 0.3))}, speed=at({}, 0.5))
    gives(boundary.smoothly(run, ROW), NO)
    assert boundary.smoothly(run, ROW).text == f"no approach lasts 3 K: {ROW}"


@pytest.mark.parametrize("first", [0.0, -0.5])
def test_a_row_that_begins_to_act_with_no_speed_towards_its_boundary(first: float) -> None:
    """Is not reached smoothly, whatever comes later: nothing is a share of no speed."""
    run: Any = Told({ROW: during((0.2, 0.6))}, speed=at({20: first}, -0.5))
    finding = boundary.smoothly(run, ROW)
    assert finding.verdict == NO
    assert isinf(finding.values["share_left"])
    assert boundary.Approach(0.0, first, 0.0, 0.0).share == inf


# --- claim 3 ---


@pytest.mark.parametrize(("until", "expected"), [(11.0, YES), (10.9, PARTLY), (0.0, PARTLY)])
def test_3a_asks_the_last_of_several_intervals(until: float, expected: str) -> None:
    """Of 12 s; the row acts three times, or never."""
    spans = [(1.0, 2.0), (4.0, 5.0), (8.0, until)] if until else []
    assert (
        found("3a", Told({BOWL_ROW: during(*spans, t=LONG)}, t=LONG, status="trapped")).verdict
        == expected
    )


def error(**columns: Any) -> Array:
    return np.column_stack(
        [np.broadcast_to(columns.get(name, 0.0), LONG.shape) for name in ("position", "angle")]
    )


def test_3b_and_3c() -> None:
    angle = at({0: 4.0, 1: 5.0, -2: 0.3, -1: 0.03}, 3.0, LONG)
    position = at({0: 8.0, 1: 5.0, -1: 0.007}, 3.0, LONG)
    run = Told(t=LONG, camera_error=error(angle=angle, position=position))
    gives(found("3b", run), YES, first=4.0, last=0.03)
    gives(found("3c", run), YES, last=0.007)
    assert found("3c", run).text == "7 mm after 12 s"


def trapped(moved: float = 0.004, speed: float = -0.04, now: float = 2.1) -> Told:
    """The camera ends at (1, 2, 3), and was so far from there a second before; φ spans 2 from 6 to
    8 s, later so much.

    Before 10 s everything is faster and wider.
    """
    place = np.full((len(LONG), 3), 9.0)
    place[LONG >= 10.0] = 1.0, 2.0, 3.0
    place[-2] += 0.001, 0.0, 0.0
    place[110] += 0.6 * moved, 0.8 * moved, 0.0
    qd = np.full((len(LONG), 2), 7.0)
    qd[LONG >= 10.0] = 0.01, 0.03
    qd[105, 0] = speed
    phi = at({59: 9.0, 60: 0.25, 70: 2.25, 81: 9.0, 99: 9.0, 100: 0.0, 120: now}, 0.5, LONG)
    return Told(
        {BOWL_ROW: phi},
        {},
        {BOWL_ROW: at({4: -0.7}, 2.0, LONG)},
        t=LONG,
        camera_position=place,
        qd=qd,
    )


def test_3d() -> None:
    gives(
        found("3d", trapped()),
        YES,
        moved=0.004,
        speed=0.04,
        phi_range=2.1,
        phi_range_before=2.0,
        depth=0.7,
    )
    assert found("3d", trapped(now=2.2)).verdict == YES
    assert found("3d", trapped(now=2.2001)).verdict == PARTLY
    assert found("3d", trapped(speed=0.05)).verdict == NO


def test_3e() -> None:
    run = Told({BOWL_ROW: at({5: -2.0}, -3.0), OTHER_ROW: -4.0}, {BOWL_ROW: at({6: -0.5}, -1.0)})
    run.drift[7] = (5.0, 0.0)
    run.drift[9] = (0.0, 6.5)
    finding = found("3e", run)
    gives(finding, YES, phi_max=-2.0, sigma_max=-0.5, excess=-2.0, longest=0.0)
    assert finding.text.endswith("(12) asks the second's row for u⁺ > 6.5")
    # the second row counts as the first does
    assert found("3e", Told({BOWL_ROW: -2.0, OTHER_ROW: at({5: 3.0})})).verdict == NO


# --- claim 4 ---


def passing(x: float, y: float, sample: int) -> Array:
    """(121, 2, 2) px: far away, but for the first marker in one sample; the second is always at the
    corners' middle.
    """
    track = np.full((len(LONG), 2, 2), 500.0)
    track[:, 1] = -120.0, 17.0
    track[sample, 0] = x, y
    return track


def test_4a() -> None:
    """3 px from (−137, 0)."""
    run = Told(
        {HEART: at({5: 9.0}, -1.0, LONG)},
        {HEART: at({8: -0.5}, -2.0, LONG)},
        t=LONG,
        features_px=passing(-135.2, 2.4, 20),
    )
    finding = found("4a", run)
    gives(finding, YES, sigma_max=-0.5, phi_max=9.0, bound=10.0, positive_samples=1.0, nearest=3.0)
    assert finding.text.endswith("passes 3.0 px from the corner; converged")


@pytest.mark.parametrize(("phi", "expected"), [(50.1, YES), (49.9, NO)])
def test_4b(phi: float, expected: str) -> None:
    """10 px from (−102, 35) where φ is greatest; 2.5 px inside the heart somewhere else."""
    run = Told(
        {HEART: at({5: phi, 6: 8.0}, -1.0, LONG)},
        {HEART: at({8: 0.5}, -2.0, LONG)},
        {HEART: at({3: -2.5}, 1.0, LONG)},
        t=LONG,
        features_px=passing(-96.0, 43.0, 5),
    )
    values = {"sigma_max": 0.5, "phi_max": phi, "bound": 10.0, "positive_samples": 2.0}
    gives(found("4b", run), expected, **values, depth=2.5, away=10.0)


def test_4c() -> None:
    phi = at({**dict.fromkeys(range(20, 27), 50.0), 99: 40.0, 110: 6.0}, -1.0, LONG)
    camera = error(
        position=at({-2: 0.5, -1: 0.0015, 1: 0.7}, 0.2, LONG),
        angle=at({-2: 0.6, -1: 0.0025}, 0.3, LONG),
    )
    finding = found("4c", Told({HEART: phi}, t=LONG, camera_error=camera))
    gives(finding, YES, samples=7.0, phi_last=6.0)
    assert finding.text == (
        "φ > 0 for 7 samples in a row (0.700 s), max φ in the last 2 s 6; the run ends converged, "
        "1.5 mm and 2.5 mrad "
        "from the goal"
    )
