"""The laws on problems of two joints, with answers worked out on paper and written out here as
numbers.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from folder_laws import goal_governor
from vsconstraints.controllers import (
    Controller,
    HierarchicalQP,
    PotentialField,
    SlidingMode,
    Tracking,
)
from vsconstraints.controllers.cascade import Target
from vsconstraints.controllers.least_norm import dependent_rows, least_norm, unit_rows
from vsconstraints.controllers.resolver import row_weights
from vsconstraints.errors import ConfigurationError, InvalidInput
from vsconstraints.formulas.tracking import demanded
from vsconstraints.rows import Command, Rows, Task

FREE = [1.0, 5.0]
"""What tracking alone does in most of these problems: the task is q̈ = b."""


def answer(
    law: Controller, rows: list[dict[str, Any]], b: list[float] = FREE, J: Any = None
) -> Command:
    """The definition's command for rows of ``phi`` and ``Lg``; ``Lf`` is 0, ``gain`` and ``scale``
    1 if not given.
    """

    def column(name: str, default: float) -> Any:
        return np.array([row.get(name, default) for row in rows], dtype=float)

    asked = Rows(
        column("phi", 0.0),
        np.array([row["Lg"] for row in rows], dtype=float).reshape(len(rows), 2),
        column("Lf", 0.0),
        column("gain", 1.0),
        tuple("abcdef"[: len(rows)]),
        column("scale", 1.0),
    )
    return law.define(
        asked, Task(np.eye(2) if J is None else np.array(J, dtype=float), np.array(b))
    )


def gives(command: Command, qdd: list[float], acted: str = "", status: str = "ok") -> None:
    np.testing.assert_allclose(command.qdd, qdd, rtol=1e-9, atol=1e-12)
    assert ("".join(command.active), command.status) == (acted, status)


# --- tracking ---


def test_tracking() -> None:
    gives(answer(Tracking(), [{"phi": 1.0, "Lg": [0, 2]}]), [1.0, 5.0])
    # 3 q̈₁ + 4 q̈₂ = 10: the shortest is along (3, 4)
    gives(answer(Tracking(), [], b=[10.0], J=[[3, 4]]), [1.2, 1.6])
    # two equations that contradict each other, q̈₁ = 2 and q̈₁ = 4: halfway, and the second joint
    # rests
    gives(answer(Tracking(), [], b=[2.0, 4.0], J=[[1, 0], [1, 0]]), [3.0, 0.0])
    # of singular values 1 and s the smaller one counts if it is above 1e-6
    gives(answer(Tracking(), [], b=[1.0, 3e-6], J=[[1, 0], [0, 1.5e-6]]), [1.0, 2.0])
    gives(answer(Tracking(), [], b=[1.0, 3e-6], J=[[1, 0], [0, 0.7e-6]]), [1.0, 0.0])
    gives(answer(Tracking(rank_tolerance=0.9), [], b=[1.0, 3.0], J=[[1, 0], [0, 0.8]]), [1.0, 0.0])


def test_a_goal_that_is_moved() -> None:
    """e = 3, s_ref at 2, ė = 0.5, drift 1: −4 × 3 − 5 × 0.5 − 1 becomes −7 × (3 − 2) − 11 × 0.5 −
    1.
    """
    assert demanded(3.0, 0.5, 1.0, 4.0, 5.0) == pytest.approx(-15.5)
    assert goal_governor.retargeted(-15.5, 3.0, 0.5, 2.0, (4.0, 5.0), (7.0, 11.0)) == pytest.approx(
        -13.5
    )
    # a reference at the goal changes nothing
    assert goal_governor.retargeted(-15.5, 3.0, 0.5, 0.0, (4.0, 5.0), (4.0, 5.0)) == pytest.approx(
        -15.5
    )


def test_gains_of_the_implicit_midpoint_rule() -> None:
    """K_p = 4, K_v = 5 and h = 0.2: 1 + 0.1 × 5 + 0.01 × 4 = 1.54. It is what the law asks of the
    mean of both ends.
    """
    Kp, Kv = goal_governor.held_gains(4.0, 5.0, 0.2)
    assert (Kp, Kv) == pytest.approx((4.0 / 1.54, 5.4 / 1.54))
    e = 3.0
    rate = -0.5
    qdd = -Kp * e - Kv * rate
    ends = e + 0.2 * rate + 0.02 * qdd, rate + 0.2 * qdd
    # the mean of q̇ is that of its ends; that of q, by the rule, lies h/2 of it farther
    mean_rate = 0.5 * (rate + ends[1])
    assert qdd == pytest.approx(-4.0 * (e + 0.1 * mean_rate) - 5.0 * mean_rate)
    assert ends[0] == pytest.approx(e + 0.2 * mean_rate)


# --- sliding mode ---


def test_sliding_mode_of_one_row() -> None:
    """2 q̈₂ = −3 on the boundary and beyond it, whatever L_fφ; the other joint tracks."""
    for phi in (0.0, 1e-12, 7.0):
        gives(
            answer(SlidingMode(), [{"phi": phi, "Lg": [0, 2], "gain": 3, "Lf": 100}]),
            [1.0, -1.5],
            "a",
        )
    gives(answer(SlidingMode(), [{"phi": -1e-300, "Lg": [0, 2], "gain": 3}]), [1.0, 5.0])


def test_sliding_mode_of_an_oblique_row() -> None:
    """3 q̈₁ + 4 q̈₂ = −10: (−1.2, −1.6), and along (4, −3)/5, which the row leaves free, what is
    left of (1, 0).
    """
    gives(
        answer(SlidingMode(), [{"phi": 0.5, "Lg": [3, 4], "gain": 10}], b=[1.0, 0.0]),
        [-0.56, -2.08],
        "a",
    )


def test_sliding_mode_of_rows_that_leave_nothing_free() -> None:
    """q̈₁ = −1 and q̈₁ + q̈₂ = −3."""
    rows = [{"phi": 0.1, "Lg": [1, 0], "gain": 1}, {"phi": 0.1, "Lg": [1, 1], "gain": 3}]
    gives(answer(SlidingMode(), rows), [-1.0, -2.0], "ab")


@pytest.mark.parametrize("phi", [0.0, 0.3])
def test_rows_that_depend_on_each_other_are_named(phi: float) -> None:
    """q̈₁ = −1 and q̈₁ = −3: halfway, and the second joint tracks."""
    rows = [{"phi": phi, "Lg": [1, 0], "gain": 1}, {"phi": phi, "Lg": [1, 0], "gain": 3}]
    command = answer(SlidingMode(), rows)
    gives(command, [-2.0, 5.0], "ab", "rank-loss")
    assert command.reason.endswith("dependent: a, b")


@pytest.mark.parametrize(("share", "named"), [(0.0021, "a, b, c"), (0.00099, "a, c")])
def test_rows_with_no_share_in_a_dependence_are_not_named(share: float, named: str) -> None:
    """(1, share) is (1, 0) and share × (0, 1): the middle one's part is share/√2, which is named
    from 0.001 on.
    """
    rows = [{"Lg": [1, 0]}, {"Lg": [0, 1]}, {"Lg": [1, share]}]
    assert answer(SlidingMode(), rows).reason.endswith(f"dependent: {named}")


@pytest.mark.parametrize(("angle", "status"), [(1.4e-6, "rank-loss"), (3e-6, "ok")])
def test_rows_are_independent_from_a_ratio_of_1e_minus_6_on(angle: float, status: str) -> None:
    """The singular values of two directions at an angle have the ratio angle / 2."""
    assert answer(SlidingMode(), [{"Lg": [1, 0]}, {"Lg": [1, angle]}]).status == status


# --- potential fields ---


def test_repulsion_adds_up() -> None:
    """δ = 0.5 × 2 = 1, ψ = (1 − 0.5)² = 0.25: 0.25 × 3 × 4 = 3 along (0, 2)/4, against tracking."""
    law = PotentialField(region=0.5, exponent=2.0, strength=3.0)
    gives(answer(law, [{"phi": -0.5, "Lg": [0, 2], "gain": 4, "scale": 2}]), [1.0, 3.5], "a")
    # beyond the boundary ψ goes on growing: 1.5² = 2.25, and 27 along (0, 2)/4
    gives(answer(law, [{"phi": 0.5, "Lg": [0, 2], "gain": 4, "scale": 2}]), [1.0, -8.5], "a")
    # two rows: 3 along (0, 2)/4, and 3 along (0.5, 0)/0.25
    rows = [{"phi": -0.5, "Lg": lg, "gain": 4, "scale": 2} for lg in ([0, 2], [0.5, 0])]
    gives(answer(law, rows), [-5.0, 3.5], "ab")
    # where the region begins, and before
    gives(answer(law, [{"phi": -1.0, "Lg": [0, 2], "gain": 4, "scale": 2}]), [1.0, 5.0])
    gives(answer(law, [{"phi": -1.5, "Lg": [0, 2], "gain": 4, "scale": 2}]), [1.0, 5.0])
    # a row without gradient acts, but cannot push
    gives(answer(law, [{"phi": -0.5, "Lg": [0, 0], "gain": 4, "scale": 2}]), [1.0, 5.0], "a")


def test_repulsion_by_default() -> None:
    """δ = 0.2, ψ = 1 − 0.05/0.2 = 0.75: 3 along (0, 2)/4."""
    gives(answer(PotentialField(), [{"phi": -0.05, "Lg": [0, 2], "gain": 4}]), [1.0, 3.5], "a")


def test_repulsion_with_priority() -> None:
    """ψ = 0.25 as above: 2 q̈₂ = 0.75 × 10 − 0.25 × 12 = 4.5."""
    law = PotentialField(blend="priority", region=0.5, exponent=2.0, strength=3.0)
    gives(answer(law, [{"phi": -0.5, "Lg": [0, 2], "gain": 4, "scale": 2}]), [1.0, 2.25], "a")
    # on the boundary and beyond it ψ is 1: 2 q̈₂ = −12
    for phi in (0.0, 0.5):
        gives(answer(law, [{"phi": phi, "Lg": [0, 2], "gain": 4, "scale": 2}]), [1.0, -6.0], "a")


def test_rows_in_their_regions_may_depend_on_each_other_until_they_reach_their_boundaries() -> None:
    """δ = 1, ψ = 0.5: both rows demand q̈₁ = 0.5 × 1 − 0.5 × gain, of gains 1 and 3; on their way
    they share it.
    """
    law = PotentialField(blend="priority", region=1.0)

    def rows(*phi: float) -> list[dict[str, Any]]:
        return [
            {"phi": value, "Lg": [1, 0], "gain": gain}
            for value, gain in zip(phi, (1, 3), strict=True)
        ]

    gives(answer(law, rows(-0.5, -0.5)), [-0.5, 5.0], "ab")
    # the first has reached its boundary and demands q̈₁ = −1, the second is on its way and demands
    # −1 too
    gives(answer(law, rows(0.0, -0.5)), [-1.0, 5.0], "ab")
    gives(answer(law, rows(0.0, 0.0)), [-2.0, 5.0], "ab", "rank-loss")


def test_of_rows_in_their_regions_only_those_at_their_boundaries_are_named() -> None:
    law = PotentialField(blend="priority", region=1.0)
    rows = [{"phi": 0.0, "Lg": [1, 0]}, {"phi": 0.0, "Lg": [1, 1e-7]}, {"phi": -0.5, "Lg": [0, 1]}]
    command = answer(law, rows)
    assert command.status == "rank-loss"
    assert command.reason.endswith("dependent: a, b")
    # of a row at its boundary that nothing can move, and another on its way
    command = answer(law, [{"phi": 0.0, "Lg": [0, 0]}, {"phi": -0.5, "Lg": [0, 1]}])
    assert command.status == "rank-loss"
    assert command.reason.endswith("dependent: a")


# --- hierarchical QP ---


def barrier(**options: Any) -> HierarchicalQP:
    return HierarchicalQP(solver="daqp", **options)


def test_barrier_rows() -> None:
    """α = 20 unless another is given: q̈₂ ≤ 20 × 0.1 − 0.5 = 1.5."""
    gives(answer(barrier(), [{"phi": -0.1, "Lg": [0, 1], "Lf": 0.5}]), [1.0, 1.5], "a")
    gives(answer(barrier(alpha=30.0), [{"phi": -0.1, "Lg": [0, 1], "Lf": 0.5}]), [1.0, 2.5], "a")
    # a row that does not resist leaves tracking as it is, and no solver is asked
    command = answer(barrier(), [{"phi": -1.0, "Lg": [0, 1], "Lf": 0.5}])
    gives(command, [1.0, 5.0])
    assert command.solver == ""


def test_active_rows() -> None:
    """q̈₂ ≤ −3 from φ = 0 on, as far as the task allows: no more than that."""
    law = barrier(rows="active")
    gives(answer(law, [{"phi": 0.0, "Lg": [0, 1], "gain": 3, "Lf": 100}]), [1.0, -3.0], "a")
    gives(answer(law, [{"phi": 0.0, "Lg": [0, 1], "gain": 3}], b=[1.0, -4.0]), [1.0, -4.0])
    gives(answer(law, [{"phi": -1e-9, "Lg": [0, 1], "gain": 3}]), [1.0, 5.0])


def test_rows_that_contradict_each_other_share_what_is_missing() -> None:
    """q̈₂ ≤ −2 and −q̈₂ ≤ −4: both miss it by 3 at q̈₂ = 1; with weights 2 and 1 by 1.2 and 4.8."""
    rows = [{"phi": 0.1, "Lg": [0, 1]}, {"phi": 0.2, "Lg": [0, -1]}]
    command = answer(barrier(), rows)
    gives(command, [1.0, 1.0], "ab", "relaxed")
    assert command.slack is not None
    np.testing.assert_allclose(command.slack, [3.0, 3.0], rtol=1e-8)
    command = answer(barrier(weights={"a": 2.0}), rows)
    gives(command, [1.0, -0.8], "ab", "relaxed")
    assert command.slack is not None
    np.testing.assert_allclose(command.slack, [1.2, 4.8], rtol=1e-8)


def test_weights_are_those_of_the_longest_beginning_and_a_copy() -> None:
    given = {"a": 2.0}
    law = barrier(weights=given)
    given["a"] = 1e3
    rows = [{"phi": 0.1, "Lg": [0, 1]}, {"phi": 0.2, "Lg": [0, -1]}]
    gives(answer(law, rows), [1.0, -0.8], "ab", "relaxed")
    with pytest.raises(ConfigurationError, match="weights must map"):
        barrier(weights=[("a", 2.0)])


def test_the_box() -> None:
    gives(answer(barrier(max_acceleration=4.0), []), [1.0, 4.0])
    gives(answer(barrier(max_acceleration=5.0), [], b=[-7.0, 0.0]), [-5.0, 0.0])
    # tracking in the box, on its side too, is left as it is, and no solver is asked
    for largest in (5.0, 10.0):
        command = answer(barrier(max_acceleration=largest), [])
        gives(command, [1.0, 5.0])
        assert command.solver == ""


def test_a_row_met_up_to_rounding_asks_no_solver() -> None:
    """q̈₁ ≤ −1 − 1e-12, of the terms 1 and 1: a relative 0.5e-12, where 1e-12 is rounding."""
    row = {"phi": (1.0 + 1e-12) / 20.0, "Lg": [1, 0]}
    assert answer(barrier(), [row], b=[-1.0, 0.0]).solver == ""
    row = {"phi": (1.0 + 4e-12) / 20.0, "Lg": [1, 0]}
    assert answer(barrier(), [row], b=[-1.0, 0.0]).solver == "daqp"


def test_rows_that_nothing_moves() -> None:
    """A gradient of 1e-13 counts as none: met on the boundary, and slack beyond it; one of 1e-7
    does not.
    """
    command = answer(barrier(), [{"phi": 0.0, "Lg": [1e-13, 0]}])
    gives(command, [1.0, 5.0])
    assert command.solver == ""
    command = answer(barrier(), [{"phi": 0.1, "Lg": [1e-13, 0]}])
    gives(command, [1.0, 5.0], "", "relaxed")
    assert command.slacks == {"a": 2.0}
    gives(answer(barrier(), [{"phi": 1e-8, "Lg": [1e-7, 0]}]), [-2.0, 5.0], "a")


def test_what_the_rows_leave_of_a_task() -> None:
    """q̈₁ + q̈₂ ≤ 2 and a task (1, 5): the nearest point is (−1, 3); of q̈₁ = 1 and 2 q̈₂ = 10,
    (−2.2, 4.2).

    With the task 2 q̈₂ = 10 alone, q̈₁ makes way: (−3, 5).
    """
    row = {"phi": -0.1, "Lg": [1, 1]}
    gives(answer(barrier(), [row]), [-1.0, 3.0], "a")
    weighed = answer(barrier(), [row], b=[1.0, 10.0], J=[[1, 0], [0, 2]])
    np.testing.assert_allclose(weighed.qdd, [-2.2, 4.2], rtol=1e-6)
    assert barrier().damping == 1e-8
    alone = answer(barrier(), [row], b=[10.0], J=[[0, 2]])
    np.testing.assert_allclose(alone.qdd, [-3.0, 5.0], rtol=1e-6)


# --- what counts as nothing, what is refused, and what a command tells ---


def test_rows_depend_below_a_share_of_the_largest_singular_value() -> None:
    """Of 4 and 1: with a quarter of 4 the second does not count, with a fifth it does."""
    for share, lost in ((0.25, 1), (0.2, 0)):
        assert dependent_rows(np.diag([4.0, 1.0]), share).shape == (2, lost)


def test_level_2_counts_what_is_above_its_share_of_the_largest_singular_value_of_the_task() -> None:
    """q̈₁ = −2, then 4 q̈₂ = 8 and q̈₁ + q̈₃ = 1: with a fifth of 4 all is met, with 0.3 × 4 the
    last rests.
    """
    one = np.ones(1)
    rows = Rows(one, np.array([[1.0, 0.0, 0.0]]), 0.0 * one, 2.0 * one, ("a",))
    J = np.array([[0.0, 4.0, 0.0], [1.0, 0.0, 1.0]])
    for share, qdd in ((0.2, [-2.0, 2.0, 3.0]), (0.3, [-2.0, 2.0, 0.0])):
        found = SlidingMode(rank_tolerance=share).command(rows, Task(J, np.array([8.0, 1.0]))).qdd
        np.testing.assert_allclose(found, qdd, rtol=1e-12, atol=1e-14)


def made(Lg: Any, scale: float = 1.0) -> Rows:
    """One row of this gradient."""
    return Rows(np.zeros(1), np.array([Lg]), np.zeros(1), np.ones(1), ("a",), np.array([scale]))


def test_rows_of_unit_length() -> None:
    """−3 q̈₁ − 4 q̈₂ = 10 is −0.6 q̈₁ − 0.8 q̈₂ = 2."""
    A, b = unit_rows(made([-3.0, -4.0]), np.array([10.0]), np.array([True]))
    np.testing.assert_allclose(A, [[-0.6, -0.8]], rtol=1e-15)
    np.testing.assert_allclose(b, [2.0], rtol=1e-15)


@pytest.mark.parametrize(
    ("Lg", "scale", "seen"),
    [
        ([1e-12, 0.0], 1.0, False),
        ([1.1e-12, 0.0], 1.0, True),
        ([0.8e-12, 0.8e-12], 1.0, True),
        ([0.7e-12, 0.7e-12], 1.0, False),
        ([1e-11, 0.0], 100.0, False),
        ([1e-9, 0.0], 100.0, True),
        ([0.0, 0.0], 1.0, False),
    ],
)
def test_a_row_is_seen_above_1e_minus_12_of_its_scale(
    Lg: list[float], scale: float, seen: bool
) -> None:
    """Its length counts; nothing is divided by zero."""
    with np.errstate(all="raise"):
        A, b = unit_rows(made(Lg, scale), np.array([1.0]), np.array([True]))
    assert np.linalg.norm(A) == pytest.approx(float(seen))
    assert (b != 0.0).all() == seen
    law = barrier()
    command = law.define(
        replace(made(Lg, scale), phi=np.array([0.1])), Task(np.eye(2), np.array(FREE))
    )
    assert (command.status == "relaxed") != seen


def test_one_of_two_rows_acts() -> None:
    rows = [{"phi": -0.1, "Lg": [1, 0]}, {"phi": 0.1, "Lg": [0, 2], "gain": 3}]
    gives(answer(SlidingMode(), rows), [1.0, -1.5], "b")


def test_rows_of_two_dependences_are_named() -> None:
    """One that nothing moves, and two that are the same."""
    command = answer(SlidingMode(), [{"Lg": [0, 0]}, {"Lg": [1, 0]}, {"Lg": [1, 0]}])
    gives(command, [-1.0, 5.0], "abc", "rank-loss")
    assert command.reason.endswith("dependent: a, b, c")
    # two that nothing moves
    command = answer(SlidingMode(), [{"Lg": [0, 0]}, {"Lg": [0, 0]}, {"Lg": [1, 0]}])
    gives(command, [-1.0, 5.0], "abc", "rank-loss")
    assert command.reason.endswith("dependent: a, b")


def test_decomposition_of_a_task() -> None:
    found = least_norm(np.diag([4.0, 1.0]), np.array([8.0, 3.0]), 0.25)
    np.testing.assert_allclose(found.qdd, [2.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(found.gains, [4.0, 0.0], rtol=1e-15)
    np.testing.assert_allclose(
        least_norm(np.diag([4.0, 1.0]), np.array([8.0, 3.0]), 0.2).gains, [4.0, 1.0], rtol=1e-15
    )
    # directions that a task leaves free are directions too
    found = least_norm(np.array([[3.0, 4.0]]), np.array([10.0]), 1e-6)
    np.testing.assert_allclose(np.abs(found.directions), [[0.6, 0.8], [0.8, 0.6]], rtol=1e-12)
    np.testing.assert_allclose(found.gains, [5.0, 0.0], rtol=1e-14)
    # a task of no equations
    found = least_norm(np.empty((0, 2)), np.empty(0), 1e-6)
    np.testing.assert_array_equal(found.qdd, [0.0, 0.0])
    np.testing.assert_array_equal(found.gains, [0.0, 0.0])
    np.testing.assert_array_equal(found.directions, np.eye(2))


@pytest.mark.parametrize(
    "options",
    [{"blend": "both"}, {"blend": 3}, {"region": 0.0}, {"exponent": -1.0}, {"strength": np.inf}],
)
def test_fields_that_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises((ConfigurationError, InvalidInput)):
        PotentialField(**options)


@pytest.mark.parametrize(
    "options",
    [
        {"rows": "both"},
        {"rows": 3},
        {"rows": ["barrier"]},
        {"alpha": 0.0},
        {"max_acceleration": -1.0},
        {"weights": ["a"]},
        {"weights": {"a": 1.0, 2: 1.0}},
        {"weights": {"a": 0.9e-10}},
        {"weights": {"a": 1.1e10}},
    ],
)
def test_programs_that_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigurationError):
        barrier(**options)


def test_weights() -> None:
    """From 1e-10 to 1e10; the longest beginning counts, and one that begins no label is told of."""
    given = {"f": 2.0, "fov[": 3.0}
    np.testing.assert_array_equal(row_weights(("fov", "fov[1]", "x"), given), [2.0, 3.0, 1.0])
    for weight in (1e-10, 1e10):
        assert barrier(weights={"a": weight}).weights == {"a": weight}
    row = {"phi": -0.1, "Lg": [0, 1]}
    assert answer(barrier(weights={"a": 2.0}), [row]).remark == ""
    command = answer(barrier(weights={"a": 2.0, "z": 3.0}), [row])
    gives(command, [1.0, 2.0], "a")
    assert command.remark == "weights that match the beginning of no row's label: 'z'"


def test_gains_of_a_task_are_relative_to_all_of_them() -> None:
    """0.4 and 0.3 of 0.5; a task of zeros has none."""
    for size in (0.1, 10.0):
        tracking = least_norm(size * np.diag([3.0, 4.0]), np.ones(2), 1e-6)
        np.testing.assert_allclose(
            Target.of(tracking, 1e-8, 1e-6, True).gains, [0.8, 0.6], rtol=1e-14
        )
    with np.errstate(all="raise"):
        cost = Target.of(least_norm(np.zeros((2, 2)), np.ones(2), 1e-6), 1e-8, 1e-6, True)
    np.testing.assert_array_equal(cost.gains, [0.0, 0.0])


def test_failures_are_forgotten() -> None:
    law = barrier()
    law.solvers.failures["daqp"] += 1
    law.reset()
    assert not law.solvers.failures


def test_rounding_is_that_of_a_rows_terms() -> None:
    """q̈₁ ≤ −100 − 1.5e-10, of the terms 100 and 100: 0.75e-12 of them."""
    row = {"phi": (100.0 + 1.5e-10) / 20.0, "Lg": [1, 0]}
    # beside it one that nothing moves, and that need not be: 0 ≤ 0, or 0 ≤ 0.5
    for law in (barrier(), barrier(max_acceleration=200.0)):
        for rows in (
            [row],
            [row, {"phi": 0.0, "Lg": [0, 0]}],
            [row, {"phi": -0.025, "Lg": [0, 0]}],
        ):
            command = answer(law, rows, b=[-100.0, 0.0])
            gives(command, [-100.0, 0.0])
            assert (command.solver, command.slacks) == ("", {})
            assert command.slack is not None
            np.testing.assert_array_equal(command.slack, np.zeros(len(rows)))
    # q̈₂ ≤ 50 − 0.75e-10, of the terms 112 and 50, and the other joint on the side of its box
    row = {"phi": (0.75e-10 - 50.0) / 20.0, "Lg": [0, 1]}
    assert answer(barrier(max_acceleration=100.0), [row], b=[-100.0, 50.0]).solver == ""


def test_demands_beyond_the_range_of_floating_point_have_no_answer() -> None:
    """1e290 × 1e29 is no number: with a box that tracking leaves and without one, in either
    form.
    """
    for law in (
        barrier(alpha=1e290, max_acceleration=1.0),
        barrier(alpha=1e290),
        HierarchicalQP(alpha=1e290),
    ):
        command = answer(law, [{"phi": 1e29, "Lg": [0, 1]}])
        gives(command, [0.0, 0.0], "", "failed")
        assert "SolverError: beyond the range of floating point" in command.reason


def test_slack_of_rows_that_nothing_moves() -> None:
    """0 ≤ −0.2 is missed by 0.2, without any solver; 0 ≤ 2 by nothing, also where another row
    resists.
    """
    command = answer(barrier(), [{"phi": 0.01, "Lg": [0, 0]}])
    gives(command, [1.0, 5.0], "", "relaxed")
    assert command.slacks == {"a": pytest.approx(0.2)}
    assert (command.solver, command.iterations) == ("", 0)
    command = answer(barrier(), [{"phi": -0.1, "Lg": [0, 1]}, {"phi": -0.1, "Lg": [0, 0]}])
    gives(command, [1.0, 2.0], "a")
    assert command.slacks == {}
    # a row that demands nothing has no slack
    command = answer(
        barrier(rows="active"), [{"phi": 0.0, "Lg": [0, 1]}, {"phi": -0.1, "Lg": [1, 0]}]
    )
    gives(command, [1.0, -1.0], "a")
    assert command.slacks == {}
