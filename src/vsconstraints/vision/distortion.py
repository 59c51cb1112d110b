"""Distortion of a lens: from normalised coordinates of a pinhole to those of the real image, and
back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from ..compiled import load
from ..errors import InvalidInput, shown, unknown_name
from ..formulas.lenses import ACCURACY, MODELS, extended
from ..rows import Array, BoolArray

#: By how much undistorting may stretch the image, or shrink it: beyond, a lens does not count as
#: one to be inverted.
MAX_STRETCH = 100.0
#: Radius in normalised coordinates up to which that is looked for: 89.4° from the axis.
MAX_RADIUS = 100.0


@dataclass(frozen=True)
class Distortion:
    """A lens with distortion, as OpenCV has it.

    Raises
    ------
    InvalidInput
        if there is no such model, or it has another number of coefficients.
    """

    #: ``brown-conrady`` (ROS: plumb_bob, rational_polynomial) or ``fisheye`` (ROS: equidistant).
    model: Literal["brown-conrady", "fisheye"]
    #: (k₁, k₂, p₁, p₂), (…, k₃) or (…, k₃, k₄, k₅, k₆) of the first; (k₁, k₂, k₃, k₄) of the
    #: second.
    coefficients: Sequence[float]

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise unknown_name("model of distortion", self.model, MODELS)
        try:
            values = tuple(float(value) for value in self.coefficients)
        except (TypeError, ValueError) as error:
            raise InvalidInput(
                f"coefficients of distortion must be numbers, not {shown(self.coefficients)}"
            ) from error
        counts = MODELS[self.model].counts
        if len(values) not in counts or not np.isfinite(values).all():
            how_many = " or ".join(map(str, counts))
            raise InvalidInput(
                f"distortion {self.model} has {how_many} finite coefficients, not {len(values)}: "
                f"{shown(list(values))}"
            )
        object.__setattr__(self, "coefficients", values)

    @property
    def parameters(self) -> tuple[float, ...]:
        """What formulas take: the radius up to which the lens can be inverted, then all its
        coefficients.
        """
        return self.reach, *_filled(self)

    @property
    def reach(self) -> float:
        """Radius in normalised coordinates up to which the lens can be inverted; 100 stands for
        everywhere.
        """
        return _reach(self)

    def scaled(self, factor: Array) -> Distortion:
        """The same with each coefficient times a factor, which is one number or one per
        coefficient.
        """
        return Distortion(self.model, tuple((np.asarray(self.coefficients) * factor).tolist()))

    def apply(self, normalised: Array) -> Array:
        """(..., 2) normalised coordinates in the real image of those of a pinhole.

        Beyond :attr:`reach` it goes on along straight lines from the centre, so that it never folds
        back.
        """
        x, y = np.moveaxis(np.asarray(normalised, dtype=np.float64), -1, 0)
        reach, *coefficients = self.parameters
        X, Y, *_ = extended(MODELS[self.model].lens, x, y, reach, coefficients)
        return np.stack((X, Y), axis=-1)

    def remove(self, distorted: Array) -> tuple[Array, BoolArray]:
        """(..., 2) normalised coordinates of a pinhole of those in the real image, and (...)
        whether that is certain.

        It is not beyond :attr:`reach`. What is NaN stays so.
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
    """All coefficients of the model, 0 where they are not given."""
    missing = max(MODELS[distortion.model].counts) - len(distortion.coefficients)
    return (*distortion.coefficients, *(0.0,) * missing)


@lru_cache(maxsize=64)
def _reach(distortion: Distortion) -> float:
    """How far the derivative's symmetric part is positive in all directions, neither small nor
    large.

    On a disc, which is convex, a function with a positive one takes every value once.
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
