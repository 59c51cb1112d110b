"""Scores of runs small enough to be worked out by hand, and what scores must never reward."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import acting
from vsconstraints.comparisons import RunRecord, score
from vsconstraints.comparisons.metrics import result_columns, run_metrics, timing_columns
from vsconstraints.controllers import (
    Controller,
    HierarchicalQP,
    SlidingMode,
    Tracking,
    make_controller,
)
from vsconstraints.reports.results import shown
from vsconstraints.rows import Array, Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Trajectory, simulate
from vsconstraints.simulation.loop import loses_rank


def made(
    clearance: Any,
    phi: Any = None,
    active: Any = None,
    *,
    Ts: float = 0.5,
    between: Any = None,
    length: Any = None,
    gain: Any = None,
    K: Any = None,
    band: Any = None,
    settled: Any = None,
    status: str = "converged",
    goals: Any = (0.0,),
    common: int | None = None,
    **arrays: Any,
) -> RunRecord:
    """A run of one joint that was never simulated; rows are columns."""
    clearance = np.array(clearance, dtype=float).T
    N, m = clearance.shape

    def of(values: Any, default: float) -> Array:
        return np.full((N, m), default) if values is None else np.array(values, dtype=float).T

    def each(values: Any, default: float) -> Array:
        return np.full(m, default) if values is None else np.array(values, dtype=float)

    nothing = np.zeros((N, 1))
    trajectory = Trajectory(
        status,  # type: ignore[arg-type]
        "",
        Ts * np.arange(N),
        **{
            **dict.fromkeys(("q", "qd", "qdd_command", "error"), nothing),
            "camera_error": np.zeros((N, 2)),
            "feature_error_px": np.zeros(N),
            "camera_position": np.zeros((N, 3)),
            "features_px": np.zeros((N, 1, 2)),
            "points": np.zeros((N, 0, 3)),
            "labels": tuple(f"row {i}" for i in range(m)),
            "phi": of(phi, -1.0),
            "sigma": of(phi, -1.0),
            "clearance": clearance,
            "active": of(active, 0.0).astype(bool),
            "saturated": np.zeros(N, dtype=bool),
            "share_to_hold": each(None, np.nan),
            "between_clearance": of(between, np.inf),
            "rows_time": np.full(N, 1e-6),
            "step_time": np.full(N, 1e-6),
            "fallbacks": 0,
            **arrays,
        },
    )
    done = np.ones(N, dtype=bool) if settled is None else np.array(settled, dtype=bool)
    return RunRecord(
        trajectory,
        ("made",) * m,
        ("px",) * m,
        each(length, 10.0),
        each(gain, 2.0),
        each(K, 0.5),
        each(band, 0.0),
        done,
        np.array(goals, dtype=float),
        N if common is None else common,
        Ts,
        "",
    )


INF = np.inf
SMALL = made(
    clearance=[[4, 2, 1, 1, 2, 4], [1, 0.2, -0.4, 0.2, 1, 1]],
    between=[[INF, INF, 0.5, INF, INF, INF], [INF] * 6],
    phi=[[-1, 0.5, -0.3, 0.2, 0.1, -2], [-0.5, -0.1, 0.2, -0.1, -0.5, -0.5]],
    active=[[0, 1, 0, 1, 0, 0], [0, 0, 1, 0, 0, 0]],
    length=[10, 2],
    gain=[2, 1],
    K=[0.5, 0],
    band=[0, 0.5],
    settled=[1, 0, 1, 0, 1, 1],
    goals=[0.0, 0.5],
    qdd_command=np.array([[0.0], [3.0], [-1.0], [0.0], [0.0], [0.0]]),
    camera_error=np.array([[9.0, 9.0]] * 5 + [[0.25, 0.125]]),
    feature_error_px=np.array([9.0] * 5 + [1.5]),
    step_time=np.array([7.0, 1e-6, 2e-6, 3e-6, 4e-6, 0.6]),
    rows_time=np.array([7.0, 1e-6, 2e-6, 5e-6, 4e-6, 3e-6]),
    saturated=np.array([False, True, False, False, False, False]),
    share_to_hold=np.array([0.25, np.nan]),
)
BASELINE = made(clearance=[[4, 3, -1, -2, 3, 4], [1, 1, 1, 1, 1, 1]], length=[10, 2])


def test_every_score_of_a_small_run() -> None:
    """T_s = 0.5 s, six samples, a row of a position (K = 0.5 s) and one of a speed that is outside
    within its band.
    """
    found = score(SMALL, BASELINE)
    assert found.result == {
        "status": "converged",
        "reason": "",
        "duration_s": 2.5,
        # at the first goal from the beginning; from 2 s on for good at the last one, which was set
        # at 0.5 s
        "settling_time_s": 1.5,
        "final_translation_error_m": 0.25,
        "final_rotation_error_rad": 0.125,
        "final_feature_error_px": 1.5,
        # tracking alone is outside at 1 and 1.5 s, when this run is 1 away, of 10
        "utilization": 0.9,
        "violated": "row 1",
        "violation_depth": pytest.approx(0.4 / 2),
        "violation_time_s": 0.5,
        # φ ≥ 0 three times; from −0.3 to 0.5
        "phi_band": pytest.approx(0.8),
        "phi_band_bound": 1.0,
        "sliding_lost_s": 0.0,
        # none, first, second, first, none, none: four changes
        "switching_rate_hz": pytest.approx(4 / 2.5),
        # |Δ| = 3, 4, 1, 0, 0
        "acceleration_variation": pytest.approx(8 / 2.5),
        "jerk_rms": pytest.approx(np.sqrt((9 + 16 + 1) / 5) / 0.5),
        "step_time_median_us": pytest.approx(3.0),
        "step_time_p99_us": pytest.approx(0.96 * 0.6e6 + 0.04 * 4.0),
        "step_time_max_us": pytest.approx(0.6e6),
        "rows_time_median_us": pytest.approx(3.0),
        "missed_periods": 1,
        "compiled": False,
        "within_band": "row 1",
        # three samples of the first row, as φ stays above −2 between them, and one of the second
        "held_time_s": 2.0,
        "saturated_time_s": 0.5,
        "violation_fraction": pytest.approx(0.4 / 2),
        "violated_tolerant": "row 1",
        "acceleration_max": 3.0,
    }
    first, second = found.constraints
    assert np.isnan(second["share_to_hold"])
    assert first == {
        "constraint": "row 0",
        "kind": "made",
        "unit": "px",
        "challenged": True,
        "active_time_s": 1.0,
        "first_active_s": 0.5,
        "last_active_s": 1.5,
        "clearance_min": 0.5,
        "usage_max": pytest.approx(0.95),
        "mean_unused_margin": 1.0,
        "violation_depth": 0.0,
        "violation_time_s": 0.0,
        "phi_max": 0.5,
        "longest_positive_run_s": 1.0,
        "sampling_band": 0.0,
        "band_depth": 0.0,
        "held_time_s": 1.5,
        # at 0.5, 1 and 1.5 s c + K ċ = 2 − 1.5, 1 − 0.5, 1 + 0.5 of 10
        "usage_held": pytest.approx((0.95 + 0.95 + 0.85) / 3),
        "share_to_hold": 0.25,
        "utilization": 0.9,
    }
    assert not second["challenged"]
    assert np.isnan([second["mean_unused_margin"], second["utilization"]]).all()
    assert (second["clearance_min"], second["usage_max"]) == (-0.4, pytest.approx(1.2))
    assert (second["violation_depth"], second["band_depth"], second["sampling_band"]) == (
        0.4,
        0.4,
        0.5,
    )
    assert (second["active_time_s"], second["longest_positive_run_s"]) == (0.5, 0.5)


def test_a_run_that_does_not_converge_has_no_settling_time_and_no_utilization() -> None:
    for status in ("trapped", "unfinished", "aborted", "failed"):
        run = replace(SMALL, trajectory=replace(SMALL.trajectory, status=status))
        result = score(run, BASELINE).result
        assert np.isnan([result["settling_time_s"], result["utilization"]]).all()
        # what each row was used for is still told
        assert score(run, BASELINE).constraints[0]["usage_held"] == pytest.approx(2.75 / 3)


def test_the_unused_margin_is_that_of_the_samples_in_which_tracking_is_outside() -> None:
    run = made(clearance=[[9, 5, 2, -1, 9]])
    baseline = made(clearance=[[9, -1, -1, -1, 9]])
    # 5, 2 and, outside, nothing
    assert score(run, baseline).constraints[0]["mean_unused_margin"] == pytest.approx(7 / 3)


# --- violation ---


def test_a_row_counts_as_outside_from_a_ten_thousandth_of_its_length_on() -> None:
    """L = 10: 0.001."""
    run = made(clearance=[[1, -0.0009, 1], [1, -0.0011, 1]])
    result = score(run, None).result
    rows = score(run, None).constraints
    assert result["violated"] == "row 1"
    assert [row["violation_depth"] for row in rows] == [0.0, 0.0011]
    assert [row["violation_time_s"] for row in rows] == [0.0, 0.5]


def test_depth_and_time_outside_see_between_samples_alike() -> None:
    run = made(clearance=[[1, 1, 1, -0.2, 1, 1]], between=[[INF, -0.3, 0.5, INF, INF, -0.0005]])
    result = score(run, None).result
    (row,) = score(run, None).constraints
    assert (row["clearance_min"], row["violation_depth"]) == (-0.3, 0.3)
    assert result["violation_depth"] == pytest.approx(0.03)
    # the periods that begin at 0.5 s and at 1.5 s
    assert result["violation_time_s"] == row["violation_time_s"] == 1.0
    alone = made(clearance=[[1, 1, 1]], between=[[INF, -0.3, INF]])
    assert score(alone, None).result["violation_time_s"] == 0.5


def test_the_sampling_band_is_told_and_excuses_nobody() -> None:
    run = made(clearance=[[1, -0.4, 1], [1, -0.6, 1], [1, -0.6, -0.4]], band=[0.5, 0.5, 0.7])
    result = score(run, None).result
    rows = score(run, None).constraints
    assert (result["violated"], result["within_band"]) == ("row 0; row 1; row 2", "row 0; row 2")
    assert [row["violation_depth"] for row in rows] == [0.4, 0.6, 0.6]
    assert [row["band_depth"] for row in rows] == [0.4, 0.0, 0.6]
    assert (result["violation_depth"], result["violation_time_s"]) == (0.06, 1.0)


def test_two_standards_and_the_depth_from_which_success_at_any_tolerance_follows() -> None:
    """L = 10, 100, 10 and 2: at samples and between them, 0.8, 1, 0.005 and, of a speed, 4 per cent
    of L.
    """
    run = made(
        clearance=[[1, -0.02, 1], [-1, 1, 1], [1, 1, 1], [1, 1, -0.08]],
        between=[[INF, -0.08, INF], [INF] * 3, [INF, -0.0005, INF], [INF] * 3],
        length=[10, 100, 10, 2],
        band=[0, 0, 0, 0.5],
    )
    result = score(run, None).result
    assert result["violated"] == "row 0; row 1; row 3"
    # exactly 1 % of L is tolerated
    assert result["violated_tolerant"] == "row 3"
    assert result["violation_fraction"] == result["violation_depth"] == pytest.approx(0.04)
    slight = score(made(clearance=[[1, -0.0005, 1], [1, 2, 3]]), None).result
    assert (slight["violated"], slight["violated_tolerant"], slight["violation_depth"]) == (
        "",
        "",
        0.0,
    )
    assert slight["violation_fraction"] == pytest.approx(5e-5)
    assert score(made(clearance=[[1, 2, 3]]), None).result["violation_fraction"] == 0.0


class Overspeeding(HierarchicalQP):
    """Believes that joints may be faster by a share of their limits."""

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        speeds = np.array([label.startswith("speed") for label in rows.labels])
        return super().solve(replace(rows, phi=rows.phi - self.share * rows.scale * speeds), task)


@pytest.mark.parametrize(("share", "tolerated"), [(0.005, True), (0.018, False), (0.17, False)])
def test_a_law_that_overspeeds_violates(share: float, tolerated: bool) -> None:
    """A UR5's band T_s u⁺ is 2 % of the limit: within it or beyond it, a speed above the limit is
    above the limit.
    """
    record, result = scored("ur5-fov", Overspeeding(share))
    assert "speed[joint 6].lower" in result["violated"]
    assert ("speed" not in result["violated_tolerant"]) == tolerated
    depth = {row["constraint"]: row for row in score(record, None).constraints}[
        "speed[joint 6].lower"
    ]
    if share < 0.02:  # farther there is no need to go
        assert depth["usage_max"] - 1.0 == pytest.approx(share, rel=0.05)
    assert ("speed[joint 6].lower" in result["within_band"]) == (share < 0.02)


def test_a_law_that_keeps_to_the_speeds_violates_none() -> None:
    assert "speed" not in scored("ur5-fov", Overspeeding(0.0))[1]["violated"]


def test_the_sampling_band_of_a_speed_is_a_switching_step() -> None:
    """T_s u⁺ = 0.002 · 10 of the limit for the UR5's speeds; nothing for its other rows."""
    setup = Scenario.load("ur5-fov").setup()
    constraints = setup.constraints
    speeds = np.array([kind == "speed" for kind in constraints.kinds])
    gain = constraints.switching_gain[speeds]
    band = constraints.sampling_band(setup.Ts)
    np.testing.assert_allclose(
        band[speeds], setup.Ts * gain * constraints.characteristic_length[speeds]
    )
    assert (band[~speeds] == 0.0).all()
    assert (constraints.approach_time[speeds] == 0.0).all()
    assert (constraints.approach_time[~speeds] > 0.0).all()


