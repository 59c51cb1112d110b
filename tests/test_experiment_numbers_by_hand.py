"""The numbers that claim 6 gives of the experiments, on made-up runs in which no two of them are
alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, Told, at, during, found
from vsconstraints.paper import scenes
from vsconstraints.paper.claims import section_10_experiments
from vsconstraints.paper.studies.summary import RunSummary
from vsconstraints.paper.studies.unselected_experiments import compared
from vsconstraints.paper.verdicts import NotMeasured

OTHER = "fov[marker 3]"


class Long(Told):
    """Rows of a characteristic length of 4, with T_s u⁺ = 4."""

    def length(self, label: str) -> float:
        return 4.0

    def bound(self, label: str) -> float:
        return 4.0


# --- the experiments as they are ---


def test_the_row_that_slides_is_the_one_that_acts_longest() -> None:
    run: Any = Told(
        {
            "occlusion[a]": 0.0,
            ROW: during((0.1, 0.2)),
            OTHER: during((0.1, 0.3)),
            "fov[marker 4]": -1.0,
        }
    )
    assert section_10_experiments.acting_rows(run, "fov") == [ROW, OTHER]
    assert section_10_experiments.sliding_row(run, "fov") == OTHER
    with pytest.raises(NotMeasured, match="no fov row ever acts"):
        section_10_experiments.sliding_row(Told({ROW: -1.0, "occlusion[a]": 0.0}), "fov")  # type: ignore[arg-type]


def test_exponentially() -> None:
    """From 0.2 to 0.6 s, K = 0.5 s: 3 px/s from 2 px away, and 2 px/s from 1.25 px away, 0.8 of
    clearance / K.
    """
    run: Any = Told(
        {ROW: during((0.2, 0.6))},
        {},
        {ROW: at({30: 2.0, 40: 1.25}, 9.0)},
        speed=at({30: 3.0, 40: 2.0}, -1.0),
        K=0.5,
    )
    finding = section_10_experiments.exponentially(run, ROW)
    assert finding.verdict == YES
    assert finding.values == {"share": pytest.approx(0.8), "speed": 3.0}
    assert finding.text == (
        f"{ROW} acts from 0.2 to 0.6 s; towards the boundary at most 3 px/s, 2 px before it: at "
        f"most 0.8 clearance / K"
    )


@pytest.mark.parametrize(("speed", "expected"), [(11.0, YES), (11.1, NO)])
def test_exponentially_but_for_a_tenth(speed: float, expected: str) -> None:
    run: Any = Told({ROW: 0.0}, {}, {ROW: 1.0}, speed=at({30: speed}, 0.0), K=0.1)
    assert section_10_experiments.exponentially(run, ROW).verdict == expected


@pytest.mark.parametrize("clearance", [0.0, -0.5])
def test_what_has_crossed_the_boundary_does_not_approach_it(clearance: float) -> None:
    run: Any = Told({ROW: 0.0}, {}, {ROW: at({30: clearance}, 1.0)}, speed=at({}, 0.5))
    finding = section_10_experiments.exponentially(run, ROW)
    assert finding.verdict == NO
    assert np.isnan(finding.values["share"])


def test_one_marker_slides() -> None:
    """It acts in 3 samples, at most 0.4 s apart; the other in one."""
    phi = {ROW: at({10: 1.0, 20: 0.0, 60: 2.0}), OTHER: -1.0}
    run: Any = Long(
        phi, {ROW: at({5: -0.25}, -3.0), OTHER: 7.0}, {ROW: at({5: 0.02}, 0.5), OTHER: -7.0}
    )
    finding = section_10_experiments.one_marker_slides(run, "fov")
    assert finding.verdict == YES
    assert finding.values == {"margin": 0.005, "sigma_max": -0.25, "rows": 1.0}
    assert finding.text == (
        f"{ROW} acts in 3 samples from 0.1 to 0.6 s, at most 0.4 s apart; max σ = −0.25, 0.02 px "
        f"from the boundary "
        "(0.5 % of L); the greatest φ is 0.5 T_s u⁺"
    )
    both: Any = Long(
        {ROW: at({10: 1.0}), OTHER: at({10: 1.0, 11: 1.0})}, {ROW: 7.0, OTHER: -1.0}, {OTHER: 0.04}
    )
    finding = section_10_experiments.one_marker_slides(both, "fov")
    assert (finding.verdict, finding.values) == (
        PARTLY,
        {"margin": 0.01, "sigma_max": -1.0, "rows": 2.0},
    )
    once: Any = Long({ROW: at({10: 1.0})})
    assert (
        "acts in 1 sample from 0.1 to 0.1 s, at most 0.0 s apart"
        in section_10_experiments.one_marker_slides(once, "fov").text
    )


@pytest.mark.parametrize(
    ("key", "kind"), [("6a", "fov"), ("6b", "fov"), ("6e", "occlusion"), ("6f", "occlusion")]
)
def test_the_kind_of_row_that_slides(key: str, kind: str) -> None:
    phi = {f"{name}[x]": 0.0 if name == kind else -1.0 for name in ("fov", "occlusion")}
    finding = found(key, Told(phi, speed=at({}, 0.0)))
    assert finding.verdict == YES
    assert finding.text.startswith(f"{kind}[x] acts")


@pytest.mark.parametrize(("status", "expected"), [("converged", YES), ("timeout", NO)])
@pytest.mark.parametrize("key", ["6c", "6g"])
def test_reached(key: str, status: str, expected: str) -> None:
    camera = np.column_stack(
        [at({-2: 0.5, -1: 0.0015, 1: 0.7}, 0.2), at({-2: 0.6, -1: 0.0025, 1: 0.8}, 0.3)]
    )
    pixels = at({-2: 5.0, -1: 0.25, 1: 7.0}, 2.0)
    run = Told(camera_error=camera, feature_error_px=pixels, status=status, settling_time=41.0)
    finding = found(key, run)
    assert (finding.verdict, finding.values) == (expected, {"settling": 41.0})
    assert (
        finding.text == f"{status} after 41 s; at the end 0.25 px, 1.50 mm, 2.50 mrad from the goal"
    )
    run.trajectory.camera_error = np.full((101, 2), np.nan)
    assert found(key, run).text == f"{status} after 41 s; at the end 0.25 px from the goal"


def test_6l_asks_every_row() -> None:
    """One beyond its boundary is enough, whichever it is."""
    kinds = ("fov", "fov", "occlusion", "occlusion")

    def runs(*least: tuple[float, float]) -> list[Told]:
        return [
            Told({f"{kind}[a]": -1.0, f"{kind}[b]": -1.0}, {}, {f"{kind}[a]": a, f"{kind}[b]": b})
            for kind, (a, b) in zip(kinds, least, strict=True)
        ]

    finding = found("6l", *runs((-0.5, 2.0), (0.25, 2.0), (3.0, -0.75), (3.0, 0.125)))
    assert finding.verdict == YES
    assert finding.text == (
        "experiment 1, T_s = 0.01 s: converged, −0.5 px clear; experiment 1, T_s = 0.01 s: "
        "converged, 0.25 px clear; "
        "experiment 2, T_s = 0.01 s: converged, −0.75 px clear; experiment 2, T_s = 0.01 s: "
        "converged, 0.125 px clear"
    )


def test_what_is_simulated_of_the_experiments() -> None:
    """Ten times the gain, as sampled and ten times faster, for a minute; these may be aborted."""
    wanted = [("experiment-1-pbvs", 0.1), ("experiment-1-pbvs", 0.01)]
    wanted += [("experiment-2-ibvs", 0.1), ("experiment-2-ibvs", 0.01)]
    for spec, (name, Ts) in zip(scenes.FASTER, wanted, strict=True):
        tables = spec.tables
        assert (spec.name, tables["sampling_time"], tables["task"]["Kp0"], tables["duration"]) == (
            name,
            Ts,
            6.0,
            60.0,
        )
        assert spec.may_end_early
    for spec in (scenes.PBVS, scenes.IBVS):
        assert spec.tables["task"]["Kp0"] == 0.6
        assert not spec.may_end_early


def integrated(*off: float, faster: float = 0.0) -> Told:
    """With T_s = 0.1 s, q̇ = 2, then 3, 3.5 and 3.5 rad/s; q of each sample off by so much."""
    q = np.array([1.0, 1.25, 1.575, 1.925]) + np.array(off or (0.0,) * 4)
    qd = np.array([2.0, 3.0, 3.5, 3.5 + faster])
    commands = np.array([10.0, 5.0, 0.0, 99.0])
    return Told(t=0.1 * np.arange(4), q=q[:, None], qd=qd[:, None], qdd_command=commands[:, None])


def test_6m() -> None:
    """Every change within 1e-9 is not enough: they add up."""
    good = found("6m", integrated(), integrated())
    assert good.verdict == YES
    assert good.values["left"] < 1e-14
    adding_up = integrated(0.0, 0.6e-9, 1.2e-9, 1.8e-9)
    for runs in ((adding_up, integrated()), (integrated(), adding_up)):
        finding = found("6m", *runs)
        assert finding.verdict == NO
        assert finding.values["left"] == pytest.approx(1.8e-9, rel=1e-5)
        assert finding.text.startswith("up to 1.8e-09 rad and ")
    back = found("6m", integrated(0.0, 0.9e-9, -0.9e-9, 0.0), integrated())
    assert (back.verdict, back.values["left"]) == (NO, pytest.approx(1.8e-9, rel=1e-5))
    finding = found("6m", integrated(), integrated(faster=-0.5))
    assert (finding.verdict, finding.values) == (NO, {"left": pytest.approx(0.5)})
    assert finding.text.endswith("rad and 0.5 rad/s are left")
    # at rest, but for exactly as much as may be left
    still = np.zeros((3, 1))
    last = Told(
        t=0.1 * np.arange(3), q=still, qd=np.array([[0.0], [0.0], [1e-9]]), qdd_command=still
    )
    assert found("6m", last, last).verdict == YES


# --- errors in the gradient ---


@pytest.mark.parametrize(("apart", "similar"), [(32.0, True), (33.0, False)])
def test_tracks_within_a_twentieth_of_the_image_are_very_similar(
    apart: float, similar: bool
) -> None:
    """Of 640 px, 32 px: the row that acts leaves a hundredth of its length in both runs."""
    rows = {"fov[marker 1]": {"clearance_min": 0.1, "usage_max": 0.99, "phi_max": 0.5}}
    exact, wrong = (
        RunSummary(
            "converged", "", rows=rows, t=np.array([0.0, 0.02]), pixels=np.array([[[0.0, 0.0]], [[x, 0.0]]]),
            qd=np.ones((2, 1)),
        )
        for x in (0.0, apart)
    )  # fmt: skip
    found = compared("fov", wrong, exact)
    assert (found["track_px"], found["similar"]) == (apart, similar)
