"""What every QP solver is: a function of P, q, G, h whose answer has passed a check."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from numbers import Integral
from typing import Any

import numpy as np

from ..errors import ConfigurationError, InvalidInput, SolverError, shown
from ..rows import Array
from .optimality import optimality_errors


@dataclass(frozen=True, slots=True)
class Answer:
    """A minimiser of ½xᵀPx + qᵀx subject to Gx ≤ h.

    Attributes
    ----------
    x
        (n,) the minimiser.
    multipliers
        (m,) λ ≥ 0 of the rows Gx ≤ h, with Px + q + Gᵀλ = 0.
    iterations
        How often the solver iterated, as it counts; 0 where it does not tell.
    """

    x: Array
    multipliers: Array
    iterations: int


class Infeasible(SolverError):
    """The solver says that no x meets every row."""


class QPSolver(ABC):
    """One back end for  min ½xᵀPx + qᵀx  subject to  Gx ≤ h  with P symmetric and positive definite.

    A new back end gives :attr:`name`, :attr:`tolerance` and :meth:`attempt`. Solvers were measured to hang,
    to drop rows or to return uninitialised memory on numbers that are not finite, and to report success with
    an answer that is none; so :meth:`solve` checks the input before, and the answer after.
    """

    name: str

    tolerance: float = 1e-6
    """Largest error in :func:`~vsconstraints.qp.optimality_errors` that an answer of this solver may have."""

    recognises_infeasibility: bool = False
    """Whether the solver finds out quickly and reliably that rows contradict each other.

    First-order methods do not: a caller that does not know whether the rows are compatible should find out
    first.
    """

    def solve(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Minimise ½xᵀPx + qᵀx subject to Gx ≤ h.

        Parameters
        ----------
        P, q
            (n, n) symmetric positive definite, and (n,).
        G, h
            (m, n) and (m,); m may be zero.

        Raises
        ------
        InvalidInput
            if a number is not finite; the solver is then not called.
        Infeasible
            if the solver says that the rows contradict each other.
        SolverError
            if the solver fails, or if its answer is not finite or not optimal within :attr:`tolerance`.
        """
        for name, array in (("P", P), ("q", q), ("G", G), ("h", h)):
            if not np.isfinite(array).all():
                raise InvalidInput(f"{name} of the quadratic program is not finite")
        if h.size == 0:
            free: Array = np.linalg.solve(P, -q)
            return Answer(free, np.empty(0), 0)
        try:
            # copies, since what is checked, and asked of others, must be what was asked
            answer = self._own(self.attempt(P.copy(), q.copy(), G.copy(), h.copy()), q.size, h.size)
        except SolverError:
            raise
        except (Exception, SystemExit) as error:
            # Third-party code: whatever it raises means the same here, that it has no answer.
            raise SolverError(f"{self.name} raised {type(error).__name__}: {error}") from error
        with np.errstate(all="ignore"):
            errors = optimality_errors(P, q, G, h, answer.x, answer.multipliers)
        if not errors.worst <= self.tolerance:
            raise SolverError(f"the answer of {self.name} is not optimal: {errors}")
        return answer

    def _own(self, answer: object, n: int, m: int) -> Answer:
        """The answer in arrays of its own, if it is one: own solvers are not type-checked."""
        if not isinstance(answer, Answer):
            raise SolverError(f"{self.name} returned {_kind(answer)}, not an Answer")
        for name, array, size in (("x", answer.x, n), ("multipliers", answer.multipliers, m)):
            if not (type(array) is np.ndarray and array.dtype.kind == "f" and array.shape == (size,)):
                raise SolverError(f"{self.name} returned {_kind(array)} as {name}, not floats of the shape {(size,)}")
            if not np.isfinite(array).all():
                raise SolverError(f"{self.name} returned numbers that are not finite")
        iterations: object = answer.iterations
        if not (isinstance(iterations, Integral) and int(iterations) >= 0):
            raise SolverError(f"{self.name} returned {_kind(iterations)} as iterations, not their number")
        x, multipliers = (array.astype(np.float64) for array in (answer.x, answer.multipliers))
        return Answer(x, multipliers, int(iterations))

    @abstractmethod
    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask the solver, with finite input and at least one row; the answer is checked by :meth:`solve`.

        Raises
        ------
        Infeasible
            if the solver says so.
        SolverError
            if the solver says that it has no answer for another reason.
        """

    def reset(self) -> None:
        """Forget everything kept between calls; most solvers keep nothing."""


def _kind(value: object) -> str:
    """What a solver returned, in a few words."""
    if isinstance(value, np.ndarray):
        return f"{type(value).__name__} of {value.dtype} of the shape {value.shape}"
    return shown(value) if isinstance(value, int | float | complex | None) else type(value).__name__


def require(module: str, solver: str, install: str) -> Any:
    """Import the package of a solver.

    Raises
    ------
    ConfigurationError
        if it cannot be imported; the message says how to install it.
    """
    try:
        return import_module(module)
    except Exception as error:  # a package that is there but broken, or built for another NumPy, raises anything
        raise ConfigurationError(
            f"the solver {solver!r} cannot be used because {module!r} cannot be imported ({error}). "
            f"Install it with: {install}"
        ) from error
