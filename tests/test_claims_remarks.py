"""Claims 7b and 9a to 12a, on sliding modes in general, measured on made-up runs and studies.

Every number is just inside or just outside the claim's limit, and expected numbers are worked out
by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log
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
    T,
    active_during,
    assert_finds,
    case,
    check,
    column,
)
from vsconstraints.paper import scenes as paper_scenes
from vsconstraints.paper.claims import appendices, section_5_remarks, section_6_advantages
from vsconstraints.paper.studies import StudyResult
from vsconstraints.rows import Array

SPEED = "speed[joint 1].upper"
SCENES = [spec.name for spec in paper_scenes.SCENES]
CORNER = SCENES.index(paper_scenes.NOT_DIFFERENTIABLE)

Runs = tuple[Any, ...]


def study(**numbers: float) -> StudyResult:
    """A study; a double underscore separates the parts of a number's key."""
    keyed = {tuple(name.split("__")): value for name, value in numbers.items()}
    return StudyResult("made up", keyed, (), (), ())


def scenes(first: list[MadeRun], others: MadeRun, start: int = 0) -> Runs:
    """Runs of all scenes: these from a place on, the others alike."""
    runs = [others] * len(SCENES)
    runs[start : start + len(first)] = first
    return tuple(runs)


# --- 7b: the approach has the time constant K, of 0.1, 0.2 and 0.4 s ---


def decaying(share: float, K: float) -> MadeRun:
    """The speed decays with a share of K from 0.2 s on for 2 K; elsewhere it is nonsense."""
    speed = np.where(T >= 0.2, np.exp(-(T - 0.2) / (share * K)), 77.0)
    speed[T > 0.2 + 2.0 * K + 1e-9] = 33.0
    return MadeRun({ROW: active_during((0.2, 1.0))}, speed=speed, K=K)


def fitted(last: float) -> MadeRun:
    """Speeds of 1, e⁻² and ``last`` at 0.25, 0.5 and 0.75 s, within 2 K = 0.5 s."""
    t = 0.25 * np.arange(9)
    speed = column({1: 1.0, 2: exp(-2.0), 3: last}, 55.0, t)
    phi = column({1: 0.0, 2: 1.0, 6: 0.0}, -1.0, t)
    return MadeRun({ROW: phi}, t=t, speed=speed, K=0.25)


TIME_CONSTANT = [
    *(
        case(
            "7b",
            f"time constants {shares} K",
            tuple(map(decaying, shares, (0.1, 0.2, 0.4))),
            verdict,
        )
        for shares, verdict in (
            ((1.24, 1.0, 1.0), HOLDS),
            ((0.76, 1.0, 1.0), HOLDS),
            ((1.26, 1.0, 1.0), PARTLY),
            ((1.0, 0.74, 1.0), PARTLY),
            ((1.0, 1.0, 1.26), PARTLY),
            ((2.1, 1.0, 1.0), FAILS),
            ((1.0, 1.0, 0.4), FAILS),
        )
    ),
    # the slope of the logarithms is half of the last one per quarter of a second
    *(
        case(
            "7b",
            f"a line is fitted to speeds of 1, exp(-2), {last:.2g}",
            (fitted(last), fitted(last), fitted(last)),
            FAILS,
            {"0.1": tau, "0.2": tau, "0.4": tau},
            f"measured time constants: K = 0.1 s: {tau:.3f} s; K = 0.2 s: {tau:.3f} s; "
            f"K = 0.4 s: {tau:.3f} s",
        )
        for last, tau in (
            (exp(-1.0), 0.5),
            (0.0, -0.5 / log(1e-6)),
            (-3.0, -0.5 / log(1e-6)),
        )
    ),
    case(
        "7b",
        "the row is never active",
        (MadeRun(speed=T), MadeRun(speed=T), MadeRun(speed=T)),
        NOT_MEASURED,
        {},
        "the row never acts",
    ),
]


