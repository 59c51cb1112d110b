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
        return Distortion(self.model, tuple((np.asarray(self.coefficients) * factor).tolist()))

    def apply(self, normalised: Array) -> Array:
        """Return normalised coordinates (..., 2) in the real image from those of a pinhole.

        Beyond :attr:`reach`, the function continues along straight lines from the centre, so that
        it never folds back.
        """
        x, y = np.moveaxis(np.asarray(normalised, dtype=np.float64), -1, 0)
        reach, *coefficients = self.parameters
        X, Y, *_ = extended(MODELS[self.model].lens, x, y, reach, coefficients)
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
        load("lenses").through(self.model)(eye, flat, ideal, True)
        with np.errstate(all="ignore"):
            off = np.abs(self.apply(ideal) - flat).max(axis=1) > ACCURACY
        certain = ~off & ~(np.hypot(ideal[:, 0], ideal[:, 1]) > self.reach)
        return ideal.reshape(image.shape), certain.reshape(image.shape[:-1])


def _filled(distortion: Distortion) -> tuple[float, ...]:
    """Return all coefficients of the model, 0 for missing ones."""
    missing = max(MODELS[distortion.model].counts) - len(distortion.coefficients)
    return (*distortion.coefficients, *(0.0,) * missing)


@lru_cache(maxsize=64)
def _reach(distortion: Distortion) -> float:
    """Return the radius up to which the distortion is invertible.

    Up to it, the eigenvalues of the symmetric part of the derivative are positive at all angles,
    and neither too small nor too large. A function with a positive definite symmetric part is
    injective on a disc, since a disc is convex.
    """
    radii = np.concatenate((np.linspace(0.0, 3.0, 1001), np.geomspace(3.0, MAX_RADIUS, 200)[1:]))
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    x = radii[:, None] * np.cos(angles)
    y = radii[:, None] * np.sin(angles)
    with np.errstate(all="ignore"):
        *_, a, b, c, d = MODELS[distortion.model].lens(x, y, _filled(distortion))
        mean = 0.5 * (a + d)
        spread = np.hypot(0.5 * (a - d), 0.5 * (b + c))
        usable = (mean - spread > 1.0 / MAX_STRETCH) & (mean + spread < MAX_STRETCH)
        folds = ~usable.all(axis=1)
    return float(radii[max(int(np.argmax(folds)) - 1, 1)] if folds.any() else MAX_RADIUS)
