"""Strictly convex quadratic programs behind one small interface, with every answer checked.

:class:`SolverChain` is what a controller uses: it asks the solver it was told to use, checks the answer by
its optimality conditions, and turns to another solver if the answer fails the check.
"""

from .backends import make_solver, solver_names
from .chain import FALLBACKS, SolverChain, Verified
from .optimality import OptimalityErrors, optimality_errors
from .solver import Answer, Infeasible, QPSolver

__all__ = [
    "FALLBACKS",
    "Answer",
    "Infeasible",
    "OptimalityErrors",
    "QPSolver",
    "SolverChain",
    "Verified",
    "make_solver",
    "optimality_errors",
    "solver_names",
]
