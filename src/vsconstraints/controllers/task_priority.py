"""Task-priority redundancy resolution, eq. (15), with the rank decisions it needs to be exact."""

from __future__ import annotations

import numpy as np

from ..qp.decomposition import norm, svd
from ..qp.lexicographic import ZERO_GRADIENT
from ..rows import UNKNOWN, Array, BoolArray, Command, Rows, Task
from .least_norm import track


def resolve(
    A1: Array, b1: Array, A2: Array, b2: Array, rank_tolerance: float, rest: Array = UNKNOWN
) -> tuple[Array, Array]:
    """q̈ = A₁† b₁ + (A₂(I − A₁†A₁))† (b₂ − A₂A₁†b₁), or of all q̈ that do as well at both levels the nearest to q̈₀.

    A₂(I − A₁†A₁) loses ranks by construction, so that a cut-off relative to its own largest singular value can keep
    pure rounding. The rank of A₁ is therefore decided on A₁; the null space is spanned by an orthonormal basis Z; and
    A₂Z is cut relative to the largest singular value of A₂.

    This and :func:`vsconstraints.compiled.least_squares.resolve` are a pair: here singular values by LAPACK, there
    reflections, which compiled code can do on its own arrays. ``test_every_law_answers_alike_in_both_forms`` in
    ``tests/test_laws.py`` holds it together.

    Parameters
    ----------
    A1, b1
        (b, n) and (b,): level 1, b ≥ 1.
    A2, b2
        (k, n) and (k,): level 2.
    rank_tolerance
        Singular values below this fraction of the largest one count as zero, at both levels.
    rest
        q̈₀ (n,), or (0,) for zero. With it, this is what is above of q̈ − q̈₀, b₁ − A₁q̈₀ and b₂ − A₂q̈₀.

    Returns
    -------
    tuple
        q̈ (n,), and the combinations of the rows of A₁ that vanish, (b, b − rank).
    """
    if len(rest):
        way, dependent = resolve(A1, b1 - A1 @ rest, A2, b2 - A2 @ rest, rank_tolerance)
        return rest + way, dependent
    U, s, Vt = svd(A1)
    rank = int((s > rank_tolerance * s[0]).sum())
    qdd = Vt[:rank].T @ ((U[:, :rank].T @ b1) / s[:rank])
    Z = Vt[rank:].T
    if Z.shape[1]:
        U2, s2, V2t = svd(A2 @ Z, full_matrices=False)
        kept = s2 > rank_tolerance * norm(A2)
        qdd = qdd + Z @ (V2t[kept].T @ ((U2[:, kept].T @ (b2 - A2 @ qdd)) / s2[kept]))
    return qdd, U[:, rank:]


def prioritise(rows: Rows, task: Task, acts: BoolArray, demand: Array, rank_tolerance: float) -> Command:
    """The command in which the acting rows have the first level and the task the second.

    Parameters
    ----------
    rows, task
        What the controller was given.
    acts
        (m,) rows that act.
    demand
        (m,) what L_gφ q̈ of those rows must be.
    rank_tolerance
        As for :func:`resolve`; of level 1 once :func:`unit_rows` has made its rows alike.

    Returns
    -------
    Command
        ``rank-loss`` if rows with φ ≥ 0 depend on each other (section 5.2), with the names of those that do. Rows
        that act before their boundary is reached are then met in the least-squares sense.
    """
    if not acts.any():
        return Command(track(task, rank_tolerance), "ok", acts, rows.labels)
    A, b = unit_rows(rows, demand, acts)
    qdd, dependent = resolve(A, b, task.J, task.b, rank_tolerance, task.rest)
    reached = acts & (rows.phi >= 0.0)
    if dependent.shape[1]:
        dependent = dependent_rows(unit_rows(rows, demand, reached)[0], rank_tolerance)
    if not dependent.shape[1]:
        return Command(qdd, "ok", acts, rows.labels)
    involved = np.flatnonzero(reached)[np.abs(dependent).max(axis=1) > 1e-3]
    names = ", ".join(rows.labels[i] for i in involved)
    return Command(qdd, "rank-loss", acts, rows.labels, f"the active rows have lost full row rank; dependent: {names}")


def unit_rows(rows: Rows, demand: Array, which: BoolArray) -> tuple[Array, Array]:
    """L_gφ (b, n) and demands (b,) of some rows, divided by ‖L_gφ‖: dependence must not depend on units.

    A row that no acceleration influences (``ZERO_GRADIENT``) becomes zero. What cannot all be met is then met best as
    a distance in q̈.
    """
    A = rows.Lg[which]
    # the squares of very large and very small numbers would leave the range
    size = np.abs(A).max(axis=1)
    direction = np.divide(A, size[:, None], out=np.zeros_like(A), where=size[:, None] > 0.0)
    length = np.sqrt(np.einsum("ij,ij->i", direction, direction))
    seen = size * length > ZERO_GRADIENT * rows.scale[which]
    direction[~seen] = 0.0
    length[~seen] = size[~seen] = 1.0
    return direction / length[:, None], demand[which] / size / length * seen


def dependent_rows(A: Array, rank_tolerance: float) -> Array:
    """(b, b − rank) combinations of the rows of A (b, n) that vanish."""
    if not len(A):
        return np.empty((0, 0))
    U, s, _ = svd(A)
    return U[:, int((s > rank_tolerance * s[0]).sum()) :]
