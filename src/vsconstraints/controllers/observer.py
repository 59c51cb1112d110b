"""Laws on rows with observed drift: motion that the model does not predict."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

from ..compiled import load
from ..rows import Array, BoolArray, Command, Rows, Task
from .base import Controller, Wrapper, require_known
from .compiled import BoundLaw, Wrapped, arrays_of
from .ranges import duration, positive_number


class Observed(Wrapper):
    """Any law, on rows whose drift is observed.

    It is meant for targets and obstacles whose motion is unknown to the model. For each row with a
    σ, d̂ is the rate of change of σ in addition to its σ̇. :func:`.observed_drift` estimates it by
    an extended state observer of first order (Han, IEEE Transactions on Industrial Electronics,
    2009) with the time constant ``observer`` [s]. The law receives σ + d̂ T_d, σ̇ + d̂, L_fφ + d̂,
    and the corresponding φ. T_d is ``dead_time`` [s], the delay with which the quantities that rows
    depend on are measured. Rows on φ itself, such as speeds, the task and all scores are unchanged.

    The observer also takes wrong gradients and noise for drift. :class:`.PredictiveControl` lets
    the drift fade along its plan. Any other law with a model of its own uses only the shift by the
    dead time.
    """

    name = "observed"
    own_uses = ("σ", "σ̇", "K", "T_s", "memory")

    def __init__(self, law: Controller, *, observer: float = 0.1, dead_time: float = 0.0) -> None:
        self.law = law
        self.observer = observer
        self.dead_time = dead_time
        self.factors = law.factors
        self.ignores = law.ignores

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "observer":
            value = positive_number("observer of a law, its time constant [s],", value)
        elif name == "dead_time":
            value = duration("dead_time of a law", value)
        elif name == "law" and hasattr(value, "fading"):
            value = copy(value)  # leaves the caller's law unchanged
        super().__setattr__(name, value)
        is_complete = hasattr(self, "law") and hasattr(self, "observer")
        if name in ("law", "observer") and is_complete and hasattr(self.law, "fading"):
            self.law.fading = self.observer
        if name in ("observer", "dead_time", "law", "period"):
            self._parts = None

    def solve(self, rows: Rows, task: Task) -> Command:
        """Return the command of the law for the corrected rows.

        Raises InvalidInput if the sampling period is unknown, if the rows lack σ, σ̇ or K, or if
        they are not the rows that were observed before.
        """
        own = self._arrays(rows)
        kernels = load("observer")
        kernels.correct(own, arrays_of(rows))
        corrected = replace(
            rows,
            phi=own.phi.copy(),
            Lf=own.Lf.copy(),
            sigma=own.sigma.copy(),
            sigma_dot=own.sigma_dot.copy(),
        )
        command = self.law.command(corrected, task)
        own.seen[:] = own.after
        return command

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        inner = self.law.bind(rows, task, acted, qdd)
        replaced = (
            type(self).command is not Controller.command or type(self).solve is not Observed.solve
        )
        if inner is None or replaced:
            return None
        own = self._arrays(rows, inner.workspace.address)
        law = Wrapped(inner.law, own, load("observer").observe)
        return BoundLaw(inner.resolver, law, rows, task, acted, qdd)

    def _arrays(self, rows: Rows, law: int = 0) -> Any:
        """Return the arrays of the observer of these rows.

        ``law`` is the address of the bound inner law, needed where everything is compiled; 0
        otherwise.
        """
        remembered, made = self._parts or ((), None)
        uses = "sigma", "sigma_dot", "K", "period"
        require_known("a law with an observer", rows, uses, self.period, remembered)
        if made is None or law not in (0, made.law):
            fresh = load("observer").ObserverArrays.of(
                len(rows.labels), law, self.period, self.observer, float(self.dead_time)
            )
            made = fresh if made is None else fresh._replace(seen=made.seen, after=made.after)
            self._parts = rows.labels, made
        return made
