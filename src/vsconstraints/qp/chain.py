"""A QP solver with others behind it, for when its answer fails the check."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from importlib.util import find_spec

from ..errors import ConfigurationError, SolverError
from ..rows import Array
from .backends import make_solver
from .solver import Answer, QPSolver

FALLBACKS = ("daqp", "proxqp", "osqp", *(("quadprog",) if find_spec("quadprog") else ()))
"""Who is asked, in this order, when the solver that was asked for has failed.

Three are installed with the package, so that the order is the same on every machine; quadprog comes last, where a user
has installed it.
"""


@dataclass(frozen=True, slots=True)
class Verified:
    """An answer that has passed the check.

    Attributes
    ----------
    answer
        The minimiser and its multipliers.
    solver
        Name of the solver that gave it.
    fallback
        What failed before; empty if the solver that was asked for gave the answer.
    """

    answer: Answer
    solver: str
    fallback: str = ""


class SolverChain:
    """The solver that was asked for, and :data:`FALLBACKS` behind it.

    Attributes
    ----------
    preferred
        The solver that was asked for.
    failures
        By solver name, how many problems known to be feasible it left without an answer that passed the
        check.
    """

    def __init__(self, name: str) -> None:
        self.preferred = make_solver(name)
        self.failures: Counter[str] = Counter()
        self._others: dict[str, QPSolver] = {}

    def solve(self, P: Array, q: Array, G: Array, h: Array) -> Verified:
        """Minimise ½xᵀPx + qᵀx subject to Gx ≤ h, rows that are known to be compatible.

        Raises
        ------
        InvalidInput
            if a number is not finite; no solver is then called.
        SolverError
            if no solver gives an answer that passes the check; says what each of them did.
        """
        failed: list[str] = []
        for name in (self.preferred.name, *(other for other in FALLBACKS if other != self.preferred.name)):
            try:
                answer = self._solver(name).solve(P, q, G, h)
            except (SolverError, ConfigurationError) as error:
                # Infeasible too, which is wrong here; and a fallback whose package is broken on this machine.
                self.failures[name] += 1
                failed.append(str(error))
                continue
            return Verified(answer, name, "; ".join(failed))
        raise SolverError("no solver gave an answer that passes the check: " + "; ".join(failed))

    def reset(self) -> None:
        """Forget warm starts and counts."""
        self.failures.clear()
        for solver in (self.preferred, *self._others.values()):
            solver.reset()

    def _solver(self, name: str) -> QPSolver:
        if name == self.preferred.name:
            return self.preferred
        if name not in self._others:
            self._others[name] = make_solver(name)
        return self._others[name]
