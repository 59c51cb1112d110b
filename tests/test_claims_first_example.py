"""Claims 1 to 4, on the first example, measured on made-up runs.

Every number is just inside or just outside the claim's limit, and expected numbers are worked out
by hand.
"""

from __future__ import annotations

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
    T,
    active_during,
    assert_finds,
    camera_errors,
    case,
    check,
    column,
)
from vsconstraints.comparisons.runs.spec import RunSpec
from vsconstraints.paper import scenes
from vsconstraints.paper.claims import section_6_advantages
from vsconstraints.paper.scenes import BOWL_ROW, HEART, OTHER_ROW
from vsconstraints.rows import Array

FIRST_MARKER = "fov[marker 1]"

# --- claim 1: the field of view ---


def in_view(sigma: float, clearance: float) -> MadeRun:
    return MadeRun({ROW: -1.0}, {ROW: column({3: sigma})}, {ROW: column({3: clearance}, 1.0)})


REMAINS_IN_VIEW = [
    case("1a", "on the boundary", in_view(0.0, 0.0), HOLDS),
    case("1a", "sigma is positive", in_view(0.001, 0.001), FAILS),
    case("1a", "the clearance is negative", in_view(-0.001, -0.001), FAILS),
    case(
        "1a",
        "numbers",
        MadeRun({ROW: -1.0}, {ROW: column({3: -0.25}, -0.5)}, {ROW: column({4: 0.125}, 1.0)}),
        HOLDS,
        {"sigma_max": -0.25, "clearance_min": 0.125},
        "max σ = −0.25; the marker stays 0.12 px inside the boundary",
    ),
]


def with_last_angle(last: float) -> MadeRun:
    return MadeRun(camera_error=camera_errors(angle=column({0: 2.0, -1: last}, 3.0)))


ORIENTATION_ERROR_VANISHES = [
    *(
        case(key, source, with_last_angle(last), verdict)
        for key in ("1d", "3b")
        for source, last, verdict in (
            ("less than 1 % is left", 0.0199, HOLDS),
            ("1 % is left", 0.02, FAILS),
        )
    ),
    case(
        "1d",
        "numbers",
        MadeRun(
            camera_error=camera_errors(angle=column({0: 2.0, 1: 0.001, -2: 0.5, -1: 0.01}, 3.0)),
            settling_time=1.5,
        ),
        HOLDS,
        {"first": 2.0, "last": 0.01, "settling": 1.5},
        "2.0000 rad at first, 10 mrad at the end; settled after 1.50 s (5 mm, 5 mrad)",
    ),
]


def peaked(changed: dict[int, float]) -> MadeRun:
    """The row is active from 0.2 to 0.9 s; the position error has a peak of 100 m in between."""
    return MadeRun(
        {ROW: active_during((0.2, 0.9))},
        camera_error=camera_errors(position=column({50: 100.0} | changed, 0.0)),
    )


def peaked_of_half(left: int) -> MadeRun:
    position = column({50: 100.0, left: 1.0}, 0.5)
    return MadeRun({ROW: active_during((0.2, 0.9))}, camera_error=camera_errors(position))


def active_three_times(peak: int) -> MadeRun:
    """The peak may be anywhere from 2 s on; what is there from 2 s on is not before."""
    position = column(
        {0: 0.25, 1: 0.5, 20: 3.0, -2: 2.0, -1: 0.75, peak: 100.0}, 0.125, TWELVE_SECONDS
    )
    return MadeRun(
        {ROW: active_during((2.0, 3.0), (5.0, 6.0), (9.0, 10.0), t=TWELVE_SECONDS)},
        t=TWELVE_SECONDS,
        camera_error=camera_errors(position, 7.0, TWELVE_SECONDS),
    )


PEAK_IN_THE_MIDDLE = camera_errors(column({50: 100.0}, 0.5))

