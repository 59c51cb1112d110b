"""A law is a demand and a resolver."""

from __future__ import annotations

import inspect
import math
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ..compiled.workspace import NEEDS_PYTHON
from ..errors import ConfigurationError, InvalidInput, SolverError, shown
from ..formulas.row import Row, asked_for
from ..qp import SolverChain
from ..rows import OPTIONAL, UNKNOWN, Array, BoolArray, Command, Rows, Task, in_box, keep_box
from .base import Controller
from .compiled import NOT_FOR_COMPILED, BoundLaw, CompiledLaw, compiled_law, in_usual_layout
from .demands import USES, Demand
from .ranges import positive
from .resolvers import COMPILED, Resolver
from .resolvers import USES as OF_TASK


class Law(Controller):
    """Rows ask L_gφ q̈ ≤ c by a demand; a resolver shares q̈ among them and the task.

    The parameters of the demand and the options of the resolver are attributes of the law too: set there, they are
    checked, and the part is made anew. It runs compiled where its parts have that form, and there is a compiler. A
    subclass with a ``solve`` of its own is a controller like any other.

    Parameters
    ----------
    demand
        What rows ask for.
    resolver
        Who gets what.

    Attributes
    ----------
    period
        The sampling period [s] that :meth:`reset` was told last; None before.
    memory
        (m, f) what the demand remembers of each row of the last call; :meth:`reset` clears it.
    last_rates
        (m,) L_gφ q̈ of the last call, or (0,) if the demand does not use it; :meth:`reset` clears it.
    remembered
        Labels of the rows that memory and last rates are of; () if there are none.
    solvers
        The QP solver asked and those behind it, with their warm starts and the count of their failures, if the resolver
        needs any; :meth:`reset` clears both.
    """

    name = "law"

    demand: Demand
    resolver: Resolver
    period: float | None
    memory: Array
    last_rates: Array
    remembered: tuple[str, ...]
    solvers: SolverChain | None

    def __init__(self, demand: Demand, resolver: Resolver) -> None:
        for part, kind in ((demand, Demand), (resolver, Resolver)):
            if not isinstance(part, kind):
                raise ConfigurationError(f"a law needs a {kind.__name__}, not {shown(part)}")
        self.period = None
        self.demand, self.resolver = demand, resolver

    def __getattr__(self, name: str) -> Any:
        part = self._part_of(name)
        if part is None:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        return getattr(vars(self)[part], name)

    def __setattr__(self, name: str, value: Any) -> None:
        part = None if hasattr(type(self), name) else self._part_of(name)
        if part is not None:
            name, value = part, replace(vars(self)[part], **{name: value})
        if name == "resolver":
            super().__setattr__("solvers", value.solvers())
        if name in ("demand", "resolver", "period"):
            self._forget()
        super().__setattr__(name, value)

    def _part_of(self, option: str) -> str | None:
        """Which of the two parts has an option of that name, if any has."""
        for part in ("demand", "resolver"):
            if part in vars(self) and any(field.name == option for field in fields(vars(self)[part])):
                return part
        return None

    def __getstate__(self) -> dict[str, Any]:
        """All but addresses, which are those of one process."""
        return {**vars(self), "_compiled": None}

    def __repr__(self) -> str:
        parameters = inspect.signature(type(self)).parameters.values()
        names = [parameter.name for parameter in parameters if parameter.kind is not parameter.VAR_KEYWORD]
        return f"{type(self).__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    def _forget(self) -> None:
        self.memory, self.last_rates = np.empty((0, 0)), np.empty(0)
        self.remembered = ()
        self._compiled: CompiledLaw | None = None

    def reset(self, period: float | None = None) -> None:
        """Forget what demand and solvers remember.

        Parameters
        ----------
        period
            The sampling period T_s [s], if the law is to know it; without one, that of the last reset.
        """
        if period is not None:
            number = positive(period)
            if number is None:
                raise InvalidInput(f"the sampling period must be a positive number of seconds, not {shown(period)}")
            self.period = number
        self._forget()
        if self.solvers is not None:
            self.solvers.reset()

    @property
    def uses(self) -> tuple[str, ...]:
        """What the law uses beside φ, L_gφ, u⁺ and the scale of rows, and J and b of the task, as printed."""
        found = [USES[name] for name in self.demand.uses] + [OF_TASK[name] for name in self.resolver.uses]
        return (*found, "memory") if self.demand.remembers else tuple(found)

    def remark(self, labels: tuple[str, ...]) -> str:
        """What a user should know of these options and rows of these labels, though nothing is wrong; else empty."""
        return self.resolver.remark(labels)

    def command(self, rows: Rows, task: Task) -> Command:
        """See :class:`.Controller`.

        Raises
        ------
        InvalidInput
            also if the demand uses what is not given, or remembers other rows.
        """
        command = self.compute(rows, task)
        return self.define(rows, task) if command is None else command

    def solve(self, rows: Rows, task: Task) -> Command:
        """See the class."""
        m, demand = len(rows.labels), self.demand
        self._prepare(rows)
        kept = self.memory
        remembered = kept

        def asked(purpose: int, tracking: Array | None) -> Array:
            nonlocal remembered
            tracked = math.nan if tracking is None else rows.Lg @ tracking
            row = Row(
                phi=rows.phi,
                Lf=rows.Lf,
                sigma=or_nan(rows.sigma),
                sigma_dot=or_nan(rows.sigma_dot),
                K=or_nan(rows.K),
                switching_gain=rows.switching_gain,
                scale=rows.scale,
                tracked=tracked,
                norm=np.linalg.norm(rows.Lg, axis=1),
                norm_1=np.abs(rows.Lg).sum(axis=1),
                effort=math.nan if tracking is None else np.linalg.norm(tracking),
                last_rate=or_nan(self.last_rates),
                period=math.nan if self.period is None else self.period,
                memory=kept.T,
            )
            value = type(demand).formula(row, *demand.parameters)
            if demand.remembers:
                value, *after = value
                remembered = np.stack([np.broadcast_to(each, (m,)) for each in after], axis=1)
            c = asked_for(value, tracked, purpose, int(demand.relative), int(demand.everywhere))
            c = np.broadcast_to(np.asarray(c, dtype=np.float64), (m,))
            if np.isnan(c).any():
                names = ", ".join(rows.labels[i] for i in np.flatnonzero(np.isnan(c)))
                raise SolverError(f"the demand {demand.name!r} is not a number for {names}")
            return c

        command = self.resolver.solve(rows, task, asked, self.resolver.tracks(demand), self.solvers)
        self.memory[:] = remembered
        if self.last_rates.size:
            self.last_rates[:] = rows.Lg @ in_box(rows, command.qdd)
        remark = self.remark(rows.labels)
        return replace(command, remark=remark) if remark else command

    def _prepare(self, rows: Rows) -> None:
        """Raise InvalidInput if the demand uses what is not given; make room for what it remembers."""
        demand, m = self.demand, len(rows.labels)
        lacking = [f"rows.{name}" for name in OPTIONAL if name in demand.uses and len(getattr(rows, name)) != m]
        if lacking:
            raise InvalidInput(f"the demand {demand.name!r} uses {', '.join(lacking)}, which these rows do not give")
        if "period" in demand.uses and self.period is None:
            raise InvalidInput(
                f"the demand {demand.name!r} uses the sampling period: tell it by reset(period=...) before the first "
                "command"
            )
        if not demand.remembers and "last_rate" not in demand.uses:
            return
        if not self.remembered:
            self.memory = np.tile(np.array(demand.remembers), (m, 1))
            self.last_rates = np.full(m if "last_rate" in demand.uses else 0, math.nan)
            self.remembered = rows.labels
        elif self.remembered != rows.labels:
            raise InvalidInput(
                f"the demand {demand.name!r} remembers other rows, {shown(self.remembered)}: reset() the law before it "
                f"is given those of another scene, {shown(rows.labels)}"
            )

    # --- compiled ---

    def compute(self, rows: Rows, task: Task) -> Command | None:
        """The command at compiled speed; None where :meth:`define` has to be asked.

        That is so without a compiler or a compiled form, for input that is refused, and at a loss of rank.
        """
        try:
            labels = rows.labels
            law = self._compiled
            if law is None or law.labels is not labels:
                law = self._compile(rows)
                if law is None:
                    return None
            code, qdd, acted, slack, iterations = law(rows, task)
            command = self.resolver.command(code, qdd, acted, labels, slack, iterations)
        except NOT_FOR_COMPILED:  # labels that are no names among them
            usual = in_usual_layout(rows, task)
            return usual and self.compute(*usual)
        if command is not None:
            if rows.qdd_max is not UNKNOWN:
                keep_box(rows, command)
            if law.remark:
                command.remark = law.remark
            return command
        if code == NEEDS_PYTHON or self.solvers is None:
            return None
        self.solvers.failures[COMPILED] += 1
        answer = self.define(rows, task)
        reason = f"the {COMPILED} solver has no answer that passes the check"
        return replace(answer, fallback="; ".join(filter(None, (reason, answer.fallback))))

    def _compile(self, rows: Rows) -> CompiledLaw | None:
        if type(self).solve is not Law.solve:
            return None
        law = self._compiled
        if law is not None and law.labels == rows.labels:
            law.labels = rows.labels
            return law
        self._prepare(rows)
        self._compiled = compiled_law(
            self.demand,
            self.resolver,
            rows.labels,
            memory=self.memory,
            last_rates=self.last_rates,
            period=self.period,
        )
        return self._compiled

    def bind(self, rows: Rows, task: Task, acted: BoolArray, qdd: Array) -> BoundLaw | None:
        """See :class:`.Controller`."""
        if type(self).command is not Law.command or "command" in vars(self):
            return None
        law = self._compile(rows)
        return None if law is None else BoundLaw(self.resolver, law, rows, task, acted, qdd)


def or_nan(array: Array) -> Array | float:
    """The array, or NaN where nothing is given."""
    return array if len(array) else math.nan
