"""Visual features: camera pose (PBVS) and markers in the image (IBVS), with their goals.

Features are evaluated in :mod:`vsconstraints.compiled.visual_task`, which builds the task. Custom
features evaluate themselves.
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
    """A visual feature vector s; a custom one defines :meth:`size` and :meth:`evaluate`."""

    name: ClassVar[str]

    @abstractmethod
    def size(self, markers: int) -> int:
        """Return the number k of components for a number of markers."""

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return s_ref (k,) relative to a new goal, from its value relative to an old goal.

        ``near`` (k,) is the error with respect to the new goal. Features that are not unique
        (angles) are chosen closest to it.
        """
        raise ConfigurationError(
            f"the feature {self.name} does not say where a reference is seen from another goal"
        )

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate a custom feature.

        ``previous`` (k,) is the error at the previous sample of the same goal, None at its first.
        Features that are not unique (angles) stay continuous with it.
        """
        raise NotImplementedError(f"the feature {self.name} is evaluated by compiled code")


class CameraPose(Feature):
    """Position-based servoing: s = (c*t_C, θu of c*R_C) of eq. (44), in metres and radians.

    The reference, the value at the goal, is zero. Both poses are relative to the target. J_s =
    blkdiag(c*R_C, L_θu) J with J the Jacobian of the camera's twist relative to the target, in the
    camera frame.
    """

    name = "camera-pose"

    def size(self, markers: int) -> int:
        """Return 6: three coordinates and three angles."""
        return 6

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        assert old.camera is not None
        assert new.camera is not None
        there = old.camera @ Pose(np.asarray(pin.exp3(reference[3:])), reference[:3])
        _, t, w = pose_error(new.camera.R, new.camera.t, there.R, there.t, near[3:], True)
        return np.array((*t, *w))


class ImagePoints(Feature):
    """Image-based servoing: s = the 2m normalised coordinates (x₁, y₁, x₂, …) of the markers.

    Parameters
    ----------
    interaction_matrix
        Interaction matrix in J_s: that of the ``current`` image, as in eq. (24), that of the
        ``desired`` one, or the ``mean`` of both. The same matrix defines the damping velocity
        ṡ = J_s q̇ and the drift, the product of the matrix with the camera's drift, as if the
        matrix were constant. The camera's twist V then follows V̇ = −K_v V − K_p L† e. It moves
        along the twist −K_p/K_v L† e of the velocity law with that matrix. This would not hold
        with the true ṡ, or with L̇ in the drift.

    Raises
    ------
    ConfigurationError
        if the name of the interaction matrix is unknown.
    """

    name = "image-points"

    def __init__(self, interaction_matrix: InteractionMatrix = "current") -> None:
        if interaction_matrix not in get_args(InteractionMatrix):
            raise unknown_name(
                "interaction_matrix", interaction_matrix, get_args(InteractionMatrix)
            )
        self.interaction_matrix = interaction_matrix

    def size(self, markers: int) -> int:
        """Return 2m: two coordinates of each marker."""
        return 2 * markers

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        return reference + (old.normalised - new.normalised).ravel()


#: Features by their names in scenario files.
FEATURES: dict[str, type[Feature]] = {
    feature.name: feature for feature in (CameraPose, ImagePoints)
}
