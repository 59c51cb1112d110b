"""QP solvers by name: DAQP and ProxQP called directly, all others through qpsolvers."""

from __future__ import annotations

import warnings
from importlib import import_module
from importlib.metadata import metadata
from importlib.util import find_spec
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import ConfigurationError, SolverError, unknown_name
from ..rows import Array
from .scaling import equilibrate
from .solver import Answer, Infeasible, QPSolver, require


class DaqpSolver(QPSolver):
    """A dual active-set method in C: exact, the fastest on small problems, and without memory between calls.

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
            if flag == 1:
                return Answer(np.asarray(x), np.asarray(info["lam"]), int(info["iterations"]))
        if flag == -1:
            raise Infeasible("daqp says that the rows contradict each other")
        raise SolverError(f"daqp gave up with exit flag {flag}")


class ProxqpSolver(QPSolver):
    """A proximal augmented Lagrangian method in C++, started afresh at every call.

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
        settings.eps_abs = settings.eps_rel = self.accuracy
        settings.eps_primal_inf = settings.eps_dual_inf = 1e-12
        # problems it can solve take far less; the defaults let the others take seconds
        settings.max_iter = settings.max_iter_in = 100
        settings.default_mu_in = 1e-5
        settings.compute_timings = False
        settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS
        problem.init(scaled.P, scaled.q, None, None, scaled.G, np.full(h.size, -1e20), scaled.h)
        problem.solve()
        results = problem.results
        if results.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
            raise SolverError(f"proxqp gave up with {results.info.status.name}")
        return Answer(*scaled.original(results.x, results.z), int(results.info.iter))


class Settings(NamedTuple):
    """How a solver is asked through qpsolvers.

    Attributes
    ----------
    options
        What it must be told to be accurate enough.
    tolerance
        Accuracy that it was measured to reach; the check decides.
    install
        What to tell pip.
    exact
        Whether it recognises rows that contradict each other, quickly and reliably.
    equilibrated
        Whether it does better on programs that are equilibrated.
    """

    options: dict[str, Any] = {}  # noqa: RUF012 (a default that nobody changes)
    tolerance: float = 1e-6
    install: str = ""
    exact: bool = False
    equilibrated: bool = False


SETTINGS: dict[str, Settings] = {
    "quadprog": Settings({}, 1e-8, '"vsconstraints[quadprog]"', exact=True),
    "osqp": Settings(
        # programs are equilibrated here, which its own scaling would undo; an interval measured in time instead of
        # iterations would make answers differ from run to run
        {"eps_abs": 1e-7, "eps_rel": 0.0, "eps_prim_inf": 1e-12, "eps_dual_inf": 1e-12, "polishing": True}
        | {"sigma": 1e-9, "scaling": 0, "max_iter": 20000, "adaptive_rho_interval": 50},
        install="osqp",
        equilibrated=True,
    ),
    "clarabel": Settings({"tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9, "tol_feas": 1e-9}, 1e-7),
    "piqp": Settings({"eps_abs": 1e-10, "eps_rel": 0.0}),
    "scs": Settings({"eps_abs": 1e-9, "eps_rel": 0.0}),
}
"""Settings by name; solvers that are not among them keep their defaults."""


class QpsolversSolver(QPSolver):
    """A solver known to qpsolvers by name, for example ``"clarabel"``. Keeps nothing between calls."""

    def __init__(self, name: str) -> None:
        self.name, self._settings = name, SETTINGS.get(name, Settings())
        self.tolerance, self.recognises_infeasibility = self._settings.tolerance, self._settings.exact
        # qpsolvers itself takes long to import, since it tries all solvers: that has time until the first problem
        if self._settings.install:
            require(name, name, f"pip install {self._settings.install}")
        if find_spec("qpsolvers") is None:
            require("qpsolvers", name, f"pip install qpsolvers {name}")

    def attempt(self, P: Array, q: Array, G: Array, h: Array) -> Answer:
        """Ask the solver, in the matrix form that it takes."""
        qpsolvers = require("qpsolvers", self.name, f"pip install qpsolvers {self.name}")
        matrix: Any = np.ascontiguousarray
        if self.name not in qpsolvers.dense_solvers:
            matrix = import_module("scipy.sparse").csc_matrix
        scaled = equilibrate(P, q, G, h) if self._settings.equilibrated else None
        data = scaled[:4] if scaled else (P, q, G, h)
        with warnings.catch_warnings():
            # qpsolvers warns of what the solver reports; here that is read from the solution instead.
            warnings.simplefilter("ignore")
            solution = qpsolvers.solve_problem(
                qpsolvers.Problem(matrix(data[0]), data[1], matrix(data[2]), data[3]),
                solver=self.name,
                **self._settings.options,
            )
        if not solution.found or solution.x is None or solution.z is None:
            raise (Infeasible if self._settings.exact else SolverError)(f"{self.name} found no solution")
        x, multipliers = np.asarray(solution.x, dtype=np.float64), np.asarray(solution.z, dtype=np.float64)
        if scaled:
            return Answer(*scaled.original(x, multipliers), _iterations(solution.extras))
        return Answer(x, multipliers, _iterations(solution.extras))


def _iterations(extras: dict[str, Any]) -> int:
    """How often the solver iterated, where qpsolvers tells."""
    found = extras.get("iterations", getattr(extras.get("info"), "iter", 0))
    return int(np.ravel(found if found is not None else 0)[0])


NATIVE: dict[str, type[QPSolver]] = {"daqp": DaqpSolver, "proxqp": ProxqpSolver}
"""Solvers that are called without any layer in between."""


def solver_names() -> tuple[str, ...]:
    """Names of the solvers that can be asked for: the native ones and whatever qpsolvers finds installed.

    ``quadprog`` is named even where it is not installed, so that asking for it tells how to install it.
    """
    others = import_module("qpsolvers").available_solvers if find_spec("qpsolvers") else ()
    return tuple(sorted({*NATIVE, "osqp", "quadprog", *others}))


def make_solver(name: str) -> QPSolver:
    """Create the solver of this name.

    Raises
    ------
    ConfigurationError
        if the name is not known, or if the solver's package cannot be imported.
    """
    if name in NATIVE:
        return NATIVE[name]()
    if name in SETTINGS and SETTINGS[name].install:
        return QpsolversSolver(name)
    names = solver_names()  # only now: it imports every solver that qpsolvers finds
    if name not in names:
        if name in (metadata("qpsolvers").get_all("Provides-Extra") or ()):
            raise ConfigurationError(
                f'the solver {name!r} is not installed. Install it with: pip install "qpsolvers[{name}]"'
            )
        raise unknown_name("QP solver", name, names)
    return QpsolversSolver(name)
