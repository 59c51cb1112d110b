"""Scores at their edges: runs of no, one and two samples, numbers exactly at a threshold, several
rows of which one is different, worked out by hand. The runs are those of :func:`test_metrics.made`:
T_s = 0.5 s, L = 10, u⁺ = 2, K = 0.5 s.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import acting
from test_metrics import made
from vsconstraints.comparisons import RunRecord, score
from vsconstraints.comparisons.metrics import MetricInputs, longest_run

CHATTERING = (
    "phi_band",
    "phi_band_bound",
    "sliding_lost_s",
    "switching_rate_hz",
    "acceleration_variation",
    "jerk_rms",
)
TIMES = (
    "step_time_median_us",
    "step_time_p99_us",
    "step_time_max_us",
    "rows_time_median_us",
    "missed_periods",
)


def of_run(record: RunRecord, *columns: str) -> list[Any]:
    """Some of a run's line of results.csv."""
    result = score(record, None).result
    return [result[name] for name in columns]


def of_rows(record: RunRecord, column: str, baseline: RunRecord | None = None) -> list[Any]:
    """A column of a run's lines of constraints.csv."""
    return [row[column] for row in score(record, baseline).constraints]


# --- few samples, few rows ---


def test_a_run_without_samples_has_no_scores() -> None:
    found = score(made(clearance=[[]], status="failed"), None)
    assert found.constraints == []
    assert (found.result["violated"], found.result["within_band"]) == ("", "")
    numbers = [value for value in found.result.values() if not isinstance(value, (str, bool))]
    assert len(numbers) == 23
    assert np.isnan(numbers).all()


def test_depths_in_the_unit_of_a_row_and_as_fractions_of_its_length() -> None:
    """L = 10, 2 and 10: the third row is outside by too little to be violated."""
    run = made(clearance=[[1.0, -0.5], [-0.5, 1.0], [1.0, -0.0005]], length=[10, 2, 10])
    depths = MetricInputs(run)
    assert depths.natural_depth.tolist() == [0.5, 0.5, 0.0]
    assert depths.relative_depth.tolist() == [0.05, 0.25, 0.0]
    assert depths.relative_depth_without_threshold.tolist() == [0.05, 0.25, 0.00005]
    assert depths.deepest_violation() == 0.25
    assert depths.name_rows(depths.relative_depth) == "row 0; row 1"


def test_a_row_whose_clearance_is_not_known_is_not_satisfied() -> None:
    """A custom constraint that cannot say its clearance is named, and its depth is not zero."""
    run = made(clearance=[[1.0, np.nan, 1.0], [1.0, 1.0, 1.0]])
    found = score(run, None).result
    first, _ = run.trajectory.labels
    assert (found["violated"], found["violated_tolerant"]) == (first, first)
    assert np.isnan([found["violation_depth"], found["violation_fraction"]]).all()


def test_a_run_of_one_sample_has_what_needs_no_second_one() -> None:
    run = made(
        clearance=[[-5.0]],
        phi=[[7.0]],
        active=[[1]],
        camera_error=np.array([[0.25, 0.125]]),
        feature_error_px=np.array([1.5]),
    )
    errors = ("final_translation_error_m", "final_rotation_error_rad", "final_feature_error_px")
    assert of_run(run, "duration_s", "settling_time_s", *errors) == [0.0, 0.0, 0.25, 0.125, 1.5]
    assert of_run(run, "violation_depth", "violation_time_s", "held_time_s") == [0.5, 0.5, 0.5]
    assert np.isnan(of_run(run, *CHATTERING, *TIMES)).all()
    # nobody knows at what speed
    assert of_rows(run, "usage_held") == [0.0]


