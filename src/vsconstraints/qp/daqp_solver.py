"""DAQP: a dual active-set method in C; exact and the fastest on small problems."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..errors import SolverError
from ..rows import Array
from .solver import Answer, Infeasible, QPSolver, require

_OPTIMAL, _INFEASIBLE = 1, -1


class DaqpSolver(QPSolver):
    """The default. Keeps nothing between calls: a cold start costs a few microseconds.

    Reference: Arnström, Bemporad, Axehill, "A dual active-set solver for embedded quadratic programming using
    recursive LDLᵀ updates", IEEE Transactions on Automatic Control, 2022.
    """

    name = "daqp"
    tolerance = 1e-8
    recognises_infeasibility = True

    attempts: ClassVar[tuple[dict[str, float], ...]] = (
        {"primal_tol": 1e-9},
        {"primal_tol": 1e-9, "sing_tol": 1e-14},
        {"primal_tol": 1e-7, "sing_tol": 1e-14},
    )
    """Settings, tried in this order until DAQP has an answer.

    Its default ``primal_tol`` lets rows be exceeded by 1e-6. But where rows are nearly parallel the solution is far
    away: 1e-9 is then below rounding, and the default ``sing_tol`` takes the rows for dependent; both were measured to
    end in cycling or in a false claim of infeasibility.
    """

    def __init__(self) -> None:
        self._solve = require("daqp", "daqp", "pip install daqp").solve

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask DAQP."""
        m = h.size
        data = np.ascontiguousarray(P), q, np.ascontiguousarray(G), h, np.full(m, -1e30)
        for settings in self.attempts:
            x, _, flag, info = self._solve(*data, np.zeros(m, dtype=np.int32), **settings)
            if flag == _OPTIMAL:
                break
        if flag == _INFEASIBLE:
            raise Infeasible("daqp says that the rows contradict each other")
        if flag != _OPTIMAL:
            raise SolverError(f"daqp gave up with exit flag {flag}")
        return Answer(np.asarray(x), np.asarray(info["lam"]), int(info["iterations"]))
