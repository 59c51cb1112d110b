"""The rules of claims about runs, on made-up ones: every number just inside or just outside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, T, Told, at, during, verdict
from vsconstraints.paper.claims import boundary
from vsconstraints.paper.claims.boundary import rounds_to
from vsconstraints.paper.claims.section_10_experiments import exponentially, one_marker_slides
from vsconstraints.rows import Array

# --- what several claims share ---


def test_intervals_round_to_what_is_printed() -> None:
    assert rounds_to([(2.5, 5.5)], [(3.0, 5.0)])
    assert not rounds_to([(2.49, 5.0)], [(3.0, 5.0)])
    assert not rounds_to([(3.0, 5.51)], [(3.0, 5.0)])
    assert not rounds_to([(3.0, 5.0), (8.0, 9.0)], [(3.0, 5.0)])
    assert not rounds_to([], [(3.0, 5.0)])


@pytest.mark.parametrize(
    ("run", "good"),
    [
        (Told({ROW: at({5: 1.0, 6: 1.0})}, {ROW: 0.0}, {ROW: 0.0}), True),
        (Told({ROW: at({5: 1.01})}, {ROW: 0.0}), False),
        (Told({ROW: at({5: 0.0, 6: 0.0, 7: 0.0})}, {ROW: 0.0}), False),
        (Told({ROW: at({5: 1.0})}, {ROW: at({9: 0.001})}), False),
        (Told({ROW: at({5: 1.0})}, {ROW: 0.0}, {ROW: -0.001}), False),
    ],
)
def test_fulfilled(run: Any, good: bool) -> None:
    assert (boundary.fulfilled(run, ROW).verdict == YES) == good


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        (Told({ROW: 0.0}), YES),
        (Told({ROW: at({5: 2.0, 6: 2.0})}, {ROW: 0.0}, {ROW: 0.0}), PARTLY),
        (Told({ROW: at({5: 2.01})}, {ROW: 0.0}), NO),
        (Told({ROW: at({5: 1.0, 6: 1.0, 7: 1.0})}, {ROW: 0.0}), NO),
        (Told({ROW: at({5: 1.0})}, {ROW: at({5: 0.001})}), NO),
        (Told({ROW: at({5: 1.0})}, {ROW: 0.0}, {ROW: -0.001}), NO),
        (Told({ROW: at({5: 1.0}), "b": -0.5}, {ROW: at({5: 0.001})}), NO),
        # the first of two rows is the worst; a speed has no σ of its own, and no clearance that
        # counts
        (Told({ROW: at({5: 2.01}), "fov[marker 3]": -0.5}, {ROW: 0.0}), NO),
        (
            Told(
                {"speed[joint 2].upper": at({5: 0.01}), ROW: -1.0},
                {},
                {"speed[joint 2].upper": -1.0},
            ),
            PARTLY,
        ),
    ],
)
def test_never_positive(run: Any, expected: str) -> None:
    assert boundary.phi_never_positive(run, list(run.trajectory.labels)).verdict == expected


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (0.0, 0.01, YES),
        (0.0, 0.0101, PARTLY),
        (-0.0001, 0.01, PARTLY),
        (0.02, 0.02, NO),
        (-0.001, -0.001, NO),
    ],
)
def test_fully_used(first: float, second: float, expected: str) -> None:
    run: Any = Told(
        {ROW: -1.0, "b": -1.0}, {}, {ROW: at({7: first}, 0.5), "b": at({9: second}, 0.5)}
    )
    assert boundary.fully_used(run, ROW, "b").verdict == expected


def approach(first: float, later: float, greatest: float, last: float = 0.6) -> Any:
    """A row that acts from 0.2 s on, with K = 0.1: normal speeds then, at 0.35 s, at 0.5 s, and
    nonsense elsewhere.
    """
    return Told(
        {ROW: during((0.2, last))},
        speed=at({20: first, 35: greatest, 50: later, 19: 99.0, 51: 99.0}, 0.0),
    )


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        (approach(1.0, 0.1, 1.1), YES),
        (approach(1.0, -0.1, 0.5), YES),
        (approach(2.0, 0.2, 2.0), YES),
        (approach(1.0, 0.101, 0.5), NO),
        (approach(1.0, 0.1, 1.101), NO),
        (approach(1.0, -0.101, 0.5), NO),
        (approach(-1.0, 0.0, 0.0), NO),
        (approach(0.5, 0.1, 0.0), NO),
        (approach(1.0, 0.1, 1.0, last=0.51), YES),
        (approach(1.0, 0.1, 1.0, last=0.49), NO),
    ],
)
def test_smoothly(run: Any, expected: str) -> None:
    assert boundary.smoothly(run, ROW).verdict == expected


def test_smoothly_of_two_rows() -> None:
    """One of which never acts for 3 K, or does not slow down."""
    speed = at({20: 1.0, 50: 0.1}, 0.5)
    run: Any = Told({ROW: during((0.2, 0.6)), "b": during((0.2, 0.3))}, speed=speed)
    assert boundary.smoothly(run, ROW, "b").verdict == PARTLY
    run = Told({ROW: during((0.2, 0.6)), "b": during((0.6, 0.95))}, speed=speed)
    assert boundary.smoothly(run, ROW, "b").verdict == PARTLY
    # twice at the boundary, 0.31 s apart: two approaches; 0.29 s apart: one
    for apart, expected in ((0.31, PARTLY), (0.29, YES)):
        spans = during((0.05, 0.2), (0.2 + apart, 1.0))
        run = Told({ROW: spans}, speed=at({5: 1.0, 20: 0.0, 35: 0.0}, 0.5), K=0.05)
        assert boundary.smoothly(run, ROW).verdict == expected


# --- claims 1 and 2 ---


def camera_error(**columns: Any) -> Array:
    return np.column_stack(
        [np.broadcast_to(columns.get(name, 0.0), T.shape) for name in ("position", "angle")]
    )


@pytest.mark.parametrize(
    ("sigma", "clearance", "expected"), [(0.0, 0.0, YES), (0.001, 0.001, NO), (-0.001, -0.001, NO)]
)
def test_1a(sigma: float, clearance: float, expected: str) -> None:
    assert (
        verdict("1a", Told({ROW: -1.0}, {ROW: at({3: sigma})}, {ROW: at({3: clearance}, 1.0)}))
        == expected
    )


@pytest.mark.parametrize(("last", "expected"), [(0.0199, YES), (0.02, NO)])
def test_1d_and_3b(last: float, expected: str) -> None:
    run = Told(camera_error=camera_error(angle=at({0: 2.0, -1: last}, 3.0)))
    assert verdict("1d", run) == expected
    assert verdict("3b", run) == expected


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, YES),
        ({10: 0.99}, YES),
        ({10: 1.01}, PARTLY),
        ({-1: 0.99}, YES),
        ({-1: 1.01}, PARTLY),
        ({10: 1.01, -1: 1.01}, NO),
        ({20: 100.0, 50: 99.0}, YES),
        ({90: 100.0, 50: 99.0}, YES),
        ({91: 100.0, 50: 99.0}, PARTLY),
    ],
)
def test_1e(changed: dict[int, float], expected: str) -> None:
    """A position error with a peak of 100 in the middle of 0.2 to 0.9 s, when the row acts."""
    run = Told(
        {ROW: during((0.2, 0.9))},
        camera_error=camera_error(position=at({50: 100.0} | changed, 0.0)),
    )
    assert verdict("1e", run) == expected


LONG = 0.1 * np.arange(121)


@pytest.mark.parametrize(
    ("spans", "other", "expected"),
    [
        ([(3.0, 5.0), (8.0, 9.0)], [], YES),
        ([(2.6, 5.4), (7.6, 9.4)], [], YES),
        ([(2.4, 5.0), (8.0, 9.0)], [], NO),
        ([(3.0, 5.0), (8.0, 9.6)], [], NO),
        ([(3.0, 5.0)], [], NO),
        ([(3.0, 5.0), (8.0, 9.0)], [(1.0, 1.0)], PARTLY),
    ],
)
def test_1f(spans: Any, other: Any, expected: str) -> None:
    run = Told({ROW: during(*spans, t=LONG), "fov[marker 1]": during(*other, t=LONG)}, t=LONG)
    assert verdict("1f", run) == expected


@pytest.mark.parametrize(
    ("speed", "jump", "expected"),
    [(0.6, 0.8, YES), (0.61, 0.8, NO), (0.6, 0.79, PARTLY), (0.61, 0.79, NO)],
)
def test_1h(speed: float, jump: float, expected: str) -> None:
    """Greatest steps beside those of 1 with the whole sampling time; a step down is one too."""
    whole = Told(qd=at({50: 0.0})[:, None], qdd_command=at({50: 0.0})[:, None])
    half = Told(
        qd=at({50: -1.0 - speed + 1e-12})[:, None],
        qdd_command=at({50: -1.0 + jump + 1e-12})[:, None],
    )
    assert verdict("1h", whole, half) == expected


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [(2.25, YES), (3.75, YES), (2.24, PARTLY), (3.76, PARTLY), (1.01, PARTLY), (1.0, NO)],
)
def test_2a(ratio: float, expected: str) -> None:
    assert verdict("2a", Told(settling_time=2.0 * ratio), Told(settling_time=2.0)) == expected


@pytest.mark.parametrize(
    ("phi", "expected"),
    [
        (dict.fromkeys(range(5, 10), 1.51), YES),
        (dict.fromkeys(range(5, 10), 1.5), PARTLY),
        (dict.fromkeys(range(5, 9), 1.51), PARTLY),
        (dict.fromkeys(range(5, 9), 1.5), NO),
    ],
)
def test_2b(phi: dict[int, float], expected: str) -> None:
    assert verdict("2b", Told({ROW: at(phi)})) == expected


def band(width: float) -> Told:
    return Told({ROW: at({5: width, 6: 0.0, 7: width})})


def test_2d_2e_and_2f() -> None:
    assert [verdict("2d", band(1.0), band(width)) for width in (0.99, 1.0, 1.01)] == [NO, NO, YES]
    assert [verdict("2f", band(1.0), band(width)) for width in (1.09, 1.11)] == [YES, NO]
    assert [verdict("2e", Told(needed=1.0), Told(needed=gain)) for gain in (0.9, 1.0, 1.1)] == [
        NO,
        NO,
        YES,
    ]


# --- claims 3 and 4 ---

BOWL = "occlusion[bowl, marker 1]"
HEART = "occlusion[heart, marker 1]"


@pytest.mark.parametrize(
    ("status", "until", "expected"),
    [
        ("trapped", 11.0, YES),
        ("trapped", 10.9, PARTLY),
        ("converged", 11.0, PARTLY),
        ("converged", 10.9, NO),
    ],
)
def test_3a(status: str, until: float, expected: str) -> None:
    """Of 12 s, the row acts until a second before the end."""
    assert (
        verdict("3a", Told({BOWL: during((5.0, until), t=LONG)}, t=LONG, status=status)) == expected
    )


@pytest.mark.parametrize(("last", "expected"), [(0.0051, YES), (0.005, NO)])
def test_3c(last: float, expected: str) -> None:
    assert verdict("3c", Told(camera_error=camera_error(position=at({-1: last}, 0.0)))) == expected


@pytest.mark.parametrize(
    ("moved", "speed", "wide", "expected"),
    [
        (0.0049, 0.049, 1.09, YES),
        (0.0049, 0.049, 1.11, PARTLY),
        (0.005, 0.049, 1.0, NO),
        (0.0049, 0.051, 1.0, NO),
        (0.0049, -0.051, 1.0, NO),
    ],
)
def test_3d(moved: float, speed: float, wide: float, expected: str) -> None:
    """Of 12 s: the last 2 begin with sample 100, those of the middle are samples 60 to 80."""
    phi = at({59: 9.0, 60: 0.0, 80: 1.0, 81: 9.0, 99: 9.0, 100: 0.0, 120: wide}, 0.5, LONG)
    place = np.column_stack([at({99: 1.0, 100: moved}, 0.0, LONG), 0.0 * LONG, 0.0 * LONG])
    qd = np.column_stack([at({99: 1.0, 100: speed}, 0.0, LONG)])
    assert verdict("3d", Told({BOWL: phi}, t=LONG, camera_position=place, qd=qd)) == expected


def pixels(x: float, y: float, sample: int = 5) -> Array:
    track = np.full((len(T), 2, 2), 500.0)
    track[sample, 0] = x, y
    return track


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        (Told({HEART: at({5: 1.0})}, {HEART: 0.0}, features_px=pixels(-137.0, 4.9)), YES),
        (Told({HEART: at({5: 1.0})}, {HEART: 0.0}, features_px=pixels(-137.0, 5.0)), PARTLY),
        (Told({HEART: at({5: 1.1})}, {HEART: 0.0}, features_px=pixels(-137.0, 4.9)), PARTLY),
        (Told({HEART: at({5: 1.0})}, {HEART: 0.1}, features_px=pixels(-137.0, 4.9)), NO),
        (Told({HEART: -1.0}, features_px=pixels(-137.0, 4.9), status="trapped"), NO),
    ],
)
def test_4a(run: Any, expected: str) -> None:
    assert verdict("4a", run) == expected


@pytest.mark.parametrize(
    ("phi", "sigma", "away", "expected"),
    [
        (5.01, 0.01, 19.9, YES),
        (5.0, 0.01, 19.9, NO),
        (5.01, 0.0, 19.9, PARTLY),
        (5.01, 0.01, 20.0, PARTLY),
    ],
)
def test_4b(phi: float, sigma: float, away: float, expected: str) -> None:
    run = Told(
        {HEART: at({5: phi})}, {HEART: at({9: sigma})}, features_px=pixels(-102.0, 35.0 + away)
    )
    assert verdict("4b", run) == expected


@pytest.mark.parametrize(
    ("samples", "last", "expected"), [(6, 1.0, YES), (5, 1.0, NO), (6, 1.1, PARTLY), (6, -1.0, YES)]
)
def test_4c(samples: int, last: float, expected: str) -> None:
    """T_s u⁺ = 10 here; of 12 s, the last 2 begin with sample 100."""
    phi = at(
        {**dict.fromkeys(range(20, 20 + samples), 50.0), 99: 50.0, 100: 10.0 * last}, -1.0, LONG
    )
    error = np.zeros((len(LONG), 2))
    assert verdict("4c", Told({HEART: phi}, t=LONG, camera_error=error)) == expected


# --- claim 6 ---


@pytest.mark.parametrize(
    ("active", "sigma", "clearance", "expected"),
    [
        ((ROW,), 0.0, 0.0, YES),
        ((ROW,), 0.0, 0.01, YES),
        ((ROW,), 0.0, 0.011, PARTLY),
        ((ROW, "fov[marker 1]"), 0.0, 0.0, PARTLY),
        ((ROW,), 0.001, 0.0, NO),
        ((ROW,), 0.0, -0.001, NO),
    ],
)
def test_one_marker_slides(
    active: tuple[str, ...], sigma: float, clearance: float, expected: str
) -> None:
    names = (ROW, "fov[marker 1]")
    acts = np.column_stack([at({5: 1.0, 6: 1.0}, 0.0) * (name in active) > 0.0 for name in names])
    acts[50, 0] = True
    run: Any = Told(
        dict.fromkeys(names, -1.0),
        {ROW: at({5: sigma})},
        {ROW: at({5: clearance}, 1.0)},
        active=acts,
    )
    assert one_marker_slides(run, "fov").verdict == expected


@pytest.mark.parametrize("sample", [20, 40, 60])
@pytest.mark.parametrize(
    ("speed", "clearance", "good"),
    [(1.09, 0.1, True), (1.11, 0.1, False), (0.5, 0.0, False), (0.5, -0.1, False)],
)
def test_exponentially(speed: float, clearance: float, good: bool, sample: int) -> None:
    """K = 0.1 s: from 0.1 px away no faster than 1 px/s; before and after the row acts, it may
    be.
    """
    run: Any = Told(
        {ROW: during((0.2, 0.6))},
        {},
        {ROW: at({sample: clearance}, 1.0)},
        speed=at({19: 99.0, sample: speed, 61: 99.0}, 0.0),
    )
    assert (exponentially(run, ROW).verdict == YES) == good
