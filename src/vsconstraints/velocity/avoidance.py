"""Law ``resolved-rate-avoidance``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np

from ..controllers.least_norm import RANK_TOLERANCE, least_norm
from ..controllers.ranges import Declared, Range, one_of, positive_number
from ..errors import ConfigurationError
from ..formulas.projection import CLOSED, OPENED, opening
from ..rows import Array, Command, Rows, Task
from .resolved_rate import ResolvedRate

#: Beginning of the labels of the rows that are avoided, by the option ``avoids``.
AVOIDED = {"ranges": "range[", "all": ""}


def large_projection(J: Array, error: Array, rank_tolerance: float) -> Array:
    """Return the large projection operator P (n, n) of Marey and Chaumette (IROS 2010, eq. 24).

    P = λ̄ Pₑ + (1 − λ̄)(I − J†J) with Pₑ = I − Jᵀe eᵀJ / (eᵀJJᵀe), which protects only the
    norm of the error e (k,); λ̄ is 0 for ‖e‖ < 0.1 and 1 for ‖e‖ > 0.7 (:func:`.opening`).
    """
    n = J.shape[1]
    step = least_norm(J, np.zeros(len(J)), rank_tolerance)
    used = step.directions[:, step.gains > 0.0]
    classical = np.eye(n) - used @ used.T
    pull = J.T @ error
    size = float(pull @ pull)
    if size == 0.0:
        return classical
    share = float(opening(np.linalg.norm(error), CLOSED, OPENED))
    norm_only = np.eye(n) - np.outer(pull, pull) / size
    large: Array = share * norm_only + (1.0 - share) * classical
    return large


def number_up_to(name: str, value: object, most: float = 1.0) -> float:
    """Return a positive number of at most ``most``; raise ConfigurationError for anything else."""
    number = positive_number(name, value)
    if number > most:
        raise ConfigurationError(f"{name} must be at most {most:g}, not {number:g}")
    return number


class ResolvedRateAvoidance(ResolvedRate):
    """Resolved rate with ViSP's avoidance of limits by the large projection operator.

    q̇ = q̇₁ − Σᵢ λᵢ (1 + λ_tune) bᵢ P gᵢ. q̇₁ is the command of :class:`.ResolvedRate`, P is
    :func:`.large_projection`, gᵢ = ∇σᵢ / ‖∇σᵢ‖ is the direction towards the boundary of a row and
    bᵢ = |gᵢᵀq̇₁| / |gᵢᵀP gᵢ|. λᵢ rises from 0 to 1 as the row enters the last ``zone`` of its
    range. As published, a row with bᵢ ≥ 1 is not avoided: where the primary task moves towards a
    limit faster than that, avoidance is off. Marey and Chaumette, "New strategies for avoiding
    robot joint limits", IROS 2010; ``vpServo::secondaryTaskJointLimitAvoidance`` of ViSP.

    Parameters
    ----------
    zone
        ρ: width of the avoidance zone at each end of a range, as a fraction of the range, at most
        0.5.
    full
        ρ₁: part of the zone after which avoidance acts fully, as a fraction of the zone.
    tune
        λ_tune: relative excess of the avoidance speed over the speed of the primary task.
    avoids
        Constraints that are avoided: ``"ranges"``, the ranges of joints, as published, or
        ``"all"``, every row on σ, in the same way.
    """

    name = "resolved-rate-avoidance"
    kernel = "resolved_rate_avoidance"
    ranges: ClassVar[Mapping[str, Declared]] = {
        "zone": Range(0.02, 0.4),
        "full": Range(0.1, 1.0),
        "tune": Range(0.05, 1.0),
    }

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
        zone: float = 0.1,
        full: float = 0.3,
        tune: float = 0.7,
        avoids: Literal["ranges", "all"] = "ranges",
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        super().__init__(
            gain=gain,
            gain_at_zero=gain_at_zero,
            slope_at_zero=slope_at_zero,
            rank_tolerance=rank_tolerance,
        )
        self.zone = number_up_to("zone", zone, 0.5)
        self.full = number_up_to("full", full)
        self.tune = number_up_to("tune", tune)
        self._begins = one_of("avoids", avoids, AVOIDED)
        self.avoids = avoids

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return (*super().uses, "σ", "K")

    def compiled_options(self, rows: Rows, n: int) -> dict[str, Any]:
        """See :class:`.VelocityLaw`."""
        avoided = [label.startswith(self._begins) for label in rows.labels]
        return {
            **super().compiled_options(rows, n),
            "zone": self.zone,
            "full": self.full,
            "tune": self.tune,
            "avoided": np.array(avoided, dtype=np.bool_),
        }

    def solve(self, rows: Rows, task: Task) -> Command:  # type: ignore[override]
        """See :class:`.VelocityController`."""
        self.require_sigma(rows)
        primary = super().solve(rows, task)
        qd = primary.copy()
        acted = np.zeros(len(rows.labels), np.bool_)
        width = 2.0 * self.zone * rows.scale
        near = (rows.sigma > -width) & (rows.K > 0.0)
        if near.any():
            P = large_projection(task.J, task.error, self.rank_tolerance)
        for i in np.flatnonzero(near):
            if not rows.labels[i].startswith(self._begins):
                continue
            full_width = self.full * width[i]
            depth = float((rows.sigma[i] + width[i]) / full_width)
            away = self._away(rows.Lg[i], P, primary)
            if away is not None:
                share = float(opening(max(depth, 0.0), 0.0, 1.0))
                qd -= share * away
                acted[i] = True
        return Command(np.zeros(len(qd)), "ok", acted, rows.labels, qd=qd)

    def _away(self, gradient: Array, P: Array, primary: Array) -> Array | None:
        """Return (1 + λ_tune) b P g of a row (n,), or None where avoidance is off."""
        length = float(np.linalg.norm(gradient))
        if length == 0.0:
            return None
        g = gradient / length
        along = P @ g
        speed = abs(float(g @ primary))
        effect = abs(float(g @ along))
        if speed >= effect:
            return None
        factor = (1.0 + self.tune) * (speed / effect)
        away: Array = factor * along
        return away