# --- chattering ---


def band(phi: list[float]) -> tuple[float, float]:
    """Of one row with T_s u⁺ = 1, and how long the sliding mode is lost [samples]."""
    result = score(made(clearance=[[1.0] * len(phi)], phi=[phi]), None).result
    return result["phi_band"], result["sliding_lost_s"] / 0.5


def test_a_sliding_modes_band_is_from_its_lowest_to_its_highest() -> None:
    assert band([-9, 0.5, -0.4, 0.1, -0.8, 0.7, -9]) == (pytest.approx(1.5), 0.0)


def test_a_touch_is_no_sliding_mode_but_an_excursion_counts() -> None:
    assert np.isnan(band([-9, 0.9, 0.8, -9, -9])[0])
    assert band([-9, 1.1, -9])[0] == pytest.approx(1.1)
    assert np.isnan(band([-1] * 5)[0])


def test_times_at_the_boundary_that_are_far_apart_are_not_one() -> None:
    there = [0.2, -0.3, 0.2, 0.1]
    assert band([*there, *[-8.0] * 9, *there])[0] == pytest.approx(8.2)
    assert band([*there, *[-8.0] * 10, *there])[0] == pytest.approx(0.5)


def test_a_lost_sliding_mode_counts_however_steady_its_phi() -> None:
    """φ stays at 18 T_s u⁺: peak to peak is nothing, and no band could be better by that."""
    assert band([-1, *[18.0] * 77, -1]) == (18.0, 77.0)
    # as long as sliding modes take
    assert band([-1, *[18.0] * 10, -1])[1] == 0.0
    # on the boundary within one step, as a barrier is
    assert band([-1, *[0.5] * 77, -1]) == (0.5, 0.0)


