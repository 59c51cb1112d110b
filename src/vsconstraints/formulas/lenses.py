"""Lens distortion: image of a point relative to that of an ideal pinhole, with derivatives.

A lens takes normalised coordinates (x, y) = (X/Z, Y/Z) and a tuple of all its coefficients. It
returns (x_d, y_d), then ∂x_d/∂x, ∂x_d/∂y, ∂y_d/∂x and ∂y_d/∂y. Both lenses follow the definitions
of OpenCV: modules calib3d and calib3d/fisheye.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from . import formula, where
from .curves import superellipse

#: x_d, y_d, ∂x_d/∂x, ∂x_d/∂y, ∂y_d/∂x and ∂y_d/∂y.
Distorted = tuple[Any, Any, Any, Any, Any, Any]
Lens = Callable[..., Distorted]

#: Newton's method: greatest number of iterations, error in normalised coordinates at which it ends,
#: and greatest error that is accepted.
ITERATIONS = 50
TOLERANCE = 1e-14
ACCURACY = 1e-12
INSIDE = 0.999  #: Newton's method starts within this share of the reach, because of the kink there.


@formula
def cubic(s, k1, k2, k3) -> tuple[Any, Any]:
    """1 + k₁s + k₂s² + k₃s³ and its derivative with respect to s."""
    value = 1.0 + s * (k1 + s * (k2 + s * k3))
    slope = k1 + s * (2.0 * k2 + s * 3.0 * k3)
    return value, slope


@formula
def brown_conrady(x, y, coefficients) -> Distorted:
    """Radial and tangential distortion (Brown-Conrady).

    x_d = x c + 2 p₁xy + p₂(r² + 2x²) and y_d = y c + p₁(r² + 2y²) + 2 p₂xy, where c = (1 + k₁r² +
    k₂r⁴ + k₃r⁶)/(1 + k₄r² + k₅r⁴ + k₆r⁶).
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    xx = x * x
    yy = y * y
    s = xx + yy  # r²
    over, over_slope = cubic(s, k1, k2, k3)
    under, under_slope = cubic(s, k4, k5, k6)
    c = over / under
    c_slope = (over_slope - c * under_slope) / under
    # radial and both tangential terms of each coordinate
    x_p1 = 2.0 * p1 * x * y
    x_p2 = p2 * (s + 2.0 * x * x)
    x_d = x * c + x_p1 + x_p2
    y_p1 = p1 * (s + 2.0 * y * y)
    y_p2 = 2.0 * p2 * x * y
    y_d = y * c + y_p1 + y_p2
    # half of the derivatives, less the common c
    half_xx = xx * c_slope + p1 * y + 3.0 * p2 * x
    half_xy = x * y * c_slope + p1 * x + p2 * y
    half_yy = yy * c_slope + 3.0 * p1 * y + p2 * x
    dx_dx = c + 2.0 * half_xx
    dx_dy = 2.0 * half_xy
    dy_dy = c + 2.0 * half_yy
    return x_d, y_d, dx_dx, dx_dy, dx_dy, dy_dy


@formula
def fisheye(x, y, coefficients) -> Distorted:
    """Distortion of the angle from the optical axis.

    (x_d, y_d) = (x, y) θ_d/r with r = tan θ and θ_d = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸).
    """
    k1, k2, k3, k4 = coefficients
    squared_radius = x * x + y * y
    r = np.sqrt(squared_radius)
    at_centre = 1.0 * (r <= 0.0)
    angle = np.arctan(r)
    s = angle * angle  # θ²
    # θ_d/θ and dθ_d/dθ
    ratio = 1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))
    slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)))
    # derivatives of the image across the radius, c = θ_d/r, and along it, dθ_d/dr
    divisor = r + at_centre
    angle_per_radius = angle / divisor
    across = angle_per_radius * ratio + at_centre
    along = slope / (1.0 + squared_radius)
    bend = (along - across) / (squared_radius + at_centre)
    x_d = x * across
    y_d = y * across
    dx_dx = across + bend * x * x
    dx_dy = bend * x * y
    dy_dy = across + bend * y * y
    return x_d, y_d, dx_dx, dx_dy, dx_dy, dy_dy


