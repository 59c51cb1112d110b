"""What every QP solver is: a function of P, q, G, h whose answer has passed the check of the
optimality conditions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from numbers import Integral
from typing import Any

import numpy as np

from ..errors import ConfigurationError, InvalidInput, SolverError, shown
from ..rows import Array


@dataclass(frozen=True, slots=True)
class Answer:
    """A minimiser x (n,), the multipliers λ ≥ 0 (m,) of Gx ≤ h, and the solver's count of
    iterations, or 0.
    """

    x: Array
    multipliers: Array
    iterations: int


class Infeasible(SolverError):
    """The solver says that no x meets every row."""


@dataclass(frozen=True, slots=True)
class OptimalityErrors:
    """How far (x, λ) is from the Karush-Kuhn-Tucker conditions; 0 is exact, all are dimensionless.

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
    """Errors of x (n,) and λ (m,), m ≥ 1, in the conditions of  min ½xᵀPx + qᵀx  subject to  Gx ≤
    h.

    The size s of x is what the data alone asks for, the largest of ‖q‖/p and of the distances
    −hᵢ/‖Gᵢ‖, or ‖x‖ if that is larger; 1 if all are zero. So multiplying the cost, a row or the
    unit of x by a factor changes nothing.
    """
    norms = np.sqrt(np.einsum("ij,ij->i", G, G))
    cost = float(np.abs(P).max())
    distances = -h[norms > 0.0] / norms[norms > 0.0]
    size = (
        max(float(np.sqrt(q @ q)) / cost, float(distances.max(initial=0.0)), float(np.sqrt(x @ x)))
        or 1.0
    )
    excess = G @ x - h
    terms = norms * size + np.abs(h)
    residual = P @ x + q + G.T @ multipliers
    terms[terms == 0.0] = 1.0
    return OptimalityErrors(
        rows=float(np.maximum(0.0, (excess / terms).max())),
        stationarity=float(np.sqrt(residual @ residual)) / (cost * size),
        sign=float(np.maximum(0.0, (-multipliers * norms).max() / (cost * size))),
        complementarity=float(np.abs(multipliers * excess).max()) / (cost * size * size),
    )


class QPSolver(ABC):
    """One back end for  min ½xᵀPx + qᵀx  subject to  Gx ≤ h  with P symmetric and positive
    definite.

    A new back end has :attr:`name`, :attr:`tolerance` and :meth:`attempt`. Solvers were measured to
    hang, to drop rows or to return uninitialised memory on numbers that are not finite, and to
    report success with an answer that is none; so :meth:`solve` checks the input before, and the
    answer after.
    """

    name: str

    tolerance: float = 1e-6
    """Largest error in :func:`optimality_errors` that an answer of this solver may have."""

    recognises_infeasibility: bool = False
    """Whether the solver finds out quickly and reliably that rows contradict each other;
    first-order methods do not.
    """

    def solve(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Minimise ½xᵀPx + qᵀx subject to Gx ≤ h, of P (n, n), q (n,), G (m, n) and h (m,), m ≥ 0.

        Raises
        ------
        InvalidInput
            if a number is not finite; the solver is then not called.
        Infeasible
            if the solver says that the rows contradict each other.
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
            # copies, since what is checked, and asked of others, must be what was asked
            answer = self._own(self.attempt(P.copy(), q.copy(), G.copy(), h.copy()), q.size, h.size)
        except SolverError:
            raise
        # third-party code: whatever it raises, it has no answer
        except (Exception, SystemExit) as error:
            raise SolverError(f"{self.name} raised {type(error).__name__}: {error}") from error
        with np.errstate(all="ignore"):
            errors = optimality_errors(P, q, G, h, answer.x, answer.multipliers)
        if not errors.worst <= self.tolerance:
            raise SolverError(f"the answer of {self.name} is not optimal: {errors}")
        return answer

    def _own(self, answer: object, n: int, m: int) -> Answer:
        """The answer in arrays of its own, if it is one: users' solvers are not type-checked."""
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
        """Ask the solver, with finite input and at least one row; Infeasible or SolverError if it
        has no answer.
        """

    def reset(self) -> None:
        """Forget everything kept between calls; most solvers keep nothing."""


def _kind(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{type(value).__name__} of {value.dtype} of the shape {value.shape}"
    return shown(value) if isinstance(value, int | float | complex | None) else type(value).__name__


def require(module: str, solver: str, install: str) -> Any:
    """Import the package of a solver; raise ConfigurationError, with the command that installs it,
    if that fails.
    """
    try:
        return import_module(module)
    # a package that is there but broken, or built for another NumPy, raises anything
    except Exception as error:
        raise ConfigurationError(
            f"the solver {solver!r} cannot be used because {module!r} cannot be imported "
            f"({error}). "
            f"Install it with: {install}"
        ) from error