def test_the_row_with_the_greatest_ratio_gives_the_band() -> None:
    run = made(clearance=[[1] * 4] * 2, phi=[[2, 2, 2, -1], [0.5, 0.5, 0.5, -1]], gain=[20, 1])
    result = score(run, None).result
    assert (result["phi_band"], result["phi_band_bound"]) == (0.5, 0.5)


# --- which rows act ---


def test_rows_act_where_the_command_slows_them_and_the_nearest_only() -> None:
    gain = [2.0, 2.0]
    ones = [1.0, 1.0]
    assert acting([-0.1, -0.2], [0.0, 0.0], gain, ones) == [False, False]
    assert acting([-0.1, -0.2], [1.0, 1.0], gain, ones) == [True, False]
    assert acting([0.1, 0.2], [1.0, 1.0], gain, ones) == [True, True]
    assert acting([0.1, -0.2], [-1.0, 1.0], gain, ones) == [False, True]
    assert acting([-0.1, -0.2], [0.0019, 0.0021], gain, ones) == [False, True]
    # nearness is relative to the rows' scales
    assert acting([-0.1, -0.2], [1.0, 1.0], gain, [1.0, 4.0]) == [False, True]
    assert acting([], [], [], []) == []


@pytest.mark.parametrize("name", ["example-2d-fast", "panda-fov"])
@pytest.mark.parametrize("by_public_call", [False, True])
def test_a_sliding_modes_rows_act_where_their_phi_is_not_negative(
    name: str, by_public_call: bool
) -> None:
    setup = Scenario.load(name).with_override("limits", {}).setup()
    run = simulate(setup, SlidingMode(), by_public_call=by_public_call)
    np.testing.assert_array_equal(run.active, run.phi >= 0.0)
    assert run.active.any()


