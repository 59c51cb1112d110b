"""Distortion of a lens: from normalised coordinates of a pinhole to those of the real image, and back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import InvalidInput, shown, unknown_name
from ..formulas import lenses
from ..rows import Array, BoolArray

MAX_STRETCH = 100.0
"""By how much undistorting may stretch the image, or shrink it: beyond, a lens does not count as one to be inverted."""

MAX_RADIUS = 100.0
"""Radius in normalised coordinates up to which that is looked for: 89.4° from the axis."""

ITERATIONS, TOLERANCE, ACCURACY = 50, 1e-14, 1e-12
"""Of Newton's method at most; the error in normalised coordinates at which it ends, and the one that is accepted."""

INSIDE = 0.999
"""Share of the reach within which it starts: there is a kink."""


class LensModel(NamedTuple):
    """A kind of lens: adding one takes two formulas in :mod:`vsconstraints.formulas.lenses`, and its line below.

    Attributes
    ----------
    lens, superellipse
        Its formula, and that of a superellipse on the sensor seen through it.
    counts
        How many coefficients it may have; those that are not given are 0.
    """

    lens: Callable[..., Any]
    superellipse: Callable[..., Any]
    counts: tuple[int, ...]


MODELS = {
    "brown-conrady": LensModel(lenses.brown_conrady, lenses.superellipse_by_brown_conrady, (4, 5, 8)),
    "fisheye": LensModel(lenses.fisheye, lenses.superellipse_by_fisheye, (4,)),
}
"""By the names that scenario files use."""


@dataclass(frozen=True)
class Distortion:
    """A lens with distortion, as OpenCV has it.

    Attributes
    ----------
    model
        ``brown-conrady`` (ROS: plumb_bob, rational_polynomial) or ``fisheye`` (ROS: equidistant).
    coefficients
        (k₁, k₂, p₁, p₂), (…, k₃) or (…, k₃, k₄, k₅, k₆) of the first; (k₁, k₂, k₃, k₄) of the second.

    Raises
    ------
    InvalidInput
        if there is no such model, or it has another number of coefficients.
    """

    model: Literal["brown-conrady", "fisheye"]
    coefficients: Sequence[float]

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise unknown_name("model of distortion", self.model, MODELS)
        try:
            values = tuple(float(value) for value in self.coefficients)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"coefficients of distortion must be numbers, not {shown(self.coefficients)}") from error
        counts = MODELS[self.model].counts
        if len(values) not in counts or not np.isfinite(values).all():
            how_many = " or ".join(map(str, counts))
            raise InvalidInput(
                f"distortion {self.model} has {how_many} finite coefficients, not {len(values)}: {shown(list(values))}"
            )
        object.__setattr__(self, "coefficients", values)

    @property
    def parameters(self) -> tuple[float, ...]:
        """What formulas take: the radius up to which the lens can be inverted, then all its coefficients."""
        return self.reach, *_filled(self)

    @property
    def reach(self) -> float:
        """Radius in normalised coordinates up to which the lens can be inverted; 100 stands for everywhere."""
        return _reach(self)

    def scaled(self, factor: Array) -> Distortion:
        """The same with each coefficient times a factor, which is one number or one per coefficient."""
        return Distortion(self.model, tuple((np.asarray(self.coefficients) * factor).tolist()))

    def apply(self, normalised: Array) -> Array:
        """(..., 2) normalised coordinates in the real image of those of a pinhole.

        Beyond :attr:`reach` it goes on along straight lines from the centre, so that it never folds back.
        """
        x, y = np.moveaxis(np.asarray(normalised, dtype=np.float64), -1, 0)
        reach, *coefficients = self.parameters
        X, Y, *_ = lenses.extended(MODELS[self.model].lens, x, y, reach, coefficients)
        return np.stack((X, Y), axis=-1)

    def remove(self, distorted: Array) -> tuple[Array, BoolArray]:
        """(..., 2) normalised coordinates of a pinhole of those in the real image, and (...) whether that is certain.

        It is not beyond :attr:`reach`. What is NaN stays so.
        """
        image = np.moveaxis(np.asarray(distorted, dtype=np.float64), -1, 0)
        lens, (reach, *coefficients) = MODELS[self.model].lens, self.parameters
        with np.errstate(all="ignore"):
            return _removed(lens, image, reach, coefficients)


def _removed(lens: lenses.Lens, image: Array, reach: float, coefficients: Sequence[float]) -> tuple[Array, BoolArray]:
    """As :meth:`Distortion.remove`, of (2, ...): Newton's method; compiled in :mod:`vsconstraints.compiled.lenses`."""
    x, y = image * np.minimum(1.0, INSIDE * reach / np.maximum(np.hypot(*image), INSIDE * reach))
    dx, dy, off = lenses.newton(lens, (x, y), image, reach, coefficients)
    for _ in range(ITERATIONS):
        if not (off > TOLERANCE).any():
            break
        ahead = x + dx, y + dy
        then_dx, then_dy, then_off = lenses.newton(lens, ahead, image, reach, coefficients)
        # a step that leads away is tried again by half
        nearer = then_off < off
        x, y, off = (np.where(nearer, a, b) for a, b in zip((*ahead, then_off), (x, y, off), strict=True))
        dx, dy = np.where(nearer, then_dx, 0.5 * dx), np.where(nearer, then_dy, 0.5 * dy)
    return np.stack((x, y), axis=-1), ~(off > ACCURACY) & ~(np.hypot(x, y) > reach)


def _filled(distortion: Distortion) -> tuple[float, ...]:
    """All coefficients of the model, 0 where they are not given."""
    missing = max(MODELS[distortion.model].counts) - len(distortion.coefficients)
    return (*distortion.coefficients, *(0.0,) * missing)


@lru_cache(maxsize=64)
def _reach(distortion: Distortion) -> float:
    """How far the derivative's symmetric part is positive in all directions, neither small nor large.

    On a disc, which is convex, a function with a positive one takes every value once.
    """
    radii = np.concatenate((np.linspace(0.0, 3.0, 1001), np.geomspace(3.0, MAX_RADIUS, 200)[1:]))
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    x, y = radii[:, None] * np.cos(angles), radii[:, None] * np.sin(angles)
    with np.errstate(all="ignore"):
        *_, a, b, c, d = MODELS[distortion.model].lens(x, y, *_filled(distortion))
        mean, spread = 0.5 * (a + d), np.hypot(0.5 * (a - d), 0.5 * (b + c))
        usable = (mean - spread > 1.0 / MAX_STRETCH) & (mean + spread < MAX_STRETCH)
        folds = ~usable.all(axis=1)
    return float(radii[max(int(np.argmax(folds)) - 1, 1)] if folds.any() else MAX_RADIUS)
