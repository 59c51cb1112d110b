"""Measures shared by several claims: fulfilment, use of the allowed space, smooth approach."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from ...comparisons.run import Run
from ...rows import Array
from ...rows.readable import amount
from ..case_study import Intervals
from ..studies import StudyResult
from ..studies.pareto import MAX_EXCESS, MAX_POSITIVE_SAMPLES
from ..verdicts import Finding, NotMeasured, finding, shown_samples

#: Rule of claims that constraints are fulfilled, see :func:`phi_never_positive`.
FULFILLED = (
    "max φ ≤ 0; partly if max σ ≤ 0, also between samples, over the rows that have a σ of their "
    "own, max φ ≤ 2 T_s u⁺ and φ ≥ 0 for two samples in a row at most: no more than sampling "
    "explains"
)
#: Rule of claims that a boundary is reached smoothly, see :func:`smoothly`.
SMOOTHLY = (
    "the speed normal to the boundary never rises once the row acts, and at most 10 % of it is "
    "left 3 K later"
)

#: Rule of claims that the orientation error is zero.
ORIENTED = "at the end less than 1 % of the initial error"
VANISHED = 0.01  #: Share of the greatest error that may remain where the paper says zero.
#: Unused margin, as a fraction of the characteristic length, up to which the allowed space counts
#: as fully used.
FULLY = 0.01
#: Share of the normal speed that may remain after 3 K; an exponential approach leaves exp(−3) =
#: 0.05.
SHARE_LEFT = 0.1


def position(run: Run) -> Array:
    """Distance (N,) between camera and goal [m]."""
    return run.trajectory.camera_error[:, 0]


def angle(run: Run) -> Array:
    """Angle (N,) between camera and goal [rad]."""
    return run.trajectory.camera_error[:, 1]


def excess(run: Run, label: str) -> float:
    """Greatest φ of a row, in units of T_s u⁺."""
    return float(run.phi(label).max() / run.bound(label))


def greatest_sigma(run: Run, *labels: str) -> float:
    """Greatest σ of the rows."""
    return max(float(run.sigma(label).max()) for label in labels)


def clear(run: Run, *labels: str) -> float:
    """Smallest clearance of the rows, also between samples, in their unit."""
    return min(float(run.row(label)["clearance_min"]) for label in labels)


def with_sigma(labels: Iterable[str]) -> list[str]:
    """Labels of rows with a separate σ; σ of a speed is its φ."""
    return [label for label in labels if not label.startswith("speed")]


def greatest_phi(run: Run, labels: Sequence[str]) -> float:
    """Greatest φ of the rows."""
    return max(float(run.phi(label).max()) for label in labels)


def fulfilled(run: Run, label: str) -> Finding:
    """Finding that σ ≤ 0, also between samples, and that φ stays within T_s u⁺ of zero."""
    sigma = greatest_sigma(run, label)
    bound = run.bound(label)
    samples = run.positive_samples(label)
    phi = float(run.row(label)["phi_max"])
    good = (
        sigma <= 0.0
        and clear(run, label) >= 0.0
        and phi <= bound
        and samples <= MAX_POSITIVE_SAMPLES
    )
    text = (
        f"max σ = {amount(sigma)}; max φ = {amount(phi)} (T_s u⁺ = {bound:g}), "
        f"positive for {shown_samples(samples)} in a row"
    )
    return finding(
        text, holds=good, sigma_max=sigma, phi_max=phi, bound=bound, positive_samples=samples
    )


def phi_never_positive(run: Run, labels: Sequence[str]) -> Finding:
    """Finding that φ ≤ 0 wherever the paper says that a constraint is fulfilled.

    The rule is :data:`FULFILLED`.
    """
    with_rows = with_sigma(labels)
    phi = greatest_phi(run, labels)
    sigma = greatest_sigma(run, *with_rows)
    worst = max(labels, key=lambda label: excess(run, label))
    longest = max(labels, key=run.positive_samples)
    most = excess(run, worst)
    samples = run.positive_samples(longest)
    part = (
        sigma <= 0.0
        and clear(run, *with_rows) >= 0.0
        and most <= MAX_EXCESS
        and samples <= MAX_POSITIVE_SAMPLES
    )
    position = run.index(longest)
    which = f" ({longest})" if len(labels) > 1 else ""
    text = (
        f"max σ = {amount(sigma)}; max φ = {amount(phi)}, up to {most:.2f} T_s u⁺ ({worst}), "
        f"at or above zero for {shown_samples(samples)} in a row{which}; "
        f"(12) asks for u⁺ > {run.drift[:, position].max():.3g} there, "
        f"where u⁺ = {run.record.switching_gain[position]:g}"
    )
    values = {"phi_max": phi, "sigma_max": sigma, "excess": most, "longest": samples}
    return finding(text, holds=phi <= 0.0, partly=part, **values)


def unused(run: Run, label: str) -> float:
    """Smallest clearance of a row as a fraction of its characteristic length."""
    return clear(run, label) / run.length(label)


def fully_used(run: Run, *labels: str) -> Finding:
    """Finding that the allowed space is fully utilized.

    Unused margins are at most 1 %, and none is negative.
    """
    shares = {label: unused(run, label) for label in labels}
    used = [0.0 <= share <= FULLY for share in shares.values()]
    texts = [
        f"{label} comes within {clear(run, label):.2g} {run.unit(label)} of its boundary "
        f"({100 * share:.2g} % of L)"
        for label, share in shares.items()
    ]
    return finding("; ".join(texts), holds=all(used), partly=any(used), **shares)


def ends_of(intervals: Intervals) -> dict[str, float]:
    """Ends of intervals as ``from_0``, ``to_0``, ``from_1`` and so on."""
    ends = {}
    for k, (first, last) in enumerate(intervals):
        ends[f"from_{k}"] = first
        ends[f"to_{k}"] = last
    return ends


def rounds_to(intervals: Intervals, printed: Intervals) -> bool:
    """True if the intervals agree with the printed ones in number, and in their ends to 0.5 s."""
    ends = zip(ends_of(intervals).values(), ends_of(printed).values(), strict=False)
    return len(intervals) == len(printed) and all(abs(a - b) <= 0.5 for a, b in ends)


class Approach(NamedTuple):
    """Approach to a boundary, by the normal speed.

    ``first`` is the speed when the row becomes active, ``later`` the speed 3 K after that, and
    ``greatest`` the greatest speed in between. ``start`` is a time [s]; the speeds are in the row's
    unit per second.
    """

    start: float
    first: float
    later: float
    greatest: float

    @property
    def share(self) -> float:
        """Share of the speed that remains after 3 K; infinite if the first speed leads inwards."""
        return abs(self.later) / self.first if self.first > 0.0 else inf

    @property
    def smooth(self) -> bool:
        """True if the speed falls as in an exponential approach, and never rises on the way."""
        return self.share <= SHARE_LEFT and self.greatest <= 1.1 * self.first


def approaches(run: Run, label: str) -> list[Approach]:
    """Return each approach in which the row is active for 3 K or longer."""
    K = run.constraint(label).K
    speed = run.approach_speed(label)
    every = []
    for first, last in run.active_intervals(label, gap=0.3):
        if last - first < 3.0 * K:
            continue
        a, b = (
            int(np.searchsorted(run.t, time - 0.5 * run.sampling_time))
            for time in (first, first + 3.0 * K)
        )
        every.append(
            Approach(first, float(speed[a]), float(speed[b]), float(speed[a : b + 1].max()))
        )
    return every


def smoothly(run: Run, *labels: str) -> Finding:
    """Finding that the boundary is reached smoothly in every approach of these rows."""
    by_row = {label: approaches(run, label) for label in labels}
    every = [approach for of_row in by_row.values() for approach in of_row]
    if missing := [label for label, of_row in by_row.items() if not of_row]:
        text = f"no approach lasts 3 K: {', '.join(missing)}"
        return finding(text, holds=False, partly=bool(every))
    smooth = [approach.smooth for approach in every]
    left = max(approach.share for approach in every)
    texts = []
    for label, of_row in by_row.items():
        unit = run.unit(label)
        speeds = [f"{approach.first:.3g} → {approach.later:.2g} {unit}/s" for approach in of_row]
        texts.append(f"{label} {', '.join(speeds)}")
    text = f"normal speed, at first and 3 K later: {'; '.join(texts)}"
    return finding(text, holds=all(smooth), partly=any(smooth), share_left=left)


def number(study: StudyResult, *key: str | float) -> float:
    """Return a finite number of a study; raises NotMeasured if there is none."""
    value = study.numbers.get(key, nan)
    if not isfinite(value):
        why = f": {study.failures[0]}" if study.failures else ""
        raise NotMeasured(f"the study {study.study} has no {'.'.join(map(str, key))}{why}")
    return value


def ending(study: StudyResult, *last: str | float) -> Iterator[tuple[str, float]]:
    """Yield first part of the key and value of each number whose key ends with ``last``."""
    return (
        (str(first), value)
        for (first, *others), value in study.numbers.items()
        if tuple(others) == last
    )
