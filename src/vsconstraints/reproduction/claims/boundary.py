"""Measures that several claims share: is a row fulfilled, is its space used, is its boundary reached smoothly."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from ..runs import Run
from ..verdicts import Finding, judged

VANISHED = 0.01
"""Share of the greatest error that may be left where the paper says zero."""

FULLY = 0.01
"""Unused margin, as a fraction of the characteristic length, up to which the allowed space counts as fully used."""

SHARE_LEFT = 0.1
"""Share of the normal speed that may be left after 3 K: an exponential approach leaves exp(−3) = 0.05."""

MOST_EXCESS = 2.0
"""How far sampling may lift φ above zero, in T_s u⁺: tracking adds to the one that eq. (43) allows."""

LONGEST_POSITIVE = 2
"""In a sliding mode φ is not positive for longer than this many samples."""


def fulfilled(run: Run, label: str) -> tuple[bool, str, dict[str, float]]:
    """Whether σ ≤ 0, also between samples, and φ stays within T_s u⁺ of zero."""
    line = run.row(label)
    sigma, phi, bound = float(run.sigma(label).max()), float(line["phi_max"]), run.bound(label)
    samples = run.positive_samples(label)
    kept = sigma <= 0.0 and float(line["clearance_min"]) >= 0.0
    good = kept and phi <= bound and samples <= LONGEST_POSITIVE
    text = (
        f"max σ = {signed(sigma)}; max φ = {signed(phi)} (T_s u⁺ = {bound:g}), positive for {plural(samples)} in a row"
    )
    return good, text, {"sigma_max": sigma, "phi_max": phi, "bound": bound, "positive_samples": float(samples)}


FULFILLED_RULE = (
    "max φ ≤ 0; partly if max σ ≤ 0, also between samples, over the rows that have a σ of their own, max φ ≤ 2 T_s u⁺ "
    "and φ ≥ 0 for two samples in a row at most: no more than sampling explains"
)
"""Wherever the paper says that a constraint is fulfilled, φ ≤ 0."""


def phi_never_positive(run: Run, labels: list[str]) -> Finding:
    """Of ``φ ≤ 0``: see :data:`FULFILLED_RULE`.

    A speed's σ is its φ, so that only the other rows are asked to keep σ ≤ 0.
    """
    phi = max(float(run.phi(label).max()) for label in labels)
    own = [label for label in labels if not label.startswith("speed")]
    sigma = max(float(run.sigma(label).max()) for label in own)
    inside = min(float(run.row(label)["clearance_min"]) for label in own) >= 0.0
    worst = max(labels, key=lambda label: float(run.phi(label).max()) / run.bound(label))
    excess = float(run.phi(worst).max()) / run.bound(worst)
    samples = {label: run.positive_samples(label) for label in labels}
    longest = max(labels, key=lambda label: samples[label])
    at = run.index(longest)
    text = (
        f"max σ = {signed(sigma)}; max φ = {signed(phi)}, up to {excess:.2f} T_s u⁺ ({worst}), at or above zero for "
        f"{plural(samples[longest])} in a row{'' if len(labels) == 1 else f' ({longest})'}; (12) asks for u⁺ > "
        f"{float(run.drift[:, at].max()):.3g} there, where u⁺ = {float(run.record.switching_gain[at]):g}"
    )
    sampled = excess <= MOST_EXCESS and samples[longest] <= LONGEST_POSITIVE
    values = {"phi_max": phi, "sigma_max": sigma, "excess": excess, "longest": float(samples[longest])}
    return Finding(judged(phi <= 0.0, sigma <= 0.0 and inside and sampled), text, values)


@dataclass(frozen=True)
class Margin:
    """How much of a row's allowed space was left unused.

    Attributes
    ----------
    least
        Least clearance, between samples too, in the row's unit.
    share
        The same as a fraction of the row's characteristic length.
    """

    least: float
    share: float

    @classmethod
    def of(cls, run: Run, label: str) -> Margin:
        """That of a run."""
        least = float(run.row(label)["clearance_min"])
        return cls(least, least / run.length(label))


def fully_used(run: Run, *labels: str) -> Finding:
    """Of ``the allowed space is fully utilized``: unused margins of at most 1 %, and none negative."""
    margins = {label: Margin.of(run, label) for label in labels}
    good = all(0.0 <= margin.share <= FULLY for margin in margins.values())
    part = any(0.0 <= margin.share <= FULLY for margin in margins.values())
    text = "; ".join(
        f"{label} comes within {margin.least:.2g} {run.unit(label)} of its boundary ({100.0 * margin.share:.2g} % of L)"
        for label, margin in margins.items()
    )
    return Finding(judged(good, part), text, {label: margin.share for label, margin in margins.items()})


@dataclass(frozen=True)
class Approach:
    """How a boundary is reached: normal speed when the row begins to act, and 3 K later.

    Attributes
    ----------
    start
        When [s].
    first, later, greatest
        Normal speed then, 3 K later, and the greatest in between [the row's unit per second].
    """

    start: float
    first: float
    later: float
    greatest: float

    @property
    def share(self) -> float:
        """What is left of the speed after 3 K; infinite if there is none towards the boundary at first."""
        return abs(self.later) / self.first if self.first > 0.0 else inf

    @property
    def smooth(self) -> bool:
        """Whether the speed falls as an exponential approach does, and never rises on the way."""
        return self.share <= SHARE_LEFT and self.greatest <= 1.1 * self.first


def approaches(run: Run, label: str, gap: float) -> list[Approach]:
    """Every time the row acts for 3 K or longer."""
    K, speed = run.constraint(label).K, run.approach_speed(label)
    found = []
    for first, last in run.active_intervals(label, gap=gap):
        if last - first < 3.0 * K:
            continue
        a, b = (int(np.searchsorted(run.t, time - 0.5 * run.sampling_time)) for time in (first, first + 3.0 * K))
        found.append(Approach(first, float(speed[a]), float(speed[b]), float(speed[a : b + 1].max())))
    return found


def smoothly(run: Run, *labels: str, gap: float = 0.3) -> Finding:
    """Of ``the boundary is reached smoothly``: every approach of these rows is."""
    found = {label: approaches(run, label, gap) for label in labels}
    every = [one for some in found.values() for one in some]
    text = "normal speed, at first and 3 K later: " + "; ".join(
        f"{label} " + ", ".join(f"{one.first:.3g} → {one.later:.2g} {run.unit(label)}/s" for one in some)
        for label, some in found.items()
    )
    if not all(found.values()):
        missing = [label for label, some in found.items() if not some]
        return Finding(judged(False, bool(every)), f"no approach lasts 3 K: {', '.join(missing)}")
    good, part = all(one.smooth for one in every), any(one.smooth for one in every)
    return Finding(judged(good, part), text, {"share_left": max(one.share for one in every)})


def signed(value: float) -> str:
    """Three significant digits with a true minus sign."""
    return f"{value:.3g}".replace("-", "−")


def plural(samples: int) -> str:
    """``1 sample``, ``14 samples``."""
    return f"{samples} sample" + ("" if samples == 1 else "s")
