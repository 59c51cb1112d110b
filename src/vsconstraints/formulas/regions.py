"""Regions in space, in local frames: depth below the surface, derivatives, and curvature.

The depth is positive inside. Its gradient points inwards along the shortest way. The curvature is
the second derivative along a motion.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula
from .limits import between

#: Distance [m] below which directions and curvatures are evaluated as at this distance, so that
#: they stay finite.
SMALL = 1e-9

Depth = tuple[Any, Any, Any, Any]


@formula
def sign(x) -> Any:
    """Sign of a coordinate, 1 at zero."""
    return 1.0 - 2.0 * (x < 0.0)


@formula
def divisor_of(length) -> tuple[Any, Any]:
    """Length, or 1 where it is zero, to divide by; and 1 where it is zero, else 0."""
    is_zero = 1.0 * (length <= 0.0)
    divisor = length + is_zero
    return divisor, is_zero


@formula
def squared(x, y, z) -> Any:
    """x² + y² + z²."""
    return x * x + y * y + z * z


@formula
def sphere(x, y, z, r) -> Depth:
    """Depth r − ‖p‖ in a sphere and its derivatives (eqs. 47 and 48); at the centre n = +z.

    n is the outward direction.
    """
    d = np.sqrt(squared(x, y, z))
    divisor, at_centre = divisor_of(d)
    depth = r - d
    dx = -x / divisor
    dy = -y / divisor
    dz = -z / divisor - at_centre
    return depth, dx, dy, dz


@formula
def sphere_curvature(x, y, z, r, x_dot, y_dot, z_dot) -> Any:
    """ṗᵀ H ṗ of :func:`sphere`: −(‖ṗ‖² − (ṗ·n)²)/‖p‖, with n the outward direction."""
    length = np.sqrt(squared(x, y, z))
    d = np.maximum(length, SMALL)
    product = x * x_dot + y * y_dot + z * z_dot
    radial = product / d
    squared_speed = squared(x_dot, y_dot, z_dot)
    bending = radial * radial - squared_speed
    return bending / d


@formula
def half_space(x, y, z) -> Depth:
    """Depth below the plane z = 0, and its derivatives: minus the normal."""
    none = 0.0 * z
    return -z, none, none, none - 1.0


@formula
def half_space_curvature(x, y, z, x_dot, y_dot, z_dot) -> Any:
    """Zero: a plane is not curved."""
    return 0.0 * z_dot


@formula
def box(x, y, z, a, b, c) -> Depth:
    """Depth in the box |x| ≤ h = (a, b, c): −‖max(|x| − h, 0)‖ outside, min(h − |x|) inside.

    n points outwards to the nearest face. If several faces are equally near, the first axis counts;
    in the middle, the positive direction.
    """
    beyond_x = np.abs(x) - a
    beyond_y = np.abs(y) - b
    beyond_z = np.abs(z) - c
    beyond_yz = np.maximum(beyond_y, beyond_z)
    outside_x = np.maximum(beyond_x, 0.0)
    outside_y = np.maximum(beyond_y, 0.0)
    outside_z = np.maximum(beyond_z, 0.0)
    length = np.sqrt(squared(outside_x, outside_y, outside_z))
    divisor, inside = divisor_of(length)
    # 1 for the nearest face of a point inside, else 0
    face_x = inside * (beyond_x >= beyond_yz)
    face_yz = inside - face_x
    face_y = face_yz * (beyond_y >= beyond_z)
    face_z = face_yz - face_y
    nx = sign(x) * (outside_x / divisor + face_x)
    ny = sign(y) * (outside_y / divisor + face_y)
    nz = sign(z) * (outside_z / divisor + face_z)
    beyond_most = np.maximum(beyond_x, beyond_yz)
    distance = length + np.minimum(beyond_most, 0.0)
    return -distance, -nx, -ny, -nz


@formula
def box_curvature(x, y, z, a, b, c, *velocity) -> Any:
    """ẋᵀ H ẋ of ``box``: −(‖ẋ_A‖² − (ẋ·n)²)/d outside, 0 inside.

    A are the axes along which x lies beyond the box.
    """
    x_dot, y_dot, z_dot = velocity
    depth, nx, ny, nz = box(x, y, z, a, b, c)
    rate = x_dot * nx + y_dot * ny + z_dot * nz
    is_beyond_x = np.abs(x) > a
    is_beyond_y = np.abs(y) > b
    is_beyond_z = np.abs(z) > c
    squared_x = is_beyond_x * x_dot * x_dot
    squared_y = is_beyond_y * y_dot * y_dot
    squared_z = is_beyond_z * z_dot * z_dot
    moving = squared_x + squared_y + squared_z
    is_outside = depth < 0.0
    distance = np.maximum(-depth, SMALL)
    bending = rate * rate - moving
    return is_outside * bending / distance


@formula
def about_axis(x, y) -> tuple[Any, Any, Any]:
    """Distance ρ from the z axis and its derivatives; on the axis, the direction is x."""
    squared_distance = x * x + y * y
    rho = np.sqrt(squared_distance)
    divisor, on_axis = divisor_of(rho)
    rx = x / divisor + on_axis
    ry = y / divisor
    return rho, rx, ry


@formula
def rectangle(rho, z, r, h) -> tuple[Any, Any, Any]:
    """Distance of (ρ, z) to the rectangle ρ ≤ r, |z| ≤ h, and its derivatives.

    Inside, where sides are equally near, the side ρ = r counts first, then the end z = +h.
    """
    beyond_side = rho - r
    beyond_end = np.abs(z) - h
    outside_side = np.maximum(beyond_side, 0.0)
    outside_end = np.maximum(beyond_end, 0.0)
    squared_length = outside_side * outside_side + outside_end * outside_end
    length = np.sqrt(squared_length)
    divisor, inside = divisor_of(length)
    # 1 for the nearest face of a point inside, else 0
    face_side = inside * (beyond_side >= beyond_end)
    face_end = inside - face_side
    n_rho = outside_side / divisor + face_side
    n_z = sign(z) * (outside_end / divisor + face_end)
    beyond_most = np.maximum(beyond_side, beyond_end)
    distance = length + np.minimum(beyond_most, 0.0)
    return distance, n_rho, n_z


@formula
def cylinder(x, y, z, r, h) -> Depth:
    """Depth in the cylinder ρ ≤ r, |z| ≤ h with ρ² = x² + y², and its derivatives.

    It is the depth of (ρ, z) in the rectangle. On the axis the outward direction is along x.
    """
    rho, rx, ry = about_axis(x, y)
    distance, n_rho, n_z = rectangle(rho, z, r, h)
    nx = n_rho * rx
    ny = n_rho * ry
    return -distance, -nx, -ny, -n_z


@formula
def cylinder_curvature(x, y, z, r, h, x_dot, y_dot, z_dot) -> Any:
    """ẋᵀ H ẋ of :func:`cylinder`.

    It is the sum of the curvature of ρ, (ẋ² + ẏ² − ρ̇²)/ρ, and that of the rectangle, which is
    curved only beyond both side and end.
    """
    rho, rx, ry = about_axis(x, y)
    distance, n_rho, n_z = rectangle(rho, z, r, h)
    rho_dot = x_dot * rx + y_dot * ry
    squared_speed = x_dot * x_dot + y_dot * y_dot
    across = squared_speed - rho_dot * rho_dot
    is_beyond_side = rho > r
    is_beyond_end = np.abs(z) > h
    beyond_both = is_beyond_side * is_beyond_end
    along_edge = rho_dot * n_z - z_dot * n_rho
    turning = beyond_both * along_edge
    radius_at_axis = np.maximum(rho, SMALL)
    radius_at_edge = np.maximum(distance, SMALL)
    of_axis = n_rho * across / radius_at_axis
    of_rectangle = turning * turning / radius_at_edge
    return -(of_axis + of_rectangle)


@formula
def from_segment(x, y, z, h) -> tuple[Any, Any, Any, Any]:
    """Distance to the segment |z| ≤ h of the z axis, and its derivatives.

    On the segment the direction is x.
    """
    nearest = between(z, -h, h)
    away = z - nearest
    length = np.sqrt(squared(x, y, away))
    divisor, on_segment = divisor_of(length)
    nx = x / divisor + on_segment
    ny = y / divisor
    nz = away / divisor
    return length, nx, ny, nz


@formula
def capsule(x, y, z, r, h) -> Depth:
    """Depth in the capsule of radius r around the segment |z| ≤ h of the z axis.

    On the segment the outward direction is along x.
    """
    length, nx, ny, nz = from_segment(x, y, z, h)
    return r - length, -nx, -ny, -nz


@formula
def capsule_curvature(x, y, z, r, h, x_dot, y_dot, z_dot) -> Any:
    """ẋᵀ H ẋ of :func:`capsule`: −(‖ẋ‖² − (ẋ·n)²) over the distance to the segment.

    Beside the segment ẋ is taken without ż.
    """
    length, nx, ny, nz = from_segment(x, y, z, h)
    is_beyond_end = np.abs(z) > h
    along = is_beyond_end * z_dot
    rate = x_dot * nx + y_dot * ny + along * nz
    squared_speed = squared(x_dot, y_dot, along)
    radius_of_curvature = np.maximum(length, SMALL)
    bending = rate * rate - squared_speed
    return bending / radius_of_curvature