class Silent(SlidingMode):
    """Does as the sliding mode, and says that nothing acted."""

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        command = super().solve(rows, task)
        return replace(command, acted=np.zeros_like(command.acted))


class Boastful(Tracking):
    """Does nothing about rows, and says that all act."""

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        command = super().solve(rows, task)
        return replace(command, acted=np.ones_like(command.acted))


def scored(
    name: str | Scenario, law: Controller, baseline: RunRecord | None = None
) -> tuple[RunRecord, dict[str, Any]]:
    """A run with its line of results.csv, without times and by what route they came."""
    setup = (Scenario.load(name) if isinstance(name, str) else name).setup()
    record = RunRecord.of(setup, simulate(setup, law, by_public_call=True), "")
    result = score(record, baseline).result
    return record, {
        name: value for name, value in result.items() if name not in (*timing_columns(), "compiled")
    }


def test_what_a_law_says_of_itself_changes_no_score() -> None:
    honest, told = scored("example-2d-fast", SlidingMode())
    silent, untold = scored("example-2d-fast", Silent())
    assert told["switching_rate_hz"] > 10.0
    for name, value in told.items():
        same = (
            value
            if isinstance(value, str)
            else pytest.approx(value, rel=1e-6, abs=1e-9, nan_ok=True)
        )
        assert untold[name] == same, name
    np.testing.assert_array_equal(silent.trajectory.active, honest.trajectory.active)
    _, boast = scored("example-2d-fast", Boastful())
    assert boast["switching_rate_hz"] == boast["held_time_s"] == 0.0
    assert np.isnan(boast["utilization"])


