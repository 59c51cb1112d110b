"""What a sample of a closed loop leaves, by hand: two joints, two rows, two markers, two goals."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsconstraints.compiled.samples import (
    Goals,
    Kept,
    Loop,
    PlantArrays,
    Running,
    feature_error,
    finish,
    greatest_change,
    hold,
    mark_acting,
    score,
)
from vsconstraints.compiled.workspace import Answer, RowArrays, TaskArrays
from vsconstraints.formulas.limits import JointLimits
from vsconstraints.formulas.motion import pose_difference
from vsconstraints.rows import Array

NONE = np.empty(0)


def rows(phi: Any, sigma: Any = (0.0, 0.0), Lg: Any = ((0.0, 0.0), (0.0, 0.0))) -> RowArrays:
    """Of u⁺ = 1 and scale 1."""
    return RowArrays(
        np.array(phi),
        np.array(Lg),
        NONE,
        np.array(sigma),
        NONE,
        NONE,
        np.ones(2),
        np.ones(2),
        NONE,
        NONE,
    )


def running() -> Running:
    """At the beginning."""
    counts = [np.zeros(2, dtype=np.int64) for _ in range(6)]
    counts[2][:] = counts[3][:] = -1
    low = np.full(2, -np.inf)
    flags = np.zeros(2, dtype=np.bool_)
    switches = np.zeros(1, dtype=np.int64)
    unreached = np.full(2, -1)
    sums = (np.zeros(1), np.zeros(1))
    saturated = np.zeros(1, dtype=np.int64)
    last = saturated, np.full(2, np.nan), flags, np.zeros(2)
    return Running(
        low, low.copy(), *counts, np.zeros(2), np.full(1, 5), *sums, switches, unreached, *last
    )


def test_scores_of_five_samples() -> None:
    """‖Δq̈‖ = 5, 13, 0 and 10; the first sample changes nothing, and neither does what stays as it
    was.
    """
    scores = running()
    for k, (phi, sigma, qdd, active) in enumerate(
        (
            ((-1.0, 0.0), (-2.0, 0.0), (1.0, 1.0), (False, True)),
            ((2.0, 0.5), (-1.0, 0.25), (4.0, 5.0), (False, True)),
            ((1.0, -0.5), (0.5, -1.0), (-1.0, -7.0), (True, True)),
            ((0.0, 3.0), (0.125, -1.0), (-1.0, -7.0), (True, True)),
            ((-3.0, 1.0), (-1.0, -1.0), (5.0, 1.0), (False, False)),
        )
    ):
        score(scores, rows(phi, sigma), np.array(qdd), np.array(active), k)
    assert scores.phi_max.tolist() == [2.0, 3.0]
    assert scores.sigma_max.tolist() == [0.5, 0.25]
    # σ = 0 is not outside, φ = 0 is not inside
    assert scores.outside.tolist() == [2, 1]
    assert scores.positive.tolist() == [0, 2]
    assert scores.longest_positive.tolist() == [3, 2]
    assert scores.acted.tolist() == [2, 4]
    assert scores.first_active.tolist() == [2, 0]
    assert scores.last_active.tolist() == [3, 3]
    assert scores.acceleration_max.tolist() == [5.0, 7.0]
    np.testing.assert_allclose(
        [scores.variation[0], scores.squared_variation[0]], [28.0, 294.0], rtol=1e-15
    )
    assert scores.switches.tolist() == [2]
    assert (scores.qdd.tolist(), scores.active.tolist()) == ([5.0, 1.0], [False, False])


def acting(phi: Any, scale: Any, gain: Any, Lg: Any) -> list[bool]:
    """Which rows act where tracking alone gives (4, 1) and the command is (1, 2)."""
    active = np.zeros(len(phi), dtype=np.bool_)
    given = RowArrays(
        np.array(phi), np.array(Lg), *(NONE,) * 4, np.array(gain), np.array(scale), NONE, NONE
    )
    mark_acting(given, np.array([1.0, 2.0]), np.array([4.0, 1.0]), active)
    return [bool(acts) for acts in active]


def test_rows_that_are_slowed_and_nearest_for_their_scale_act() -> None:
    """L_gφ = (2, −3) is slowed by 2 · 3 + 3 · 1 = 9, and (1, 3) by nothing."""
    slowed = (2.0, -3.0)
    free = (1.0, 3.0)
    assert acting([0.5], [1.0], [8000.0], [slowed]) == [True]
    assert acting([0.5], [1.0], [9001.0], [slowed]) == [False]
    near = [-1.0, -0.5, 3.0], [4.0, 1.0, 1.0], [1.0, 1.0, 1.0]
    # a quarter of its scale away, and half of it; what is beyond does not act if nothing slows it
    assert acting(*near, [slowed, slowed, free]) == [True, False, False]
    assert acting(*near, [slowed, slowed, slowed]) == [False, False, True]
    assert acting([-9.0, -0.5, -0.5], *near[1:], [free, slowed, slowed]) == [False, True, True]


def test_errors_by_hand() -> None:
    """A turn that takes x to y, y to z and z to x: by 120°; moved by (1, −2, 2); markers 5 px and
    13 px away.
    """
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    found = pose_difference(turn, np.array([2.0, -1.0, 5.0]), np.eye(3), np.array([1.0, 1.0, 3.0]))
    np.testing.assert_allclose(found, [3.0, 2.0 * np.pi / 3.0], rtol=1e-14)
    pixels = np.array([[4.0, 6.0], [-4.0, -10.0], [1.0, 2.0]])
    wanted = np.array([[1.0, 2.0], [1.0, 2.0], [1.0, 2.0]])
    assert [feature_error(pixels[:count], wanted[:count]) for count in range(4)] == [
        0.0,
        5.0,
        13.0,
        13.0,
    ]


def test_a_state_is_held_on() -> None:
    transition = np.array([[1.0, 2.0], [3.0, -4.0]])
    x = np.array([[1.0, 10.0, 100.0], [5.0, 6.0, 7.0]])
    expected = transition @ x
    hold(transition, x, np.empty_like(x))
    np.testing.assert_array_equal(x, expected)


def loop(by_pose: bool) -> Loop:
    """Goals at 0 s and 1 s, T_s = 0.5 s; three samples are kept, and two poses of the camera."""
    flags = np.zeros((3, 2), dtype=np.bool_)
    kept = Kept(
        *(np.zeros(shape) for shape in ((3, 3, 2), (3, 1), (2, 2), (2,), (2, 3, 3), (2, 3))),
        *(np.zeros(shape) for shape in ((3, 1, 2), (3, 1, 3), (3, 2), (3, 2))),
        flags,
        np.zeros(3, dtype=np.bool_),
        np.zeros(3),
        np.zeros(3),
    )
    goals = Goals(
        np.array([0.0, 1.0]),
        np.array([[[0.0, 0.0]], [[3.0, 4.0]]]),
        np.stack([np.eye(3)] * 2),
        np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]),
        np.array([[0.5, 0.1, 1.0, 9.0], [0.5, 0.1, 1.0, 9.0]]),
        np.array([by_pose]),
    )
    # q ← q + 0.5 u with u, the last, which is pushed and then forgotten; nothing touches what is
    # between
    transition = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    push = np.array([[1.0, 2.0], [3.0, 4.0]])
    return Loop(
        parts=np.zeros(5, dtype=np.int64),
        Ts=np.array([0.5]),
        clock=np.zeros(2, dtype=np.int64),
        rows=rows((0.0, 0.0)),
        task=TaskArrays(NONE, NONE, np.zeros(1), NONE, NONE, NONE),
        answer=Answer(np.zeros(2), flags[0], NONE, np.zeros(1, dtype=np.int64), NONE),
        alone=np.array([1.0, 1.0]),
        true=rows((0.25, -0.5), (0.125, -0.25), ((1.0, 0.0), (0.0, 0.0))),
        pixels=np.zeros((1, 2)),
        points=np.full((1, 3), 7.0),
        camera_R=np.eye(3),
        camera_t=np.zeros(3),
        own_error=np.full(1, np.nan),
        goals=goals,
        plant=PlantArrays(
            transition,
            np.array([[10.0, 20.0], [8.0, 9.0], [0.0, 0.0]]),
            np.zeros((3, 2)),
            push,
            JointLimits(*(NONE,) * 5, ranges=0, period=0.5),
            np.zeros(2),
            speed_weights=np.zeros(1),
            of_speeds=np.zeros((1, 2)),
        ),
        kept=kept,
        scores=running(),
    )


def unreached(by_pose: bool, positions: Array) -> tuple[Loop, list[list[int]]]:
    """The last sample in which each goal is not reached, after each sample: of pixels and the
    camera's z [m] (k, 3).
    """
    one = loop(by_pose)
    found = []
    for k, (u, v, z) in enumerate(positions):
        one.pixels[0] = u, v
        one.camera_t[2] = z
        one.task.error[0] = k
        finish(one, k)
        found.append(one.scores.unreached.tolist())
    return one, found


POSITIONS = np.array([(3.0, 4.0, 0.0), (0.0, 1.0, 0.6), (3.0, 4.0, 0.5), (3.0, 4.5, 1.5)])


def test_goals_are_reached_by_pose_or_by_markers() -> None:
    """By markers: 5 px from the first goal, then 1 px; then at the second. By pose: at it, beyond,
    not yet, nearly.
    """
    assert unreached(False, POSITIONS)[1] == [[0, -1]] * 4
    assert unreached(True, POSITIONS)[1] == [[-1, -1], [1, -1], [1, 2], [1, 2]]


def test_a_goal_is_not_reached_while_a_joint_moves() -> None:
    """The joints have 8 and 9 units per second; which way does not matter."""
    for speed, expected in ((9.0, -1), (-9.0, -1), (9.1, 0), (-9.1, 0)):
        one = loop(True)
        one.plant.x[1, 1] = speed
        finish(one, 0)
        assert one.scores.unreached[0] == expected


def test_what_is_kept_fills_its_arrays_round_and_round() -> None:
    one, _ = unreached(True, POSITIONS)
    kept = one.kept
    # the fourth sample takes the first one's place; of poses and errors two are kept
    assert kept.error[:, 0].tolist() == [3.0, 1.0, 2.0]
    assert kept.camera_error[:, 0].tolist() == [1.5, 0.5]
    assert kept.camera_error[:, 1].tolist() == [0.0, 0.0]
    assert kept.feature_error.tolist() == [0.0, 0.5]
    assert kept.camera_t[:, 2].tolist() == [0.5, 1.5]
    np.testing.assert_array_equal(kept.camera_R, [np.eye(3)] * 2)
    assert kept.pixels[:, 0].tolist() == [[3.0, 4.5], [0.0, 1.0], [3.0, 4.0]]
    np.testing.assert_array_equal(kept.points, np.full((3, 1, 3), 7.0))
    np.testing.assert_array_equal(kept.phi, [[0.25, -0.5]] * 3)
    np.testing.assert_array_equal(kept.sigma, [[0.125, -0.25]] * 3)
    # the first row is slowed by 1
    np.testing.assert_array_equal(kept.active, [[True, False]] * 3)
    assert one.scores.acted.tolist() == [4, 0]
    assert one.scores.phi_max.tolist() == [0.25, -0.5]
    # pushed by (1, 2) and (3, 4) in turn: 10, 10.5, 12, 12.5 and 14
    states = [
        [[12.5, 24.0], [8.0, 9.0], [3.0, 4.0]],
        [[10.5, 21.0], [8.0, 9.0], [3.0, 4.0]],
        [[12.0, 23.0], [8.0, 9.0], [1.0, 2.0]],
    ]
    np.testing.assert_array_equal(kept.states, states)
    np.testing.assert_array_equal(one.plant.x, [[14.0, 26.0], [8.0, 9.0], [0.0, 0.0]])


def test_the_greatest_change_of_a_row() -> None:
    """|1| 3 + |−2| 4, and a joint without effect whose acceleration has no limit."""
    one = rows((0.0,), Lg=((1.0, -2.0, 0.0),))
    assert greatest_change(one, 0, np.array([3.0, 4.0, np.inf])) == 11.0
