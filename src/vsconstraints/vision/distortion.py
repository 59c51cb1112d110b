"""Lens distortion: conversion between normalised coordinates of a pinhole and the real image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np

from ..compiled import load
from ..errors import InvalidInput, format_value, unknown_name
from ..formulas.lenses import ACCURACY, MODELS, extended
from ..rows import Array, BoolArray

#: Largest factor by which undistorting may stretch or shrink the image; beyond it, the lens counts
#: as not invertible.
MAX_STRETCH = 100.0
#: Largest radius in normalised coordinates that is examined: 89.4° from the axis.
MAX_RADIUS = 100.0


@dataclass(frozen=True)
class Distortion:
    """Lens distortion with the models and coefficients of OpenCV.

    Raises
    ------
    InvalidInput
        if the model is unknown, or has another number of coefficients.
    """

    #: ``brown-conrady`` (ROS: plumb_bob, rational_polynomial) or ``fisheye`` (ROS: equidistant).
    model: Literal["brown-conrady", "fisheye"]
    #: (k₁, k₂, p₁, p₂), (…, k₃) or (…, k₃, k₄, k₅, k₆) for Brown–Conrady; (k₁, k₂, k₃, k₄) for
    #: fisheye.
    coefficients: Sequence[float]
    #: True if the model is assumed, because a calibration file states none.
    assumed: bool = field(default=False, init=False, repr=False, compare=False)

    @classmethod
    def of_unstated_model(cls, coefficients: Sequence[float]) -> Distortion:
        """Return a Brown–Conrady distortion with coefficients from a file that states no model."""
        distortion = cls("brown-conrady", coefficients)
        object.__setattr__(distortion, "assumed", True)
        return distortion

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise unknown_name("model of distortion", self.model, MODELS)
        try:
            values = tuple(float(value) for value in self.coefficients)
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f"coefficients of distortion must be numbers, not {format_value(self.coefficients)}"
            ) from error
        counts = MODELS[self.model].counts
        if len(values) not in counts or not np.isfinite(values).all():
            how_many = " or ".join(map(str, counts))
            raise InvalidInput(
                f"distortion {self.model} has {how_many} finite coefficients, not {len(values)}: "
                f"{format_value(list(values))}"
            )
        object.__setattr__(self, "coefficients", values)

    @property
    def parameters(self) -> tuple[float, ...]:
        """Parameters of the formulas: invertible radius :attr:`reach`, then all coefficients."""
        return self.reach, *_filled(self)

    @property
    def reach(self) -> float:
        """Radius in normalised coordinates up to which the distortion can be inverted.

        The value 100 means that it can be inverted everywhere.
        """
        return _reach(self)

    def scaled(self, factor: Array) -> Distortion:
        """Return the distortion with each coefficient multiplied by a factor.

        ``factor`` is one number, or one per coefficient.
        """
        scaled = np.asarray(self.coefficients) * factor
        return Distortion(self.model, tuple(scaled.tolist()))

    def apply(self, normalised: Array) -> Array:
        """Return normalised coordinates (..., 2) in the real image from those of a pinhole.

        Beyond :attr:`reach`, the function continues along straight lines from the centre, so that
        it never folds back.
        """
        points = np.asarray(normalised, dtype=np.float64)
        x, y = np.moveaxis(points, -1, 0)
        reach, *coefficients = self.parameters
        lens = MODELS[self.model].lens
        X, Y, *_ = extended(lens, x, y, reach, coefficients)
        return np.stack((X, Y), axis=-1)

    def remove(self, distorted: Array) -> tuple[Array, BoolArray]:
        """Return normalised coordinates (..., 2) of a pinhole from those in the real image.

        The second array (...) is True where the result is certain, which excludes points beyond
        :attr:`reach`. NaN is preserved.
        """
        image = np.asarray(distorted, dtype=np.float64)
        flat = np.ascontiguousarray(image).reshape(-1, 2)
        ideal = np.empty_like(flat)
        eye = np.array((1.0, 1.0, 0.0, 0.0, *self.parameters))
        through_lens = load("lenses").through(self.model)
        through_lens(eye, flat, ideal, True)
        with np.errstate(all="ignore"):
            error = np.abs(self.apply(ideal) - flat)
            is_off = error.max(axis=1) > ACCURACY
        radius = np.hypot(ideal[:, 0], ideal[:, 1])
        is_beyond = radius > self.reach
        certain = ~is_off & ~is_beyond
        return ideal.reshape(image.shape), certain.reshape(image.shape[:-1])


def _filled(distortion: Distortion) -> tuple[float, ...]:
    """Return all coefficients of the model, 0 for missing ones."""
    count = max(MODELS[distortion.model].counts)
    missing = count - len(distortion.coefficients)
    return (*distortion.coefficients, *(0.0,) * missing)


@lru_cache(maxsize=64)
def _reach(distortion: Distortion) -> float:
    """Return the radius up to which the distortion is invertible.

    Up to it, the eigenvalues of the symmetric part of the derivative are positive at all angles,
    and neither too small nor too large. A function with a positive definite symmetric part is
    injective on a disc, since a disc is convex.
    """
    near = np.linspace(0.0, 3.0, 1001)
    far = np.geomspace(3.0, MAX_RADIUS, 200)[1:]
    radii = np.concatenate((near, far))
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    x = radii[:, None] * np.cos(angles)
    y = radii[:, None] * np.sin(angles)
    with np.errstate(all="ignore"):
        lens = MODELS[distortion.model].lens
        *_, dx_dx, dx_dy, dy_dx, dy_dy = lens(x, y, _filled(distortion))
        # eigenvalues of the symmetric part
        mean = 0.5 * (dx_dx + dy_dy)
        half_difference = 0.5 * (dx_dx - dy_dy)
        off_diagonal = 0.5 * (dx_dy + dy_dx)
        spread = np.hypot(half_difference, off_diagonal)
        least = mean - spread
        greatest = mean + spread
        is_usable = (least > 1.0 / MAX_STRETCH) & (greatest < MAX_STRETCH)
        folds = ~is_usable.all(axis=1)
    if not folds.any():
        return MAX_RADIUS
    last_before = int(np.argmax(folds)) - 1
    return float(radii[max(last_before, 1)])
