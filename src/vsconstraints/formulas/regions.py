"""Regions in space, in frames of their own: signed distances, derivatives, and second derivatives along a motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula

SMALL = 1e-9
"""Distance [m] below which a direction or a curvature is taken as that at this distance, so that it stays finite."""


@formula
def sphere(x: Any, y: Any, z: Any, r: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Depth in a sphere r − ‖p‖, its derivatives (eqs. 47 and 48), and ‖p‖; at the centre the direction out is +z."""
    d = np.sqrt(x * x + y * y + z * z)
    inside = d > 0.0
    s = -1.0 / np.where(inside, d, 1.0)
    return r - d, s * x, s * y, np.where(inside, s * z, -1.0), d


@formula
def sphere_curvature(x: Any, y: Any, z: Any, x_dot: Any, y_dot: Any, z_dot: Any) -> Any:
    """ṗᵀ H ṗ of :func:`sphere`: −(‖ṗ‖² − (ṗ·n)²)/‖p‖, n the direction out."""
    d = np.maximum(np.sqrt(x * x + y * y + z * z), SMALL)
    radial = (x * x_dot + y * y_dot + z * z_dot) / d
    return -(x_dot * x_dot + y_dot * y_dot + z_dot * z_dot - radial * radial) / d


@formula
def half_space(x: Any, y: Any, z: Any, x_dot: Any, y_dot: Any, z_dot: Any) -> tuple[Any, Any, Any, Any, Any]:
    """Height above the plane z = 0; its gradient is the normal, and it is not bent."""
    none = 0.0 * z
    return z, none, none, none + 1.0, none


@formula
def box(
    x: Any, y: Any, z: Any, a: Any, b: Any, c: Any, x_dot: Any, y_dot: Any, z_dot: Any
) -> tuple[Any, Any, Any, Any, Any]:
    """Distance to the box |x| ≤ a, |y| ≤ b, |z| ≤ c: ‖max(|x| − h, 0)‖ outside, −min(h − |x|) inside, h = (a, b, c).

    n leads away from the nearest point of the surface, inside towards it: along the first axis of those that are
    equally near, and towards + in the middle. The bend is (‖ẋ_A‖² − (ẋ·n)²)/d with A the axes along which x is beyond
    the box; 0 inside.
    """
    sx, sy, sz = 1.0 - 2.0 * (x < 0.0), 1.0 - 2.0 * (y < 0.0), 1.0 - 2.0 * (z < 0.0)
    beyond_x, beyond_y, beyond_z = np.abs(x) - a, np.abs(y) - b, np.abs(z) - c
    ox, oy, oz = np.maximum(beyond_x, 0.0), np.maximum(beyond_y, 0.0), np.maximum(beyond_z, 0.0)
    length = np.sqrt(ox * ox + oy * oy + oz * oz)
    inside = 1.0 * (length <= 0.0)
    yz, whole = np.maximum(beyond_y, beyond_z), length + inside
    face_x = inside * (beyond_x >= yz)
    face_y = (inside - face_x) * (beyond_y >= beyond_z)
    nx = sx * (ox / whole + face_x)
    ny = sy * (oy / whole + face_y)
    nz = sz * (oz / whole + (inside - face_x - face_y))
    rate = x_dot * nx + y_dot * ny + z_dot * nz
    moving = (ox > 0.0) * x_dot * x_dot + (oy > 0.0) * y_dot * y_dot + (oz > 0.0) * z_dot * z_dot
    bend = (1.0 - inside) * (moving - rate * rate) / np.maximum(length, SMALL)
    return length + np.minimum(np.maximum(beyond_x, yz), 0.0), nx, ny, nz, bend


@formula
def cylinder(
    x: Any, y: Any, z: Any, r: Any, h: Any, x_dot: Any, y_dot: Any, z_dot: Any
) -> tuple[Any, Any, Any, Any, Any]:
    """Distance to the cylinder ρ ≤ r, |z| ≤ h, ρ² = x² + y²: that of (ρ, |z|) to the rectangle of r and h.

    n leads away from the nearest point of the surface, inside towards it: through the side where side and end are
    equally near, along x on the axis, and towards + in the middle. The bend is that of the rectangle's distance, which
    is there only beyond both side and end, and that of ρ: (ẋ² + ẏ² − ρ̇²)/ρ.
    """
    rho = np.sqrt(x * x + y * y)
    on_axis = 1.0 * (rho <= 0.0)
    rx, ry, sz = x / (rho + on_axis) + on_axis, y / (rho + on_axis), 1.0 - 2.0 * (z < 0.0)
    side, end = rho - r, np.abs(z) - h
    out_side, out_end = np.maximum(side, 0.0), np.maximum(end, 0.0)
    length = np.sqrt(out_side * out_side + out_end * out_end)
    inside = 1.0 * (length <= 0.0)
    by_side = inside * (side >= end)
    n_rho, n_z = out_side / (length + inside) + by_side, sz * (out_end / (length + inside) + (inside - by_side))
    rho_dot = x_dot * rx + y_dot * ry
    across = x_dot * x_dot + y_dot * y_dot - rho_dot * rho_dot
    turning = (side > 0.0) * (end > 0.0) * (rho_dot * n_z - z_dot * n_rho)
    bend = n_rho * across / np.maximum(rho, SMALL) + turning * turning / np.maximum(length, SMALL)
    return length + np.minimum(np.maximum(side, end), 0.0), n_rho * rx, n_rho * ry, n_z, bend


@formula
def capsule(
    x: Any, y: Any, z: Any, r: Any, h: Any, x_dot: Any, y_dot: Any, z_dot: Any
) -> tuple[Any, Any, Any, Any, Any]:
    """Distance to the capsule of radius r around the segment |z| ≤ h of the z axis: that to the segment, less r.

    n leads away from the nearest point of the segment, on it along x. The bend is (‖ẋ‖² − (ẋ·n)²) over the distance to
    the segment; beside the segment, without ż.
    """
    away = z - np.minimum(np.maximum(z, -h), h)
    length = np.sqrt(x * x + y * y + away * away)
    on_segment = 1.0 * (length <= 0.0)
    whole = length + on_segment
    nx, ny, nz = x / whole + on_segment, y / whole, away / whole
    along = (np.abs(z) > h) * z_dot
    rate = x_dot * nx + y_dot * ny + along * nz
    bend = (x_dot * x_dot + y_dot * y_dot + along * along - rate * rate) / np.maximum(length, SMALL)
    return length - r, nx, ny, nz, bend