POSITION_ERROR_ARISES_AND_VANISHES = [
    *(
        case("1e", source, peaked(changed), verdict)
        for source, changed, verdict in (
            ("nothing elsewhere", {}, HOLDS),
            ("less than 1 % before", {10: 0.99}, HOLDS),
            ("more than 1 % before", {10: 1.01}, PARTLY),
            ("less than 1 % at the end", {-1: 0.99}, HOLDS),
            ("more than 1 % at the end", {-1: 1.01}, PARTLY),
            ("more than 1 % before and at the end", {10: 1.01, -1: 1.01}, FAILS),
            ("peak where the row begins to act", {20: 100.0, 50: 99.0}, HOLDS),
            ("peak where the row ends to act", {90: 100.0, 50: 99.0}, HOLDS),
            ("peak after the row acts", {91: 100.0, 50: 99.0}, PARTLY),
        )
    ),
    case("1e", "1 % is left before", peaked_of_half(10), PARTLY),
    case("1e", "1 % is left at the end", peaked_of_half(-1), PARTLY),
    *(
        case(
            "1e",
            f"three intervals, peak at sample {peak}",
            active_three_times(peak),
            HOLDS,
            {"before": 0.5, "peak": 100.0, "peak_at": TWELVE_SECONDS[peak], "last": 0.75},
            f"5e+02 mm before 2.00 s, peak of 100000.0 mm at {TWELVE_SECONDS[peak]:.2f} s, "
            "7.5e+02 mm at the end",
        )
        for peak in (20, 25, 95, 100)
    ),
    case(
        "1e",
        "active at once: nothing is before",
        MadeRun({ROW: 0.0}, camera_error=PEAK_IN_THE_MIDDLE),
        HOLDS,
        {"before": 0.0, "peak": 100.0, "peak_at": 0.5, "last": 0.5},
    ),
    case(
        "1e",
        "never active",
        MadeRun(camera_error=PEAK_IN_THE_MIDDLE),
        FAILS,
        {},
        "the constraint never becomes active",
    ),
]


def active_within(
    spans: list[tuple[float, float]], first_marker: list[tuple[float, float]]
) -> MadeRun:
    return MadeRun(
        {
            ROW: active_during(*spans, t=TWELVE_SECONDS),
            FIRST_MARKER: active_during(*first_marker, t=TWELVE_SECONDS),
        },
        t=TWELVE_SECONDS,
    )


PRINTED = [(3.0, 5.0), (8.0, 9.0)]
"""The paper prints 3 to 5 s and 8 to 9 s, in whole seconds."""

ACTIVE_INTERVALS = [
    case("1f", "as printed", active_within(PRINTED, []), HOLDS),
    case("1f", "round to the printed", active_within([(2.6, 5.4), (7.6, 9.4)], []), HOLDS),
    case("1f", "begins at 2 s", active_within([(2.4, 5.0), (8.0, 9.0)], []), FAILS),
    case("1f", "ends at 10 s", active_within([(3.0, 5.0), (8.0, 9.6)], []), FAILS),
    case("1f", "one interval", active_within([(3.0, 5.0)], []), FAILS),
    case("1f", "the first marker acts", active_within(PRINTED, [(1.0, 1.0)]), PARTLY),
    case(
        "1f",
        "numbers",
        active_within(PRINTED, [(6.0, 7.0)]),
        PARTLY,
        {"from_0": 3.0, "to_0": 5.0, "from_1": 8.0, "to_1": 9.0},
        "active at 3.00–5.00 s and 8.00–9.00 s; for the first feature 6.00–7.00 s",
    ),
]


def one_step(speed: float, acceleration: float) -> MadeRun:
    """One joint, which is elsewhere in one sample."""
    return MadeRun(qd=column({50: speed})[:, None], qdd_command=column({50: acceleration})[:, None])


def halved_period(speed: float, jump: float) -> tuple[MadeRun, MadeRun]:
    """Greatest steps beside those of 1 with the whole period; a step down is one, too."""
    return one_step(0.0, 0.0), one_step(-1.0 - speed + 1e-12, -1.0 + jump + 1e-12)


