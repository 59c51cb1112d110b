"""The barrier governor: a goal governor whose reference moves as a barrier of its predicted margins lets it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from .goal_governor import GoalGovernor
from .ranges import Declared, Range


class BarrierGovernor(GoalGovernor):
    """The reference governor by control barrier functions, in closed form.

    It predicts what :class:`.GoalGovernor` does. With dᵢ the least −σᵢ of row i, by its scale, along the predicted
    motion, the barrier is their softmin h = −1/κ log Σ exp(−κ dᵢ) − δ, and ṡ_ref, with the goal's attraction a,

        min ‖ṡ_ref − v a‖²  s.t.  ∇h ṡ_ref ≥ −α h:   ṡ_ref = v a + ∇hᵀ max(0, −α h − v ∇h a)/‖∇h‖²

    (after Nakano, Garone and Notomista, "Optimization-free constrained control with guaranteed recursive feasibility: a
    CBF-based reference governor approach", arXiv:2604.04001, 2026). While s_ref rests no dᵢ falls. So what the arm's
    motion adds to ḣ is left out, and where h ≥ 0 there is a solution, ṡ_ref = 0. ∇dᵢ = −S J⁺ᵀ ∂σᵢ/∂q where row i is
    nearest, with tracking's step response S; Ṡ for rows of speeds. Gains, and J of speeds, count as constant. Where
    h < 0 the reference returns, by v at most. No step is made after which a dᵢ is less than δ/2.

    Parameters
    ----------
    alpha, sharpness
        α, how fast h may fall [1/s]; and κ: h is less than the least dᵢ − δ by up to log(m)/κ.
    speed, margin, horizon, demand, resolver, options
        As of :class:`.GoalGovernor`.
    """

    name = "barrier-governor"
    ranges: ClassVar[Mapping[str, Declared]] = {
        **{name: each for name, each in GoalGovernor.ranges.items() if name != "influence"},
        "alpha": Range(0.5, 20.0),
        "sharpness": Range(30.0, 1000.0),
    }

    def __init__(
        self,
        *,
        speed: float = 2.0,
        margin: float = 0.02,
        alpha: float = 5.0,
        sharpness: float = 200.0,
        horizon: float | None = None,
        demand: str = "nothing",
        resolver: str = "priority",
        **options: Any,
    ) -> None:
        self.alpha, self.sharpness = alpha, sharpness
        law = {"demand": demand, "resolver": resolver, **options}
        super().__init__(speed=speed, margin=margin, influence=float("inf"), horizon=horizon, **law)

    @property
    def _settings(self) -> tuple[float, ...]:
        return self.speed, self.margin, self.influence, self.alpha, self.sharpness
