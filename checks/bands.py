"""Width of the band of φ against the sampling time: ``python -m checks.bands``.

Theory predicts the power of T_s with which the band grows: the first for a switch and for implicit
laws that do not know the drift, the second for laws that estimate it. The check measures it on the
first example while a marker slides. The exit code is 1 if a law deviates from theory.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence

import numpy as np

from vsconstraints.controllers import Controller, HierarchicalQP, make_controller
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

PERIODS = (0.01, 0.005, 0.0025, 0.00125)
"""Sampling times [s]."""

LAWS: dict[str, tuple[Mapping[str, float], float]] = {
    "sliding-mode": ({}, 1.0),
    "implicit-switch": ({"periods": 1.0}, 1.0),
    "implicit-switch-with-drift": ({"periods": 1.0}, 2.0),
    "super-twisting": ({}, 2.0),
    "implicit-super-twisting": ({}, 2.0),
}
"""Laws with their options, and the expected power of T_s."""

NEAR = 0.05
"""Greatest |φ| while the marker slides."""

SETTLED = 0.4
"""Time after contact from which a law has converged, and time before the contact ends [s]."""

DOUBT = 0.3
"""Accepted deviation of the order from theory, which holds for a period that goes to zero."""


def run_of(law: Controller, period: float) -> tuple[Array, Array]:
    """Times [s] and φ of the second marker in the first example (N,)."""
    run = simulate(
        Scenario.load("example-2d-fov").with_override("sampling_time", period).setup(), law
    )
    return run.t, run.phi[:, run.labels.index("fov[marker 2]")]


def sliding() -> list[tuple[float, float]]:
    """Intervals in which the marker slides along the image's border [s].

    They are those of the barrier, which all other laws follow.
    """
    t, phi = run_of(HierarchicalQP(), PERIODS[-1])
    near = np.concatenate(([False], np.abs(phi) <= NEAR, [False]))
    begins = np.flatnonzero(~near[:-1] & near[1:])
    ends = np.flatnonzero(near[:-1] & ~near[1:]) - 1
    spans = [
        (float(t[a]) + SETTLED, float(t[b]) - SETTLED) for a, b in zip(begins, ends, strict=True)
    ]
    return [(begin, end) for begin, end in spans if begin < end]


def bands(name: str, periods: Sequence[float] = PERIODS) -> list[float]:
    """Greatest |φ| of a law while the marker slides, for each period."""
    found = []
    spans = sliding()
    for period in periods:
        t, phi = run_of(make_controller(name, LAWS[name][0]), period)
        found.append(
            max(float(np.abs(phi[(begin <= t) & (t <= end)]).max()) for begin, end in spans)
        )
    return found


def order(found: Sequence[float], periods: Sequence[float] = PERIODS) -> float:
    """Power of the sampling time with which bands grow."""
    return float(np.polyfit(np.log(periods), np.log(found), 1)[0])


def main() -> int:
    """Print a line for each law; return 1 if an order deviates from theory."""
    wrong = 0
    print(
        f"band of φ at T_s = {', '.join(f'{1e3 * period:g}' for period in PERIODS)} ms; power of "
        f"T_s; theory's"
    )
    for name, (_, theory) in LAWS.items():
        found = bands(name)
        other = not abs(order(found) - theory) <= DOUBT
        wrong += other
        cells = "  ".join(f"{band:.2e}" for band in found)
        print(
            f"{name:<28}{cells}  {order(found):.2f}  "
            f"{theory:g}{', otherwise than theory' if other else ''}"
        )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
