"""Arrays of the predictive safety filter: its plan, its predictions and its program, compiled."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ...compiled.codes import PARTS
from ...compiled.compiler import in_place
from ...compiled.memory import zeros
from ...compiled.parts import struct_loader
from ...rows import Array, IntArray
from .plan_arrays import Factor, Limits, Space

#: Reported numbers: instants at which rows and task were predicted, instants requested, active rows
#: of the plan, the code of its program, and 1 if the current plan came from a program, in this or
#: an earlier sample; 0 if it is a brake.
PREDICTED, ASKED, ACTIVE, CODE, FOUND, OUTCOMES = range(6)
#: Stages of a law (option 1). If Python predicts, it requests one at a time.
ALL, PROPOSE, BRAKE, CONCLUDE = range(4)


class PlanArrays(NamedTuple):
    """Arrays of a predictive law: H blocks, up to N instants, n joints, m rows, k features."""

    #: Addresses of the step in the loop and of the predicting step; 0 if Python predicts.
    loop: int
    step: int
    frozen: int  #: 1 if everything is predicted at the current time.
    #: Time constant [s] with which the current difference of σ̇ from the model is assumed to decay;
    #: 0 if at once.
    fading: float
    #: T_s, T and κ [s], λ relative to the mean of ‖J‖², and the margin as a share of the rows'
    #: scales.
    period: float
    length: float
    approach: float
    damping: float
    margin: float
    #: K_p(0), its slope, K_v/√K_p; d and (d/2)² of q̈₀.
    tracking: Annotated[Array, "5"]
    most: Annotated[Array, "n"]  #: Greatest |q̈|.
    K: Annotated[Array, "m"]  #: K of the rows, 0 for rows that give φ itself.
    weights: Annotated[Array, "m"]  #: Weights of violations.
    now: Annotated[Array, "2n+1"]  #: t, q, q̇.
    #: First entries of the parts of a prediction, or −1; predictions; outputs of the step.
    at: Annotated[IntArray, PARTS]
    seen: Annotated[Array, "N outputs"]
    out: Annotated[Array, "outputs"]
    #: Instants from now [s], their blocks, and the time since the block began [s]; the last instant
    #: is that of the brake.
    times: Annotated[Array, "N"]
    block: Annotated[IntArray, "N"]
    since: Annotated[Array, "N"]
    states: Annotated[Array, "2 N n"]  #: q and q̇.
    plan: Annotated[Array, "H n"]  #: Planned q̈.
    then: Annotated[Array, "n"]  #: q̈ after the plan.
    made: Annotated[Array, "1"]  #: Time at which it was made, NaN if there is no plan.
    outcome: Annotated[IntArray, OUTCOMES]  #: Reported numbers.
    braking: Annotated[Array, "1"]  #: Duration of the brake [s].
    #: See :class:`.Cost`.
    gains: Annotated[Array, "H 2"]
    rest: Annotated[Array, "H 2"]
    square: Annotated[Array, "H n n"]
    pull: Annotated[Array, "H n"]
    free: Annotated[Array, "H n"]
    factor: Factor
    #: See :class:`.Limits`.
    value: Annotated[Array, "N m"]
    gradient: Annotated[Array, "N m n"]
    by_speed: Annotated[IntArray, "m"]
    falls: Annotated[Array, "N-1"]
    left: Annotated[Array, "N-1 m"]
    row_factor: Annotated[Array, "N-1 m"]
    low: Annotated[Array, "H n"]
    high: Annotated[Array, "H n"]
    space: Space


load_plans = struct_loader(zeros(PlanArrays))


@in_place
def limits_of(plans: PlanArrays, count: int, scale: Array) -> Limits:
    """Return the limits at the first ``count`` instants."""
    return Limits(
        count,
        plans.block,
        plans.since,
        plans.braking[0],
        plans.value,
        plans.gradient,
        plans.by_speed,
        plans.falls,
        plans.left,
        plans.row_factor,
        scale,
        plans.low,
        plans.high,
    )