def steps_of_two_joints(speed: float, jump: float) -> MadeRun:
    """Two joints, far apart from each other; the second makes its step down, and stays there."""

    def joints(step: float) -> Array:
        return np.column_stack((column({40: 0.5}, 0.0), np.where(T < 0.5, 100.0, 100.0 - step)))

    return MadeRun(qd=joints(speed), qdd_command=joints(jump))


SPEEDS_ARE_CONTINUOUS = [
    case("1h", "speed 0.6, acceleration 0.8", halved_period(0.6, 0.8), HOLDS),
    case("1h", "speed 0.61", halved_period(0.61, 0.8), FAILS),
    case("1h", "acceleration 0.79", halved_period(0.6, 0.79), PARTLY),
    case("1h", "both outside", halved_period(0.61, 0.79), FAILS),
    case(
        "1h",
        "numbers",
        (steps_of_two_joints(4.0, 8.0), steps_of_two_joints(2.0, 10.0)),
        HOLDS,
        {"speed_ratio": 0.5, "acceleration_ratio": 1.25},
        "T_s = 10 ms and 10 ms: q̇ steps by up to 4e+03 and 2e+03 mrad/s, q̈_c by up to 8 and 10 "
        "rad/s²",
    ),
    *(
        case("1h", source, (steps_of_two_joints(5.0, 5.0), steps_of_two_joints(*halved)), verdict)
        for source, halved, verdict in (
            ("two joints, 0.6 and 0.8", (3.0, 4.0), HOLDS),
            ("two joints, speed 0.625", (3.125, 4.0), FAILS),
            ("two joints, acceleration 0.775", (3.0, 3.875), PARTLY),
        )
    ),
]

# --- claim 2: speed, switching gain and sampling time ---

THREE_TIMES_FASTER = [
    *(
        case(
            "2a",
            f"ratio {ratio} of 3, a quarter off is allowed",
            (MadeRun(settling_time=2.0 * ratio), MadeRun(settling_time=2.0)),
            verdict,
        )
        for ratio, verdict in (
            (2.25, HOLDS),
            (3.75, HOLDS),
            (2.24, PARTLY),
            (3.76, PARTLY),
            (1.01, PARTLY),
            (1.0, FAILS),
        )
    ),
    case(
        "2a",
        "numbers",
        (MadeRun(settling_time=6.0), MadeRun(settling_time=2.0)),
        HOLDS,
        {"ratio": 3.0},
        "settled after 6.00 s and 2.00 s: 3.00 times faster",
    ),
]


def positive(samples: int, phi: float) -> MadeRun:
    return MadeRun({ROW: column(dict.fromkeys(range(5, 5 + samples), phi))})


def positive_with_twice_the_period(phi: float, sigma: float) -> MadeRun:
    """T_s u⁺ = 2."""
    return MadeRun({ROW: column(dict.fromkeys(range(5, 10), phi))}, {ROW: sigma}, t=2.0 * T)


SMALL_GAIN_IS_NOT_ENOUGH = [
    case("2b", "five samples beyond 1.5 T_s u+", positive(5, 1.51), HOLDS),
    case("2b", "five samples up to 1.5 T_s u+", positive(5, 1.5), PARTLY),
    case("2b", "four samples", positive(4, 1.51), PARTLY),
    case("2b", "four samples up to 1.5 T_s u+", positive(4, 1.5), FAILS),
    *(
        case(
            "2b",
            f"phi {phi} of T_s u+ = 2, sigma {sigma}",
            positive_with_twice_the_period(phi, sigma),
            verdict,
            {"sigma_max": sigma, "phi_max": phi, "bound": 2.0, "positive_samples": 5.0},
        )
        for phi, sigma, verdict in ((3.5, -0.5, HOLDS), (3.0, -0.5, PARTLY), (3.5, 0.0, HOLDS))
    ),
]