# --- utilization ---


class Frozen(Controller):
    """Stands still."""

    name = "frozen"

    def solve(self, rows: Rows, task: Task) -> Command:
        """Nothing."""
        return Command(np.zeros(task.J.shape[1]), "ok", rows.phi >= 0.0, rows.labels)


@pytest.mark.parametrize("name", ["example-2d-fov", "panda-fov"])
def test_standing_still_uses_nothing(name: str) -> None:
    assert np.isnan(scored(name, Frozen())[1]["utilization"])


def used(clearance: Any, alone: Any, **more: Any) -> tuple[float, Any]:
    """Utilization of a run and of each of its rows (None where there is none), with tracking alone
    beside it.
    """
    found = score(made(clearance=clearance, **more), made(clearance=alone))
    rows = [
        None if np.isnan(row["utilization"]) else row["utilization"] for row in found.constraints
    ]
    return found.result["utilization"], rows


def test_utilization_is_over_the_time_in_which_tracking_alone_is_outside() -> None:
    """Of L = 10: 2, 1 and, outside, all; of the second row 4 once; the third acts, and nothing
    challenges it.
    """
    run = [[0, 2, 1, -1, 9], [9, 9, 9, 4, 9], [1, 1, 1, 1, 1]]
    alone = [[9, -1, -2, -1, 0], [9, 9, 9, -9, 9], [9] * 5]
    active = [[0] * 5, [0] * 5, [1] * 5]
    assert used(run, alone, active=active) == (
        pytest.approx((0.8 + 0.9 + 1.0 + 0.6) / 4),
        [pytest.approx((0.8 + 0.9 + 1.0) / 3), pytest.approx(0.6), None],
    )
    # beyond L there is nothing left to be unused, nor where there is no boundary in sight
    assert used([[0, 30, 0, np.inf]], [[1, -1, -1, -1]])[0] == pytest.approx(1 / 3)
    # outside between two samples is outside
    between = made(clearance=[[9, 9, 9]], between=[[INF, -1, INF]])
    assert score(made(clearance=[[0, 5, 0]]), between).result["utilization"] == 0.5


