"""QP solvers by name, and chains of them.

Solvers are called through qpsolvers. DAQP and ProxQP are called directly, for the measured reasons
that their classes state: ``python -m benchmarks.qp_back_ends``.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import metadata
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from ..errors import ConfigurationError, SolverError, unknown_name
from ..rows import Array
from .scaling import equilibrate
from .solver import Answer, Infeasible, QPSolver, require

#: Exit flags of DAQP.
DAQP_OPTIMAL = 1
DAQP_INFEASIBLE = -1


class DaqpSolver(QPSolver):
    """A dual active-set method in C: exact, the fastest on small problems, without memory.

    It is called directly: on programs of two to eight joints it then takes 72 µs instead of 106 µs,
    it reports its iterations and whether rows contradict each other, which qpsolvers does not pass
    on, and the first call does not import qpsolvers (0.12 s).

    Reference: Arnström, Bemporad, Axehill, "A dual active-set solver for embedded quadratic
    programming using recursive LDLᵀ updates", IEEE Transactions on Automatic Control, 2022.
    """

    name = "daqp"
    tolerance = 1e-8
    recognises_infeasibility = True

    attempts: tuple[dict[str, float], ...] = (
        {"primal_tol": 1e-9},
        {"primal_tol": 1e-9, "sing_tol": 1e-14},
        {"primal_tol": 1e-7, "sing_tol": 1e-14},
    )
    """Settings, tried in this order until DAQP has an answer.

    Its default ``primal_tol`` lets rows be exceeded by 1e-6. If rows are nearly parallel, the
    solution is far away: 1e-9 is then below rounding, and the default ``sing_tol`` takes the rows
    for dependent. Measurements of both ended in cycling or in false infeasibility.
    """

    def __init__(self) -> None:
        self._solve = require("daqp", "daqp", "pip install daqp").solve

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Solve with DAQP."""
        no_lower_bounds = np.full(h.size, -1e30)
        data = np.ascontiguousarray(P), q, np.ascontiguousarray(G), h, no_lower_bounds
        for settings in self.attempts:
            inequalities = np.zeros(h.size, dtype=np.int32)
            x, _, flag, info = self._solve(*data, inequalities, **settings)
            if flag == DAQP_OPTIMAL:
                return Answer(np.asarray(x), np.asarray(info["lam"]), int(info["iterations"]))
        if flag == DAQP_INFEASIBLE:
            raise Infeasible("daqp reports that the rows contradict each other")
        raise SolverError(f"daqp failed with exit flag {flag}")


