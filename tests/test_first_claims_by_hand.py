"""What claims 1, 2, 7b and 9a find of made-up runs: verdict, text and every number, worked out by
hand.
"""

from __future__ import annotations

from math import exp, log
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, T, Told, at, during, found, verdict
from vsconstraints.comparisons.run import Run
from vsconstraints.comparisons.runs.spec import RunSpec
from vsconstraints.paper import scenes, verdicts
from vsconstraints.paper.claims import section_6_advantages
from vsconstraints.paper.verdicts import CLAIMS, Claim, Finding, claim, judged, shown_intervals
from vsconstraints.rows import Array

# --- verdicts ---


def test_what_is_said_of_nothing() -> None:
    assert shown_intervals([]) == "never"
    assert shown_intervals([(1.0, 2.5), (3.0, 4.125)]) == "1.00–2.50 s and 3.00–4.12 s"
    assert [judged(True), judged(False), judged(False, True), judged(True, True)] == [
        YES,
        NO,
        PARTLY,
        YES,
    ]


def test_keys_are_numbers_and_letters() -> None:
    assert (CLAIMS["12a"].number, CLAIMS["12a"].letter, CLAIMS["12a"].key) == (12, "a", "12a")


def test_what_was_not_run_is_not_measured() -> None:
    here = RunSpec("example-2d-fov")
    other = "a study"
    one = Claim(1, "z", "", "", "", "", (here, other), lambda a, b: Finding("holds", f"{a} {b}"))
    assert one.check({here: 1, other: 2}).text == "1 2"
    assert one.check({here: 1}).text == "a study: was not run"
    assert one.check({here: "lost", other: 2}) == Finding("not measured", f"{here}: lost")


@pytest.mark.parametrize("tolerated", [False, True])
@pytest.mark.parametrize("status", ["converged", "trapped", "failed", "aborted"])
def test_a_run_that_ended_early_is_not_measured(status: str, tolerated: bool) -> None:
    """Unless the claim is about how it ends."""
    need = RunSpec("example-2d-fov", may_end_early=tolerated)
    record: Any = SimpleNamespace(trajectory=SimpleNamespace(status=status, reason="why"))
    nothing: Any = None
    one = Claim(
        1, "z", "", "", "", "", (need,), lambda run: Finding("holds", run.trajectory.status)
    )
    of = one.check({need: Run(nothing, record)})
    early = status in ("failed", "aborted") and not tolerated
    assert of == (
        Finding("not measured", f"{need}: {status}, why") if early else Finding("holds", status)
    )


def test_a_claim_is_what_is_said_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(study: object) -> Finding:
        return Finding("holds", "")

    monkeypatch.setattr(verdicts, "CLAIMS", {})
    register = claim(
        "123b", "a study", where="where", sentence="sentence", rule="rule", figure="figure.png"
    )
    register(measure)
    claim("4c", where="there", sentence="other", rule="its rule")(measure)
    assert {
        "123b": Claim(123, "b", "where", "sentence", "rule", "figure.png", ("a study",), measure),
        "4c": Claim(4, "c", "there", "other", "its rule", "", (), measure),
    } == verdicts.CLAIMS
    with pytest.raises(ValueError, match="there are two claims 123b"):
        register(measure)


# --- claims 1 and 2 ---

LONG = 0.1 * np.arange(121)


def errors(position: Array, angle: Array) -> Array:
    return np.column_stack((position, angle))


def test_1a() -> None:
    of = found("1a", Told({ROW: -1.0}, {ROW: at({3: -0.25}, -0.5)}, {ROW: at({4: 0.125}, 1.0)}))
    assert of == Finding(
        YES,
        "max σ = −0.25; the marker stays 0.12 px inside the boundary",
        {"sigma_max": -0.25, "clearance_min": 0.125},
    )


def test_1d() -> None:
    angle = at({0: 2.0, 1: 0.001, -2: 0.5, -1: 0.01}, 3.0)
    of = found("1d", Told(camera_error=errors(0.0 * T, angle), settling_time=1.5))
    assert of.text == "2.0000 rad at first, 10 mrad at the end; settled after 1.50 s (5 mm, 5 mrad)"
    assert (of.verdict, of.values) == (YES, {"first": 2.0, "last": 0.01, "settling": 1.5})