@pytest.mark.parametrize(("phi", "sigma"), [(3.5, -0.5), (3.0, -0.5), (3.5, 0.0)])
def test_2b_tells_if_the_marker_itself_stays_inside(phi: float, sigma: float) -> None:
    text = check("2b", (positive_with_twice_the_period(phi, sigma),)).text
    remark = "the marker itself stays inside (σ < 0), since φ also counts its speed"
    assert text.endswith(remark) == (sigma < 0.0)


def band(width: float) -> MadeRun:
    return MadeRun({ROW: column({5: width, 6: 0.0, 7: width})})


def band_above(width: float) -> MadeRun:
    return MadeRun({ROW: column({5: 0.25, 6: 0.25 + width, 7: 0.0})})


def falling(phi: float) -> MadeRun:
    return MadeRun({ROW: column({5: phi, 6: 0.0})})


GAINS = [
    *(
        case("2d", f"band {width} beside 1", (band(1.0), band(width)), verdict)
        for width, verdict in ((0.99, FAILS), (1.0, FAILS), (1.01, HOLDS))
    ),
    case(
        "2d",
        "numbers",
        (band_above(0.25), band_above(1.25)),
        HOLDS,
        {"slow": 0.5, "fast": 1.5},
        "φ moves by 0.500 (u⁺ = 10, Fig. 4) and 1.500 (u⁺ = 50): 3.0 times as much",
    ),
    *(
        case("2e", f"needs {gain} beside 1", (MadeRun(needed=1.0), MadeRun(needed=gain)), verdict)
        for gain, verdict in ((0.9, FAILS), (1.0, FAILS), (1.1, HOLDS))
    ),
    case(
        "2e",
        "numbers: the greatest of the run",
        (MadeRun(needed=column({5: 3.0}, 1.0)), MadeRun(needed=column({5: 4.0}, 0.5))),
        HOLDS,
        {"slow": 3.0, "fast": 4.0},
        "(12) asks for u⁺ > 3.00 in Fig. 4 and u⁺ > 4.00 in Fig. 5",
    ),
    *(
        case("2f", f"band {width} beside 1", (band(1.0), band(width)), verdict)
        for width, verdict in ((1.09, HOLDS), (1.11, FAILS))
    ),
    case(
        "2f",
        "numbers: a tenth more",
        (falling(2.0), falling(2.2)),
        HOLDS,
        {"slow": 2.0, "fast": 2.2},
        "with u⁺ = 50 and T_s = 10 ms φ moves by 2.200, in Fig. 4 by 2.000",
    ),
    case("2f", "more than a tenth more", (falling(2.0), falling(2.21)), FAILS),
]


def test_scenes_differ_as_the_claims_say() -> None:
    """Half the sampling time; and one with which T_s u⁺ is what it is in the first example."""

    def period_and_gain(spec: RunSpec) -> tuple[float, float]:
        setup = spec.load().setup()
        return setup.Ts, setup.constraints.constraints[0].switching_gain

    Ts, gain = period_and_gain(scenes.FOV)
    assert period_and_gain(scenes.HALVED) == (0.5 * Ts, gain)
    assert period_and_gain(scenes.SAMPLED_FASTER) == (pytest.approx(Ts / 5.0), 5.0 * gain)
    approaches = [
        spec.load().setup().constraints.constraints[0].K for spec in section_6_advantages.APPROACHES
    ]
    assert approaches == [0.1, 0.2, 0.4]


# --- claim 3: the bowl, in a run of 12 s ---


def in_the_bowl(status: str, *spans: tuple[float, float]) -> MadeRun:
    phi = {BOWL_ROW: active_during(*spans, t=TWELVE_SECONDS)}
    return MadeRun(phi, t=TWELVE_SECONDS, status=status)


def with_last_position(last: float) -> MadeRun:
    return MadeRun(camera_error=camera_errors(position=column({-1: last}, 0.0)))


BOTH_ERRORS = MadeRun(
    t=TWELVE_SECONDS,
    camera_error=camera_errors(
        column({0: 8.0, 1: 5.0, -1: 0.007}, 3.0, TWELVE_SECONDS),
        column({0: 4.0, 1: 5.0, -2: 0.3, -1: 0.03}, 3.0, TWELVE_SECONDS),
        TWELVE_SECONDS,
    ),
)

