"""The numbers that claim 5 gives of the case study, on made-up runs in which no two of them are
alike.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, Told, at, during, found, gives
from vsconstraints.paper import case_study, scenes
from vsconstraints.paper.claims import section_4_approach, section_9_case_study
from vsconstraints.rows import Array

LONG = 0.1 * np.arange(121)
RANGE = "range[joint 6].upper"
SPEED = "speed[joint 2].upper"
SPHERE = "sphere[tip]"


class Phases(Told):
    """A case study whose second goal holds from 4 s on."""

    setup = SimpleNamespace(task=SimpleNamespace(goals=[None, SimpleNamespace(from_time=4.0)]))
    asked = 0.5

    def needed_share(self) -> Array:
        return at({5: self.asked}, 0.0, self.t)


def case(t: Array = LONG, **spans: Any) -> Phases:
    """Rows act in the intervals given."""
    names = {f"marker{i}": label for i, label in enumerate(case_study.BORDERS, start=1)}
    names |= {"range": RANGE, "speed": SPEED, "sphere": SPHERE, "lower": "range[joint 6].lower"}
    return Phases({label: during(*spans.get(name, ()), t=t) for name, label in names.items()}, t=t)


@pytest.mark.parametrize(("early", "in_second"), [(0.0, True), (1e-12, True), (1e-7, False)])
def test_the_second_phase_begins_where_its_goal_does_but_for_rounding(
    early: float, in_second: bool
) -> None:
    t = LONG.copy()
    t[40] = 4.0 - early
    run: Any = case(t, sphere=[(t[40], t[40])])
    assert case_study.phases(run, SPHERE) == (
        ([], [(t[40], t[40])]) if in_second else ([(t[40], t[40])], [])
    )


def test_5a() -> None:
    """Position and angle are left of what each phase begins with: at samples 0, 39, 40 and 120."""
    columns = np.full((len(LONG), 2), 7.0)
    columns[0] = (2.0, 4.0)
    columns[39] = (0.01, 0.03)
    columns[40] = (5.0, 8.0)
    columns[-1] = (0.04, 0.4)
    finding = found("5a", Phases(t=LONG, camera_error=columns))
    left = {"position_left_1": 0.005, "orientation_left_1": 0.0075}
    gives(finding, PARTLY, **left, position_left_2=0.008, orientation_left_2=0.05)
    assert finding.text.startswith(
        "phase 1: 2000 → 10.0 mm, 4.00 → 0.0300 rad; phase 2: 5000 → 40.0 mm"
    )


def test_5a_needs_less_than_a_hundredth() -> None:
    columns = np.full((len(LONG), 2), 1.0)
    columns[39] = columns[-1] = 0.01
    assert found("5a", Phases(t=LONG, camera_error=columns)).verdict == NO


def test_5b_and_5c() -> None:
    """Of the second and third marker, and of no other."""
    second, third = case_study.BORDERS[1:3]
    phi = dict.fromkeys(case_study.BORDERS, -1.0) | {
        second: during((0.1, 0.5)),
        third: during((0.5, 0.9)),
    }
    run = Told(phi, {}, dict.fromkeys(case_study.BORDERS, 0.5) | {second: 0.004, third: 0.006})
    run.approach_speed = lambda label: at(
        {10: 4.0, 40: 0.2} if label == second else {50: 2.0, 80: 0.15}, 0.0
    )  # type: ignore[method-assign]
    gives(found("5b", run), YES, **{second: 0.004, third: 0.006})
    finding = found("5c", run)
    gives(finding, YES, share_left=0.075)
    assert finding.text.endswith(f": {second} 4 → 0.2 px/s; {third} 2 → 0.15 px/s")


@pytest.mark.parametrize(
    ("asked", "said"), [(0.999, "keep (12)"), (1.0, "break (12): this is not sampling")]
)
def test_5d(asked: float, said: str) -> None:
    """Two speeds, of which the second is exceeded more; with half the period the first row is
    positive longest.
    """
    lower = "speed[joint 2].lower"
    upper = SPEED
    run = Phases(
        {ROW: at({5: 0.75}, -2.0), lower: at({7: 0.125}), upper: at({8: 0.25, 9: 0.1})},
        {ROW: at({5: -0.5}, -2.0)},
    )
    run.asked = asked
    halved = Told({ROW: at(dict.fromkeys(range(5), 1.0)), lower: at({7: 0.0}), upper: -1.0})
    finding = found("5d", run, halved)
    values = {"phi_max": 0.75, "sigma_max": -0.5, "excess": 0.75, "longest": 2.0}
    gives(finding, PARTLY, **values, speed_excess=0.25, longest_halved=5.0)
    assert (
        f"the printed gains {said}: with half the period φ ≥ 0 for 5 samples in a row; the speed"
        in finding.text
    )
    assert finding.text.endswith("25.00 % above its limit")


def test_5e() -> None:
    """The sixth joint's greatest place, and the second's greatest speed of either sign."""
    run = case(range=[(1.0, 2.0)], speed=[(2.5, 3.0)])
    q = np.full((len(LONG), 7), 9.0)
    qd = np.full((len(LONG), 7), 9.0)
    q[:, 5], qd[:, 1] = (
        at({7: section_9_case_study.Q6_LIMIT}, -3.0, LONG),
        at({7: -0.4, 9: 0.2}, 0.0, LONG),
    )
    run.trajectory.q = q
    run.trajectory.qd = qd
    finding = found("5e", run)
    gives(finding, YES, q6=0.1, qd2=0.4)
    assert finding.text.startswith(
        "range[joint 6] at 1.00–2.00 s; speed[joint 2] at 2.50–3.00 s; q₆ up to 0.1000 rad"
    )
    # acting in the second phase, too
    run = case(range=[(1.0, 2.0), (5.0, 6.0)], speed=[(2.5, 3.0)])
    run.trajectory.q = q
    run.trajectory.qd = qd
    assert found("5e", run).verdict == NO
    # by either of its sides
    run = case(lower=[(1.0, 2.0)], speed=[(2.5, 3.0)])
    run.trajectory.q = q
    run.trajectory.qd = qd
    assert found("5e", run).verdict == YES


def test_5f() -> None:
    gives(
        found("5f", case(sphere=[(6.0, 6.5), (8.0, 9.0)])),
        PARTLY,
        from_0=6.0,
        to_0=6.5,
        from_1=8.0,
        to_1=9.0,
    )
    finding = found("5f", case(sphere=[(1.0, 2.0), (6.0, 8.0)]))
    gives(finding, PARTLY, from_0=6.0, to_0=8.0)
    assert finding.text == "active at 1.00–2.00 s and 6.00–8.00 s"


def test_5g() -> None:
    finding = found("5g", case(marker2=[(1.0, 2.0), (5.0, 6.0)], marker4=[(7.0, 8.0)]))
    gives(finding, NO)
    assert (
        finding.text == "fov[marker 2] at 1.00–2.00 s and 5.00–6.00 s; fov[marker 4] at 7.00–8.00 s"
    )
    assert found("5g", case()).text == "no border ever acts"


def test_5h() -> None:
    """Three intervals overlap from 1.2 to 1.5 s, where φ ≥ 0 of one row, of none, and at last of
    two.
    """
    finding = found(
        "5h",
        case(
            marker2=[(1.0, 1.0), (1.5, 1.5)],
            marker3=[(1.1, 1.1), (1.6, 1.6)],
            range=[(1.2, 1.2), (1.5, 1.5)],
        ),
    )
    gives(finding, YES, most=3.0, same_sample=2.0)
    assert (
        finding.text
        == "up to 3 intervals overlap (1.20–1.50 s); up to 2 rows have φ ≥ 0 in one sample"
    )


def test_5j() -> None:
    """An error that ends as (42) wants it, but for a share of its start in one sample of the first
    phase.
    """
    t = 0.002 * np.arange(2100)
    start = np.array([3e-6, 0.0, 0.0, 0.0, 0.0, 4e-6])
    wanted = section_4_approach.ideal_error(start, -3.0 * start, t)
    wanted[:, 3] += at({300: 0.006 * 5e-6, 301: 0.004 * 5e-6}, 0.0, t)
    wanted[t > 4.0 - 1e-9] = 1.0
    finding = found("5j", Phases(t=t, error=wanted))
    assert finding.verdict == YES
    assert finding.values == {"share": pytest.approx(0.006, rel=2e-3)}
    assert finding.text.endswith("in 2000 samples")


def test_what_is_simulated_for_the_case_study() -> None:
    """Half the period of 2 ms; tracking starts in motion."""
    assert scenes.CASE_HALVED.load().setup().Ts == 0.5 * scenes.CASE.load().setup().Ts == 0.001
    np.testing.assert_array_equal(
        scenes.TRACKING.load().setup().qd0, [0.2, -0.2, 0.2, 0.6, -0.6, 0.6]
    )