@pytest.mark.parametrize("when", [20, 25, 95, 100])
def test_1e_of_three_intervals(when: int) -> None:
    """From 2 to 10 s: the peak may be anywhere between, and what is there from 2 s on is not
    before.
    """
    row = during((2.0, 3.0), (5.0, 6.0), (9.0, 10.0), t=LONG)
    position = at({0: 0.25, 1: 0.5, 20: 3.0, -2: 2.0, -1: 0.75, when: 100.0}, 0.125, LONG)
    of = found("1e", Told({ROW: row}, t=LONG, camera_error=errors(position, 7.0 + 0.0 * LONG)))
    assert of.values == {"before": 0.5, "peak": 100.0, "peak_at": LONG[when], "last": 0.75}
    assert of.text == (
        f"5e+02 mm before 2.00 s, peak of 100000.0 mm at {LONG[when]:.2f} s, 7.5e+02 mm at the end"
    )
    assert of.verdict == YES


def test_1e_of_a_row_that_acts_at_once_or_never() -> None:
    position = errors(at({50: 100.0}, 0.5), 0.0 * T)
    of = found("1e", Told({ROW: 0.0}, camera_error=position))
    assert (of.verdict, of.values["before"]) == (YES, 0.0)
    assert found("1e", Told(camera_error=position)) == Finding(
        NO, "the constraint never becomes active"
    )


@pytest.mark.parametrize("left", [10, -1])
def test_1e_of_one_per_cent(left: int) -> None:
    position = errors(at({50: 100.0, left: 1.0}, 0.5), 0.0 * T)
    assert verdict("1e", Told({ROW: during((0.2, 0.9))}, camera_error=position)) == PARTLY


def test_1f() -> None:
    rows = {
        ROW: during((3.0, 5.0), (8.0, 9.0), t=LONG),
        "fov[marker 1]": during((6.0, 7.0), t=LONG),
    }
    of = found("1f", Told(rows, t=LONG))
    assert of.text == "active at 3.00–5.00 s and 8.00–9.00 s; for the first feature 6.00–7.00 s"
    assert of.verdict == PARTLY
    assert {name: round(value, 9) for name, value in of.values.items()} == {
        "from_0": 3.0, "to_0": 5.0, "from_1": 8.0, "to_1": 9.0
    }  # fmt: skip


def steps(speed: float, jump: float) -> Told:
    """Two joints, far apart from each other; the second makes its step down, and stays there."""

    def joints(step: float) -> Array:
        return np.column_stack((at({40: 0.5}, 0.0), np.where(T < 0.5, 100.0, 100.0 - step)))

    return Told(qd=joints(speed), qdd_command=joints(jump))


def test_1h() -> None:
    of = found("1h", steps(4.0, 8.0), steps(2.0, 10.0))
    assert (of.verdict, of.values) == (YES, {"speed_ratio": 0.5, "acceleration_ratio": 1.25})
    assert of.text == (
        "T_s = 10 ms and 10 ms: q̇ steps by up to 4e+03 and 2e+03 mrad/s, q̈_c by up to 8 and 10 "
        "rad/s²"
    )
    assert verdict("1h", steps(5.0, 5.0), steps(3.0, 4.0)) == YES
    assert verdict("1h", steps(5.0, 5.0), steps(3.125, 4.0)) == NO
    assert verdict("1h", steps(5.0, 5.0), steps(3.0, 3.875)) == PARTLY


def test_scenes_differ_as_the_claims_say() -> None:
    """Half the sampling time; and one with which T_s u⁺ is what it is in the first example."""

    def period_and_gain(spec: RunSpec) -> tuple[float, float]:
        setup = spec.load().setup()
        return setup.Ts, setup.constraints.constraints[0].switching_gain

    Ts, gain = period_and_gain(scenes.FOV)
    assert period_and_gain(scenes.HALVED) == (0.5 * Ts, gain)
    assert period_and_gain(scenes.SAMPLED_FASTER) == (pytest.approx(Ts / 5.0), 5.0 * gain)
    assert [
        spec.load().setup().constraints.constraints[0].K for spec in section_6_advantages.APPROACHES
    ] == [0.1, 0.2, 0.4]


def test_2a() -> None:
    of = found("2a", Told(settling_time=6.0), Told(settling_time=2.0))
    assert of == Finding(YES, "settled after 6.00 s and 2.00 s: 3.00 times faster", {"ratio": 3.0})


