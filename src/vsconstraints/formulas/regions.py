"""Regions in space, in local frames: depth below the surface, derivatives, and curvature.

The depth is positive inside. Its gradient points inwards along the shortest way. The curvature is
the second derivative along a motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula

#: Distance [m] below which directions and curvatures are evaluated as at this distance, so that
#: they stay finite.
SMALL = 1e-9

Depth = tuple[Any, Any, Any, Any]


@formula
def sphere(x: Any, y: Any, z: Any, r: Any) -> Depth:
    """Depth r − ‖p‖ in a sphere and its derivatives (eqs. 47 and 48); at the centre n = +z.

    n is the outward direction.
    """
    d = np.sqrt(x * x + y * y + z * z)
    at_centre = 1.0 * (d <= 0.0)
    whole = d + at_centre
    return r - d, -x / whole, -y / whole, -z / whole - at_centre


@formula
def sphere_curvature(x: Any, y: Any, z: Any, r: Any, x_dot: Any, y_dot: Any, z_dot: Any) -> Any:
    """ṗᵀ H ṗ of :func:`sphere`: −(‖ṗ‖² − (ṗ·n)²)/‖p‖, with n the outward direction."""
    d = np.maximum(np.sqrt(x * x + y * y + z * z), SMALL)
    radial = (x * x_dot + y * y_dot + z * z_dot) / d
    return (radial * radial - (x_dot * x_dot + y_dot * y_dot + z_dot * z_dot)) / d


@formula
def half_space(x: Any, y: Any, z: Any) -> Depth:
    """Depth below the plane z = 0, and its derivatives: minus the normal."""
    none = 0.0 * z
    return -z, none, none, none - 1.0


@formula
def half_space_curvature(x: Any, y: Any, z: Any, x_dot: Any, y_dot: Any, z_dot: Any) -> Any:
    """Zero: a plane is not curved."""
    return 0.0 * z_dot


@formula
def box(x: Any, y: Any, z: Any, a: Any, b: Any, c: Any) -> Depth:
    """Depth in the box |x| ≤ h = (a, b, c): −‖max(|x| − h, 0)‖ outside, min(h − |x|) inside.

    n points outwards to the nearest face. If several faces are equally near, the first axis counts;
    in the middle, the positive direction.
    """
    sx = 1.0 - 2.0 * (x < 0.0)
    sy = 1.0 - 2.0 * (y < 0.0)
    sz = 1.0 - 2.0 * (z < 0.0)
    beyond_x = np.abs(x) - a
    beyond_y = np.abs(y) - b
    beyond_z = np.abs(z) - c
    ox = np.maximum(beyond_x, 0.0)
    oy = np.maximum(beyond_y, 0.0)
    oz = np.maximum(beyond_z, 0.0)
    length = np.sqrt(ox * ox + oy * oy + oz * oz)
    inside = 1.0 * (length <= 0.0)
    yz = np.maximum(beyond_y, beyond_z)
    whole = length + inside
    face_x = inside * (beyond_x >= yz)
    face_y = (inside - face_x) * (beyond_y >= beyond_z)
    nx = sx * (ox / whole + face_x)
    ny = sy * (oy / whole + face_y)
    nz = sz * (oz / whole + (inside - face_x - face_y))
    return -(length + np.minimum(np.maximum(beyond_x, yz), 0.0)), -nx, -ny, -nz


@formula
def box_curvature(x: Any, y: Any, z: Any, a: Any, b: Any, c: Any, *velocity: Any) -> Any:
    """ẋᵀ H ẋ of ``box``: −(‖ẋ_A‖² − (ẋ·n)²)/d outside, 0 inside.

    A are the axes along which x lies beyond the box.
    """
    x_dot, y_dot, z_dot = velocity
    depth, nx, ny, nz = box(x, y, z, a, b, c)
    rate = x_dot * nx + y_dot * ny + z_dot * nz
    moving = (
        (np.abs(x) > a) * x_dot * x_dot
        + (np.abs(y) > b) * y_dot * y_dot
        + (np.abs(z) > c) * z_dot * z_dot
    )
    return (depth < 0.0) * (rate * rate - moving) / np.maximum(-depth, SMALL)


@formula
def about_axis(x: Any, y: Any) -> tuple[Any, Any, Any]:
    """Distance ρ from the z axis and its derivatives; on the axis, the direction is x."""
    rho = np.sqrt(x * x + y * y)
    on_axis = 1.0 * (rho <= 0.0)
    whole = rho + on_axis
    return rho, x / whole + on_axis, y / whole


@formula
def rectangle(rho: Any, z: Any, r: Any, h: Any) -> tuple[Any, Any, Any]:
    """Distance of (ρ, z) to the rectangle ρ ≤ r, |z| ≤ h, and its derivatives.

    Inside, where sides are equally near, the side ρ = r counts first, then the end z = +h.
    """
    side = rho - r
    end = np.abs(z) - h
    sz = 1.0 - 2.0 * (z < 0.0)
    out_side = np.maximum(side, 0.0)
    out_end = np.maximum(end, 0.0)
    length = np.sqrt(out_side * out_side + out_end * out_end)
    inside = 1.0 * (length <= 0.0)
    by_side = inside * (side >= end)
    n_rho = out_side / (length + inside) + by_side
    n_z = sz * (out_end / (length + inside) + (inside - by_side))
    return length + np.minimum(np.maximum(side, end), 0.0), n_rho, n_z


@formula
def cylinder(x: Any, y: Any, z: Any, r: Any, h: Any) -> Depth:
    """Depth in the cylinder ρ ≤ r, |z| ≤ h with ρ² = x² + y², and its derivatives.

    It is the depth of (ρ, z) in the rectangle. On the axis the outward direction is along x.
    """
    rho, rx, ry = about_axis(x, y)
    distance, n_rho, n_z = rectangle(rho, z, r, h)
    return -distance, -(n_rho * rx), -(n_rho * ry), -n_z


@formula
def cylinder_curvature(
    x: Any, y: Any, z: Any, r: Any, h: Any, x_dot: Any, y_dot: Any, z_dot: Any
) -> Any:
    """ẋᵀ H ẋ of :func:`cylinder`.

    It is the sum of the curvature of ρ, (ẋ² + ẏ² − ρ̇²)/ρ, and that of the rectangle, which is
    curved only beyond both side and end.
    """
    rho, rx, ry = about_axis(x, y)
    distance, n_rho, n_z = rectangle(rho, z, r, h)
    rho_dot = x_dot * rx + y_dot * ry
    across = x_dot * x_dot + y_dot * y_dot - rho_dot * rho_dot
    turning = (rho > r) * (np.abs(z) > h) * (rho_dot * n_z - z_dot * n_rho)
    return -(
        n_rho * across / np.maximum(rho, SMALL) + turning * turning / np.maximum(distance, SMALL)
    )


@formula
def from_segment(x: Any, y: Any, z: Any, h: Any) -> tuple[Any, Any, Any, Any]:
    """Distance to the segment |z| ≤ h of the z axis, and its derivatives.

    On the segment the direction is x.
    """
    away = z - np.minimum(np.maximum(z, -h), h)
    length = np.sqrt(x * x + y * y + away * away)
    on_segment = 1.0 * (length <= 0.0)
    whole = length + on_segment
    return length, x / whole + on_segment, y / whole, away / whole


@formula
def capsule(x: Any, y: Any, z: Any, r: Any, h: Any) -> Depth:
    """Depth in the capsule of radius r around the segment |z| ≤ h of the z axis.

    On the segment the outward direction is along x.
    """
    length, nx, ny, nz = from_segment(x, y, z, h)
    return r - length, -nx, -ny, -nz


@formula
def capsule_curvature(
    x: Any, y: Any, z: Any, r: Any, h: Any, x_dot: Any, y_dot: Any, z_dot: Any
) -> Any:
    """ẋᵀ H ẋ of :func:`capsule`: −(‖ẋ‖² − (ẋ·n)²) over the distance to the segment.

    Beside the segment ẋ is taken without ż.
    """
    length, nx, ny, nz = from_segment(x, y, z, h)
    along = (np.abs(z) > h) * z_dot
    rate = x_dot * nx + y_dot * ny + along * nz
    return (rate * rate - (x_dot * x_dot + y_dot * y_dot + along * along)) / np.maximum(
        length, SMALL
    )
