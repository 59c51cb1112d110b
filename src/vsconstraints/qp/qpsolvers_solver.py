"""Any other solver, through the common interface of qpsolvers."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from ..errors import SolverError
from ..rows import Array
from .solver import Answer, QPSolver, require

_OPTIONS: dict[str, dict[str, Any]] = {
    "clarabel": {"tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9, "tol_feas": 1e-9},
    "piqp": {"eps_abs": 1e-10, "eps_rel": 0.0},
    "scs": {"eps_abs": 1e-9, "eps_rel": 0.0},
}
"""What a solver must be told to be accurate enough; others keep their defaults, and the check decides."""

_TOLERANCES = {"clarabel": 1e-7}
"""Accuracy that these settings were measured to reach; 1e-6 is asked of the others."""


class QpsolversSolver(QPSolver):
    """A solver known to qpsolvers by name, for example ``"clarabel"``. Keeps nothing between calls."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.tolerance = _TOLERANCES.get(name, self.tolerance)
        self._qpsolvers = require("qpsolvers", name, f"pip install qpsolvers {name}")
        self._sparse = require("scipy.sparse", name, "pip install scipy")
        self._wants_sparse = name not in self._qpsolvers.dense_solvers

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask the solver, in the matrix form that it takes."""
        matrix = self._sparse.csc_matrix if self._wants_sparse else np.ascontiguousarray
        with warnings.catch_warnings():
            # qpsolvers warns of what the solver reports; here that is read from the solution instead.
            warnings.simplefilter("ignore")
            solution = self._qpsolvers.solve_problem(
                self._qpsolvers.Problem(matrix(P), q, matrix(G), h),
                solver=self.name,
                **_OPTIONS.get(self.name, {}),
            )
        if not solution.found or solution.x is None or solution.z is None:
            raise SolverError(f"{self.name} found no solution")
        return Answer(
            np.asarray(solution.x, dtype=np.float64),
            np.asarray(solution.z, dtype=np.float64),
            int(solution.extras.get("iterations", 0) or 0),
        )
