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

Lens = Callable[..., tuple[Any, Any, Any, Any, Any, Any]]

#: Newton's method: greatest number of iterations, error in normalised coordinates at which it ends,
#: and greatest error that is accepted.
ITERATIONS = 50
TOLERANCE = 1e-14
ACCURACY = 1e-12
INSIDE = 0.999  #: Newton's method starts within this share of the reach, because of the kink there.


@formula
def brown_conrady(x: Any, y: Any, coefficients: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Radial and tangential distortion (Brown-Conrady).

    x_d = x c + 2 p₁xy + p₂(r² + 2x²) and y_d = y c + p₁(r² + 2y²) + 2 p₂xy, where c = (1 + k₁r² +
    k₂r⁴ + k₃r⁶)/(1 + k₄r² + k₅r⁴ + k₆r⁶).
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    s = x * x + y * y
    over = 1.0 + s * (k1 + s * (k2 + s * k3))
    under = 1.0 + s * (k4 + s * (k5 + s * k6))
    c = over / under
    # dc/d(r²)
    slope = (k1 + s * (2.0 * k2 + s * 3.0 * k3) - c * (k4 + s * (2.0 * k5 + s * 3.0 * k6))) / under
    across = 2.0 * (x * y * slope + p1 * x + p2 * y)
    return (
        x * c + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * c + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        c + 2.0 * (x * x * slope + p1 * y + 3.0 * p2 * x),
        across,
        across,
        c + 2.0 * (y * y * slope + 3.0 * p1 * y + p2 * x),
    )


@formula
def fisheye(x: Any, y: Any, coefficients: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Distortion of the angle from the optical axis.

    (x_d, y_d) = (x, y) θ_d/r with r = tan θ and θ_d = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸).
    """
    k1, k2, k3, k4 = coefficients
    squared = x * x + y * y
    r = np.sqrt(squared)
    centre = 1.0 * (r <= 0.0)
    angle = np.arctan(r)
    s = angle * angle
    c = angle / (r + centre) * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))) + centre
    along = (1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)))) / (
        1.0 + squared
    )
    bend = (along - c) / (squared + centre)
    return x * c, y * c, c + bend * x * x, bend * x * y, bend * x * y, c + bend * y * y


@formula
def extended(
    lens: Lens, x: Any, y: Any, reach: Any, coefficients: Any
) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Lens that is continued beyond the radius ``reach``, one to one along straight lines.

    The lines start at the centre. If the lens is invertible up to that radius, the continued lens
    is invertible everywhere. Farther out the polynomials of the lens may turn back.
    """
    r = np.sqrt(x * x + y * y)
    beyond = 1.0 * (r > reach)
    share = where(r > reach, reach / np.maximum(r, reach), 1.0)
    X, Y, a, b, c, d = lens(share * x, share * y, coefficients)
    X = X / share
    Y = Y / share
    per = beyond / (r * r + (1.0 - beyond))
    u = per * (X - (a * x + b * y))
    v = per * (Y - (c * x + d * y))
    return X, Y, a + u * x, b + u * y, c + v * x, d + v * y


@formula
def newton(lens: Lens, at: Any, image: Any, reach: Any, coefficients: Any) -> tuple[Any, Any, Any]:
    """Newton step from (x, y) to the point whose image is (X, Y), and the present error.

    The error is the greater distance of both coordinates between the image of (x, y) and (X, Y).
    """
    X, Y, a, b, c, d = extended(lens, at[0], at[1], reach, coefficients)
    u = image[0] - X
    v = image[1] - Y
    determinant = a * d - b * c
    return (
        (d * u - b * v) / determinant,
        (a * v - c * u) / determinant,
        np.maximum(np.abs(u), np.abs(v)),
    )


@formula
def on_sensor(lens: Lens, u: Any, v: Any, eye: Any) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Pixels on the sensor for ideal pixels, and their derivatives.

    ``eye`` is the camera's attribute of that name.
    """
    F = eye[0]
    G = eye[1]
    X, Y, a, b, c, d = extended(lens, (u - eye[2]) / F, (v - eye[3]) / G, eye[4], eye[5:])
    return F * X + eye[2], G * Y + eye[3], a, b * F / G, c * G / F, d


@formula
def superellipse_on_sensor(lens: Lens, y: Any, half: Any, n: Any, eye: Any) -> tuple[Any, Any, Any]:
    """Superellipse of half axes (a, b) on the sensor, and its derivatives.

    They are evaluated at ideal pixels y = (u, v).
    """
    u, v, a, b, c, d = on_sensor(lens, y[0], y[1], eye)
    value, du, dv = superellipse(u, v, half[0], half[1], n)
    return value, du * a + dv * c, du * b + dv * d


@formula
def superellipse_by_brown_conrady(
    u: Any, v: Any, a: Any, b: Any, n: Any, *eye: Any
) -> tuple[Any, Any, Any]:
    """:func:`superellipse_on_sensor` with :func:`brown_conrady`."""
    return superellipse_on_sensor(brown_conrady, (u, v), (a, b), n, eye)


@formula
def superellipse_by_fisheye(
    u: Any, v: Any, a: Any, b: Any, n: Any, *eye: Any
) -> tuple[Any, Any, Any]:
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
