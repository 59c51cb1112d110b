"""What the rows of constraints share, whatever formula they are made of."""

from __future__ import annotations

from typing import Any

from ..formulas.motion import displacement
from ..formulas.vectors import Vector
from .compiler import in_place
from .parts import load_step


@in_place
def displaced(motion: Any, t: float) -> tuple[Vector, Vector, Vector]:
    """Displacement, velocity and acceleration of a MOTION."""
    x = displacement(t, motion.velocity[0], motion.amplitude[0], motion.rate, motion.phase)
    y = displacement(t, motion.velocity[1], motion.amplitude[1], motion.rate, motion.phase)
    z = displacement(t, motion.velocity[2], motion.amplitude[2], motion.rate, motion.phase)
    return (x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])


@in_place
def obstacle_motion(part: Any, t: float) -> tuple[Vector, Vector, Vector]:
    """How far what a constraint forbids has moved, and how it moves, as far as that is known."""
    moved, velocity, acceleration = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if part.moves:
        moved, velocity, acceleration = displaced(part.motion, t)
        if not part.known:
            velocity, acceleration = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return moved, velocity, acceleration


@in_place
def write_row(address: int, row: int, K: float, sigma: float, sigma_dot: float, drift: float) -> None:
    """Write all of a row but L_gφ: φ = σ + K σ̇ and L_fφ = σ̇ + K σ̈, with σ̈ as it is when q̈ = 0."""
    rows = load_step(address).rows
    rows.sigma[row], rows.sigma_dot[row] = sigma, sigma_dot
    rows.phi[row], rows.Lf[row] = sigma + K * sigma_dot, sigma_dot + K * drift
