"""Strictly convex quadratic programs behind one small interface, with checked answers."""

from .backends import FALLBACKS, SolverChain, Verified, make_solver, solver_names
from .solver import Answer, Infeasible, OptimalityErrors, QPSolver, optimality_errors

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