BLOCKED_IN_THE_BOWL = [
    case("3a", "active until 1 s before the end", in_the_bowl("trapped", (5.0, 11.0)), HOLDS),
    case("3a", "until earlier", in_the_bowl("trapped", (5.0, 10.9)), PARTLY),
    case("3a", "converged", in_the_bowl("converged", (5.0, 11.0)), PARTLY),
    case("3a", "converged, until earlier", in_the_bowl("converged", (5.0, 10.9)), FAILS),
    *(
        case(
            "3a",
            f"the last of three intervals ends at {until} s",
            in_the_bowl("trapped", (1.0, 2.0), (4.0, 5.0), (8.0, until)),
            verdict,
        )
        for until, verdict in ((11.0, HOLDS), (10.9, PARTLY))
    ),
    case("3a", "never active", in_the_bowl("trapped"), PARTLY),
    case("3b", "numbers", BOTH_ERRORS, HOLDS, {"first": 4.0, "last": 0.03}),
    case("3c", "more than 5 mm are left", with_last_position(0.0051), HOLDS),
    case("3c", "5 mm are left", with_last_position(0.005), FAILS),
    case("3c", "numbers", BOTH_ERRORS, HOLDS, {"last": 0.007}, "7 mm after 12 s"),
]


def resting(moved: float, speed: float, width: float) -> MadeRun:
    """The last 2 s begin with sample 100; those from 6 to 8 s are samples 60 to 80."""
    phi = column(
        {59: 9.0, 60: 0.0, 80: 1.0, 81: 9.0, 99: 9.0, 100: 0.0, 120: width}, 0.5, TWELVE_SECONDS
    )
    x = column({99: 1.0, 100: moved}, 0.0, TWELVE_SECONDS)
    zeros = np.zeros(len(TWELVE_SECONDS))
    return MadeRun(
        {BOWL_ROW: phi},
        t=TWELVE_SECONDS,
        camera_position=np.column_stack([x, zeros, zeros]),
        qd=column({99: 1.0, 100: speed}, 0.0, TWELVE_SECONDS)[:, None],
    )


def trapped(moved: float = 0.004, speed: float = -0.04, width: float = 2.1) -> MadeRun:
    """The camera ends at (1, 2, 3) m and was ``moved`` away a second before.

    φ spans 2 from 6 to 8 s, and ``width`` later. Before 10 s everything is faster and wider.
    """
    is_late = TWELVE_SECONDS >= 10.0
    position = np.full((len(TWELVE_SECONDS), 3), 9.0)
    position[is_late] = 1.0, 2.0, 3.0
    position[-2] += 0.001, 0.0, 0.0
    position[110] += 0.6 * moved, 0.8 * moved, 0.0
    qd = np.full((len(TWELVE_SECONDS), 2), 7.0)
    qd[is_late] = 0.01, 0.03
    qd[105, 0] = speed
    phi = column(
        {59: 9.0, 60: 0.25, 70: 2.25, 81: 9.0, 99: 9.0, 100: 0.0, 120: width}, 0.5, TWELVE_SECONDS
    )
    return MadeRun(
        {BOWL_ROW: phi},
        {},
        {BOWL_ROW: column({4: -0.7}, 2.0, TWELVE_SECONDS)},
        t=TWELVE_SECONDS,
        camera_position=position,
        qd=qd,
    )


