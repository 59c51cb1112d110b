"""What claims 11 and 12 find of made-up runs: verdict, text and every number, worked out by
hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from told import NO, PARTLY, ROW, YES, T, Told, at, found, verdict
from vsconstraints.paper.claims import section_5_remarks
from vsconstraints.rows import Array


def test_11a_is_about_the_worst_row() -> None:
    rows = {"fov[marker 1]": -1.0, ROW: at({5: 0.0}), "speed[joint 1].upper": -1.0}
    sigma = {"fov[marker 1]": -0.25, ROW: at({5: 0.5}, -2.0), "speed[joint 1].upper": 3.0}
    good = Told(rows, {**sigma, ROW: -0.5})
    bad = Told(rows, sigma)
    idle = Told(status="trapped")
    of = found("11a", good, bad, idle)
    assert of.text == (
        f"moving-target: converged, max σ = −0.25, {ROW} active; moving-occluder: converged, max "
        f"σ = 0.5, {ROW} "
        "active; moving-sphere: trapped, max σ = −1, no row active"
    )
    assert of.verdict == PARTLY
    assert [verdict("11a", bad, bad, bad), verdict("11a", good, good, good)] == [NO, YES]


@dataclass(frozen=True)
class Rows:
    """φ, L_fφ and L_gφ of rows."""

    phi: Array
    Lf: Array
    Lg: Array

    @classmethod
    def of(cls, phi: list[float], Lf: list[float], Lg: float) -> Rows:
        """L_gφ is 5 but for one element of the second row."""
        return cls(
            np.array(phi), np.array(Lf), np.array([[5.0, 5.0], [5.0, Lg], [5.0, 5.0]][: len(phi)])
        )


class Moving(Told):
    """A run whose rows are those written down, by time, where they are known: what is told of the
    motion.
    """

    def __init__(self, told: dict[int, Rows], rows: int = 3) -> None:
        names = ("a", "b", "c")[:rows]
        phi = {
            name: at({k: float(one.phi[i]) for k, one in told.items()})
            for i, name in enumerate(names)
        }
        super().__init__(phi, q=np.zeros((len(T), 2)), qd=np.zeros((len(T), 2)))
        step = SimpleNamespace(
            evaluate=lambda t, q, qd: SimpleNamespace(rows=told[round(t / 0.01)])
        )
        self.setup = SimpleNamespace(world=lambda: step)


def blindly(monkeypatch: pytest.MonkeyPatch, **blind: dict[int, Rows]) -> None:
    """What the scenarios' rows are where the motion is not told."""

    def untold(scenario: str, overrides: Any) -> Any:
        assert overrides == {"constraints.0.motion.known": False}
        rows = blind[scenario.removeprefix("moving-")]
        step = SimpleNamespace(
            evaluate=lambda t, q, qd: SimpleNamespace(rows=rows[round(t / 0.01)])
        )
        return SimpleNamespace(
            load=lambda: SimpleNamespace(setup=lambda: SimpleNamespace(control=lambda: step))
        )

    monkeypatch.setattr(section_5_remarks, "RunSpec", untold)


def test_11b(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rows of three act in two samples: one of them pushes inwards, which takes nothing from
    what is needed.
    """
    told = {
        20: Rows.of([0.0, 0.5, -0.5], [1.0, -3.0, 90.0], 5.0),
        40: Rows.of([0.0, 2.0, -0.5], [-3.0, 4.0, 80.0], 5.0),
    }
    blind = {
        20: Rows.of([0.25, 1.0, 9.0], [2.5, -3.0, 90.0], 5.25),
        40: Rows.of([0.0, 2.25, 9.0], [-3.0, 3.0, 80.0], 5.0),
    }
    blindly(monkeypatch, occluder=blind, sphere={})
    of = found("11b", Moving(told), Moving({}))
    assert of.text == (
        "moving-occluder: L_gφ differs by 0.25; (12) asks for u⁺ > 4, without ∂φ/∂t for 3; φ of "
        "active rows differs by "
        "up to 0.5, as σ̇ contains ∂σ/∂t; moving-sphere: L_gφ differs by 0; (12) asks for u⁺ > 0, "
        "without ∂φ/∂t for 0; "
        "φ of active rows differs by up to 0, as σ̇ contains ∂σ/∂t"
    )
    assert of.verdict == NO


def pair(
    phi: float = 0.0, Lf: float = 0.0, Lg: float = 0.0
) -> tuple[dict[int, Rows], dict[int, Rows]]:
    """One row with numbers of its own, and φ = L_f φ = L_g φ = 0 without what is told."""
    one, other = (
        Rows(np.array([a]), np.array([b]), np.array([[c, 5.0]]))
        for a, b, c in ((phi, Lf, Lg), (0.0, 0.0, 0.0))
    )
    return {20: one}, {20: other}


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ({"Lf": 1.0}, YES),
        ({"Lf": 1.1e-9}, YES),
        ({"Lf": 1e-9}, NO),
        ({"Lf": 1.0, "Lg": 1e-10}, YES),
        ({"Lf": 1.0, "Lg": 1e-9}, NO),
        ({"Lf": 1.0, "Lg": -1e-8}, NO),
        ({"Lf": 1.0, "phi": 1e-10}, YES),
        ({"Lf": 1.0, "phi": 1e-9}, PARTLY),
        ({"Lf": 1e-10, "Lg": 1e-6}, NO),
    ],
)
def test_11b_of_small_differences(
    numbers: dict[str, float], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In either of the scenes; and where the bound is greater without what is told."""
    told, blind = pair(**numbers)
    fine, without = pair(Lf=2.0)
    blindly(monkeypatch, occluder=blind, sphere=without)
    assert found("11b", Moving(told, 1), Moving(fine, 1)).verdict == expected
    blindly(monkeypatch, occluder=without, sphere=blind)
    assert found("11b", Moving(fine, 1), Moving(told, 1)).verdict == expected
    blindly(monkeypatch, occluder=fine, sphere=without)
    assert found("11b", Moving(fine, 1), Moving(fine, 1)).verdict == NO
    if "phi" not in numbers:
        blindly(monkeypatch, occluder=told, sphere=without)
        assert found("11b", Moving(blind, 1), Moving(fine, 1)).verdict == expected


def test_12a() -> None:
    """With T_s = 16/1024 s, in 1/1024 s: 6, 16, 4, 6 and 30, of which the law takes 1, 2, 3, 4 and
    30.
    """
    step = np.array([99.0, 1.0, 2.0, 3.0, 4.0, 30.0])
    rows = np.array([500.0, 5.0, 14.0, 1.0, 2.0, 0.0])
    of = found(
        "12a",
        Told(
            t=np.arange(6) / 64.0, step_time=step / 1024.0, rows_time=rows / 1024.0, compiled=False
        ),
    )
    assert (of.verdict, of.values) == (
        PARTLY,
        {"median": 6.0 / 1024.0, "law": 3.0 / 1024.0, "missed": 1.0},
    )
    assert of.text == (
        "not compiled: median 5859 µs, law 2930 µs, rows and task 1953 µs; 99 % below 28750 µs; 1 "
        "of 5 samples miss "
        "T_s = 15.625 ms"
    )
