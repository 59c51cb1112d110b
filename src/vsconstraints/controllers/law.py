"""Base class of laws that consist of a demand and a resolver."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np

from ..compiled.codes import NEEDS_PYTHON, RANK_LOSS
from ..errors import ConfigurationError, InvalidInput, SolverError, format_value
from ..qp import SolverChain
from ..rows import UNKNOWN, Array, BoolArray, Command, Rows, Task, in_box, keep_box
from .base import Controller, require_known
from .compiled import BoundLaw, CompiledLaw, in_usual_layout
from .demand import USES, Demand
from .least_norm import track
from .ranges import positive
from .resolver import COMPILED, Resolver
from .resolver import USES as OF_TASK


@cache
def _options_of(part: Any) -> frozenset[str]:
    return frozenset(field.name for field in fields(part))


class Law(Controller):
    """Law of two parts: a demand bounds L_gφ q̈ ≤ c, a resolver computes q̈ from bounds and task.

    The parameters of the demand and the options of the resolver are attributes of the law, too.
    Setting one checks the value and replaces the part. A subclass that overrides ``solve`` is a
    controller like any other.
    """

    name = "law"

    demand: Demand
    resolver: Resolver
    #: The sampling period [s] of the last :meth:`reset` with one; None before.
    period: float | None
    #: Memory of the demand for each row (m, f), L_gφ q̈ of the last call, (m,) or (0,) if the
    #: demand does not use it, and the labels of these rows, () before the first call.
    #: :meth:`reset` clears all three.
    memory: Array
    last_rates: Array
    remembered: tuple[str, ...]
    #: The requested QP solver and its fallbacks, with warm starts and counts of failures, which
    #: :meth:`reset` clears; None if the resolver needs no solver.
    solvers: SolverChain | None

    def __init__(self, demand: Demand, resolver: Resolver) -> None:
        for part, kind in ((demand, Demand), (resolver, Resolver)):
            if not isinstance(part, kind):
                raise ConfigurationError(f"a law needs a {kind.__name__}, not {format_value(part)}")
        self.period = None
        self.demand = demand
        self.resolver = resolver

    def __getattr__(self, name: str) -> Any:
        part = self._part_of(name)
        if part is None:
            raise AttributeError(
                f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self
            )
        return getattr(vars(self)[part], name)

    def __setattr__(self, name: str, value: Any) -> None:
        part = None if hasattr(type(self), name) else self._part_of(name)
        if part is not None:
            value = replace(vars(self)[part], **{name: value})
            name = part
        if name == "resolver":
            super().__setattr__("solvers", value.solvers())
        if name == "demand" and type(self).solve is Law.solve:
            super().__setattr__("ignores", value.ignores)
        if name in ("demand", "resolver", "period"):
            self._forget()
        super().__setattr__(name, value)

    def _part_of(self, option: str) -> str | None:
        """Return the part that has this option, ``"demand"`` or ``"resolver"``, or None."""
        for name in ("demand", "resolver"):
            part = vars(self).get(name)
            if part is not None and option in _options_of(part.__class__):
                return name
        return None

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_compiled": None}

    def _forget(self) -> None:
        self.memory = np.empty((0, 0))
        self.last_rates = np.empty(0)
        self.remembered = ()
        self._compiled: CompiledLaw | None = None

    def reset(self, period: float | None = None) -> None:
        """Clear the memory of the demand and of the solvers.

        If no sampling period T_s [s] is given, the last one is kept. Raises InvalidInput if it is
        not positive.
        """
        if period is not None:
            number = positive(period)
            if number is None:
                raise InvalidInput(
                    f"the sampling period must be a positive number of seconds, not "
                    f"{format_value(period)}"
                )
            self.period = number
        self._forget()
        if self.solvers is not None:
            self.solvers.reset()

    @property
    def uses(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        known = [USES[name] for name in self.demand.used] + [
            OF_TASK[name] for name in self.resolver.uses
        ]
        return (*known, "memory") if self.demand.remembers else tuple(known)

    @property
    def kernels(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        return (self.resolver.kernel[0],)

    def remark(self, labels: tuple[str, ...]) -> str:
        """See :class:`.Controller`."""
        return self.resolver.remark(labels)

    def command(self, rows: Rows, task: Task) -> Command:
        """See :class:`.Controller`.

        Raises InvalidInput also if the rows lack a quantity that the demand uses, or if its memory
        belongs to other rows.
        """
        command = self.compute(rows, task)
        return self.define(rows, task) if command is None else command

    def solve(self, rows: Rows, task: Task) -> Command:
        """Compute the command step by step, with QP solvers where they are requested or needed.

        The formula of the demand is called from Python.
        """
        demand = self.demand
        resolver = self.resolver
        for name in resolver.uses:
            if getattr(task, name).shape != task.b.shape:
                raise InvalidInput(
                    f"the resolver {resolver.name!r} uses task.{name}, which this task does not "
                    f"give"
                )
        rows, task = in_usual_layout(rows, task) or (rows, task)
        law = self._compile(rows)
        tracking = track(task, self.rank_tolerance) if resolver.tracks(demand) else None
        c = law.demanded(rows, tracking, resolver.purpose)
        undefined = np.flatnonzero(np.isnan(c))
        if undefined.size:
            names = ", ".join(rows.labels[i] for i in undefined)
            raise SolverError(f"the demand {demand.name!r} is not a number for {names}")
        command = resolver.solve(rows, task, c, self.solvers)
        self.memory[:] = law.arrays.after
        if self.last_rates.size:
            self.last_rates[:] = rows.Lg @ in_box(rows, command.qdd)
        return replace(command, remark=law.remark) if law.remark else command

    def compute(self, rows: Rows, task: Task) -> Command | None:
        """Return the command by compiled functions alone; None if :meth:`define` must be used.

        None is returned for invalid input, at a loss of rank, for a formula that does not compile,
        and for a QP solver that is requested by name.
        """
        try:
            labels = rows.labels
            law = self._compiled
            if law is None or law.labels is not labels:
                if type(self).solve is not Law.solve:
                    return None
                law = self._compile(rows)
            if not law.complete:
                return None
            answer = law(rows, task)
            command = self.resolver.command(answer, labels)
        # numba may raise anything for other array types or layouts, and for invalid labels
        except Exception:
            usual = in_usual_layout(rows, task)
            return usual and self.compute(*usual)
        if command is not None:
            if rows.qdd_max is not UNKNOWN:
                keep_box(rows, command)
            if law.remark:
                command.remark = law.remark
            return command
        if answer.code in (NEEDS_PYTHON, RANK_LOSS) or self.solvers is None:
            return None
        self.solvers.failures[COMPILED] += 1
        command = self.define(rows, task)
        reason = f"the {COMPILED} solver has no answer that passes the check"
        return replace(command, fallback="; ".join(filter(None, (reason, command.fallback))))

    def _compile(self, rows: Rows) -> CompiledLaw:
        """Return the compiled law for these rows, with arrays for the memory of its demand."""
        law = self._compiled
        demand = self.demand
        m = len(rows.labels)
        require_known(
            f"the demand {demand.name!r}", rows, demand.used, self.period, self.remembered
        )
        if law is not None and law.labels == rows.labels:
            law.labels = rows.labels
            return law
        if (demand.remembers or "last_rate" in demand.used) and not self.remembered:
            self.memory = np.tile(np.array(demand.remembers), (m, 1))
            self.last_rates = np.full(m if "last_rate" in demand.used else 0, math.nan)
            self.remembered = rows.labels
        memory = {"memory": self.memory, "last_rates": self.last_rates}
        self._compiled = law = CompiledLaw(
            demand, self.resolver, rows.labels, period=self.period, **memory
        )
        law.complete &= type(self).solve is Law.solve
        return law

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        if (
            type(self).command is not Law.command
            or "command" in vars(self)
            or type(self).solve is not Law.solve
        ):
            return None
        law = self._compile(rows)
        return BoundLaw(self.resolver, law, rows, task, acted, qdd) if law.complete else None
