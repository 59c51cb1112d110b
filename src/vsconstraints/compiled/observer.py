"""Law on rows with observed drift, compiled: corrects the rows and calls another law."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from ..formulas.innovation import observed_drift
from ..rows import Array
from .codes import NEEDS_PYTHON
from .compiler import IN_PLACE, compiled, in_place
from .laws import RESOLVER, is_answer, load_law
from .linear import copy_vector
from .memory import zeros
from .parts import call_int_pointer, set_fields, struct_loader
from .workspace import Answer, RowArrays, TaskArrays

#: Rows of an observation.
SIGMA, SIGMA_DOT, DRIFT = range(3)


class ObserverArrays(NamedTuple):
    """Observer of the drift of m rows, and the address of the law that computes the command."""

    law: int
    period: float  #: T_s [s].
    time_constant: float
    dead_time: float
    #: SIGMA and SIGMA_DOT of the previous sample, NaN if there was none, and DRIFT d̂ [1/s].
    seen: Annotated[Array, "3 m"]
    after: Annotated[Array, "3 m"]  #: Values of this sample, stored once the law has answered.
    #: Fields of the corrected rows.
    phi: Annotated[Array, "m"]
    Lf: Annotated[Array, "m"]
    sigma: Annotated[Array, "m"]
    sigma_dot: Annotated[Array, "m"]
    corrected: RowArrays  #: Corrected rows, which share the other fields of the rows.

    @classmethod
    def of(
        cls, m: int, law: int, period: float, time_constant: float, dead_time: float
    ) -> ObserverArrays:
        """Return an observer that has no observations yet."""
        known = {
            "law": law,
            "period": period,
            "time_constant": time_constant,
            "dead_time": dead_time,
            "corrected": zeros(RowArrays),  # its arrays are set in each sample
        }
        arrays: ObserverArrays = zeros(cls, {"m": m}, known)
        arrays.seen[:DRIFT] = math.nan
        arrays.after[:DRIFT] = math.nan
        return arrays


load_observer = struct_loader(zeros(ObserverArrays))


@in_place
def correct(own: ObserverArrays, rows: RowArrays) -> None:
    """Observe the drift of this sample, and write the corrected rows.

    They contain σ̇ + d̂, and σ after the dead time.
    """
    for i in range(own.phi.size):
        drift = 0.0
        if rows.K[i] > 0.0:
            drift = observed_drift(
                own.seen[DRIFT, i],
                rows.sigma[i] - own.seen[SIGMA, i],
                0.5 * (rows.sigma_dot[i] + own.seen[SIGMA_DOT, i]),
                rows.switching_gain[i],
                own.period,
                own.time_constant,
            )
        own.after[SIGMA, i] = rows.sigma[i]
        own.after[SIGMA_DOT, i] = rows.sigma_dot[i]
        own.after[DRIFT, i] = drift
        late = own.dead_time * drift
        own.sigma[i] = rows.sigma[i] + late
        own.sigma_dot[i] = rows.sigma_dot[i] + drift
        own.phi[i] = rows.phi[i] + late + rows.K[i] * drift
        own.Lf[i] = rows.Lf[i] + drift


@compiled(RESOLVER, IN_PLACE, from_python=False)
def observe(address: int, rows: RowArrays, task: TaskArrays, answer: Answer) -> int:
    """Compute the command of :class:`vsconstraints.controllers.Observed`."""
    own = load_observer(load_law(address).demand)
    m = own.phi.size
    if rows.sigma.size != m or rows.sigma_dot.size != m or rows.K.size != m or rows.phi.size != m:
        return NEEDS_PYTHON
    correct(own, rows)
    set_fields(
        own.corrected,
        (
            own.phi,
            rows.Lg,
            own.Lf,
            own.sigma,
            own.sigma_dot,
            rows.K,
            rows.switching_gain,
            rows.scale,
            rows.qdd_min,
            rows.qdd_max,
        ),
    )
    resolver = load_law(own.law).resolver
    code: int = call_int_pointer(resolver, (own.law, own.corrected, task, answer))
    if is_answer(code):
        for part in range(3):
            copy_vector(own.seen[part], own.after[part])
    return code
