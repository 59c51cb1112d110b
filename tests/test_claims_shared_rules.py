"""Rules that several claims of the paper share, on made-up runs.

Every number is just inside or just outside a limit, and no two numbers of a run are alike.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from made_runs import (
    FAILS,
    HOLDS,
    NOT_MEASURED,
    PARTLY,
    ROW,
    Expected,
    MadeRun,
    active_during,
    assert_finds,
    column,
)
from vsconstraints.comparisons.run import Run
from vsconstraints.comparisons.runs.spec import RunSpec
from vsconstraints.paper import verdicts
from vsconstraints.paper.claims import boundary
from vsconstraints.paper.claims.boundary import rounds_to
from vsconstraints.paper.claims.section_10_experiments import (
    acting_rows,
    exponentially,
    one_marker_slides,
    sliding_row,
)
from vsconstraints.paper.verdicts import (
    CLAIMS,
    Claim,
    Finding,
    NotMeasured,
    claim,
    judged,
    shown_intervals,
)

OTHER = "fov[marker 3]"
SPEED = "speed[joint 2].upper"

# --- verdicts ---


@pytest.mark.parametrize(
    ("conditions", "verdict"),
    [((True,), HOLDS), ((False,), FAILS), ((False, True), PARTLY), ((True, True), HOLDS)],
)
def test_verdict_of_a_full_and_a_weaker_condition(
    conditions: tuple[bool, ...], verdict: str
) -> None:
    assert judged(*conditions) == verdict


@pytest.mark.parametrize(
    ("intervals", "text"),
    [([], "never"), ([(1.0, 2.5), (3.0, 4.125)], "1.00–2.50 s and 3.00–4.12 s")],
)
def test_text_of_intervals(intervals: list[tuple[float, float]], text: str) -> None:
    assert shown_intervals(intervals) == text


def test_keys_are_numbers_and_letters() -> None:
    assert (CLAIMS["12a"].number, CLAIMS["12a"].letter, CLAIMS["12a"].key) == (12, "a", "12a")


def test_a_claim_is_not_measured_without_its_runs() -> None:
    spec = RunSpec("example-2d-fov")
    study = "a study"
    measure: Any = lambda run, study: Finding(HOLDS, f"{run} {study}")  # noqa: E731
    one = Claim(1, "z", "", "", "", "", (spec, study), measure)
    assert one.check({spec: 1, study: 2}).text == "1 2"
    assert one.check({spec: 1}).text == "a study: was not run"
    assert one.check({spec: "lost", study: 2}) == Finding(NOT_MEASURED, f"{spec}: lost")


@pytest.mark.parametrize("may_end_early", [False, True])
@pytest.mark.parametrize("status", ["converged", "trapped", "failed", "aborted"])
def test_a_run_that_ended_early_is_not_measured(status: str, may_end_early: bool) -> None:
    """Unless the claim is about how the run ends."""
    spec = RunSpec("example-2d-fov", may_end_early=may_end_early)
    record: Any = SimpleNamespace(trajectory=SimpleNamespace(status=status, reason="why"))
    setup: Any = None
    measure: Any = lambda run: Finding(HOLDS, run.trajectory.status)  # noqa: E731
    found = Claim(1, "z", "", "", "", "", (spec,), measure).check({spec: Run(setup, record)})
    if status in ("failed", "aborted") and not may_end_early:
        assert found == Finding(NOT_MEASURED, f"{spec}: {status}, why")
    else:
        assert found == Finding(HOLDS, status)


def test_a_claim_is_registered_with_its_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    def measure(study: object) -> Finding:
        return Finding(HOLDS, "")

    monkeypatch.setattr(verdicts, "CLAIMS", {})
    register = claim(
        "123b", "a study", where="where", sentence="sentence", rule="rule", figure="figure.png"
    )
    register(measure)
    claim("4c", where="there", sentence="other", rule="its rule")(measure)
    expected = {
        "123b": Claim(123, "b", "where", "sentence", "rule", "figure.png", ("a study",), measure),
        "4c": Claim(4, "c", "there", "other", "its rule", "", (), measure),
    }
    assert expected == verdicts.CLAIMS
    with pytest.raises(ValueError, match="there are two claims 123b"):
        register(measure)


# --- intervals ---


@pytest.mark.parametrize(
    ("measured", "rounds"),
    [
        ([(2.5, 5.5)], True),
        ([(2.49, 5.0)], False),
        ([(3.0, 5.51)], False),
        ([(3.0, 5.0), (8.0, 9.0)], False),
        ([], False),
    ],
)
def test_intervals_round_to_the_printed_seconds(
    measured: list[tuple[float, float]], rounds: bool
) -> None:
    assert rounds_to(measured, [(3.0, 5.0)]) == rounds


# --- rows at their boundaries ---


def rule(
    function: Callable[..., Finding],
    source: str,
    run: MadeRun,
    arguments: tuple[Any, ...],
    verdict: str,
    values: dict[str, float] | None = None,
    text: str | None = None,
) -> Any:
    """Row of a table: a rule, its run and further arguments, what it finds, and why it must."""
    expected = Expected(verdict, values, text)
    return pytest.param(function, run, arguments, expected, id=f"{function.__name__}: {source}")


def three_rows(first: float = 2.0, second: float = 3.0) -> MadeRun:
    """φ is greatest in the first row, φ/(T_s u⁺) in the second, and longest positive in the third.

    The third is a speed: it has no σ of its own, and its clearance does not count.
    """
    run = MadeRun(
        {
            ROW: column({5: 6.0}, -1.0),
            OTHER: column({5: 3.8}, -8.0),
            SPEED: column({5: 0.5, 6: 0.5}, -2.0),
        },
        {
            ROW: column({4: -0.25}, -3.0),
            OTHER: column({3: -0.5}, -2.0),
            SPEED: column({3: 7.0}, -2.0),
        },
        {ROW: first, OTHER: second, SPEED: -9.0},
        bounds={ROW: 4.0, OTHER: 2.0, SPEED: 1.0},
    )
    run.drift[8, 2] = 7.0
    return run


def approaching(first: float, later: float, greatest: float, last: float = 0.6) -> MadeRun:
    """A row that is active from 0.2 s on, with K = 0.1 s.

    Its normal speed is ``first`` at 0.2 s, ``greatest`` at 0.35 s and ``later`` at 0.5 s, 3 K after
    the first. Outside of these times it is nonsense.
    """
    speed = column({20: first, 35: greatest, 50: later, 19: 99.0, 51: 99.0}, 0.0)
    return MadeRun({ROW: active_during((0.2, last))}, speed=speed)


def two_approaching(second: tuple[float, float]) -> MadeRun:
    speed = column({20: 1.0, 50: 0.1}, 0.5)
    phi = {ROW: active_during((0.2, 0.6)), "b": active_during(second)}
    return MadeRun(phi, speed=speed)


def approaching_twice(pause: float) -> MadeRun:
    """A row that is active twice, with a pause [s] between, and K = 0.05 s."""
    phi = {ROW: active_during((0.05, 0.2), (0.2 + pause, 1.0))}
    return MadeRun(phi, speed=column({5: 1.0, 20: 0.0, 35: 0.0}, 0.5), K=0.05)


def near_its_boundary(first: float, second: float) -> MadeRun:
    clearance = {ROW: column({7: first}, 0.5), "b": column({9: second}, 0.5)}
    return MadeRun({ROW: -1.0, "b": -1.0}, {}, clearance)


def near_with_lengths() -> MadeRun:
    run = near_its_boundary(0.03, 0.002)
    run.lengths = {ROW: 4.0, "b": 0.25}
    return run


def smooth_in_turn() -> MadeRun:
    """K = 0.1 s; the first row is active from 0.1 s on and the second from 0.5 s on."""
    return MadeRun(
        {ROW: active_during((0.1, 0.45)), "b": active_during((0.5, 0.85))},
        speed={ROW: column({10: 4.0, 40: 0.2}, 0.0), "b": column({50: 2.0, 80: -0.16}, 0.0)},
    )


ON_TIME = {ROW: 0.0}

FULFILLED = [
    rule(boundary.fulfilled, source, run, (ROW,), verdict)
    for source, run, verdict in (
        ("phi is T_s u+ twice", MadeRun({ROW: column({5: 1.0, 6: 1.0})}, ON_TIME, ON_TIME), HOLDS),
        ("phi exceeds T_s u+", MadeRun({ROW: column({5: 1.01})}, ON_TIME), FAILS),
        (
            "phi is positive three times",
            MadeRun({ROW: column({5: 0.0, 6: 0.0, 7: 0.0})}, ON_TIME),
            FAILS,
        ),
        (
            "sigma is positive",
            MadeRun({ROW: column({5: 1.0})}, {ROW: column({9: 0.001})}),
            FAILS,
        ),
        (
            "the clearance is negative",
            MadeRun({ROW: column({5: 1.0})}, ON_TIME, {ROW: -0.001}),
            FAILS,
        ),
    )
]
FULFILLED_NUMBERS = rule(
    boundary.fulfilled,
    "numbers",
    MadeRun(
        {ROW: column({5: 3.0, 7: 2.0, 8: 1.0}, -4.0)},
        {ROW: column({9: -0.25}, -3.0)},
        {ROW: 0.5},
        bounds={ROW: 4.0},
    ),
    (ROW,),
    HOLDS,
    {"sigma_max": -0.25, "phi_max": 3.0, "bound": 4.0, "positive_samples": 2.0},
    "max σ = −0.25; max φ = 3 (T_s u⁺ = 4), positive for 2 samples in a row",
)

NEVER_POSITIVE = [
    rule(boundary.phi_never_positive, source, run, (list(run.trajectory.labels),), verdict)
    for source, run, verdict in (
        ("phi is zero", MadeRun({ROW: 0.0}), HOLDS),
        (
            "phi is 2 T_s u+ twice",
            MadeRun({ROW: column({5: 2.0, 6: 2.0})}, ON_TIME, ON_TIME),
            PARTLY,
        ),
        ("phi exceeds 2 T_s u+", MadeRun({ROW: column({5: 2.01})}, ON_TIME), FAILS),
        (
            "phi is positive three times",
            MadeRun({ROW: column({5: 1.0, 6: 1.0, 7: 1.0})}, ON_TIME),
            FAILS,
        ),
        (
            "sigma is positive",
            MadeRun({ROW: column({5: 1.0})}, {ROW: column({5: 0.001})}),
            FAILS,
        ),
        (
            "the clearance is negative",
            MadeRun({ROW: column({5: 1.0})}, ON_TIME, {ROW: -0.001}),
            FAILS,
        ),
        (
            "sigma of the first of two rows",
            MadeRun({ROW: column({5: 1.0}), "b": -0.5}, {ROW: column({5: 0.001})}),
            FAILS,
        ),
        (
            "phi of the first of two rows",
            MadeRun({ROW: column({5: 2.01}), OTHER: -0.5}, ON_TIME),
            FAILS,
        ),
        (
            "a speed has neither sigma nor clearance",
            MadeRun({SPEED: column({5: 0.01}), ROW: -1.0}, {}, {SPEED: -1.0}),
            PARTLY,
        ),
        ("clearance of the first row", three_rows(first=-0.001), FAILS),
        ("clearance of the second row", three_rows(second=-0.001), FAILS),
    )
]
NEVER_POSITIVE_NUMBERS = rule(
    boundary.phi_never_positive,
    "numbers of three rows",
    three_rows(),
    ([ROW, OTHER, SPEED],),
    PARTLY,
    {"phi_max": 6.0, "sigma_max": -0.25, "excess": 1.9, "longest": 2.0},
    f"max σ = −0.25; max φ = 6, up to 1.90 T_s u⁺ ({OTHER}), at or above zero for 2 samples "
    f"in a row ({SPEED}); (12) asks for u⁺ > 7 there, where u⁺ = 100",
)

FULLY_USED = [
    rule(boundary.fully_used, source, near_its_boundary(first, second), (ROW, "b"), verdict)
    for source, first, second, verdict in (
        ("1 % of the length is left", 0.0, 0.01, HOLDS),
        ("more than 1 % is left", 0.0, 0.0101, PARTLY),
        ("the first is beyond its boundary", -0.0001, 0.01, PARTLY),
        ("both leave more than 1 %", 0.02, 0.02, FAILS),
        ("both are beyond their boundaries", -0.001, -0.001, FAILS),
    )
]
FULLY_USED_NUMBERS = rule(
    boundary.fully_used,
    "numbers of two lengths",
    near_with_lengths(),
    (ROW, "b"),
    HOLDS,
    {ROW: 0.0075, "b": 0.008},
)

SMOOTHLY = [
    rule(boundary.smoothly, source, run, (ROW,), verdict)
    for source, run, verdict in (
        ("a tenth is left, a tenth faster between", approaching(1.0, 0.1, 1.1), HOLDS),
        ("a tenth away from the boundary", approaching(1.0, -0.1, 0.5), HOLDS),
        ("relative to the first speed", approaching(2.0, 0.2, 2.0), HOLDS),
        ("more than a tenth is left", approaching(1.0, 0.101, 0.5), FAILS),
        ("more than a tenth faster between", approaching(1.0, 0.1, 1.101), FAILS),
        ("more than a tenth away", approaching(1.0, -0.101, 0.5), FAILS),
        ("leaves at first", approaching(-1.0, 0.0, 0.0), FAILS),
        ("a fifth is left", approaching(0.5, 0.1, 0.0), FAILS),
        ("active for 3 K", approaching(1.0, 0.1, 1.0, last=0.51), HOLDS),
        ("active for less than 3 K", approaching(1.0, 0.1, 1.0, last=0.49), FAILS),
        ("two approaches", approaching_twice(0.31), PARTLY),
        ("one approach with a gap", approaching_twice(0.29), HOLDS),
    )
]
SMOOTHLY_TWO_ROWS = [
    rule(boundary.smoothly, source, run, (ROW, "b"), PARTLY)
    for source, run in (
        ("the second is never active for 3 K", two_approaching((0.2, 0.3))),
        ("the second does not slow down", two_approaching((0.6, 0.95))),
    )
]
SMOOTHLY_NUMBERS = [
    rule(
        boundary.smoothly,
        "numbers of two rows",
        smooth_in_turn(),
        (ROW, "b"),
        HOLDS,
        {"share_left": 0.08},
        f"normal speed, at first and 3 K later: {ROW} 4 → 0.2 px/s; b 2 → -0.16 px/s",
    ),
    rule(
        boundary.smoothly,
        "no approach is long enough",
        MadeRun({ROW: active_during((0.2, 0.3))}, speed=column({}, 0.5)),
        (ROW,),
        FAILS,
        {},
        f"no approach lasts 3 K: {ROW}",
    ),
    *(
        rule(
            boundary.smoothly,
            f"first speed {first}: nothing is a share of no speed",
            MadeRun({ROW: active_during((0.2, 0.6))}, speed=column({20: first}, -0.5)),
            (ROW,),
            FAILS,
            {"share_left": inf},
        )
        for first in (0.0, -0.5)
    ),
]

EXPONENTIALLY = [
    rule(
        exponentially,
        f"{source}, sample {sample}",
        MadeRun(
            {ROW: active_during((0.2, 0.6))},
            {},
            {ROW: column({sample: clearance}, 1.0)},
            # before and after the row is active, the speed does not count
            speed=column({19: 99.0, sample: speed, 61: 99.0}, 0.0),
        ),
        (ROW,),
        verdict,
    )
    for sample in (20, 40, 60)
    for source, speed, clearance, verdict in (
        ("1.09 clearance / K", 1.09, 0.1, HOLDS),
        ("1.11 clearance / K", 1.11, 0.1, FAILS),
        ("at the boundary", 0.5, 0.0, FAILS),
        ("beyond the boundary", 0.5, -0.1, FAILS),
    )
]
EXPONENTIALLY_NUMBERS = [
    rule(
        exponentially,
        "numbers: 3 px/s from 2 px away, 2 px/s from 1.25 px away, K = 0.5 s",
        MadeRun(
            {ROW: active_during((0.2, 0.6))},
            {},
            {ROW: column({30: 2.0, 40: 1.25}, 9.0)},
            speed=column({30: 3.0, 40: 2.0}, -1.0),
            K=0.5,
        ),
        (ROW,),
        HOLDS,
        {"share": 0.8, "speed": 3.0},
        f"{ROW} acts from 0.2 to 0.6 s; towards the boundary at most 3 px/s, 2 px before it: at "
        "most 0.8 clearance / K",
    ),
    *(
        rule(
            exponentially,
            f"{speed} px/s from 1 px away, K = 0.1 s: a tenth more is allowed",
            MadeRun({ROW: 0.0}, {}, {ROW: 1.0}, speed=column({30: speed}, 0.0), K=0.1),
            (ROW,),
            verdict,
        )
        for speed, verdict in ((11.0, HOLDS), (11.1, FAILS))
    ),
    *(
        rule(
            exponentially,
            f"a clearance of {clearance} is no approach",
            MadeRun({ROW: 0.0}, {}, {ROW: column({30: clearance}, 1.0)}, speed=column({}, 0.5)),
            (ROW,),
            FAILS,
            {"share": nan, "speed": 0.5},
        )
        for clearance in (0.0, -0.5)
    ),
]


def sliding(active: tuple[str, ...], sigma: float, clearance: float) -> MadeRun:
    """Rows that are active in samples 5 and 6, and the first in sample 50 as well."""
    names = (ROW, "fov[marker 1]")
    acts = np.column_stack(
        [column({5: 1.0, 6: 1.0}, 0.0) * (name in active) > 0.0 for name in names]
    )
    acts[50, 0] = True
    return MadeRun(
        dict.fromkeys(names, -1.0),
        {ROW: column({5: sigma})},
        {ROW: column({5: clearance}, 1.0)},
        active=acts,
    )


BOTH = (ROW, "fov[marker 1]")
OF_FOUR = {ROW: 4.0, OTHER: 4.0}
"""A characteristic length, and T_s u⁺."""

ONE_MARKER_SLIDES = [
    rule(one_marker_slides, source, sliding(active, sigma, clearance), ("fov",), verdict)
    for source, active, sigma, clearance, verdict in (
        ("on the boundary", (ROW,), 0.0, 0.0, HOLDS),
        ("1 % of the length inside", (ROW,), 0.0, 0.01, HOLDS),
        ("more than 1 % inside", (ROW,), 0.0, 0.011, PARTLY),
        ("two rows", BOTH, 0.0, 0.0, PARTLY),
        ("sigma is positive", (ROW,), 0.001, 0.0, FAILS),
        ("the clearance is negative", (ROW,), 0.0, -0.001, FAILS),
    )
]
ONE_MARKER_SLIDES_NUMBERS = [
    rule(
        one_marker_slides,
        "numbers: active in 3 samples, at most 0.4 s apart",
        MadeRun(
            {ROW: column({10: 1.0, 20: 0.0, 60: 2.0}), OTHER: -1.0},
            {ROW: column({5: -0.25}, -3.0), OTHER: 7.0},
            {ROW: column({5: 0.02}, 0.5), OTHER: -7.0},
            lengths=OF_FOUR,
            bounds=OF_FOUR,
        ),
        ("fov",),
        HOLDS,
        {"margin": 0.005, "sigma_max": -0.25, "rows": 1.0},
        f"{ROW} acts in 3 samples from 0.1 to 0.6 s, at most 0.4 s apart; max σ = −0.25, 0.02 px "
        "from the boundary (0.5 % of L); the greatest φ is 0.5 T_s u⁺",
    ),
    rule(
        one_marker_slides,
        "the row that is active longest counts",
        MadeRun(
            {ROW: column({10: 1.0}), OTHER: column({10: 1.0, 11: 1.0})},
            {ROW: 7.0, OTHER: -1.0},
            {OTHER: 0.04},
            lengths=OF_FOUR,
            bounds=OF_FOUR,
        ),
        ("fov",),
        PARTLY,
        {"margin": 0.01, "sigma_max": -1.0, "rows": 2.0},
    ),
]


@pytest.mark.parametrize(
    ("function", "run", "arguments", "expected"),
    [
        *FULFILLED,
        FULFILLED_NUMBERS,
        *NEVER_POSITIVE,
        NEVER_POSITIVE_NUMBERS,
        *FULLY_USED,
        FULLY_USED_NUMBERS,
        *SMOOTHLY,
        *SMOOTHLY_TWO_ROWS,
        *SMOOTHLY_NUMBERS,
        *EXPONENTIALLY,
        *EXPONENTIALLY_NUMBERS,
        *ONE_MARKER_SLIDES,
        *ONE_MARKER_SLIDES_NUMBERS,
    ],
)
def test_rule(
    function: Callable[..., Finding], run: Any, arguments: tuple[Any, ...], expected: Expected
) -> None:
    assert_finds(function(run, *arguments), expected)


@pytest.mark.parametrize(
    ("finding", "part"),
    [
        (
            lambda: boundary.fully_used(near_with_lengths(), ROW, "b"),  # type: ignore[arg-type]
            f"{ROW} comes within 0.03 px of its boundary (0.75 % of L); b comes within 0.002 px",
        ),
        (
            lambda: one_marker_slides(MadeRun({ROW: column({10: 1.0})}), "fov"),  # type: ignore[arg-type]
            "acts in 1 sample from 0.1 to 0.1 s, at most 0.0 s apart",
        ),
    ],
)
def test_part_of_the_text(finding: Callable[[], Finding], part: str) -> None:
    assert part in finding().text


def test_approaches() -> None:
    run: Any = smooth_in_turn()
    (approach,) = boundary.approaches(run, "b")
    assert approach.start == pytest.approx(0.5)
    assert (approach.first, approach.later, approach.greatest) == (2.0, -0.16, 2.0)
    # the sample 3 K later counts among the greatest
    run = MadeRun({ROW: active_during((0.2, 0.6))}, speed=column({20: 2.0, 50: 5.0, 51: 6.0}, 1.0))
    (approach,) = boundary.approaches(run, ROW)
    assert (approach.later, approach.greatest) == (5.0, 5.0)
    assert boundary.Approach(0.0, 0.0, 0.0, 0.0).share == inf
    assert boundary.Approach(0.0, -0.5, 0.0, 0.0).share == inf


def test_the_row_that_slides_is_active_longest() -> None:
    run: Any = MadeRun(
        {
            "occlusion[a]": 0.0,
            ROW: active_during((0.1, 0.2)),
            OTHER: active_during((0.1, 0.3)),
            "fov[marker 4]": -1.0,
        }
    )
    assert acting_rows(run, "fov") == [ROW, OTHER]
    assert sliding_row(run, "fov") == OTHER
    idle: Any = MadeRun({ROW: -1.0, "occlusion[a]": 0.0})
    with pytest.raises(NotMeasured, match="no fov row ever acts"):
        sliding_row(idle, "fov")