@pytest.mark.parametrize(
    ("constants", "verdict"),
    [
        ((0.125, 0.25, 0.5), HOLDS),
        ((0.125, 0.25, 0.51), PARTLY),
        ((0.2, 0.2, 0.4), FAILS),
        ((0.2, 0.21, 0.21), FAILS),
    ],
)
def test_7b_of_time_constants(
    constants: tuple[float, ...], verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(section_6_advantages, "time_constant", lambda run: run)
    assert check("7b", constants).verdict == verdict


# --- 9a: second derivatives are not needed ---


def commanded(command: float = 0.0, place: float = 0.0, samples: int = 101) -> MadeRun:
    """One joint; a command of 1 rad/s², but for one sample."""
    t = T[:samples]
    q = column({50: place}, 0.0, t)[:, None]
    return MadeRun(t=t, q=q, qdd_command=column({70: command}, 1.0, t)[:, None])


def commanded_second(command: float, samples: int = 101) -> MadeRun:
    """As above, by the second of two joints."""
    t = T[:samples]
    commands = np.column_stack((0.0 * t, column({70: command}, 1.0, t)))
    return MadeRun(t=t, q=np.zeros((len(t), 2)), qdd_command=commands)


NO_SECOND_DERIVATIVES = [
    case("9a", "alike", (commanded(),) * 4, HOLDS),
    *(
        case(
            "9a",
            f"{source}, in run {1 + place}",
            (*([commanded()] * place), other, *([commanded()] * (3 - place))),
            FAILS,
        )
        for place in (2, 3)
        for source, other in (
            ("another command", commanded(command=1.0 - 1e-12)),
            ("another position", commanded(place=1e-12)),
            ("one sample less", commanded(samples=100)),
        )
    ),
    case(
        "9a",
        "text: another command",
        (
            commanded_second(0.5),
            commanded_second(3.0),
            commanded_second(2.5),
            commanded_second(3.0),
        ),
        FAILS,
        text="example-2d-fov: q̈_c differs by 2 rad/s² in 101 samples; case-study-6r: q̈_c differs by "
        "0 rad/s² in 101 samples",
    ),
    case(
        "9a",
        "text: an earlier end",
        (
            commanded_second(0.5),
            commanded_second(3.0),
            commanded_second(0.5),
            commanded_second(3.0, 90),
        ),
        FAILS,
        text="example-2d-fov: q̈_c differs by 0 rad/s² in 101 samples; case-study-6r: one run ends "
        "earlier",
    ),
]

# --- 10b: the bound (12) on u⁺ is sufficient ---


def bounded(
    phi: float = -1.0,
    clearance: float = 0.0,
    needed_share: float = 0.75,
    t: Array = T,
) -> MadeRun:
    """Three rows, of which the first has this φ twice; (12) asks for a share of u⁺ once.

    The second is inside, and nothing is asked of the clearance of a speed.
    """
    return MadeRun(
        {ROW: column({5: phi, 6: min(phi, 0.0)}), "b": -1.0, SPEED: -1.0},
        {},
        {ROW: clearance, "b": 1.0, SPEED: -9.0},
        t=t,
        needed_shares=column({5: needed_share}, 0.0),
    )


def sweep(above: float = 3.0, allowed: float = 3.0, in_band: float = 3.0) -> StudyResult:
    return study(above_bound=above, above_bound_allowed=allowed, above_bound_in_band=in_band)


def at_bound(phi: float = 1.0, clearance: float = 0.0, needed_share: float = 0.99) -> MadeRun:
    return bounded(phi, clearance, needed_share)


ALL_ABOVE = 3 + len(SCENES) - 1
"""Runs above the bound: three of the study, and all scenes but the corner."""

BOUND_IS_SUFFICIENT = [
    *(
        case("10b", source, (sweep(*counts), *scenes([run], at_bound(), place)), verdict)
        for source, counts, run, place, verdict in (
            ("phi is T_s u+", (), at_bound(), 0, HOLDS),
            ("phi exceeds T_s u+", (), at_bound(1.01), 0, PARTLY),
            ("beyond the boundary", (), at_bound(1.01, -0.001), 0, FAILS),
            ("(12) asks for more", (), at_bound(1.01, -0.001, 1.0), 0, HOLDS),
            ("at the corner", (), at_bound(1.01, -0.001), CORNER, HOLDS),
            ("a run of the study leaves its band", (3.0, 3.0, 2.0), at_bound(), 0, PARTLY),
            ("a run of the study is not allowed", (3.0, 2.0, 3.0), at_bound(), 0, HOLDS),
            (
                "(12) asks for more, and a run of the study leaves its band",
                (3.0, 3.0, 2.0),
                at_bound(1.01, -0.001, 1.0),
                0,
                PARTLY,
            ),
            (
                "(12) asks for more, and a run of the study is not allowed",
                (3.0, 2.0, 3.0),
                at_bound(1.01, -0.001, 1.0),
                0,
                HOLDS,
            ),
            (
                "at the corner, and a run of the study leaves its band",
                (3.0, 3.0, 2.0),
                at_bound(1.01, -0.001),
                CORNER,
                PARTLY,
            ),
            (
                "at the corner, and a run of the study is not allowed",
                (3.0, 2.0, 3.0),
                at_bound(1.01, -0.001),
                CORNER,
                HOLDS,
            ),
            (
                "one of two rows is beyond its boundary",
                (),
                MadeRun(
                    {ROW: column({5: 1.01}), "b": -1.0},
                    {},
                    {ROW: -0.001, "b": 1.0},
                    needed_shares=column({5: 0.5}, 0.0),
                ),
                0,
                FAILS,
            ),
        )
    ),
    case(
        "10b",
        "numbers: the corner is left out, one asks for too much, one each leaves band and boundary",
        (
            sweep(7.0, 6.0, 5.0),
            *scenes(
                [
                    bounded(phi=3.0, t=2.0 * T),
                    bounded(needed_share=1.25),
                    bounded(phi=1.0),
                    bounded(phi=0.75, clearance=-0.5),
                ],
                bounded(),
            ),
        ),
        FAILS,
        {"above": 18, "kept": 16, "band": 15},
        "of 18 runs above the bound 16 keep σ ≤ 0 and 15 keep φ ≤ T_s u⁺, not example-2d-fov (1.5 "
        "T_s u⁺); (12) asks for more than the printed u⁺ in example-2d-fast (1.25 u⁺); (12) is "
        "about continuous time, in which tracking does not move φ while the law acts",
    ),
    case(
        "10b",
        "numbers: all keep their band",
        (sweep(7.0, 6.0, 7.0), *scenes([], bounded())),
        HOLDS,
        {"above": 19, "kept": 18, "band": 19},
        "of 19 runs above the bound 18 keep σ ≤ 0 and 19 keep φ ≤ T_s u⁺; (12) asks for more than "
        "the printed u⁺ in no scene",
    ),
    case(
        "10b", "one of the study does not", (sweep(7.0, 7.0, 6.0), *scenes([], bounded())), PARTLY
    ),
    case(
        "10b",
        "no run is above the bound",
        (sweep(0.0, 0.0, 0.0), *scenes([], bounded(needed_share=1.0))),
        NOT_MEASURED,
        text="no run is above the bound",
    ),
    case(
        "10b",
        "one run of the study is above the bound",
        (sweep(1.0, 1.0, 1.0), *scenes([], bounded(needed_share=1.0))),
        HOLDS,
        {"above": 1, "kept": 1, "band": 1},
    ),
]


@pytest.mark.parametrize(
    ("run", "place", "above"),
    [
        (at_bound(), 0, ALL_ABOVE),
        (at_bound(1.01), 0, ALL_ABOVE),
        (at_bound(1.01, -0.001), 0, ALL_ABOVE),
        (at_bound(1.01, -0.001, 1.0), 0, ALL_ABOVE - 1),
        (at_bound(1.01, -0.001), CORNER, ALL_ABOVE),
    ],
)
def test_10b_counts_runs_above_the_bound(run: MadeRun, place: int, above: int) -> None:
    found = check("10b", (sweep(), *scenes([run], at_bound(), place)))
    assert found.values["above"] == above


# --- 10c: φ stays in a band of T_s u⁺ ---


def band(width: float, *more: float) -> MadeRun:
    samples = dict(enumerate((0.0, width, *more), start=5))
    return MadeRun({ROW: column(samples)})


def bands(excess: float, exponent: float) -> StudyResult:
    return study(s__greatest_excess=excess, s__exponent=exponent)


def two_bands(excess: float, other_excess: float, other_exponent: float) -> StudyResult:
    return study(
        s__greatest_excess=excess,
        s__exponent=1.0,
        u__greatest_excess=other_excess,
        u__exponent=other_exponent,
    )


def two_rows_with_twice_the_period() -> MadeRun:
    return MadeRun({"a": column({5: 0.0, 6: 0.5}), ROW: column({5: 0.0, 6: 1.0})}, t=2.0 * T)


BAND_IS_BOUNDED = [
    *(
        case(
            "10c",
            f"band {width}, excess {excess}, exponent {exponent}, {source}",
            (bands(excess, exponent), *scenes([band(width, 0.0)], others)),
            verdict,
        )
        for width, excess, exponent, verdict in (
            (1.0, 1.0, 1.0, HOLDS),
            (1.01, 1.0, 1.2, PARTLY),
            (1.0, 1.01, 0.8, PARTLY),
            (2.0, 1.0, 1.0, PARTLY),
            (2.01, 1.0, 1.0, FAILS),
            (1.0, 2.01, 1.0, FAILS),
            (1.5, 1.0, 1.21, FAILS),
            (1.5, 1.0, 0.79, FAILS),
        )
        for source, others in (
            ("half of it elsewhere", band(0.5, 0.0)),
            ("no row is active elsewhere", MadeRun()),
        )
    ),
    case(
        "10c",
        "relative to the period: T_s u+ is 2",
        (
            bands(1.0, 1.0),
            *scenes([MadeRun({ROW: column({5: 0.0, 6: 2.0, 7: 0.0})}, t=2.0 * T)], band(0.5, 0.0)),
        ),
        HOLDS,
    ),
    *(
        case(
            "10c",
            f"the second sweep has the exponent {exponent}",
            (two_bands(1.5, 0.5, exponent), *scenes([band(0.5)], MadeRun())),
            verdict,
        )
        for exponent, verdict in ((1.2, PARTLY), (0.8, PARTLY), (1.3, FAILS), (0.7, FAILS))
    ),
    case(
        "10c",
        "numbers: the worst row of a scene; one that is positive for three samples is named",
        (
            two_bands(0.5, 0.75, 0.9),
            *scenes([two_rows_with_twice_the_period(), band(0.25, 0.0), band(0.125)], MadeRun()),
        ),
        HOLDS,
        {
            "s": 0.5,
            "u": 0.75,
            f"{SCENES[0]}/scene": 0.5,
            f"{SCENES[1]}/scene": 0.25,
            f"{SCENES[2]}/scene": 0.125,
        },
        "s: up to 0.50 T_s u⁺, growing with T_s to the power 1.00; u: up to 0.75 T_s u⁺, growing "
        "with T_s to the power 0.90. In every scene: example-2d-fov 0.5, example-2d-fast 0.25 "
        f"({ROW}, φ ≥ 0 for 3 samples in a row), example-2d-fast-high-gain 0.125. (43) is about "
        "one step of the constraint action alone, tracking moves φ as well",
    ),
    case(
        "10c",
        "a study without a band",
        (study(s__exponent=1.0), *scenes([band(0.5)], MadeRun())),
        NOT_MEASURED,
        text="the study sampling-time has no band",
    ),
]

# --- 10e: φ = 0 is reached in finite time ---


def outside(first: int, later: float, drift: float) -> MadeRun:
    """φ starts at 5 and is below zero after ``first`` samples.

    It decreases by u⁺ − L_fφ, 100 − 50 if the drift L_fφ is 50: within 0.1 s, and one sample.
    """
    run = MadeRun({ROW: column({**dict.fromkeys(range(first), 5.0), first + 9: later}, -1.0)})
    run.drift[first - 1, 0] = drift
    run.drift[first + 5, 0] = 1e3
    return run


def outside_of_two(first: int, later: float, drift: float) -> MadeRun:
    """φ of the second row starts at 4: with a drift of 36 within 1/16 s, which is eight periods.

    It is zero until it leaves. The first row does not count.
    """
    t = np.arange(101) / 128.0
    bound = 100.0 / 128.0
    phi = {**dict.fromkeys(range(first), 0.0), 0: 4.0, first + 5: later * bound}
    run = MadeRun({"a": 5.0, ROW: column(phi, -1.0)}, t=t)
    run.drift[:, 0] = 1e3
    run.drift[2, 1] = drift
    run.drift[first + 1, 1] = 1e3
    return run


OUTSIDE_OF_TWO = [
    (9, 2.0, 36.0, HOLDS),
    (10, 2.0, 36.0, PARTLY),
    (9, 2.01, 36.0, PARTLY),
    (3, 2.0, 100.0, PARTLY),
    (3, 2.0, 101.0, PARTLY),
]

REACHED_IN_FINITE_TIME = [
    *(
        case(
            "10e",
            f"{first} samples, then {later} T_s u+, drift {drift}",
            outside(first, later, drift),
            verdict,
        )
        for first, later, drift, verdict in (
            (10, 2.0, 50.0, HOLDS),
            (11, 2.0, 50.0, HOLDS),
            (12, 2.0, 50.0, PARTLY),
            (10, 2.01, 50.0, PARTLY),
            (5, 2.0, 100.0, PARTLY),
        )
    ),
    *(
        case(
            "10e",
            f"numbers: {first} samples, then {later} T_s u+, drift {drift}",
            outside_of_two(first, later, drift),
            verdict,
            text=f"φ starts at 4; u⁺ = 100, L_fφ up to {drift:g}: below zero after "
            f"{1e3 * first / 128.0:.3g} ms, promised "
            f"{'within 62.5 ms' if drift == 36.0 else 'never'}; then at most {later:.2f} T_s u⁺",
        )
        for first, later, drift, verdict in OUTSIDE_OF_TWO
    ),
    case(
        "10e",
        "relative to the period: T_s u+ is 2",
        MadeRun({ROW: column({**dict.fromkeys(range(3), 5.0), 20: 4.0}, -1.0)}, t=2.0 * T),
        HOLDS,
    ),
    case("10e", "one sample", MadeRun({ROW: column({0: 0.5}, -1.0)}), HOLDS),
    case("10e", "it never ends", MadeRun({ROW: 5.0}), FAILS),
    case(
        "10e",
        "it is never below zero",
        MadeRun({ROW: column({7: 0.0}, 5.0)}),
        FAILS,
        {},
        "φ starts at 5 and never falls below zero",
    ),
    case("10e", "it begins at zero", MadeRun({ROW: column({0: 0.0})}), NOT_MEASURED),
    case("10e", "zero, then above", MadeRun({ROW: column({0: 0.0, 1: 5.0})}), NOT_MEASURED),
    case(
        "10e",
        "it is zero",
        MadeRun({ROW: 0.0}),
        NOT_MEASURED,
        text="φ is 0 at the start, not above zero",
    ),
]


@pytest.mark.parametrize(("first", "later", "drift"), [row[:3] for row in OUTSIDE_OF_TWO])
def test_10e_numbers(first: int, later: float, drift: float) -> None:
    values = check("10e", (outside_of_two(first, later, drift),)).values
    assert values["after"] == first / 128.0
    if drift == 36.0:
        assert values["within"] == 0.0625
    else:
        assert np.isnan(values["within"])


def test_scene_that_starts_outside() -> None:
    setup = appendices.OUTSIDE.load().setup()
    assert (setup.Ts, setup.duration) == (0.001, 1.0)
    assert setup.constraints.constraints[0].switching_gain == 100.0
    np.testing.assert_array_equal(setup.qd0, [0.0, 0.0, -3.0])


# --- 10f: a run is aborted where its active rows lose their rank ---


def with_gradients(run: MadeRun, gradients: Array) -> MadeRun:
    """Let a run's rows have these gradients L_gφ in every sample."""

    def evaluate(t: float, q: Any, qd: Any) -> Any:
        rows = SimpleNamespace(Lg=gradients, phi=run.trajectory.phi[round(t / 0.01)])
        return SimpleNamespace(rows=rows)

    run.setup = SimpleNamespace(world=lambda: SimpleNamespace(evaluate=evaluate))
    return run


def two_directions(angle: float, last: int = 100, both: bool = True, **ending: str) -> MadeRun:
    """Rows (1, 0) and (1, angle), scaled; both are active in one sample, ``last``."""
    phi = {"a": column({last: 0.0}), "b": column({last if both else 3: 0.0})}
    run = MadeRun(phi, q=np.zeros((101, 2)), qd=np.zeros((101, 2)), **ending)
    return with_gradients(run, np.array([[5.0, 0.0], [1.0, angle]]))


ABORTED = {"status": "aborted", "reason": "dependent: a, b"}
LOST = two_directions(1e-7, **ABORTED)
WELL = two_directions(1.0)

GRADIENTS = {
    "row a": (2.0, 0.0, 0.0),
    "row b": (0.0, 3.0, 0.0),
    "row c": (0.0, 3.0, 3e-7),
    "row d": (1e-7, 1e-7, 1e-7),
}
"""Rows b and c have the same direction; four rows of three joints are always dependent."""


def four_rows(
    *samples: tuple[int, str],
    until: int = 61,
    gradients: Array | None = None,
    **ending: str,
) -> MadeRun:
    """Rows, by their letters, are active in these samples."""
    t = T[:until]
    phi = {
        name: column({k: 0.0 for k, letters in samples if name[-1] in letters}, -1.0, t)
        for name in GRADIENTS
    }
    run = MadeRun(phi, t=t, q=np.zeros((until, 3)), qd=np.zeros((until, 3)), **ending)
    return with_gradients(run, np.array([*GRADIENTS.values()]) if gradients is None else gradients)


FOUR_WELL = four_rows((20, "ab"), (30, "abd"), (40, "cd"), (50, "c"))
KNOWN = four_rows((10, "bc"), until=11, status="aborted", reason="row b")
SPANNING = np.vstack((np.eye(3)[[0, 1]], [[1.0, 1.0, 1.0]], np.eye(3)[2]))
"""Four rows of three joints of which no combination is small."""


def losing(last: str, reason: str, status: str = "aborted", until: int = 61) -> Runs:
    lost = four_rows(
        (20, "ab"), (30, "abd"), (40, "cd"), (60, last), until=until, reason=reason, status=status
    )
    return FOUR_WELL, lost, KNOWN, FOUR_WELL


def rank_text(status: str | None) -> str:
    second = "experiment-2-ibvs, T_s = 0.01 s: rank lost at 0.10 s, aborted"
    if status is None:
        return second
    return f"experiment-1-pbvs, T_s = 0.01 s: rank lost at 0.60 s, {status}; {second}"


ABORTED_WITHOUT_RANK = [
    *(
        case("10f", source, (run, WELL, LOST, WELL), verdict)
        for source, run, verdict in (
            # the smaller singular value is angle/√2
            ("singular value below 1e-6", two_directions(1.2e-6, **ABORTED), HOLDS),
            ("singular value above 1e-6", two_directions(1.6e-6, **ABORTED), FAILS),
            ("it goes on", two_directions(1.2e-6, last=99, **ABORTED), FAILS),
            ("one row is active", two_directions(1.2e-6, both=False, **ABORTED), FAILS),
            ("not aborted", two_directions(1.2e-6), FAILS),
            (
                "another reason",
                two_directions(1.2e-6, status="aborted", reason="something else"),
                FAILS,
            ),
            ("never dependent", two_directions(1.0), HOLDS),
        )
    ),
    *(
        case("10f", source, runs, verdict, text=rank_text(status))
        for source, runs, verdict, status in (
            ("b and c, named b", losing("abc", "dependent: row b, row a"), HOLDS, "aborted"),
            ("b and c, named c", losing("bc", "dependent: row c"), HOLDS, "aborted"),
            ("four rows", losing("abcd", "dependent: row d"), HOLDS, "aborted"),
            (
                "a row that is not active is named",
                losing("abc", "dependent: row d"),
                FAILS,
                "aborted",
            ),
            (
                "not aborted, named b",
                losing("abc", "dependent: row b", "converged"),
                FAILS,
                "converged",
            ),
            ("it goes on, named b", losing("abc", "dependent: row b", until=62), FAILS, "aborted"),
            ("independent rows", losing("abd", "dependent: row b"), FAILS, None),
        )
    ),
    case(
        "10f",
        "four rows of three joints, none of them small",
        (
            four_rows(
                (10, "abd"), (60, "abdc"), gradients=SPANNING, status="aborted", reason="row a"
            ),
            FOUR_WELL,
            FOUR_WELL,
            FOUR_WELL,
        ),
        HOLDS,
    ),
    case(
        "10f",
        "no run loses its rank",
        (FOUR_WELL,) * 4,
        NOT_MEASURED,
        text="no run loses the rank of its active rows",
    ),
    case("10f", "no run of two rows loses its rank", (WELL,) * 4, NOT_MEASURED),
]

# --- 11a: moving targets and obstacles ---


def converging(sigma: float = 0.0) -> MadeRun:
    return MadeRun({ROW: 0.0, "speed[joint 1].upper": 5.0}, {ROW: column({5: sigma})})


def worst_of_three(sigma: float) -> MadeRun:
    return MadeRun(
        {"fov[marker 1]": -1.0, ROW: column({5: 0.0}), SPEED: -1.0},
        {"fov[marker 1]": -0.25, ROW: column({5: sigma}, -2.0), SPEED: 3.0},
    )


CONVERGING = converging()
BROKEN = [
    ("trapped", MadeRun({ROW: 0.0}, status="trapped")),
    ("sigma is positive", MadeRun({ROW: 0.0}, {ROW: column({5: 0.001})})),
    ("no row is active", MadeRun({ROW: -0.1})),
]

MOVING_OBJECTS = [
    case("11a", "all converge, a speed does not count", (CONVERGING,) * 3, HOLDS),
    *(
        case("11a", f"{source} in {where}", runs, verdict)
        for source, bad in BROKEN
        for where, runs, verdict in (
            ("the last", (CONVERGING, CONVERGING, bad), PARTLY),
            ("the first", (bad, CONVERGING, CONVERGING), PARTLY),
            ("all", (bad, bad, bad), FAILS),
        )
    ),
    case(
        "11a",
        "numbers: the worst row",
        (worst_of_three(-0.5), worst_of_three(0.5), MadeRun(status="trapped")),
        PARTLY,
        text=f"moving-target: converged, max σ = −0.25, {ROW} active; moving-occluder: converged, "
        f"max σ = 0.5, {ROW} active; moving-sphere: trapped, max σ = −1, no row active",
    ),
    case("11a", "worst row of all", (worst_of_three(0.5),) * 3, FAILS),
    case("11a", "worst row of none", (worst_of_three(-0.5),) * 3, HOLDS),
]

# --- 11b: with known motion only the bound changes ---


@dataclass(frozen=True)
class Rows:
    """φ, L_fφ and L_gφ of rows."""

    phi: Array
    Lf: Array
    Lg: Array

    @classmethod
    def three(cls, phi: list[float], Lf: list[float], Lg: float = 5.0) -> Rows:
        """Rows with L_gφ = (5, 5), but for one element of the second."""
        gradients = np.full((3, 2), 5.0)
        gradients[1, 1] = Lg
        return cls(np.array(phi), np.array(Lf), gradients)

    @classmethod
    def one(cls, phi: float = 0.0, Lf: float = 0.0, Lg: float = 0.0) -> Rows:
        return cls(np.array([phi]), np.array([Lf]), np.array([[Lg, 5.0]]))


RowsBySample = dict[int, Rows]


def informed(rows: RowsBySample, count: int = 1) -> MadeRun:
    """A run whose rows are these in some samples, with known motion; no row is active in others."""
    names = ("a", "b", "c")[:count]
    phi = {
        name: column({k: float(known.phi[i]) for k, known in rows.items()})
        for i, name in enumerate(names)
    }
    run = MadeRun(phi, q=np.zeros((len(T), 2)), qd=np.zeros((len(T), 2)))
    step = SimpleNamespace(evaluate=lambda t, q, qd: SimpleNamespace(rows=rows[round(t / 0.01)]))
    run.setup = SimpleNamespace(world=lambda: step)
    return run


def set_uninformed(
    monkeypatch: pytest.MonkeyPatch, occluder: RowsBySample, sphere: RowsBySample
) -> None:
    """Let these be the rows of the two scenarios where the motion is not known."""
    by_scenario = {"moving-occluder": occluder, "moving-sphere": sphere}

    def spec(scenario: str, overrides: Any) -> Any:
        assert overrides == {"constraints.0.motion.known": False}
        rows = by_scenario[scenario]
        step = SimpleNamespace(
            evaluate=lambda t, q, qd: SimpleNamespace(rows=rows[round(t / 0.01)])
        )
        setup = SimpleNamespace(control=lambda: step)
        return SimpleNamespace(load=lambda: SimpleNamespace(setup=lambda: setup))

    monkeypatch.setattr(section_5_remarks, "RunSpec", spec)


def test_11b_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two of three rows are active in two samples; one pushes inwards, which needs no gain."""
    known = {
        20: Rows.three([0.0, 0.5, -0.5], [1.0, -3.0, 90.0]),
        40: Rows.three([0.0, 2.0, -0.5], [-3.0, 4.0, 80.0]),
    }
    unknown = {
        20: Rows.three([0.25, 1.0, 9.0], [2.5, -3.0, 90.0], 5.25),
        40: Rows.three([0.0, 2.25, 9.0], [-3.0, 3.0, 80.0]),
    }
    set_uninformed(monkeypatch, unknown, {})
    found = check("11b", (informed(known, 3), informed({}, 3)))
    assert found.verdict == FAILS
    assert found.text == (
        "moving-occluder: L_gφ differs by 0.25; (12) asks for u⁺ > 4, without ∂φ/∂t for 3; φ of "
        "active rows differs by up to 0.5, as σ̇ contains ∂σ/∂t; moving-sphere: L_gφ differs by 0; "
        "(12) asks for u⁺ > 0, without ∂φ/∂t for 0; φ of active rows differs by up to 0, as σ̇ "
        "contains ∂σ/∂t"
    )


NOTHING = {20: Rows.one()}
GREATER = {20: Rows.one(Lf=2.0)}


@pytest.mark.parametrize(
    ("known", "verdict"),
    [
        ({"Lf": 1.0}, HOLDS),
        ({"Lf": 1.1e-9}, HOLDS),
        ({"Lf": 1e-9}, FAILS),
        ({"Lf": 1.0, "Lg": 1e-10}, HOLDS),
        ({"Lf": 1.0, "Lg": 1e-9}, FAILS),
        ({"Lf": 1.0, "Lg": -1e-8}, FAILS),
        ({"Lf": 1.0, "phi": 1e-10}, HOLDS),
        ({"Lf": 1.0, "phi": 1e-9}, PARTLY),
        ({"Lf": 1e-10, "Lg": 1e-6}, FAILS),
    ],
)
def test_11b_small_differences(
    known: dict[str, float], verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In either of the scenes, and where the bound is greater with unknown motion."""
    rows = {20: Rows.one(**known)}
    set_uninformed(monkeypatch, NOTHING, NOTHING)
    assert check("11b", (informed(rows), informed(GREATER))).verdict == verdict
    assert check("11b", (informed(GREATER), informed(rows))).verdict == verdict
    if "phi" not in known:
        set_uninformed(monkeypatch, rows, NOTHING)
        assert check("11b", (informed(NOTHING), informed(GREATER))).verdict == verdict


def test_11b_fails_where_nothing_changes_in_a_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    set_uninformed(monkeypatch, GREATER, NOTHING)
    assert check("11b", (informed(GREATER), informed(GREATER))).verdict == FAILS


# --- 12a: the time of a control step ---


def timed(step: float, rows: float) -> MadeRun:
    """Times [s] of T_s = 10 ms; the first samples are slow, and the very first does not count."""
    step_time = column({0: 1.0, 1: 1.0, 2: 1.0}, step)
    return MadeRun(step_time=step_time, rows_time=column({0: 1.0}, rows), compiled=True)


def uncompiled() -> MadeRun:
    """T_s = 16/1024 s; steps of 6, 16, 4, 6 and 30, of which the law takes 1, 2, 3, 4 and 30."""
    step = np.array([99.0, 1.0, 2.0, 3.0, 4.0, 30.0]) / 1024.0
    rows = np.array([500.0, 5.0, 14.0, 1.0, 2.0, 0.0]) / 1024.0
    return MadeRun(t=np.arange(6) / 64.0, step_time=step, rows_time=rows, compiled=False)


COMPUTATION_TIME = [
    *(
        case("12a", f"law {step:g} s, rows {rows:g} s", timed(step, rows), verdict)
        for step, rows, verdict in (
            (12e-6, 8e-6, HOLDS),
            (20e-6, 0.0, HOLDS),
            (12e-6, 8.1e-6, PARTLY),
            (3e-3, 2e-3, PARTLY),
            (3e-3, 2.001e-3, FAILS),
        )
    ),
    case(
        "12a",
        "numbers",
        uncompiled(),
        PARTLY,
        {"median": 6.0 / 1024.0, "law": 3.0 / 1024.0, "missed": 1.0},
        "not compiled: median 5859 µs, law 2930 µs, rows and task 1953 µs; 99 % below 28750 µs; 1 "
        "of 5 samples miss T_s = 15.625 ms",
    ),
]

# --- all of them ---


@pytest.mark.parametrize(
    ("key", "needs", "expected"),
    [
        *TIME_CONSTANT,
        *NO_SECOND_DERIVATIVES,
        *BOUND_IS_SUFFICIENT,
        *BAND_IS_BOUNDED,
        *REACHED_IN_FINITE_TIME,
        *ABORTED_WITHOUT_RANK,
        *MOVING_OBJECTS,
        *COMPUTATION_TIME,
    ],
)
def test_claim(key: str, needs: Runs, expected: Expected) -> None:
    assert_finds(check(key, needs), expected)
