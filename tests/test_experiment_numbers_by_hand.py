"""The numbers that claim 6 gives of the experiments, on made-up runs in which no two of them are alike."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, T, Told, at, during, found
from vsconstraints.paper.claims import experiments
from vsconstraints.paper.claims.experiments import (
    CASES,
    Difference,
    in_unselected,
    little_speed_difference,
    very_similar,
)
from vsconstraints.paper.studies import StudyResult
from vsconstraints.paper.studies.summary import RunSummary
from vsconstraints.paper.studies.unselected_experiments import compared
from vsconstraints.paper.verdicts import NotMeasured

OTHER = "fov[marker 3]"
MADE_UP = "experiment-1-pbvs"


class Long(Told):
    """Rows of a characteristic length of 4, with T_s u⁺ = 4."""

    def length(self, label: str) -> float:
        return 4.0

    def bound(self, label: str) -> float:
        return 4.0


# --- the experiments as they are ---


def test_the_row_that_slides_is_the_one_that_acts_longest() -> None:
    run: Any = Told({"occlusion[a]": 0.0, ROW: during((0.1, 0.2)), OTHER: during((0.1, 0.3)), "fov[marker 4]": -1.0})
    assert experiments.acting_rows(run, "fov") == [ROW, OTHER]
    assert experiments.sliding_row(run, "fov") == OTHER
    with pytest.raises(NotMeasured, match="no fov row ever acts"):
        experiments.sliding_row(Told({ROW: -1.0, "occlusion[a]": 0.0}), "fov")  # type: ignore[arg-type]


def test_exponentially() -> None:
    """From 0.2 to 0.6 s, K = 0.5 s: 3 px/s from 2 px away, and 2 px/s from 1.25 px away, 0.8 of clearance / K."""
    run: Any = Told(
        {ROW: during((0.2, 0.6))}, {}, {ROW: at({30: 2.0, 40: 1.25}, 9.0)}, speed=at({30: 3.0, 40: 2.0}, -1.0), K=0.5
    )
    finding = experiments.exponentially(run, ROW)
    assert finding.verdict == YES
    assert finding.values == {"share": pytest.approx(0.8), "speed": 3.0}
    assert finding.text == (
        f"{ROW} acts from 0.2 to 0.6 s; towards the boundary at most 3 px/s, 2 px before it: at most 0.8 clearance / K"
    )


@pytest.mark.parametrize(("speed", "expected"), [(11.0, YES), (11.1, NO)])
def test_exponentially_but_for_a_tenth(speed: float, expected: str) -> None:
    run: Any = Told({ROW: 0.0}, {}, {ROW: 1.0}, speed=at({30: speed}, 0.0), K=0.1)
    assert experiments.exponentially(run, ROW).verdict == expected


@pytest.mark.parametrize("clearance", [0.0, -0.5])
def test_what_has_crossed_the_boundary_does_not_approach_it(clearance: float) -> None:
    run: Any = Told({ROW: 0.0}, {}, {ROW: at({30: clearance}, 1.0)}, speed=at({}, 0.5))
    finding = experiments.exponentially(run, ROW)
    assert finding.verdict == NO
    assert np.isnan(finding.values["share"])


def test_one_marker_slides() -> None:
    """It acts in 3 samples, at most 0.4 s apart; the other in one."""
    phi = {ROW: at({10: 1.0, 20: 0.0, 60: 2.0}), OTHER: -1.0}
    run: Any = Long(phi, {ROW: at({5: -0.25}, -3.0), OTHER: 7.0}, {ROW: at({5: 0.02}, 0.5), OTHER: -7.0})
    finding = experiments.one_marker_slides(run, "fov")
    assert finding.verdict == YES
    assert finding.values == {"margin": 0.005, "sigma_max": -0.25, "rows": 1.0}
    assert finding.text == (
        f"{ROW} acts in 3 samples from 0.1 to 0.6 s, at most 0.4 s apart; max σ = −0.25, 0.02 px from the boundary "
        "(0.5 % of L); the greatest φ is 0.5 T_s u⁺"
    )
    both: Any = Long({ROW: at({10: 1.0}), OTHER: at({10: 1.0, 11: 1.0})}, {ROW: 7.0, OTHER: -1.0}, {OTHER: 0.04})
    finding = experiments.one_marker_slides(both, "fov")
    assert (finding.verdict, finding.values) == (PARTLY, {"margin": 0.01, "sigma_max": -1.0, "rows": 2.0})
    once: Any = Long({ROW: at({10: 1.0})})
    assert "acts in 1 sample from 0.1 to 0.1 s, at most 0.0 s apart" in experiments.one_marker_slides(once, "fov").text


@pytest.mark.parametrize(("key", "kind"), [("6a", "fov"), ("6b", "fov"), ("6e", "occlusion"), ("6f", "occlusion")])
def test_the_kind_of_row_that_slides(key: str, kind: str) -> None:
    phi = {f"{name}[x]": 0.0 if name == kind else -1.0 for name in ("fov", "occlusion")}
    finding = found(key, Told(phi, speed=at({}, 0.0)))
    assert finding.verdict == YES
    assert finding.text.startswith(f"{kind}[x] acts")


@pytest.mark.parametrize(("status", "expected"), [("converged", YES), ("timeout", NO)])
@pytest.mark.parametrize("key", ["6c", "6g"])
def test_reached(key: str, status: str, expected: str) -> None:
    camera = np.column_stack([at({-2: 0.5, -1: 0.0015, 1: 0.7}, 0.2), at({-2: 0.6, -1: 0.0025, 1: 0.8}, 0.3)])
    pixels = at({-2: 5.0, -1: 0.25, 1: 7.0}, 2.0)
    run = Told(camera_error=camera, feature_error_px=pixels, status=status, settling_time=41.0)
    finding = found(key, run)
    assert (finding.verdict, finding.values) == (expected, {"settling": 41.0})
    assert finding.text == f"{status} after 41 s; at the end 0.25 px, 1.50 mm, 2.50 mrad from the goal"
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
        "experiment 1, T_s = 0.01 s: converged, −0.5 px clear; experiment 1, T_s = 0.01 s: converged, 0.25 px clear; "
        "experiment 2, T_s = 0.01 s: converged, −0.75 px clear; experiment 2, T_s = 0.01 s: converged, 0.125 px clear"
    )


def test_what_is_simulated_of_the_experiments() -> None:
    """Ten times the gain, as sampled and ten times faster, for a minute; these may be aborted."""
    wanted = [("experiment-1-pbvs", 0.1), ("experiment-1-pbvs", 0.01)]
    wanted += [("experiment-2-ibvs", 0.1), ("experiment-2-ibvs", 0.01)]
    for spec, (name, Ts) in zip(experiments.FASTER, wanted, strict=True):
        tables = spec.tables
        assert (spec.name, tables["sampling_time"], tables["task"]["Kp0"], tables["duration"]) == (
            name,
            Ts,
            6.0,
            60.0,
        )
        assert spec.may_end_early
    for spec in (experiments.PBVS, experiments.IBVS):
        assert spec.tables["task"]["Kp0"] == 0.6
        assert not spec.may_end_early
    for spec in (experiments.PBVS_ALONE, experiments.IBVS_ALONE):
        assert spec.tables["disturbances"]["gradient_error_in_phi"] is False


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
    last = Told(t=0.1 * np.arange(3), q=still, qd=np.array([[0.0], [0.0], [1e-9]]), qdd_command=still)
    assert found("6m", last, last).verdict == YES


# --- errors in the gradient ---


class Imaged(Told):
    """A run with an image of 640 × 480 px."""

    setup = SimpleNamespace(
        scene=SimpleNamespace(
            camera=SimpleNamespace(size=(640.0, 480.0), sees=lambda pixels: np.abs(pixels[..., 0]) <= 100.0)
        )
    )


def imaged(
    far: tuple[float, float] = (0.0, 0.0), slower: float = 0.0, samples: int = 101, kind: str = "fov", **changed: Any
) -> Imaged:
    """One marker is so far off in one sample, and one joint slower; joints move at 0.5 rad/s, last at −4 rad/s."""
    pixels, qd = np.full((samples, 2, 2), 5.0), np.full((samples, 3), 0.5)
    pixels[7, 1] += far
    qd[9, 2] -= slower
    qd[90:, 1] = -4.0
    row, other = f"{kind}[marker 1]", f"{kind}[marker 2]"
    phi = {row: 0.0, other: -1.0}
    t = T[:samples]
    sigma = {row: at({3: changed.pop("sigma", -0.25)}, -5.0, t), other: -2.0}
    run = Imaged(phi, sigma, t=t, features_px=pixels, qd=qd, **changed)
    run.sampling_time = 0.1
    return run


def study(scenario: str, what: str, plus: float = 190.0, minus: float = 195.0, alone: float = 50.0) -> StudyResult:
    numbers = {(scenario, case, what): x for case, x in zip(CASES, (plus, minus, alone), strict=True)}
    numbers |= {(scenario, case, name): 200.0 for case in CASES for name in ("scenes", "applied")}
    return StudyResult("made up", numbers, (), (), ())


def test_difference() -> None:
    """Of runs of which either ends first: what both have is compared, but all of the exact one is the fastest."""
    short: Any = imaged((3.0, 4.0), 0.125, samples=60)
    found = Difference.between(imaged(), short, "fov")  # type: ignore[arg-type]
    assert found == Difference(5.0, 0.125, 4.0, -0.25, fine=True, same=True)
    found = Difference.between(short, imaged(), "fov")  # type: ignore[arg-type]
    assert found == Difference(5.0, 0.125, 0.5, -0.25, fine=True, same=True)
    late: Any = imaged((3.0, 4.0), status="timeout", sigma=0.5)
    assert Difference.between(imaged(), late, "fov") == Difference(5.0, 0.0, 4.0, 0.5, fine=False, same=True)  # type: ignore[arg-type]
    for pair in ((imaged(), imaged((3.0, 4.0), status="timeout")), (imaged(status="timeout"), imaged((3.0, 4.0)))):
        assert not Difference.between(*pair, "fov").fine  # type: ignore[arg-type]
    origin, beside = imaged(), imaged()
    origin.trajectory.features_px, beside.trajectory.features_px = np.zeros((101, 2, 2)), np.zeros((101, 2, 2))
    beside.trajectory.features_px[7, 1, 0] = 0.01
    with pytest.raises(NotMeasured, match=r"tracks differ by 0\.01 px"):
        Difference.between(origin, beside, "fov")  # type: ignore[arg-type]


@pytest.mark.parametrize(("far", "expected"), [((18.0, 24.0), YES), ((19.3, 25.7), PARTLY)])
def test_very_similar(far: tuple[float, float], expected: str) -> None:
    """30 px are less than 5 % of the image's width, 32 px, but more than of its height, 24 px."""
    alone = imaged((0.6, 0.8), sigma=0.75, status="timeout")
    finding = very_similar(imaged(), imaged(far), alone, study(MADE_UP, "similar"), MADE_UP)  # type: ignore[arg-type]
    track = np.hypot(*far)
    assert finding.verdict == expected
    assert finding.values == {"track_difference_px": pytest.approx(track), "sigma_max": -0.25}
    here = "holds" if expected == YES else "does not hold"
    assert finding.text == (
        f"{here} in this scene; in 190 of 200 unselected scenes, with reversed signs in 195 of 200, with ∇σ_e in "
        f"L_gφ alone, the other reading of (49), in 50 of 200. Here tracks differ by up to {track:.2f} px, with errors "
        "max σ = −0.25, converged; with ∇σ_e in L_gφ alone by 1.00 px, max σ = 0.75, timeout"
    )