def test_a_run_of_two_samples_has_all_scores() -> None:
    run = made(
        clearance=[[4.0, 2.0]],
        phi=[[-1.0, 3.0]],
        active=[[0, 1]],
        qdd_command=np.array([[0.0, 0.0], [3.0, 4.0]]),
        step_time=np.array([9.0, 2e-6]),
        rows_time=np.array([9.0, 3e-6]),
    )
    # φ beyond its bound T_s u⁺ = 1; one change in half a second; ‖Δ‖ = 5
    assert of_run(run, *CHATTERING) == [3.0, 1.0, 0.0, 2.0, 10.0, 10.0]
    assert of_run(run, *TIMES) == pytest.approx([2.0, 2.0, 2.0, 3.0, 0.0])
    # at 2, and 4 nearer every second: 1 − (2 − 0.5 · 4)/10
    assert of_rows(run, "usage_held") == [1.0]


def test_a_run_without_rows_violates_nothing() -> None:
    run = made(clearance=np.empty((0, 3)))
    assert of_run(run, "violated", "violation_depth", "violation_time_s", "held_time_s") == [
        "",
        0.0,
        0.0,
        0.0,
    ]
    assert np.isnan(of_run(run, "phi_band", "phi_band_bound", "utilization")).all()
    assert of_run(run, "sliding_lost_s", "switching_rate_hz") == [0.0, 0.0]


# --- a run's line ---


def test_settling_is_counted_from_every_goal_and_never_negative() -> None:
    here = made(clearance=[[1.0] * 5])
    assert of_run(here, "settling_time_s") == [0.0]
    assert of_run(replace(here, goal_begins=np.array([0.25])), "settling_time_s") == [0.0]
    # T_s = 0.5 s: the first goal from 0.5 s on for good, the second, which is set at 1.25 s, from 2
    # s on
    late = made(clearance=[[1.0] * 5], settled=[0, 1, 1, 0, 1], goals=[0.0, 1.25])
    assert of_run(late, "settling_time_s") == [0.5 + 0.75]
    # a goal between two samples is none
    skipped = made(clearance=[[1.0] * 5], settled=[0, 1, 1, 0, 1], goals=[0.0, 1.1, 1.25])
    assert of_run(skipped, "settling_time_s") == [0.5 + 0.75]


def test_what_a_run_takes_beyond_the_duration_makes_it_no_calmer() -> None:
    """Four samples of the scenario's duration, in 1.5 s; then nothing happens for 3.5 s."""
    command = np.array([[0.0], [3.0], [-1.0], [0.0]] + [[0.0]] * 7)
    short, long = (
        made(
            clearance=[[1.0] * N],
            active=[([0, 1, 0, 1] + [1] * 7)[:N]],
            qdd_command=command[:N],
            common=4,
        )
        for N in (4, 11)
    )
    columns = "acceleration_variation", "jerk_rms", "switching_rate_hz"
    assert of_run(long, *columns) == of_run(short, *columns)
    assert of_run(long, "acceleration_variation", "switching_rate_hz") == pytest.approx(
        [8.0 / 1.5, 3.0 / 1.5]
    )


def test_times_are_those_after_the_first_sample_and_a_period_is_missed_by_both_together() -> None:
    run = made(
        clearance=[[1.0] * 6],
        step_time=np.array([9.0, 0.3, 0.25, 0.125, 0.375, 0.0625]),
        rows_time=np.array([9.0, 0.25, 0.25, 0.375, 0.03125, 0.125]),
    )
    # 0.55, 0.5, 0.5, 0.40625, 0.1875 of T_s = 0.5 s; of five sorted numbers the 99th percentile is
    # 0.96 of the last way
    assert of_run(run, *TIMES) == pytest.approx(
        [0.25e6, 0.375e6 - 0.04 * 0.075e6, 0.375e6, 0.25e6, 1]
    )


def test_when_a_row_acts_is_told_by_its_first_and_last_sample() -> None:
    run = made(clearance=[[1.0] * 7] * 2, active=[[0, 1, 0, 1, 1, 0, 0], [0] * 7])
    assert of_rows(run, "active_time_s") == [1.5, 0.0]
    first, never = of_rows(run, "first_active_s")
    last, nor = of_rows(run, "last_active_s")
    assert (first, last) == (0.5, 2.0)
    assert np.isnan([never, nor]).all()


