"""Arrays of the program of a plan: its cost, its rows, and the workspace of its search.

A plan u has H blocks for n joints. x = (q, q̇) is the motion of the joints by the plan, as double
integrators. The plan minimises

    ½ Σₖ ‖Jₖ (uₖ + K_p qₖ + K_v q̇ₖ) − bₖ‖² + λ ‖uₖ + s qₖ + d q̇ₖ − rₖ‖²

subject to rows σ(τ + Δτ) ≤ e^(−Δτ/κ) σ(τ), linear in x, at N instants, and to a box of u.

Rows are numbered: first those of the constraints, t m + i for constraint i from instant t to the
next; then the upper bounds of the box, k n + j for joint j in block k, and its lower bounds; then
the bounds zᵢ ≥ 0 of the slacks.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ...compiled.linear import QR, constant
from ...rows import Array, IntArray

#: Rows of the workspace behind those of :mod:`.least_distance`, and the total number of rows.
TURNED = constant(5)
SIDE = constant(6)
VECTORS = 7
WORK = f"{VECTORS} p"  #: Axes of these vectors.
#: Parts of a motion: q and q̇ at every instant.
Q, QD = range(2)
#: Rows of an adjoint: gradients of a row with respect to the acceleration of a block, and to q and
#: q̇ of the state before it.
BY_QDD, BY_Q, BY_QD = range(3)


class Cost(NamedTuple):
    """Cost that a plan minimises."""

    #: Duration of a block [s], and λ.
    length: float
    damping: float
    #: (H, 2) K_p and K_v, s and d. These and the following fields are zero in blocks that cannot be
    #: predicted.
    gains: Array
    rest: Array
    #: (H, n, n) JᵀJ, (H, n) Jᵀb, and (H, n) r.
    square: Array
    pull: Array
    free: Array


class Factor(NamedTuple):
    """Riccati factors of the cost: Y, y, L and the inverses of its diagonal, P of the cost-to-go.

    The cost-to-go of a state x is ½ xᵀP x − pᵀx, where the last row of P is p, with this sign.
    """

    Y: Annotated[Array, "H n 2n"]
    y: Annotated[Array, "H n"]
    L: Annotated[Array, "H n n"]
    inverse: Annotated[Array, "H n"]
    P: Annotated[Array, "2n+1 2n"]


class Limits(NamedTuple):
    """Rows along a plan."""

    instants: int  #: N, number of instants that can be predicted.
    #: (N,) block of each instant, and the time since it began [s]; block H is that of the brake.
    block: IntArray
    since: Array
    stop: float  #: Duration of the brake [s].
    #: (N, m) values for the plan without any acceleration, and (N, m, n) gradients with respect to
    #: q, or to q̇ if ``by_speed`` (m,) is not 0.
    value: Array
    gradient: Array
    by_speed: IntArray
    #: (N − 1,) and (N − 1, m): rows are value(t + 1) − fall value(t) ≤ left, multiplied by their
    #: factors.
    falls: Array
    left: Array
    row_factor: Array
    scale: Array  #: (m,) scales of the rows.
    #: (H, n) bounds of the box.
    low: Array
    high: Array


class Space(NamedTuple):
    """Workspace of the search, with p unknowns.

    ``u`` is the plan, and ``x`` (q, q̇) between its blocks and at its ends. ``moved`` are q and q̇
    at every instant. ``normals`` are those of the ``active`` rows, and ``qr`` is their QR. ``held``
    is their number in the previous sample. ``slack`` contains the slacks, in the units of the rows,
    and ``slack_unit`` the excess that a slack z = 1 allows. ``adjoint`` has the rows ``BY_QDD`` to
    ``BY_QD``.
    """

    p: int
    u: Annotated[Array, "H n"]
    x: Annotated[Array, "H+1 2n"]
    moved: Annotated[Array, "2 N n"]
    work: Annotated[Array, WORK]
    normals: Annotated[Array, "p p"]
    qr: QR
    active: Annotated[IntArray, "p"]
    held: Annotated[IntArray, "1"]
    slack: Annotated[Array, "m"]
    slack_unit: Annotated[Array, "m"]
    adjoint: Annotated[Array, "3 n"]


def lengths_of(H: int, N: int, n: int, m: int) -> dict[str, int]:
    """Return the lengths of the axes in declarations.

    They are those of H blocks, up to N instants, n joints and m rows.
    """
    p = H * n + m  # a QR is of up to p active rows
    sums = {"H+1": H + 1, "N-1": N - 1, "2n": 2 * n, "2n+1": 2 * n + 1}
    return {"H": H, "N": N, "n": n, "m": m, "p": p, "c": p, "r": p, **sums}
