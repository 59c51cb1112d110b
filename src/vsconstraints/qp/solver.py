"""Base class of QP solvers: functions of P, q, G, h whose answer passes the optimality check."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from numbers import Integral
from typing import Any

import numpy as np

from ..errors import ConfigurationError, InvalidInput, SolverError, format_value
from ..rows import Array


@dataclass(frozen=True, slots=True)
class Answer:
    """Minimiser x (n,) and multipliers λ ≥ 0 (m,) of Gx ≤ h.

    ``iterations`` is the solver's count, or 0.
    """

    x: Array
    multipliers: Array
    iterations: int


class Infeasible(SolverError):
    """Raised if the solver reports that no x meets every row."""


@dataclass(frozen=True, slots=True)
class OptimalityErrors:
    """Errors of (x, λ) in the Karush-Kuhn-Tucker conditions; 0 is exact, all are dimensionless.

    With s the size of x (see :func:`optimality_errors`) and p the largest entry of P they are the
    largest (Gx − h)ᵢ / (‖Gᵢ‖ s + |hᵢ|), ‖Px + q + Gᵀλ‖ / (p s), the largest −λᵢ‖Gᵢ‖ / (p s) and |λᵢ
    (Gx − h)ᵢ| / (p s²).
    """

    rows: float
    stationarity: float
    sign: float
    complementarity: float

    @property
    def worst(self) -> float:
        """The largest of the four; NaN if one of them is."""
        return float(np.max([self.rows, self.stationarity, self.sign, self.complementarity]))

    def __str__(self) -> str:
        return (
            f"rows exceeded by {self.rows:.1e}, stationarity off by {self.stationarity:.1e}, "
            f"multipliers negative by {self.sign:.1e}, complementarity off by "
            f"{self.complementarity:.1e}"
        )


def optimality_errors(
    P: Array, q: Array, G: Array, h: Array, x: Array, multipliers: Array
) -> OptimalityErrors:
    """Return the errors of x (n,) and λ (m,), m ≥ 1, in the optimality conditions.

    The program is  min ½xᵀPx + qᵀx  subject to  Gx ≤ h. The size s of x is the largest of ‖q‖/p, of
    the distances −hᵢ/‖Gᵢ‖, and of ‖x‖; 1 if all are zero. The errors are therefore invariant to
    factors on the cost, on a row or on the unit of x.
    """
    norms = np.sqrt(np.einsum("ij,ij->i", G, G))
    has_gradient = norms > 0.0
    distances = -h[has_gradient] / norms[has_gradient]
    farthest = float(distances.max(initial=0.0))
    cost = float(np.abs(P).max())
    pull = float(np.sqrt(q @ q)) / cost
    size = max(pull, farthest, float(np.sqrt(x @ x))) or 1.0
    excess = G @ x - h
    terms = norms * size + np.abs(h)
    terms[terms == 0.0] = 1.0
    residual = P @ x + q + G.T @ multipliers
    slope = cost * size
    worst_sign = (-multipliers * norms).max() / slope
    worst_product = float(np.abs(multipliers * excess).max())
    return OptimalityErrors(
        rows=float(np.maximum(0.0, (excess / terms).max())),
        stationarity=float(np.sqrt(residual @ residual)) / slope,
        sign=float(np.maximum(0.0, worst_sign)),
        complementarity=worst_product / (cost * size * size),
    )


class QPSolver(ABC):
    """Back end for  min ½xᵀPx + qᵀx  subject to  Gx ≤ h, P symmetric and positive definite.

    A new back end defines :attr:`name`, :attr:`tolerance` and :meth:`attempt`. :meth:`solve` checks
    the input before and the answer after. Measurements showed that solvers hang, drop rows or
    return uninitialised memory on numbers that are not finite, and report success with invalid
    answers.
    """

    name: str

    tolerance: float = 1e-6
    """Largest error in :func:`optimality_errors` that an answer of this solver may have."""

    recognises_infeasibility: bool = False
    """True if the solver quickly and reliably recognises rows that contradict each other.

    First-order methods do not.
    """

    def solve(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Minimise ½xᵀPx + qᵀx subject to Gx ≤ h, of P (n, n), q (n,), G (m, n) and h (m,), m ≥ 0.

        Raises
        ------
        InvalidInput
            if a number is not finite; the solver is then not called.
        Infeasible
            if the solver reports that the rows contradict each other.
        SolverError
            if the solver fails, or if its answer is not finite or not optimal within
            :attr:`tolerance`.
        """
        for name, array in (("P", P), ("q", q), ("G", G), ("h", h)):
            if not np.isfinite(array).all():
                raise InvalidInput(f"{name} of the quadratic program is not finite")
        if h.size == 0:
            return Answer(np.linalg.solve(P, -q), np.empty(0), 0)
        try:
            # copies: a solver must not change the program that is checked and passed to others
            given = self.attempt(P.copy(), q.copy(), G.copy(), h.copy())
            answer = self._own(given, q.size, h.size)
        except SolverError:
            raise
        # third-party code may raise anything
        except (Exception, SystemExit) as error:
            raise SolverError(f"{self.name} raised {type(error).__name__}: {error}") from error
        with np.errstate(all="ignore"):
            errors = optimality_errors(P, q, G, h, answer.x, answer.multipliers)
        if not errors.worst <= self.tolerance:
            raise SolverError(f"the answer of {self.name} is not optimal: {errors}")
        return answer

    def _own(self, answer: object, n: int, m: int) -> Answer:
        """Return a checked copy of the answer; raise SolverError if it is invalid.

        Custom solvers are not type-checked.
        """
        if not isinstance(answer, Answer):
            raise SolverError(f"{self.name} returned {_kind(answer)}, not an Answer")
        for name, array, size in (("x", answer.x, n), ("multipliers", answer.multipliers, m)):
            if not (
                type(array) is np.ndarray and array.dtype.kind == "f" and array.shape == (size,)
            ):
                raise SolverError(
                    f"{self.name} returned {_kind(array)} as {name}, not floats of the shape "
                    f"{(size,)}"
                )
            if not np.isfinite(array).all():
                raise SolverError(f"{self.name} returned numbers that are not finite")
        iterations: object = answer.iterations
        if not (isinstance(iterations, Integral) and int(iterations) >= 0):
            raise SolverError(
                f"{self.name} returned {_kind(iterations)} as iterations, not their number"
            )
        return Answer(
            answer.x.astype(np.float64), answer.multipliers.astype(np.float64), int(iterations)
        )

    @abstractmethod
    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Solve a program with finite input and at least one row.

        Raises Infeasible or SolverError if there is no answer.
        """

    def reset(self) -> None:
        """Clear everything that is kept between calls; most solvers keep nothing."""


def _kind(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{type(value).__name__} of {value.dtype} of the shape {value.shape}"
    return (
        format_value(value)
        if isinstance(value, int | float | complex | None)
        else type(value).__name__
    )


def require(module: str, solver: str, install: str) -> Any:
    """Import the package of a solver.

    Raises ConfigurationError, with the command that installs the package, if the import fails.
    """
    try:
        return import_module(module)
    # a broken package, or one built for another NumPy, may raise anything
    except Exception as error:
        raise ConfigurationError(
            f"the solver {solver!r} cannot be used because {module!r} cannot be imported "
            f"({error}). "
            f"Install it with: {install}"
        ) from error
