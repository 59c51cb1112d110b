"""Visual features: the camera's pose (PBVS) and the markers in the image (IBVS), and the goals
where they should be.

Features are evaluated in :mod:`vsconstraints.compiled.visual_task`, which makes a task of them; own
ones evaluate themselves.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, NamedTuple, get_args

import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError, InvalidInput, unknown_name
from ..formulas.features import pose_error
from ..formulas.tracking import minimum_jerk
from ..robots.geometry import Pose
from ..rows import Array
from .scene import State, interaction_matrix

InteractionMatrix = Literal["current", "desired", "mean"]


@dataclass(frozen=True)
class MinimumJerk:
    """A reference trajectory s_ref(t) of eq. (5): from where the feature is straight to the goal,
    at rest at both ends.

    s_ref, less the feature's value at the goal, is start · (1 − 10τ³ + 15τ⁴ − 6τ⁵), τ the share of
    ``duration`` [s].
    """

    duration: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.duration) and self.duration > 0.0):
            raise InvalidInput(
                f"the duration of a reference trajectory must be positive, not {self.duration}"
            )

    def at(self, elapsed: float, start: Array) -> tuple[Array, Array, Array]:
        """s_ref less the feature's value at the goal, ṡ_ref and s̈_ref (k,), ``elapsed`` [s] after
        it was ``start``.
        """
        left, rate, acceleration = minimum_jerk(elapsed, self.duration)
        return left * start, rate * start, acceleration * start


@dataclass(frozen=True)
class Goal:
    """What the camera should see, from a given time on."""

    from_time: float  #: Time from which this goal holds [s].
    pixels: Array  #: (m, 2) where the markers should be, from the image's centre [px].
    normalised: Array  #: The same in normalised coordinates.
    #: Desired pose of the camera in the target's frame; None if only the image is given.
    camera: Pose | None = None
    depth: Array | None = None  #: (m,) Z of the markers there [m]; None if not known.
    #: How s_ref moves to the goal; None if it is the goal from the start.
    reference: MinimumJerk | None = None
    #: (n,) joint coordinates at which the camera is there at t = 0, if it was given by them.
    q: Array | None = None
    tolerance_factor: float = 1.0  #: By how much its tolerances are wider than those of the setup.

    @cached_property
    def interaction(self) -> Array:
        """(2m, 6) the markers' interaction matrix at the goal; raises ConfigurationError if the
        depth is not known.
        """
        if self.depth is None:
            raise ConfigurationError(
                "the interaction matrix at a goal needs the markers' depths there: give a goal as "
                "a pose or a "
                "configuration, or depth_m with markers_px"
            )
        return interaction_matrix(self.normalised, self.depth).reshape(-1, 6)


class FeatureMotion(NamedTuple):
    """A feature vector s (k,) less its value at the goal, J_s (k, n), ṡ, s̈ when q̈ = 0, and ∂s/∂t
    of eq. (2) (k,) each.

    The drift s̈ is J̇_s q̇ + ∂ṡ/∂t exactly; ∂s/∂t is zero unless the target is known to move.
    """

    error: Array
    J: Array
    velocity: Array
    drift: Array
    partial: Array


class Feature(ABC):
    """A visual feature vector s; an own one gives :meth:`size` and :meth:`evaluate`."""

    name: ClassVar[str]

    @abstractmethod
    def size(self, markers: int) -> int:
        """How many numbers k it has, with so many markers."""

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """S_ref (k,), less the feature's value at a new goal instead of at an old one.

        ``near`` (k,) is the error to the new goal: features that are not unique (angles) are those
        closest to it.
        """
        raise ConfigurationError(
            f"the feature {self.name} does not say where a reference is seen from another goal"
        )

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """An own feature now.

        ``previous`` (k,) is the error at the previous sample of the same goal, None at its first:
        features that are not unique (angles) stay continuous with it.
        """
        raise NotImplementedError(f"the feature {self.name} is evaluated by compiled code")


class CameraPose(Feature):
    """Position-based servoing: s = (c*t_C, θu of c*R_C) of eq. (44), in metres and radians; its
    reference is zero.

    Both poses are relative to the target. J_s = blkdiag(c*R_C, L_θu) J with J the Jacobian of the
    camera's twist relative to the target, in the camera frame.
    """

    name = "camera-pose"

    def size(self, markers: int) -> int:
        """Three coordinates and three angles."""
        return 6

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """See :meth:`Feature.carried`."""
        assert old.camera is not None
        assert new.camera is not None
        there = old.camera @ Pose(np.asarray(pin.exp3(reference[3:])), reference[:3])
        _, t, w = pose_error(new.camera.R, new.camera.t, there.R, there.t, near[3:], True)
        return np.array((*t, *w))


class ImagePoints(Feature):
    """Image-based servoing: s = the normalised coordinates (x₁, y₁, x₂, …) of the markers, 2m
    numbers.

    Parameters
    ----------
    interaction_matrix
        Which one makes J_s: that of the ``current`` image, as in eq. (24), that of the ``desired``
        one, or the ``mean`` of both. The ṡ that damps the motion is J_s q̇ with the same one, and
        the drift its product with the camera's, as if it were constant: then the camera's twist V
        follows V̇ = −K_v V − K_p L† e, and moves along what the velocity law −K_p/K_v L† e of that
        matrix asks for. With the true ṡ, or with L̇ in the drift, it would not.

    Raises
    ------
    ConfigurationError
        if there is no interaction matrix of that name.
    """

    name = "image-points"

    def __init__(self, interaction_matrix: InteractionMatrix = "current") -> None:
        if interaction_matrix not in get_args(InteractionMatrix):
            raise unknown_name(
                "interaction_matrix", interaction_matrix, get_args(InteractionMatrix)
            )
        self.interaction_matrix = interaction_matrix

    def size(self, markers: int) -> int:
        """Two coordinates of each marker."""
        return 2 * markers

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """See :meth:`Feature.carried`."""
        return reference + (old.normalised - new.normalised).ravel()


#: Features by the name scenario files use.
FEATURES: dict[str, type[Feature]] = {
    feature.name: feature for feature in (CameraPose, ImagePoints)
}
