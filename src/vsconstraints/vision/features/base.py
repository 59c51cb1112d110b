"""Base class of visual features, their goals, and the motion of a feature."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from ...errors import ConfigurationError, InvalidInput, format_value
from ...formulas.tracking import minimum_jerk
from ...robots.geometry import Pose
from ...rows import Array, IntArray
from ..scene import State, interaction_matrix


@dataclass(frozen=True)
class MinimumJerk:
    """Reference trajectory s_ref(t) of eq. (5) from the feature to the goal, at rest at both ends.

    s_ref minus the feature's value at the goal is start · (1 − 10τ³ + 15τ⁴ − 6τ⁵), with τ the share
    of ``duration`` [s] that has elapsed.
    """

    duration: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.duration) and self.duration > 0.0):
            raise InvalidInput(
                f"the duration of a reference trajectory must be positive, not {self.duration}"
            )

    def at(self, elapsed: float, start: Array) -> tuple[Array, Array, Array]:
        """Return s_ref minus the feature's value at the goal, ṡ_ref and s̈_ref, (k,) each.

        ``elapsed`` [s] is the time since the first of them was ``start``.
        """
        left, rate, acceleration = minimum_jerk(elapsed, self.duration)
        return left * start, rate * start, acceleration * start


@dataclass(frozen=True)
class Goal:
    """Desired image of the markers from a given time on."""

    from_time: float  #: Time from which this goal holds [s].
    pixels: Array  #: (m, 2) desired pixels of the markers from the image centre [px].
    normalised: Array  #: (m, 2) desired normalised coordinates.
    #: Desired pose of the camera in the target's frame; None if only the image is given.
    camera: Pose | None = None
    depth: Array | None = None  #: (m,) Z of the markers at the goal [m]; None if unknown.
    #: Trajectory of s_ref to the goal; if None, s_ref is the goal from the start.
    reference: MinimumJerk | None = None
    #: (n,) configuration with the camera at the goal at t = 0, if the goal was given by it.
    q: Array | None = None
    tolerance_factor: float = 1.0  #: Factor on the tolerances of the setup.

    @cached_property
    def interaction(self) -> Array:
        """Interaction matrix (2m, 6) of the markers at the goal.

        Raises ConfigurationError if the depth is unknown.
        """
        if self.depth is None:
            raise ConfigurationError(
                "the interaction matrix at a goal needs the markers' depths there: give a goal as "
                "a pose or a "
                "configuration, or depth_m with markers_px"
            )
        return interaction_matrix(self.normalised, self.depth).reshape(-1, 6)


class FeatureMotion(NamedTuple):
    """Error, Jacobian J_s (k, n), velocity, drift and partial derivative of a feature s (k,).

    The error is s less its value at the goal, the velocity is ṡ, the drift is s̈ when q̈ = 0, and
    the partial derivative is ∂s/∂t of eq. (2), (k,) each. The drift s̈ is exactly J̇_s q̇ + ∂ṡ/∂t.
    ∂s/∂t is zero unless the target is known to move.
    """

    error: Array
    J: Array
    velocity: Array
    drift: Array
    partial: Array


class Feature(ABC):
    """A visual feature vector s (k,).

    A custom one derives from :class:`.ViewFeature`, which needs its value only. A class derived
    from this one defines :meth:`size` and :meth:`evaluate`; its J_s is not checked.
    """

    #: Name for results and messages; that of the class if it states none.
    name: str
    #: Error by which a goal counts as reached: that of the camera's ``pose``, of all ``markers`` in
    #: the image, or of the ``feature`` itself, for features that determine neither.
    reached_by: Literal["pose", "markers", "feature"] = "markers"

    def __init_subclass__(cls) -> None:
        """Name the class, unless it has or inherits a name that its author has chosen."""
        super().__init_subclass__()
        unnamed = ("", *(base.__name__ for base in cls.__mro__[1:]))
        if getattr(cls, "name", "") in unnamed:
            cls.name = cls.__name__

    @abstractmethod
    def size(self, markers: int) -> int:
        """Return the number k of components for a number of markers."""

    @property
    def parts(self) -> tuple[Feature, ...]:
        """Features that this one consists of: itself, unless it is a stack."""
        return (self,)

    @property
    def remarks(self) -> list[str]:
        """Remarks for a reader of the results."""
        return []

    def check_goal(self, goal: Goal) -> None:
        """Raise ConfigurationError if the feature is not defined at a goal."""

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return ``reference``, s_ref (k,) relative to an old goal, relative to a new goal.

        ``near`` (k,) is the error with respect to the new goal. Features that are not unique
        (angles) are chosen closest to it.
        """
        raise ConfigurationError(
            f"the feature {self.name} does not say where a reference is seen from another goal"
        )

    @abstractmethod
    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate the feature in NumPy.

        ``previous`` (k,) is the error at the previous sample of the same goal, None at its first.
        Features that are not unique (angles) stay continuous with it. Raises SceneError if the
        feature is not defined in this state.
        """


def selected(markers: Sequence[int] | None, count: int, name: str) -> IntArray:
    """Return the indices of markers that are given by their numbers, from 1; all if None.

    Raises ConfigurationError, which names the feature, unless the numbers are those of some of
    ``count`` markers, each once.
    """
    if markers is None:
        return np.arange(count)
    for number in markers:
        if isinstance(number, bool) or number not in range(1, count + 1):
            raise ConfigurationError(
                f"feature {name}: markers are numbered from 1 to {count}; there is no marker "
                f"{format_value(number)}"
            )
    if not len(markers) or len(set(markers)) < len(markers):
        raise ConfigurationError(
            f"feature {name}: markers must be one or more different numbers, not "
            f"{format_value(list(markers))}"
        )
    return np.array(markers, dtype=np.int64) - 1