@pytest.mark.parametrize("case", CASES)
def test_scenes_must_be_enough_in_every_case(case: str) -> None:
    few = study("s", "x")
    few = StudyResult("made up", few.numbers | {("s", case, "scenes"): 99.0}, (), (), ())
    with pytest.raises(NotMeasured, match="has 99 scenes of s, fewer than 100"):
        in_unselected(few, "s", "x", here=True)


@pytest.mark.parametrize(("slower", "expected"), [(0.4, YES), (0.401, PARTLY)])
def test_little_speed(slower: float, expected: str) -> None:
    erroneous: Any = imaged((3.0, 4.0), slower)
    finding = little_speed_difference(imaged(), erroneous, study(MADE_UP, "little_speed"), MADE_UP)  # type: ignore[arg-type]
    assert finding.verdict == expected
    assert finding.values == {"share": pytest.approx(slower / 4.0)}
    assert finding.text.endswith("Here by up to 4e+02 mrad/s, 10 % of the fastest joint's 4e+03 mrad/s")


@pytest.mark.parametrize(
    ("key", "kind", "scenario", "what"),
    [
        ("6d", "fov", "experiment-1-pbvs", "similar"),
        ("6h", "occlusion", "experiment-2-ibvs", "similar"),
        ("6j", "fov", "experiment-1-pbvs", "little_speed"),
        ("6k", "occlusion", "experiment-2-ibvs", "little_speed"),
    ],
)
def test_what_is_compared(key: str, kind: str, scenario: str, what: str) -> None:
    runs = [imaged(kind=kind), imaged((3.0, 4.0), 0.1, kind=kind)]
    runs += [imaged((3.0, 4.0), kind=kind)] * (what == "similar")
    assert found(key, *runs, study(scenario, what)).verdict == YES
    assert found(key, *runs, study(scenario, what, plus=189.0)).verdict == PARTLY


def test_6i() -> None:
    scenarios = ("experiment-1-pbvs", "experiment-2-ibvs")
    numbers = {k: v for name in scenarios for k, v in study(name, "satisfactory").numbers.items()}
    everywhere = StudyResult("made up", numbers, (), (), ())
    runs = [imaged(far, sigma=sigma, kind=kind) for kind, sigma in (("fov", -0.5), ("occlusion", 0.0))
            for far in ((0.0, 0.0), (3.0, 4.0))]  # fmt: skip
    finding = found("6i", *runs, everywhere)
    assert finding.verdict == YES
    one, two = finding.text.split(". ")
    assert one.startswith("experiment 1: holds in this scene; in 190 of 200")
    assert one.endswith("here T_s = 0.1 s, converged, max σ = −0.5")
    assert two.startswith("experiment 2: holds in this scene; in 190 of 200")
    assert two.endswith("here T_s = 0.1 s, converged, max σ = 0")


@pytest.mark.parametrize(("apart", "similar"), [(32.0, True), (33.0, False)])
def test_tracks_within_a_twentieth_of_the_image_are_very_similar(apart: float, similar: bool) -> None:
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