def test_phi_of_exactly_zero_counts_as_at_the_boundary() -> None:
    run = made(
        clearance=[[1.0] * 7] * 3,
        phi=[[-1, 0, 0, 0, -1, 0, 0], [-1] * 7, [-1, 0.5, -2, -1, -1, -1, -1]],
    )
    assert of_rows(run, "longest_positive_run_s") == [1.5, 0.0, 0.5]
    assert of_rows(run, "phi_max") == [0.0, -1.0, 0.5]
    assert longest_run(np.array([True, True, False, True])) == 2
    assert longest_run(np.zeros(3, dtype=np.bool_)) == longest_run(np.zeros(0, dtype=np.bool_)) == 0


# --- clearance ---


def test_exactly_at_a_threshold_is_not_beyond_it() -> None:
    """What is slight is 0.001; the second row's band is 0.5 and the third one's clearance is
    positive, but slight.
    """
    run = made(clearance=[[1, -1e-4 * 10.0, 1], [1, -0.5, 1], [1, 0.0005, 1]], band=[0.0, 0.5, 0.0])
    assert of_run(run, "violated", "within_band", "violation_depth", "violation_time_s") == [
        "row 1",
        "row 1",
        0.05,
        0.5,
    ]
    assert of_rows(run, "band_depth") == of_rows(run, "violation_depth") == [0.0, 0.5, 0.0]
    assert of_rows(run, "violation_time_s") == [0.0, 0.5, 0.0]
    beyond = made(clearance=[[1, -0.0010001, 1], [1, -0.5001, 1]], band=[0.0, 0.5])
    assert of_run(beyond, "violated", "within_band") == ["row 0; row 1", ""]


def test_depth_is_that_of_the_row_deepest_for_its_length_and_time_that_of_any() -> None:
    run = made(clearance=[[1, -3, -2, 1], [1, 1, -1, -0.5], [1, 1, 1, 1]], length=[10, 2, 5])
    assert of_run(run, "violated", "violation_depth", "violation_time_s") == [
        "row 0; row 1",
        0.5,
        1.5,
    ]
    assert of_rows(run, "violation_depth") == [3.0, 1.0, 0.0]
    assert of_rows(run, "violation_time_s") == [1.0, 1.0, 0.0]
    assert of_rows(run, "usage_max") == [1.3, 1.5, 0.8]


def test_rows_are_challenged_where_tracking_is_outside_be_it_within_the_band() -> None:
    run = made(clearance=[[1.0] * 3] * 4)
    baseline = made(
        clearance=[[1, -0.25, 1], [1, -0.75, 1], [1, 0, 1], [1, -0.0005, 1]],
        band=[0.5, 0.5, 0.0, 0.0],
    )
    assert of_rows(run, "challenged", baseline) == [True, True, False, False]
    assert of_rows(run, "challenged") == [False] * 4
    assert np.isnan(of_rows(run, "mean_unused_margin")).all()
    others = replace(baseline, trajectory=replace(baseline.trajectory, labels=tuple("abcd")))
    assert of_rows(run, "challenged", others) == [False] * 4
    assert np.isnan(of_rows(run, "mean_unused_margin", others)).all()


def test_the_unused_margin_is_over_the_time_that_both_runs_last() -> None:
    """On the boundary tracking is not outside; once is enough for a mean."""
    short = made(clearance=[[1, 2, 4], [1, 8, 4], [1, 2, 4]])
    long = made(clearance=[[-1, 0, -1, -1, -1], [1, -1, 1, 1, 1], [1, 1, 1, -1, -1]])
    margin = of_rows(short, "mean_unused_margin", long)
    assert margin[:2] == [2.5, 8.0]
    assert np.isnan(margin[2])
    back = of_rows(
        made(clearance=[[7, 5, 3, 9, 9]]), "mean_unused_margin", made(clearance=[[1, -1, -1]])
    )
    assert back == [4.0]


# --- chattering ---


def band(*phi: list[float]) -> list[float]:
    """Band of φ and time lost [samples] of rows with T_s u⁺ = 1."""
    width, lost = of_run(
        made(clearance=[[1.0] * len(phi[0])] * len(phi), phi=phi), "phi_band", "sliding_lost_s"
    )
    return [width, 2.0 * lost]


