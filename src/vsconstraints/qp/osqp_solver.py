"""OSQP: an operator-splitting method (ADMM) in C, polished to high accuracy."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..errors import SolverError
from ..rows import Array
from .equilibration import Equilibrated, equilibrate
from .solver import Answer, QPSolver, require

_SOLVED = 1


class OsqpSolver(QPSolver):
    """OSQP with a workspace that is kept, and warm-started, as long as the shapes do not change.

    Reference: Stellato, Banjac, Goulart, Bemporad, Boyd, "OSQP: an operator splitting solver for quadratic
    programs", Mathematical Programming Computation 12, 2020.
    """

    name = "osqp"
    tolerance = 1e-6

    settings: ClassVar[dict[str, Any]] = {
        "verbose": False,
        "eps_abs": 1e-7,
        "eps_rel": 0.0,
        "eps_prim_inf": 1e-12,
        "eps_dual_inf": 1e-12,
        "polishing": True,
        "sigma": 1e-9,
        # The program is scaled here, which its own scaling would undo.
        "scaling": 0,
        "max_iter": 20000,
        # Counted in iterations: an interval measured in time would make answers differ from run to run.
        "adaptive_rho_interval": 50,
    }

    def __init__(self) -> None:
        self._osqp = require("osqp", "osqp", "pip install osqp")
        self._sparse = require("scipy.sparse", "osqp", "pip install scipy")
        self.workspace: Any = None

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask OSQP."""
        scaled = equilibrate(P, q, G, h)
        workspace = self._loaded(scaled)
        self.workspace = None  # until it has proved a good start for the next call
        result = workspace.solve(raise_error=False)
        if result.info.status_val != _SOLVED:
            raise SolverError(f"osqp gave up: {result.info.status}")
        self.workspace = workspace
        return scaled.answer(result.x, result.y, int(result.info.iter))

    def reset(self) -> None:
        """Drop the workspace and with it the warm start."""
        self.workspace = None

    def _loaded(self, problem: Equilibrated) -> Any:
        """Return a workspace with this problem, the kept one if the shapes agree."""
        m, n = problem.G.shape
        # Columns of the upper triangle, one after the other. Entries that happen to be zero are kept, so that the
        # sparsity pattern depends on the shapes alone.
        cost_values = problem.P.T[np.tri(n, dtype=np.bool_)]
        row_values = problem.G.T.ravel()
        workspace = self.workspace
        if workspace is not None and (workspace.n, workspace.m) == (n, m):
            workspace.update(Px=cost_values, q=problem.q, Ax=row_values, u=problem.h)
            return workspace
        starts = np.arange(n + 1)
        cost_indices = np.concatenate([np.arange(j + 1) for j in range(n)])
        workspace = self._osqp.OSQP()
        workspace.setup(
            self._sparse.csc_matrix((cost_values, cost_indices, starts * (starts + 1) // 2), shape=(n, n)),
            problem.q,
            self._sparse.csc_matrix((row_values, np.tile(np.arange(m), n), starts * m), shape=(m, n)),
            np.full(m, -np.inf),
            problem.h,
            **self.settings,
        )
        return workspace
