"""Strictly convex quadratic programs behind one small interface, with every answer checked.

:class:`SolverChain` is what a controller uses: it asks the solver it was told to use, checks the answer by
its optimality conditions, and turns to another solver if the answer fails the check.
"""

from .chain import FALLBACKS, SolverChain, Verified
from .least_distance import LeastDistance, least_distance
from .least_violation import least_violation
from .lexicographic import Cost, Optimum, lexicographic
from .optimality import OptimalityErrors, optimality_errors
from .registry import make_solver, solver_names
from .solver import Answer, Infeasible, QPSolver

__all__ = [
    "FALLBACKS",
    "Answer",
    "Cost",
    "Infeasible",
    "LeastDistance",
    "OptimalityErrors",
    "Optimum",
    "QPSolver",
    "SolverChain",
    "Verified",
    "least_distance",
    "least_violation",
    "lexicographic",
    "make_solver",
    "optimality_errors",
    "solver_names",
]