def test_a_band_reaches_from_the_first_sample_at_the_boundary_to_the_last() -> None:
    assert band([-9, 0.75, -0.75, 0.25, -0.5, 0.5, -9]) == [1.5, 0.0]
    assert band([-9, 0.0, 0.0, 0.0, -9]) == [0.0, 0.0]
    # always above zero: from zero
    assert band([-9, 0.5, 0.25, 0.5, -9]) == [0.5, 0.0]


def test_of_several_bands_the_greatest_counts() -> None:
    away = [-9.0] * 10
    assert band([0.25, 0.125, 0.25, *away, 0.5, 0.75, 0.5, *away, 0.125, 0.5, 0.125]) == [0.75, 0.0]


def test_a_touch_up_to_the_bound_is_no_band() -> None:
    assert np.isnan(band([-9, 1.0, -9])[0])
    assert band([-9, 1.125, -9])[0] == 1.125
    assert band([-9, 1.125, 0.5, -9])[0] == 1.125


def test_a_sliding_mode_is_lost_after_ten_samples_beyond_the_bound() -> None:
    """From exactly zero on; exactly at the bound is not beyond it; of two rows, one lost is
    enough.
    """
    assert band([-1, 2.0, *[0.0] * 10, -1])[1] == 11.0
    assert band([-1, 2.0, *[0.0] * 9, -1])[1] == 0.0
    assert band([-1, *[1.0] * 11, -1])[1] == 0.0
    assert band([-1, *[1.125] * 11, -1])[1] == 11.0
    assert band([-1, *[1.125] * 11, -1, -1], [-1, -1, *[1.125] * 11, -1])[1] == 12.0
    assert band([-1] * 13, [-1, *[1.125] * 11, -1])[1] == 11.0


# --- utilization ---


def test_a_row_holds_on_while_phi_is_within_two_switching_steps() -> None:
    """T_s u⁺ = 1, 0.5 and 1: φ = −2 is within, −1.125 of the second row and −2.125 are not; nor
    what no row ends.
    """
    phi = [[0, -2, 0, -1, -1], [0, -1.125, 0, -1, -1], [0, -2.125, -0.5, -0.5, -1]]
    active = [[1, 0, 1, 0, 0], [1, 0, 1, 0, 0], [1, 0, 0, 1, 1]]
    run = made(clearance=[[1.0] * 5] * 3, phi=phi, active=active, gain=[2.0, 1.0, 2.0])
    assert MetricInputs(run).held.T.astype(int).tolist() == [
        [1, 1, 1, 0, 0],
        [1, 0, 1, 0, 0],
        [1, 0, 0, 1, 1],
    ]
    assert of_rows(run, "held_time_s") == [1.5, 1.0, 1.5]
    assert of_run(run, "held_time_s") == [4.0]


def test_usage_at_speed_is_between_nothing_and_all() -> None:
    """Of rows at rest: twice L away, half L away, outside and without a boundary in sight."""
    run = made(
        clearance=[[20.0] * 3, [5.0] * 3, [-4.0] * 3, [np.inf] * 3, [2.5] * 3],
        active=[[1] * 3] * 4 + [[0] * 3],
    )
    assert of_rows(run, "usage_held")[:4] == [0.0, 0.5, 1.0, 0.0]
    assert np.isnan(of_rows(run, "usage_held")[4])
    once = made(clearance=[[6.0] * 3], active=[[0, 1, 0]])
    assert of_rows(once, "usage_held") == [pytest.approx(0.4)]


# --- which rows act ---


def test_rows_act_from_beyond_a_thousandth_of_their_gain() -> None:
    """Of equally near rows both act; φ above zero is as near as zero."""
    gain = [2.0, 4.0]
    scale = [1.0, 2.0]
    assert acting([0.0, 3.0], [0.002, 0.0041], gain, scale) == [False, True]
    assert acting([-1.0, -2.0], [0.0021, 0.0041], gain, scale) == [True, True]
    assert acting([0.0, 3.0], [1.0, 0.004], gain, scale) == [True, False]
    assert acting([-1.0, -2.0], [1.0, 0.0039], gain, scale) == [True, False]