def test_runs_are_held_together_at_the_same_times_while_both_last() -> None:
    """A law that comes to the boundary two samples later than tracking; runs that are shorter, and
    longer.
    """
    assert used([[9, 9, 9, 0, 0, 0]], [[9, -1, -1, -1, 9, 9]])[0] == pytest.approx(
        (0.1 + 0.1 + 1.0) / 3
    )
    assert used([[9, 5, 2]], [[9, -1, -1, -1, -1]])[0] == pytest.approx((0.5 + 0.8) / 2)
    assert used([[9, 5, 2, 0, 0, 0]], [[9, -1, -1]])[0] == pytest.approx((0.5 + 0.8) / 2)
    assert np.isnan(used([[9]], [[9, -1]])[0])


def test_a_law_that_bounces_off_the_boundary_uses_little() -> None:
    """It touches the boundary, is thrown 90 of 100 away, and comes back as slowly as tracking
    brings it.
    """
    way = [20, 0, 90, 80, 70, 60, 50, 40, 30, 20, 10, 0]
    touches = [[0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]]
    alone = made(clearance=[[20, *[-5] * 11]], length=[100])
    bounced = score(
        made(clearance=[way], phi=[[-c for c in way]], active=touches, length=[100]), alone
    )
    stayed = score(made(clearance=[[20, *[3] * 11]], active=touches, length=[100]), alone)
    assert bounced.result["utilization"] == pytest.approx(1.0 - 450 / 1100)
    assert bounced.constraints[0]["held_time_s"] == 1.0
    assert stayed.result["utilization"] == pytest.approx(0.97)
    assert bounced.constraints[0]["mean_unused_margin"] == pytest.approx(450 / 11)


def test_smaller_regions_use_more_and_the_sliding_mode_the_most() -> None:
    laws = [
        make_controller("potential-field", {"blend": "priority", "region": r})
        for r in (0.5, 0.2, 0.05)
    ]
    baseline, _ = scored("example-2d-fast", Tracking())
    share = [
        scored("example-2d-fast", law, baseline)[1]["utilization"] for law in (*laws, SlidingMode())
    ]
    assert share == sorted(share)
    assert share[0] < 0.975 < share[-1]


def test_of_rows_that_hold_both_back_the_nearer_law_uses_more() -> None:
    """On the Panda, sliding mode fills the two rows that hold it back; a field leaves 2.5 px and
    0.416 rad.

    Its elbow runs on, since nothing damps it, and that counts as converged here.
    """
    undamped = Scenario.load("panda-fov").with_override("task.rest", {"damping": 0.0})
    undamped = undamped.with_override("tolerances", {"joint_speed": 10.0})
    baseline, _ = scored(undamped, Tracking())
    sliding, filled = scored(undamped, SlidingMode(), baseline)
    field = make_controller("potential-field", {"blend": "priority"})
    other, left = scored(undamped, field, baseline)
    rows = {
        row["constraint"]: row
        for row in score(sliding, baseline).constraints
        if row["held_time_s"] > 0.0
    }
    assert set(rows) == {"fov[marker 3]", "range[joint 7].lower"}
    assert min(row["usage_max"] for row in rows.values()) > 0.997
    assert sum(row["challenged"] for row in score(sliding, baseline).constraints) == 5
    least = dict(zip(other.trajectory.labels, other.trajectory.clearance.min(axis=0), strict=True))
    assert least["range[joint 7].lower"] > 0.4
    assert least["fov[marker 3]"] > 2.4
    theirs = {row["constraint"]: row for row in score(other, baseline).constraints}
    for label, row in rows.items():
        assert row["utilization"] > 0.97 > 0.95 > theirs[label]["utilization"]
        assert row["usage_held"] > 0.997 > theirs[label]["usage_held"]
    assert filled["utilization"] > left["utilization"]