@pytest.mark.parametrize(
    ("phi", "sigma", "expected"), [(3.5, -0.5, YES), (3.0, -0.5, PARTLY), (3.5, 0.0, YES)]
)
def test_2b(phi: float, sigma: float, expected: str) -> None:
    """T_s u⁺ = 2 in a run with twice the period."""
    of = found("2b", Told({ROW: at(dict.fromkeys(range(5, 10), phi))}, {ROW: sigma}, t=2.0 * T))
    assert of.verdict == expected
    assert of.values == {"sigma_max": sigma, "phi_max": phi, "bound": 2.0, "positive_samples": 5.0}
    assert of.text.endswith(
        "the marker itself stays inside (σ < 0), since φ also counts its speed"
    ) == (sigma < 0.0)


def band(width: float) -> Told:
    return Told({ROW: at({5: 0.25, 6: 0.25 + width, 7: 0.0})})


def test_2d_2e_and_2f() -> None:
    of = found("2d", band(0.25), band(1.25))
    assert of == Finding(YES, "φ moves by 0.500 (u⁺ = 10, Fig. 4) and 1.500 (u⁺ = 50): 3.0 times "
                              "as much",
                         {"slow": 0.5, "fast": 1.5})  # fmt: skip
    of = found("2e", Told(needed=at({5: 3.0}, 1.0)), Told(needed=at({5: 4.0}, 0.5)))
    assert of == Finding(
        YES, "(12) asks for u⁺ > 3.00 in Fig. 4 and u⁺ > 4.00 in Fig. 5", {"slow": 3.0, "fast": 4.0}
    )
    of = found("2f", Told({ROW: at({5: 2.0, 6: 0.0})}), Told({ROW: at({5: 2.2, 6: 0.0})}))
    assert of == Finding(YES, "with u⁺ = 50 and T_s = 10 ms φ moves by 2.200, in Fig. 4 by 2.000",
                         {"slow": 2.0, "fast": 2.2})  # fmt: skip
    assert (
        verdict("2f", Told({ROW: at({5: 2.0, 6: 0.0})}), Told({ROW: at({5: 2.21, 6: 0.0})})) == NO
    )


# --- claims 7 and 9 ---

QUARTERS = 0.25 * np.arange(9)


@pytest.mark.parametrize(
    ("last", "tau"), [(exp(-1.0), 0.5), (0.0, -0.5 / log(1e-6)), (-3.0, -0.5 / log(1e-6))]
)
def test_7b_fits_a_line(last: float, tau: float) -> None:
    """Of the logarithms of 1, e⁻² and the last at 0.25, 0.5 and 0.75 s: their slope is half of it
    per quarter.
    """
    speed = at({1: 1.0, 2: exp(-2.0), 3: last}, 55.0, QUARTERS)
    row = at({1: 0.0, 2: 1.0, 6: 0.0}, -1.0, QUARTERS)
    of = found("7b", *[Told({ROW: row}, t=QUARTERS, speed=speed, K=0.25)] * 3)
    assert of.values == pytest.approx({"0.1": tau, "0.2": tau, "0.4": tau}, rel=1e-9)
    assert (
        of.text
        == f"measured time constants: K = 0.1 s: {tau:.3f} s; K = 0.2 s: {tau:.3f} s; K = 0.4 s: "
        f"{tau:.3f} s"
    )


def test_7b_needs_a_row_that_acts() -> None:
    assert found("7b", *[Told(speed=T)] * 3) == Finding("not measured", "the row never acts")


@pytest.mark.parametrize(
    ("constants", "expected"),
    [
        ((0.125, 0.25, 0.5), YES),
        ((0.125, 0.25, 0.51), PARTLY),
        ((0.2, 0.2, 0.4), NO),
        ((0.2, 0.21, 0.21), NO),
    ],
)
def test_7b_of_time_constants(
    constants: tuple[float, ...], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(section_6_advantages, "time_constant", lambda run: run)
    assert found("7b", *constants).verdict == expected


def test_9a_says_how_much() -> None:
    def told(change: float, samples: int = 101) -> Told:
        t = T[:samples]
        return Told(
            t=t,
            q=np.zeros((len(t), 2)),
            qdd_command=np.column_stack((0.0 * t, at({70: change}, 1.0, t))),
        )

    of = found("9a", told(0.5), told(3.0), told(2.5), told(3.0))
    assert of.text == (
        "example-2d-fov: q̈_c differs by 2 rad/s² in 101 samples; case-study-6r: q̈_c differs by "
        "0 rad/s² in 101 samples"
    )
    of = found("9a", told(0.5), told(3.0), told(0.5), told(3.0, 90))
    assert (
        of.text
        == "example-2d-fov: q̈_c differs by 0 rad/s² in 101 samples; case-study-6r: one run ends "
        "earlier"
    )
    assert of.verdict == NO