@formula
def extended(lens: Lens, x, y, reach, coefficients) -> Distorted:
    """Lens that is continued beyond the radius ``reach``, one to one along straight lines.

    The lines start at the centre. If the lens is invertible up to that radius, the continued lens
    is invertible everywhere. Farther out the polynomials of the lens may turn back.
    """
    squared_radius = x * x + y * y
    r = np.sqrt(squared_radius)
    is_beyond = r > reach
    beyond = 1.0 * is_beyond
    # factor that moves (x, y) to the nearest point within the reach
    inwards = where(is_beyond, reach / np.maximum(r, reach), 1.0)
    x_within = inwards * x
    y_within = inwards * y
    x_d, y_d, dx_dx, dx_dy, dy_dx, dy_dy = lens(x_within, y_within, coefficients)
    x_d = x_d / inwards
    y_d = y_d / inwards
    # along the radius the image grows in proportion to r: J p = p_d there, by J ← J + (p_d − J p)
    # pᵀ/r²
    divisor = r * r + (1.0 - beyond)
    per_squared_radius = beyond / divisor
    Jp_x = dx_dx * x + dx_dy * y
    Jp_y = dy_dx * x + dy_dy * y
    u = per_squared_radius * (x_d - Jp_x)
    v = per_squared_radius * (y_d - Jp_y)
    return (
        x_d,
        y_d,
        dx_dx + u * x,
        dx_dy + u * y,
        dy_dx + v * x,
        dy_dy + v * y,
    )


@formula
def newton(lens: Lens, at, image, reach, coefficients) -> tuple[Any, Any, Any]:
    """Newton step from (x, y) to the point whose image is (X, Y), and the present error.

    The error is the greater distance of both coordinates between the image of (x, y) and (X, Y).
    """
    x, y = at
    X, Y = image
    x_d, y_d, dx_dx, dx_dy, dy_dx, dy_dy = extended(lens, x, y, reach, coefficients)
    error_x = X - x_d
    error_y = Y - y_d
    determinant = dx_dx * dy_dy - dx_dy * dy_dx
    # Cramer's rule
    numerator_x = dy_dy * error_x - dx_dy * error_y
    numerator_y = dx_dx * error_y - dy_dx * error_x
    step_x = numerator_x / determinant
    step_y = numerator_y / determinant
    distance_x = np.abs(error_x)
    distance_y = np.abs(error_y)
    error = np.maximum(distance_x, distance_y)
    return step_x, step_y, error


@formula
def on_sensor(lens: Lens, u, v, eye) -> Distorted:
    """Pixels on the sensor for ideal pixels, and their derivatives.

    ``eye`` is the camera's attribute of that name: focal lengths, principal point, reach of the
    lens, and its coefficients.
    """
    Fu = eye[0]
    Fv = eye[1]
    u0 = eye[2]
    v0 = eye[3]
    reach = eye[4]
    coefficients = eye[5:]
    x = (u - u0) / Fu
    y = (v - v0) / Fv
    x_d, y_d, dx_dx, dx_dy, dy_dx, dy_dy = extended(lens, x, y, reach, coefficients)
    u_d = Fu * x_d + u0
    v_d = Fv * y_d + v0
    du_dv = dx_dy * Fu / Fv
    dv_du = dy_dx * Fv / Fu
    return u_d, v_d, dx_dx, du_dv, dv_du, dy_dy


@formula
def superellipse_on_sensor(lens: Lens, y, half, n, eye) -> tuple[Any, Any, Any]:
    """Superellipse of half axes (a, b) on the sensor, and its derivatives.

    They are evaluated at ideal pixels y = (u, v).
    """
    a, b = half
    ideal_u, ideal_v = y
    u, v, du_du, du_dv, dv_du, dv_dv = on_sensor(lens, ideal_u, ideal_v, eye)
    value, slope_u, slope_v = superellipse(u, v, a, b, n)
    by_u = slope_u * du_du + slope_v * dv_du
    by_v = slope_u * du_dv + slope_v * dv_dv
    return value, by_u, by_v


@formula
def superellipse_by_brown_conrady(u, v, a, b, n, *eye) -> tuple[Any, Any, Any]:
    """:func:`superellipse_on_sensor` with :func:`brown_conrady`."""
    return superellipse_on_sensor(brown_conrady, (u, v), (a, b), n, eye)


@formula
def superellipse_by_fisheye(u, v, a, b, n, *eye) -> tuple[Any, Any, Any]:
    """:func:`superellipse_on_sensor` with :func:`fisheye`."""
    return superellipse_on_sensor(fisheye, (u, v), (a, b), n, eye)


class LensModel(NamedTuple):
    """Kind of lens: formula, superellipse on the sensor, and permitted numbers of coefficients."""

    lens: Lens
    superellipse: Callable[..., Any]
    counts: tuple[int, ...]


#: Lens models by their names in scenario files. Coefficients that are not given are 0.
MODELS = {
    "brown-conrady": LensModel(brown_conrady, superellipse_by_brown_conrady, (4, 5, 8)),
    "fisheye": LensModel(fisheye, superellipse_by_fisheye, (4,)),
}