class ProxqpSolver(QPSolver):
    """A proximal augmented Lagrangian method in C++, restarted at every call.

    It is called directly: of 400 feasible programs with rows of mixed scale it then solves 284, and
    111 through qpsolvers. The default threshold of its infeasibility test is far too loose for such
    rows, and only the native object allows a tighter one. A reused solver object falsely reports
    infeasibility, or takes a quarter of a second when nothing has changed. A repeated call repeats
    the answer to rounding, not bit by bit.

    Reference: Bambade, El-Kazdadi, Taylor, Carpentier, "ProxQP: yet another quadratic programming
    solver for robotics and beyond", Robotics: Science and Systems, 2022.
    """

    name = "proxqp"
    tolerance = 1e-7

    def __init__(self) -> None:
        self._proxqp = require("proxsuite", "proxqp", "pip install proxsuite").proxqp

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Solve with ProxQP."""
        scaled = equilibrate(P, q, G, h)
        problem = self._proxqp.dense.QP(q.size, 0, h.size)
        settings = problem.settings
        results = problem.results
        settings.eps_abs = settings.eps_rel = 1e-9
        settings.eps_primal_inf = settings.eps_dual_inf = 1e-12
        # solvable problems need far fewer; with the defaults the others take seconds
        settings.max_iter = settings.max_iter_in = 100
        settings.default_mu_in = 1e-5
        settings.compute_timings = False
        settings.initial_guess = self._proxqp.InitialGuess.NO_INITIAL_GUESS
        no_lower_bounds = np.full(h.size, -1e20)
        problem.init(scaled.P, scaled.q, None, None, scaled.G, no_lower_bounds, scaled.h)
        problem.solve()
        if results.info.status != self._proxqp.QPSolverOutput.PROXQP_SOLVED:
            raise SolverError(f"proxqp failed with {results.info.status.name}")
        return Answer(*scaled.original(results.x, results.z), int(results.info.iter))


class Settings(NamedTuple):
    """Settings of a solver in qpsolvers: its options, measured accuracy and pip argument.

    ``exact``: it recognises rows that contradict each other. ``equilibrated``: it performs better
    on equilibrated programs.
    """

    options: dict[str, Any] = {}  # noqa: RUF012 (a default that nobody changes)
    tolerance: float = 1e-6
    install: str = ""
    exact: bool = False
    equilibrated: bool = False


#: Settings by name; all other solvers keep their defaults.
SETTINGS: dict[str, Settings] = {
    "quadprog": Settings({}, 1e-8, '"vsconstraints[quadprog]"', exact=True),
    "osqp": Settings(
        # programs are equilibrated here, which the scaling of OSQP would undo; an interval in time
        # instead of iterations would make answers differ from run to run
        {
            "eps_abs": 1e-7,
            "eps_rel": 0.0,
            "eps_prim_inf": 1e-12,
            "eps_dual_inf": 1e-12,
            "polishing": True,
        }
        | {"sigma": 1e-9, "scaling": 0, "max_iter": 20000, "adaptive_rho_interval": 50},
        install="osqp",
        equilibrated=True,
    ),
    "clarabel": Settings({"tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9, "tol_feas": 1e-9}, 1e-7),
    "piqp": Settings({"eps_abs": 1e-10, "eps_rel": 0.0}),
    "scs": Settings({"eps_abs": 1e-9, "eps_rel": 0.0}),
}


class QpsolversSolver(QPSolver):
    """A solver known to qpsolvers by name, for example ``"clarabel"``.

    Nothing is kept between calls.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._settings = SETTINGS.get(name, Settings())
        self.tolerance = self._settings.tolerance
        self.recognises_infeasibility = self._settings.exact
        # qpsolvers takes long to import, since it tries all solvers: import it at the first problem
        if self._settings.install:
            require(name, name, f"pip install {self._settings.install}")
        if find_spec("qpsolvers") is None:
            require("qpsolvers", name, f"pip install qpsolvers {name}")

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Solve in the matrix form that the solver takes."""
        qpsolvers = require("qpsolvers", self.name, f"pip install qpsolvers {self.name}")
        dense = self.name in qpsolvers.dense_solvers
        matrix: Any = np.ascontiguousarray if dense else import_module("scipy.sparse").csc_matrix
        scaled = None
        if self._settings.equilibrated:
            scaled = equilibrate(P, q, G, h)
            P, q, G, h = scaled[:4]
        with warnings.catch_warnings():
            # qpsolvers repeats the solver's report as warnings; the solution is checked instead
            warnings.simplefilter("ignore")
            problem = qpsolvers.Problem(matrix(P), q, matrix(G), h)
            solution = qpsolvers.solve_problem(problem, solver=self.name, **self._settings.options)
        if not solution.found or solution.x is None or solution.z is None:
            error = Infeasible if self._settings.exact else SolverError
            raise error(f"{self.name} found no solution")
        x: Array = np.asarray(solution.x, dtype=np.float64)
        multipliers: Array = np.asarray(solution.z, dtype=np.float64)
        if scaled:
            x, multipliers = scaled.original(x, multipliers)
        return Answer(x, multipliers, _iterations(solution.extras))


def _iterations(extras: Mapping[str, Any]) -> int:
    """Return the number of iterations that a solver reports by qpsolvers, or 0."""
    count = extras.get("iterations", getattr(extras.get("info"), "iter", 0))
    if count is None:
        return 0
    return int(np.ravel(count)[0])


#: Solvers that are called directly.
NATIVE: dict[str, type[QPSolver]] = {"daqp": DaqpSolver, "proxqp": ProxqpSolver}


def solver_names() -> tuple[str, ...]:
    """Return the names of available solvers: the native ones and those that qpsolvers finds.

    ``quadprog`` is listed even if it is not installed, so that the error of a request tells how to
    install it.
    """
    names = {*NATIVE, "osqp", "quadprog"}
    if find_spec("qpsolvers"):
        names.update(import_module("qpsolvers").available_solvers)
    return tuple(sorted(names))


def make_solver(name: str) -> QPSolver:
    """Create the solver of this name.

    Raises ConfigurationError if it is unknown or its package cannot be imported.
    """
    if name in NATIVE:
        return NATIVE[name]()
    if name in SETTINGS and SETTINGS[name].install:
        return QpsolversSolver(name)
    # this imports every solver that qpsolvers finds
    names = solver_names()
    if name in names:
        return QpsolversSolver(name)
    if name in (metadata("qpsolvers").get_all("Provides-Extra") or ()):
        raise ConfigurationError(
            f"the solver {name!r} is not installed. Install it with: pip install "
            f'"qpsolvers[{name}]"'
        )
    raise unknown_name("QP solver", name, names)


FALLBACKS = ("daqp", "proxqp", "osqp", *(("quadprog",) if find_spec("quadprog") else ()))
"""Solvers that are tried, in this order, when the requested solver has failed.

Three are installed with the package, so that the order is the same on every machine. quadprog is
the last, where a user has installed it.
"""


@dataclass(frozen=True, slots=True)
class Verified:
    """Answer that has passed the check, and the solver that gave it.

    ``fallback`` lists the earlier failures; it is empty if there were none.
    """

    answer: Answer
    solver: str
    fallback: str = ""


class SolverChain:
    """The requested solver, ``preferred``, followed by :data:`FALLBACKS`.

    ``failures`` counts, by name, the problems known to be feasible for which a solver gave no
    verified answer.
    """

    def __init__(self, name: str) -> None:
        self.preferred = make_solver(name)
        self.failures: Counter[str] = Counter()
        self._solvers = {self.preferred.name: self.preferred}

    def solve(self, P: Array, q: Array, G: Array, h: Array) -> Verified:
        """Minimise ½xᵀPx + qᵀx subject to compatible rows Gx ≤ h.

        Raises InvalidInput, without calling a solver, if a number is not finite. Raises
        SolverError, with the failure of each solver, if none gives an answer that passes the check.
        """
        failed: list[str] = []
        for name in dict.fromkeys((self.preferred.name, *FALLBACKS)):
            try:
                if name not in self._solvers:
                    self._solvers[name] = make_solver(name)
                answer = self._solvers[name].solve(P, q, G, h)
                return Verified(answer, name, "; ".join(failed))
            except (SolverError, ConfigurationError) as error:
                # also a false Infeasible, and a fallback whose package is broken on this machine
                self.failures[name] += 1
                failed.append(str(error))
        raise SolverError("no solver gave an answer that passes the check: " + "; ".join(failed))

    def reset(self) -> None:
        """Clear warm starts and counts."""
        self.failures.clear()
        for solver in self._solvers.values():
            solver.reset()
