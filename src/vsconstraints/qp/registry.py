"""QP solvers by name."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import metadata
from importlib.util import find_spec

from ..errors import ConfigurationError, unknown_name
from .daqp_solver import DaqpSolver
from .osqp_solver import OsqpSolver
from .proxqp_solver import ProxqpSolver
from .qpsolvers_solver import QpsolversSolver
from .quadprog_solver import QuadprogSolver
from .solver import QPSolver

NATIVE: dict[str, type[QPSolver]] = {
    "daqp": DaqpSolver,
    "osqp": OsqpSolver,
    "proxqp": ProxqpSolver,
    "quadprog": QuadprogSolver,
}
"""Solvers with a back end of their own, called without any layer in between."""


def solver_names() -> tuple[str, ...]:
    """Names of the solvers that can be asked for: the native ones and whatever qpsolvers finds installed.

    ``quadprog`` is named even where it is not installed, so that asking for it tells how to install it.
    """
    others: tuple[str, ...] = ()
    if find_spec("qpsolvers") is not None:
        others = tuple(import_module("qpsolvers").available_solvers)
    return tuple(sorted({*NATIVE, *others}))


def make_solver(name: str) -> QPSolver:
    """Create the solver of this name.

    Raises
    ------
    ConfigurationError
        if the name is not known, or if the solver's package cannot be imported.
    """
    if name in NATIVE:
        return NATIVE[name]()
    names = solver_names()  # only now: it imports every solver that qpsolvers finds
    if name not in names:
        if name in (metadata("qpsolvers").get_all("Provides-Extra") or ()):
            raise ConfigurationError(
                f'the solver {name!r} is not installed. Install it with: pip install "qpsolvers[{name}]"'
            )
        raise unknown_name("QP solver", name, names)
    return QpsolversSolver(name)
