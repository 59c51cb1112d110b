"""quadprog: the dual method of Goldfarb and Idnani; an optional extra because of its license, the GPL."""

from __future__ import annotations

from ..rows import Array
from .solver import Answer, Infeasible, QPSolver, require


class QuadprogSolver(QPSolver):
    """Goldfarb-Idnani in Cython. Keeps nothing between calls.

    Reference: Goldfarb, Idnani, "A numerically stable dual method for solving strictly convex quadratic
    programs", Mathematical Programming 27, 1983.
    """

    name = "quadprog"
    tolerance = 1e-8
    recognises_infeasibility = True

    def __init__(self) -> None:
        self._solve = require("quadprog", "quadprog", 'pip install "vsconstraints[quadprog]"').solve_qp

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask quadprog, which minimises ½xᵀPx − aᵀx subject to Cᵀx ≥ b."""
        try:
            x, _, _, iterations, multipliers, _ = self._solve(P, -q, -G.T, -h)
        except ValueError as error:
            if "inconsistent" in str(error):
                raise Infeasible("quadprog says that the rows contradict each other") from error
            raise
        return Answer(x, multipliers, int(iterations[0]))