STABLE_IN_THE_BOWL = [
    case("3d", "less than 5 mm, 0.05 rad/s, 1.1 times", resting(0.0049, 0.049, 1.09), HOLDS),
    case("3d", "phi spans 1.11 times as much", resting(0.0049, 0.049, 1.11), PARTLY),
    case("3d", "5 mm", resting(0.005, 0.049, 1.0), FAILS),
    case("3d", "more than 0.05 rad/s", resting(0.0049, 0.051, 1.0), FAILS),
    case("3d", "less than -0.05 rad/s", resting(0.0049, -0.051, 1.0), FAILS),
    case(
        "3d",
        "numbers",
        trapped(),
        HOLDS,
        {
            "moved": 0.004,
            "speed": 0.04,
            "phi_range": 2.1,
            "phi_range_before": 2.0,
            "depth": 0.7,
        },
    ),
    case("3d", "phi spans 1.1 times as much", trapped(width=2.2), HOLDS),
    case("3d", "phi spans a bit more than 1.1 times", trapped(width=2.2001), PARTLY),
    case("3d", "0.05 rad/s", trapped(speed=0.05), FAILS),
]


def two_features() -> MadeRun:
    run = MadeRun(
        {BOWL_ROW: column({5: -2.0}, -3.0), OTHER_ROW: -4.0}, {BOWL_ROW: column({6: -0.5}, -1.0)}
    )
    run.drift[7] = (5.0, 0.0)
    run.drift[9] = (0.0, 6.5)
    return run


NO_FEATURE_ENTERS_THE_AREA = [
    case(
        "3e",
        "numbers",
        two_features(),
        HOLDS,
        {"phi_max": -2.0, "sigma_max": -0.5, "excess": -2.0, "longest": 0.0},
        part="(12) asks the second's row for u⁺ > 6.5",
    ),
    case(
        "3e",
        "the second row counts, too",
        MadeRun({BOWL_ROW: -2.0, OTHER_ROW: column({5: 3.0})}),
        FAILS,
    ),
]

# --- claim 4: the heart; its convex corner is at (-137, 0) px, its concave one at (-102, 35) px ---


def track(x: float, y: float) -> Array:
    """(101, 2, 2) px: far away, but for the first marker in sample 5."""
    pixels = np.full((len(T), 2, 2), 500.0)
    pixels[5, 0] = x, y
    return pixels


def long_track(x: float, y: float, sample: int) -> Array:
    """(121, 2, 2) px: as above; the second marker is always between the corners."""
    pixels = np.full((len(TWELVE_SECONDS), 2, 2), 500.0)
    pixels[:, 1] = -120.0, 17.0
    pixels[sample, 0] = x, y
    return pixels


def passing(phi: float, away: float, sigma: float = 0.0) -> MadeRun:
    return MadeRun({HEART: column({5: phi})}, {HEART: sigma}, features_px=track(-137.0, away))


CONVEX_CORNER_IS_PASSED = [
    case("4a", "less than 5 px away", passing(1.0, 4.9), HOLDS),
    case("4a", "5 px away", passing(1.0, 5.0), PARTLY),
    case("4a", "phi exceeds T_s u+", passing(1.1, 4.9), PARTLY),
    case("4a", "sigma is positive", passing(1.0, 4.9, sigma=0.1), FAILS),
    case(
        "4a",
        "trapped",
        MadeRun({HEART: -1.0}, features_px=track(-137.0, 4.9), status="trapped"),
        FAILS,
    ),
    case(
        "4a",
        "numbers: 3 px from the corner",
        MadeRun(
            {HEART: column({5: 9.0}, -1.0, TWELVE_SECONDS)},
            {HEART: column({8: -0.5}, -2.0, TWELVE_SECONDS)},
            t=TWELVE_SECONDS,
            features_px=long_track(-135.2, 2.4, 20),
        ),
        HOLDS,
        {
            "sigma_max": -0.5,
            "phi_max": 9.0,
            "bound": 10.0,
            "positive_samples": 1.0,
            "nearest": 3.0,
        },
        part="passes 3.0 px from the corner; converged",
    ),
]


def entering(phi: float, sigma: float, away: float) -> MadeRun:
    return MadeRun(
        {HEART: column({5: phi})},
        {HEART: column({9: sigma})},
        features_px=track(-102.0, 35.0 + away),
    )


