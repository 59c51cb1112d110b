"""Artificial potential fields on the same rows: repulsion that grows continuously towards the boundary."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np

from ..errors import InvalidInput, shown, unknown_name
from ..kernels.layout import ADDITIVE, PRIORITY
from ..rows import Array, BoolArray, Command, Rows, Task
from .base import Controller
from .compiled import BoundLaw, bound_law, compiled_command
from .options import positive
from .options import rank_tolerance as check_rank_tolerance
from .task_priority import prioritise
from .tracking import RANK_TOLERANCE, track

BLENDS = ("additive", "priority")


def _blend(value: object) -> object:
    if not (isinstance(value, str) and value in BLENDS):
        raise unknown_name("blend", value, BLENDS)
    return value


def _positive(option: str) -> Callable[[object], float]:
    def check(value: object) -> float:
        number = positive(value)
        if number is None:
            raise InvalidInput(f"{option} of a potential field must be positive, not {shown(value)}")
        return number

    return check


class PotentialField(Controller):
    """Repulsion that grows continuously towards the boundary, inside an influence region.

    The repulsion is ψ(φ) u⁺ inside the region −δ < φ, with δ = ``region`` × the row's scale.
    ψ = (1 + φ/δ)^exponent is 0 where the region begins and 1 on the boundary. Since φ = σ + K σ̇, the repulsion is a
    spring in σ together with a damper in σ̇.

    ``additive`` is the classical sum of tracking and repulsion: q̈ = J†b − Σ ψᵢ u⁺ᵢ L_gφᵢ†, where ψ goes on growing
    beyond the boundary. Either part may win, so that rows can be violated.

    ``priority`` gives the rows the place they have in the paper's law: those inside their regions demand
    L_gφ q̈ = (1 − ψ) L_gφ J†b − ψ u⁺, with ψ at most 1, and the task acts in their null space. Where the region begins
    this is what tracking does anyway, on the boundary it is the sliding-mode law; in between it is continuous. As
    ``region`` goes to zero it becomes the sliding-mode law.

    Parameters
    ----------
    blend
        ``"additive"`` or ``"priority"``.
    region
        Depth of the influence region as a fraction of each row's allowed range; positive.
    exponent
        How ψ grows; 1 is linear, larger values concentrate the repulsion at the boundary.
    strength
        Factor on every u⁺.
    rank_tolerance
        As for :class:`SlidingMode`.
    """

    name = "potential-field"
    _checks: ClassVar = {
        "blend": _blend,
        "rank_tolerance": check_rank_tolerance,
        **{option: _positive(option) for option in ("region", "exponent", "strength")},
    }

    def __init__(
        self,
        *,
        blend: Literal["additive", "priority"] = "additive",
        region: float = 0.2,
        exponent: float = 1.0,
        strength: float = 1.0,
        rank_tolerance: float = RANK_TOLERANCE,
    ) -> None:
        self.blend, self.region, self.exponent, self.strength = blend, region, exponent, strength
        self.rank_tolerance = rank_tolerance

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        # the product of a small region and a small scale may be zero
        psi = np.maximum(1.0 + rows.phi / rows.scale / self.region, 0.0) ** self.exponent
        acts = psi > 0.0
        gain = self.strength * rows.switching_gain
        free = track(task, self.rank_tolerance)
        if self.blend == "priority":
            psi = np.minimum(psi, 1.0)
            demand = (1.0 - psi) * (rows.Lg @ free) - psi * gain
            return prioritise(rows, task, acts, demand, self.rank_tolerance)
        squared = (rows.Lg * rows.Lg).sum(axis=1)
        # a row whose gradient vanishes cannot be pushed: its pseudoinverse is zero
        push = np.divide(psi * gain, squared, out=np.zeros_like(psi), where=squared > 0.0)
        return Command(free - push @ rows.Lg, "ok", acts, rows.labels)

    def _compiled(self, rows: Rows, task: Task) -> Command | None:
        law = PRIORITY if self.blend == "priority" else ADDITIVE
        return compiled_command(rows, task, self.rank_tolerance, law, self.region, self.exponent, self.strength)

    def _bound(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        law = PRIORITY if self.blend == "priority" else ADDITIVE
        return bound_law(rows, task, acted, qdd, self.rank_tolerance, law, self.region, self.exponent, self.strength)