# --- rank loss ---


class Claims(Tracking):
    """Tracks, and claims a loss of rank."""

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        return replace(super().solve(rows, task), status="rank-loss", reason="so it says")


def test_a_claimed_loss_of_rank_is_checked_by_the_rows() -> None:
    setup = Scenario.load("example-2d-fov").with_override("duration", 0.1).setup()
    run = simulate(setup, Claims())
    assert run.status == "unfinished"
    assert "claimed a loss of rank in 21 samples" in run.reason
    np.testing.assert_array_equal(run.q, simulate(setup, Tracking()).q)


def test_rank_is_that_of_the_rows_at_their_boundary_whatever_their_units() -> None:
    def rows(phi: list[float], Lg: list[list[float]]) -> Rows:
        m = len(phi)
        return Rows(np.array(phi), np.array(Lg), np.zeros(m), np.ones(m), tuple(map(str, range(m))))

    assert loses_rank(rows([0.0, 0.1], [[1.0, 2.0, 0.0], [-2.0, -4.0, 0.0]]))
    assert not loses_rank(rows([0.0, -0.1], [[1.0, 2.0, 0.0], [-2.0, -4.0, 0.0]]))
    assert not loses_rank(rows([0.0, 0.1], [[1e4, 0.0, 0.0], [0.0, 1e-3, 0.0]]))
    assert not loses_rank(rows([-1.0], [[0.0, 0.0, 0.0]]))


# --- times ---


def test_every_law_is_timed_by_the_same_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiled route that only shipped laws have is not taken, and commands are the same by
    both.
    """
    setup = Scenario.load("example-2d-fast").with_override("duration", 0.6).setup()
    usual = simulate(setup, SlidingMode())
    calls = []
    command = SlidingMode.command
    bound = SlidingMode.bind

    def never(*arguments: Any) -> Any:
        law = bound(*arguments)
        if law is not None:
            law.solve = lambda: pytest.fail("the bound law is asked")
        return law

    monkeypatch.setattr(SlidingMode, "bind", never)
    monkeypatch.setattr(
        SlidingMode, "command", lambda *arguments: calls.append(1) or command(*arguments)
    )
    run = simulate(setup, SlidingMode(), by_public_call=True)
    assert len(calls) == len(run.t)
    np.testing.assert_allclose(run.qdd_command, usual.qdd_command, rtol=1e-9, atol=1e-9)


def test_columns_stand_in_the_order_in_which_they_were_added() -> None:
    added = [metric.column_order for metric in run_metrics() if metric.column_order]
    assert len(set(added)) == len(added), (
        "two columns were added at once: which comes first is chance"
    )
    assert result_columns()[-8:] == (
        "compiled",
        "within_band",
        "sliding_lost_s",
        "held_time_s",
        "saturated_time_s",
        "violation_fraction",
        "violated_tolerant",
        "acceleration_max",
    )


def test_the_largest_acceleration_is_that_of_one_joint_in_one_sample() -> None:
    """Of either sign; what is not a number is left out, and a run without any has none."""
    commanded = np.array([[1.0, -2.0], [np.nan, 0.5], [-30.0, 4.0]])
    result = score(made([[1.0, 1.0, 1.0]], qdd_command=commanded), None).result
    assert result["acceleration_max"] == 30.0
    nothing = score(made([[1.0, 1.0]], qdd_command=np.full((2, 2), np.nan)), None).result
    assert np.isnan(nothing["acceleration_max"])


def test_a_depth_is_stored_as_a_share_and_shown_in_per_cent() -> None:
    (depth,) = (metric for metric in run_metrics() if metric.column == "violation_depth")
    assert "[%" in depth.header
    assert shown(depth, {"violation_depth": 0.25}) == 25.0
