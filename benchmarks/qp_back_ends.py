"""Native calls of QP solvers against the same solvers through qpsolvers.

``python -m benchmarks.qp_back_ends`` prints, for DAQP and ProxQP, how many programs each way solves
with a verified answer, and the median time of both, in paired alternation. The programs have the
sizes and scales of those of laws: up to eight joints and 30 rows, and a task with damping.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from vsconstraints.errors import SolverError
from vsconstraints.qp.backends import (
    SETTINGS,
    DaqpSolver,
    ProxqpSolver,
    QpsolversSolver,
    Settings,
)
from vsconstraints.qp.solver import QPSolver
from vsconstraints.rows import Array

PROGRAMS = 400
REPETITIONS = 5
#: The settings of the native calls, as far as qpsolvers passes them on.
THROUGH_QPSOLVERS = {
    "daqp": Settings({"primal_tol": 1e-9}, tolerance=1e-8, exact=True),
    "proxqp": Settings(
        {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 100, "mu_in": 1e-5},
        tolerance=1e-7,
        equilibrated=True,
    ),
}

Program = tuple[Array, Array, Array, Array]


def programs() -> Iterator[Program]:
    """Yield feasible programs: a task J q̈ = b with damping, and rows of different scales."""
    rng = np.random.default_rng(0)
    for _ in range(PROGRAMS):
        n = int(rng.integers(2, 9))
        J = rng.normal(size=(int(rng.integers(1, n + 1)), n))
        b = rng.normal(size=len(J))
        damping = 10.0 ** rng.uniform(-6.0, -2.0)
        size = float((J**2).sum())
        rows = rng.normal(size=(int(rng.integers(2, 31)), n))
        rows *= 10.0 ** rng.uniform(-2.0, 2.0, size=(len(rows), 1))
        inside = rng.normal(size=n)
        slack = np.abs(rows @ rng.normal(size=n)) * rng.integers(0, 2, len(rows))
        yield J.T @ J / size + damping * np.eye(n), -J.T @ b / size, rows, rows @ inside + slack


def least_time(solver: QPSolver, program: Program) -> float:
    """Return the shortest time of several solutions [µs]; NaN without a verified answer."""
    times = []
    for _ in range(REPETITIONS):
        begun = time.perf_counter()
        try:
            solver.solve(*program)
        except SolverError:
            return np.nan
        times.append(1e6 * (time.perf_counter() - begun))
    return min(times)


def main() -> None:
    """Print a line for each solver."""
    SETTINGS.update(THROUGH_QPSOLVERS)
    for native in (DaqpSolver(), ProxqpSolver()):
        ways = native, QpsolversSolver(native.name)
        times = np.empty((PROGRAMS, 2))
        for number, program in enumerate(programs()):
            for way in (0, 1) if number % 2 else (1, 0):
                times[number, way] = least_time(ways[way], program)
        solved = np.isfinite(times)
        both = times[solved.all(axis=1)]
        print(
            f"{native.name}: of {PROGRAMS} programs {solved[:, 0].sum()} native and "
            f"{solved[:, 1].sum()} through qpsolvers; {np.median(both[:, 0]):.0f} and "
            f"{np.median(both[:, 1]):.0f} µs, {np.median(both[:, 1] - both[:, 0]):.0f} µs more in "
            f"pairs"
        )


if __name__ == "__main__":
    main()
