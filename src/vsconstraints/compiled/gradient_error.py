"""Rows with erroneous gradients, compiled: see :class:`vsconstraints.simulation.sensing.GradientError`."""

from __future__ import annotations

from ..formulas.row import gradient_error
from .compiler import IN_PLACE, compiled
from .parts import address, load_step


@compiled("void(int64, int64)", IN_PLACE, from_python=False)
def apply_gradient_error(step_address: int, in_phi: int) -> None:
    """Put ∇σ_e in place of ∇σ in the rows of a step: in L_gφ, and in φ and L_fφ if so."""
    step = load_step(step_address)
    rows, share = step.rows, step.gradient_share
    for i in range(len(rows.phi)):
        change = 0.0
        for j in range(len(step.qd)):
            error = gradient_error(rows.Lg[i, j], share[i, j])
            rows.Lg[i, j] += error
            change += error * step.qd[j]
        # rows on φ itself have no ∇σ in them
        if in_phi and rows.K[i] > 0.0:
            rows.phi[i] += change
            rows.Lf[i] += change / rows.K[i]


APPLY = address(apply_gradient_error)
"""Where it begins."""
