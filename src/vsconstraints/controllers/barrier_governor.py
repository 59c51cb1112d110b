"""The barrier governor: a goal governor whose reference moves as a barrier of its predicted margins lets it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from .goal_governor import GoalGovernor
from .ranges import Declared, Range


class BarrierGovernor(GoalGovernor):
    """The reference governor by control barrier functions, in closed form.

    It predicts what :class:`.GoalGovernor` does. With dᵢ the least −σᵢ of row i along the predicted motion, by the row's
    scale, the barrier is their softmin h = −1/κ log Σ exp(−κ dᵢ) − δ, and ṡ_ref the solution of

        min ‖ṡ_ref − v a‖²  s.t.  ∇h ṡ_ref ≥ −α h:   ṡ_ref = v a + ∇hᵀ max(0, −α h − v ∇h a)/‖∇h‖²

    (after Nakano, Garone and Notomista, "Optimization-free constrained control with guaranteed recursive feasibility: a
    CBF-based reference governor approach", arXiv:2604.04001, 2026), with the attraction a of the goal governor. While
    s_ref rests no margin falls, as less and less of the same motion is left. So the part of ḣ that is due to the motion
    of the arm is not negative, and is left out, and where h ≥ 0 there always is a solution, ṡ_ref = 0.

    ∇h = Σ wᵢ ∇dᵢ, w the softmax of −κ d, with ∇dᵢ = −J⁺ᵀ ∂σᵢ/∂q S where row i is nearest: s follows s_ref by the step
    response S of the tracking law, whose gains count as constant; Ṡ takes its place for rows of speeds. Where h < 0 the
    reference returns, no faster than v. As in the goal governor no step is made after which a dᵢ is less than δ/2.

    Parameters
    ----------
    speed, margin, horizon, demand, resolver, options
        As of :class:`.GoalGovernor`.
    alpha
        α, how fast h may fall [1/s].
    sharpness
        κ: h is less than the least dᵢ − δ by up to log(m)/κ.
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
        margin: float = 0.01,
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
    def _barrier(self) -> tuple[float, float]:
        return self.alpha, self.sharpness