CONCAVE_CORNER_IS_ENTERED = [
    case("4b", "phi exceeds 5 T_s u+ at the corner", entering(5.01, 0.01, 19.9), HOLDS),
    case("4b", "phi is 5 T_s u+", entering(5.0, 0.01, 19.9), FAILS),
    case("4b", "sigma is zero", entering(5.01, 0.0, 19.9), PARTLY),
    case("4b", "20 px away", entering(5.01, 0.01, 20.0), PARTLY),
    *(
        case(
            "4b",
            f"numbers: 10 px from the corner, phi {phi}, 2.5 px inside elsewhere",
            MadeRun(
                {HEART: column({5: phi, 6: 8.0}, -1.0, TWELVE_SECONDS)},
                {HEART: column({8: 0.5}, -2.0, TWELVE_SECONDS)},
                {HEART: column({3: -2.5}, 1.0, TWELVE_SECONDS)},
                t=TWELVE_SECONDS,
                features_px=long_track(-96.0, 43.0, 5),
            ),
            verdict,
            {
                "sigma_max": 0.5,
                "phi_max": phi,
                "bound": 10.0,
                "positive_samples": 2.0,
                "depth": 2.5,
                "away": 10.0,
            },
        )
        for phi, verdict in ((50.1, HOLDS), (49.9, FAILS))
    ),
]


def lost_for_a_time(samples: int, last: float) -> MadeRun:
    """T_s u⁺ = 10; the last 2 s begin with sample 100."""
    phi = column(
        {**dict.fromkeys(range(20, 20 + samples), 50.0), 99: 50.0, 100: 10.0 * last},
        -1.0,
        TWELVE_SECONDS,
    )
    error = np.zeros((len(TWELVE_SECONDS), 2))
    return MadeRun({HEART: phi}, t=TWELVE_SECONDS, camera_error=error)


SLIDING_MODE_IS_LOST_FOR_A_TIME = [
    case("4c", "six samples", lost_for_a_time(6, 1.0), HOLDS),
    case("4c", "five samples", lost_for_a_time(5, 1.0), FAILS),
    case("4c", "beyond T_s u+ at last", lost_for_a_time(6, 1.1), PARTLY),
    case("4c", "below zero at last", lost_for_a_time(6, -1.0), HOLDS),
    case(
        "4c",
        "numbers",
        MadeRun(
            {
                HEART: column(
                    {**dict.fromkeys(range(20, 27), 50.0), 99: 40.0, 110: 6.0},
                    -1.0,
                    TWELVE_SECONDS,
                )
            },
            t=TWELVE_SECONDS,
            camera_error=camera_errors(
                column({-2: 0.5, -1: 0.0015, 1: 0.7}, 0.2, TWELVE_SECONDS),
                column({-2: 0.6, -1: 0.0025}, 0.3, TWELVE_SECONDS),
                TWELVE_SECONDS,
            ),
        ),
        HOLDS,
        {"samples": 7.0, "phi_last": 6.0},
        "φ > 0 for 7 samples in a row (0.700 s), max φ in the last 2 s 6; the run ends converged, "
        "1.5 mm and 2.5 mrad from the goal",
    ),
]


@pytest.mark.parametrize(
    ("key", "needs", "expected"),
    [
        *REMAINS_IN_VIEW,
        *ORIENTATION_ERROR_VANISHES,
        *POSITION_ERROR_ARISES_AND_VANISHES,
        *ACTIVE_INTERVALS,
        *SPEEDS_ARE_CONTINUOUS,
        *THREE_TIMES_FASTER,
        *SMALL_GAIN_IS_NOT_ENOUGH,
        *GAINS,
        *BLOCKED_IN_THE_BOWL,
        *STABLE_IN_THE_BOWL,
        *NO_FEATURE_ENTERS_THE_AREA,
        *CONVEX_CORNER_IS_PASSED,
        *CONCAVE_CORNER_IS_ENTERED,
        *SLIDING_MODE_IS_LOST_FOR_A_TIME,
    ],
)
def test_claim(key: str, needs: tuple[Any, ...], expected: Expected) -> None:
    assert_finds(check(key, needs), expected)
