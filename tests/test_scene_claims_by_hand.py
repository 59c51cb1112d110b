"""What claims 10b to 10f find of made-up runs: verdict, text and every number, worked out by
hand.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, T, Told, at, found, verdict
from vsconstraints.paper.claims import appendices
from vsconstraints.paper.scenes import SCENES
from vsconstraints.paper.studies import StudyResult
from vsconstraints.paper.verdicts import Finding
from vsconstraints.rows import Array

NAMES = [spec.name for spec in SCENES]


def study(**numbers: float) -> StudyResult:
    return StudyResult(
        "made up", {tuple(name.split("__")): value for name, value in numbers.items()}
    )


def scenes(first: list[Told], others: Told) -> list[Told]:
    return [*first, *[others] * (len(NAMES) - len(first))]


# --- claim 10b ---

SPEED = "speed[joint 1].upper"


class Shared(Told):
    """A run in which (12) asks for a share of u⁺ in one sample."""

    asked = 0.0

    def needed_share(self) -> Array:
        return at({5: self.asked}, 0.0)


def shared(asked: float = 0.75, phi: float = -1.0, least: float = 0.0, t: Array = T) -> Shared:
    """Two rows of which the second is inside; nothing is said of the clearance of a speed."""
    run = Shared(
        {ROW: at({5: phi}), "b": -1.0, SPEED: -1.0}, {}, {ROW: least, "b": 1.0, SPEED: -9.0}, t=t
    )
    run.asked = asked
    return run


def sweep(above: float, allowed: float, in_band: float) -> StudyResult:
    return study(above_bound=above, above_bound_allowed=allowed, above_bound_in_band=in_band)


def test_10b_counts() -> None:
    """Of 13 scenes the corner is left out and one asks for too much: 11, of which one each leaves
    band and boundary.
    """
    runs = [shared(phi=3.0, t=2.0 * T), shared(1.25), shared(phi=1.0), shared(phi=0.75, least=-0.5)]
    of = found("10b", sweep(7.0, 6.0, 5.0), *scenes(runs, shared()))
    assert of.values == {"above": 18, "kept": 16, "band": 15}
    assert of.text == (
        "of 18 runs above the bound 16 keep σ ≤ 0 and 15 keep φ ≤ T_s u⁺, not example-2d-fov (1.5 "
        "T_s u⁺); (12) asks "
        "for more than the printed u⁺ in example-2d-fast (1.25 u⁺); (12) is about continuous "
        "time, in which tracking "
        "does not move φ while the law acts"
    )
    assert of.verdict == NO


def test_10b_where_all_keep_their_band() -> None:
    of = found("10b", sweep(7.0, 6.0, 7.0), *scenes([], shared()))
    assert of.values == {"above": 19, "kept": 18, "band": 19}
    assert of.text == (
        "of 19 runs above the bound 18 keep σ ≤ 0 and 19 keep φ ≤ T_s u⁺; (12) asks for more than "
        "the printed u⁺ in no "
        "scene"
    )
    assert of.verdict == YES
    assert verdict("10b", sweep(7.0, 7.0, 6.0), *scenes([], shared())) == PARTLY


def test_10b_needs_a_run_above_the_bound() -> None:
    too_much = scenes([], shared(1.0))
    assert found("10b", sweep(0.0, 0.0, 0.0), *too_much).text == "no run is above the bound"
    assert found("10b", sweep(1.0, 1.0, 1.0), *too_much).values == {
        "above": 1,
        "kept": 1,
        "band": 1,
    }


# --- claim 10c ---


def test_10c_says_the_worst_row_of_every_scene() -> None:
    """T_s u⁺ = 2 in a run with twice the period; a row that is positive for more than two samples
    is named.
    """
    two = Told({"a": at({5: 0.0, 6: 0.5}), ROW: at({5: 0.0, 6: 1.0})}, t=2.0 * T)
    long = Told({ROW: at({5: 0.0, 6: 0.25, 7: 0.0})})
    short = Told({ROW: at({5: 0.0, 6: 0.125})})
    numbers = study(
        s__greatest_excess=0.5, s__exponent=1.0, u__greatest_excess=0.75, u__exponent=0.9
    )
    of = found("10c", numbers, *scenes([two, long, short], Told()))
    assert of.values == {
        "s": 0.5, "u": 0.75, f"{NAMES[0]}/scene": 0.5, f"{NAMES[1]}/scene": 0.25, f"{NAMES[2]}/scene": 0.125
    }  # fmt: skip
    assert of.text == (
        "s: up to 0.50 T_s u⁺, growing with T_s to the power 1.00; u: up to 0.75 T_s u⁺, growing "
        "with T_s to the power "
        f"0.90. In every scene: example-2d-fov 0.5, example-2d-fast 0.25 ({ROW}, φ ≥ 0 for 3 "
        f"samples in a row), "
        "example-2d-fast-high-gain 0.125. (43) is about one step of the constraint action alone, "
        "tracking moves φ as "
        "well"
    )
    assert of.verdict == YES


def test_10c_asks_for_proportion_of_every_sweep() -> None:
    some = scenes([Told({ROW: at({5: 0.0, 6: 0.5})})], Told())
    for power, expected in ((1.2, PARTLY), (0.8, PARTLY), (1.3, NO), (0.7, NO)):
        numbers = study(
            s__greatest_excess=1.5, s__exponent=1.0, u__greatest_excess=0.5, u__exponent=power
        )
        assert verdict("10c", numbers, *some) == expected
    assert found("10c", study(s__exponent=1.0), *some).text == "the study sampling-time has no band"


# --- claim 10e ---


def test_the_start_outside_is_what_it_says() -> None:
    setup = appendices.OUTSIDE.load().setup()
    assert (setup.Ts, setup.duration, setup.constraints.constraints[0].switching_gain) == (
        0.001,
        1.0,
        100.0,
    )
    np.testing.assert_array_equal(setup.qd0, [0.0, 0.0, -3.0])


PERIODS = np.arange(101) / 128.0


@pytest.mark.parametrize(
    ("first", "later", "push", "expected"),
    [
        (9, 2.0, 36.0, YES),
        (10, 2.0, 36.0, PARTLY),
        (9, 2.01, 36.0, PARTLY),
        (3, 2.0, 100.0, PARTLY),
        (3, 2.0, 101.0, PARTLY),
    ],
)
def test_10e(first: int, later: float, push: float, expected: str) -> None:
    """φ starts at 4 and u⁺ − L_fφ = 100 − 36: within 1/16 s, which are eight periods, and one
    more.
    """
    bound = 100.0 / 128.0
    row = at({**dict.fromkeys(range(first), 0.0), 0: 4.0, first + 5: later * bound}, -1.0)
    run = Told({"a": 5.0, ROW: row}, t=PERIODS)
    run.drift[:, 0] = 1e3
    run.drift[2, 1] = push
    run.drift[first + 1, 1] = 1e3
    of = found("10e", run)
    assert of.verdict == expected
    assert of.values["after"] == first / 128.0
    assert of.values["within"] == (0.0625 if push == 36.0 else pytest.approx(np.nan, nan_ok=True))
    promised = "within 62.5 ms" if push == 36.0 else "never"
    assert of.text == (
        f"φ starts at 4; u⁺ = 100, L_fφ up to {push:g}: below zero after "
        f"{1e3 * first / 128.0:.3g} ms, promised "
        f"{promised}; then at most {later:.2f} T_s u⁺"
    )


def test_10e_of_a_row_that_never_leaves() -> None:
    of = found("10e", Told({ROW: at({7: 0.0}, 5.0)}))
    assert of == Finding(NO, "φ starts at 5 and never falls below zero")
    assert found("10e", Told({ROW: 0.0})).text == "φ is 0 at the start, not above zero"
    assert verdict("10e", Told({ROW: at({0: 0.5}, -1.0)})) == YES


# --- claim 10f ---

AXES = {
    "row a": (2.0, 0.0, 0.0),
    "row b": (0.0, 3.0, 0.0),
    "row c": (0.0, 3.0, 3e-7),
    "row d": (1e-7, 1e-7, 1e-7),
}


def active(*spans: tuple[int, str], until: int = 61, gradients: Any = None, **changed: Any) -> Told:
    """Rows by their letters, active in these samples; the gradients of the rows are those above if
    not given.
    """
    t = T[:until]
    phi = {
        name: at({k: 0.0 for k, letters in spans if name[-1] in letters}, -1.0, t) for name in AXES
    }
    run: Any = Told(phi, t=t, q=np.zeros((until, 3)), qd=np.zeros((until, 3)), **changed)
    slopes = np.array([*AXES.values()] if gradients is None else gradients)

    def evaluate(t: float, q: Any, qd: Any) -> Any:
        return SimpleNamespace(
            rows=SimpleNamespace(Lg=slopes, phi=run.trajectory.phi[round(t / 0.01)])
        )

    run.setup = SimpleNamespace(world=lambda: SimpleNamespace(evaluate=evaluate))
    return run  # type: ignore[no-any-return]


WELL = active((20, "ab"), (30, "abd"), (40, "cd"), (50, "c"))


@pytest.mark.parametrize(
    ("last", "changed", "expected"),
    [
        ("abc", {"reason": "dependent: row b, row a"}, YES),
        ("bc", {"reason": "dependent: row c"}, YES),
        ("abcd", {"reason": "dependent: row d"}, YES),
        ("abc", {"reason": "dependent: row d"}, NO),
        ("abc", {"reason": "dependent: row b", "status": "converged"}, NO),
        ("abc", {"reason": "dependent: row b", "until": 62}, NO),
        ("abd", {"reason": "dependent: row b"}, NO),
    ],
)
def test_10f(last: str, changed: dict[str, Any], expected: str) -> None:
    """Rows b and c point the same way; four of three joints are dependent wherever they point."""
    spans = (20, "ab"), (30, "abd"), (40, "cd"), (60, last)
    lost = active(*spans, **{"status": "aborted", **changed})
    known = active((10, "bc"), until=11, status="aborted", reason="row b")
    of = found("10f", WELL, lost, known, WELL)
    assert of.verdict == expected
    here = (
        f"experiment-1-pbvs, T_s = 0.01 s: rank lost at 0.60 s, "
        f"{changed.get('status', 'aborted')}; "
    )
    assert (
        of.text
        == (here if last != "abd" else "")
        + "experiment-2-ibvs, T_s = 0.01 s: rank lost at 0.10 s, aborted"
    )


def test_10f_of_four_rows_that_span_all() -> None:
    """More rows than joints, of which no combination is small."""
    gradients = np.vstack((np.eye(3)[[0, 1]], [[1.0, 1.0, 1.0]], np.eye(3)[2]))
    lost = active((10, "abd"), (60, "abdc"), gradients=gradients, status="aborted", reason="row a")
    assert verdict("10f", lost, WELL, WELL, WELL) == YES
    assert found("10f", WELL, WELL, WELL, WELL).text == "no run loses the rank of its active rows"
