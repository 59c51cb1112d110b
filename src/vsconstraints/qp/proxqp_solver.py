"""ProxQP: a proximal augmented Lagrangian method in C++."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..errors import SolverError
from ..rows import Array
from .equilibration import equilibrate
from .solver import Answer, QPSolver, require


class ProxqpSolver(QPSolver):
    """ProxQP's dense solver, started afresh at every call.

    A kept solver object answers false infeasibility, or takes a quarter of a second when nothing has changed;
    a fresh one costs little more than a warm start at this size. The default threshold of its infeasibility
    test is far too loose for rows of mixed scale, and only the native object lets it be tightened.

    Repeating a call repeats the answer to rounding, not bit by bit as with the other solvers: measured, one in ten
    differs by up to 1e-14, however its input is aligned.

    Reference: Bambade, El-Kazdadi, Taylor, Carpentier, "ProxQP: yet another quadratic programming solver for
    robotics and beyond", Robotics: Science and Systems, 2022.
    """

    name = "proxqp"
    tolerance = 1e-7

    accuracy: ClassVar[float] = 1e-9
    """Absolute accuracy asked of the solver (primal and dual residual)."""

    def __init__(self) -> None:
        self._proxqp = require("proxsuite", "proxqp", "pip install proxsuite").proxqp

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask ProxQP."""
        proxqp = self._proxqp
        scaled = equilibrate(P, q, G, h)
        problem = proxqp.dense.QP(q.size, 0, h.size)
        settings = problem.settings
        settings.eps_abs = self.accuracy
        settings.eps_rel = self.accuracy
        settings.eps_primal_inf = 1e-12
        settings.eps_dual_inf = 1e-12
        # Problems it can solve take far less; the defaults let the others take seconds.
        settings.max_iter = 100
        settings.max_iter_in = 100
        settings.default_mu_in = 1e-5
        settings.compute_timings = False
        settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS
        problem.init(scaled.P, scaled.q, None, None, scaled.G, np.full(h.size, -1e20), scaled.h)
        problem.solve()
        results = problem.results
        if results.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
            raise SolverError(f"proxqp gave up with {results.info.status.name}")
        return scaled.answer(results.x, results.z, int(results.info.iter))
