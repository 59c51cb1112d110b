"""Visual features: the camera's pose (PBVS) and the markers in the image (IBVS).

A feature turns a state and a goal into its error, Jacobian and drift; the law that makes a task of them is in
:mod:`vsconstraints.vision.tracking`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, get_args

import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError, unknown_name
from ..formulas.features import pose_error, pose_rates
from ..formulas.rotation import rotation_vector_rate
from ..formulas.vectors import turned
from ..robots.geometry import Pose
from ..rows import Array
from .references import Reference
from .scene import State, interaction_matrix

InteractionMatrix = Literal["current", "desired", "mean"]


@dataclass(frozen=True)
class Goal:
    """What the camera should see, from a given time on.

    Attributes
    ----------
    from_time
        Time from which this goal holds [s].
    pixels
        (m, 2) where the markers should be, from the image's centre [px].
    normalised
        The same in normalised coordinates.
    camera
        Desired pose of the camera in the target's frame; None if only the image is given.
    depth
        (m,) Z of the markers there [m]; None if not known.
    reference
        How s_ref moves on the way to the goal; None if it is the goal from the start.
    q
        (n,) joint coordinates at which the camera is there at t = 0; None where the goal was not given by them.
    tolerance_factor
        By how much the tolerances within which this goal counts as reached are wider than those of the setup.
    """

    from_time: float
    pixels: Array
    normalised: Array
    camera: Pose | None = None
    depth: Array | None = None
    reference: Reference | None = None
    q: Array | None = None
    tolerance_factor: float = 1.0

    @cached_property
    def interaction(self) -> Array:
        """(2m, 6) the markers' interaction matrix at the goal; raises ConfigurationError if the depth is not known."""
        if self.depth is None:
            raise ConfigurationError(
                "the interaction matrix at a goal needs the markers' depths there: give a goal as a pose or a "
                "configuration, or depth_m with markers_px"
            )
        return interaction_matrix(self.normalised, self.depth).reshape(-1, 6)


@dataclass(frozen=True, slots=True)
class FeatureMotion:
    """A feature vector s and how it moves.

    Attributes
    ----------
    error
        (k,) s less its value at the goal.
    J
        (k, n) J_s = ∂s/∂q.
    velocity
        (k,) ṡ.
    drift
        (k,) s̈ when q̈ = 0, exactly: J̇_s q̇ + ∂ṡ/∂t.
    partial
        (k,) ∂s/∂t of eq. (2): zero unless the target is known to move.
    """

    error: Array
    J: Array
    velocity: Array
    drift: Array
    partial: Array


class Feature(ABC):
    """A visual feature vector s."""

    name: ClassVar[str]

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """The same s_ref (k,), less the feature's value at a new goal instead of at an old one.

        Parameters
        ----------
        reference
            (k,) s_ref less the feature's value at the old goal.
        old, new
            The goals.
        near
            (k,) the error to the new goal: features that are not unique (angles) are those closest to it.
        """
        raise ConfigurationError(f"the feature {self.name} does not say where a reference is seen from another goal")

    @abstractmethod
    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Error, Jacobian and drift of the feature.

        Parameters
        ----------
        state
            The scene now.
        goal
            What should be seen.
        previous
            (k,) the error at the previous sample of the same goal, or None at its first: features that are not
            unique (angles) stay continuous with it.
        """


class CameraPose(Feature):
    """Position-based servoing: s = (c*t_C, θu of c*R_C) of eq. (44), in metres and radians; its reference is zero.

    Both poses are relative to the target. J_s = blkdiag(c*R_C, L_θu) J with J the Jacobian of the camera's twist
    relative to the target, in the camera frame.
    """

    name = "camera-pose"

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """See :meth:`Feature.carried`."""
        assert old.camera is not None
        assert new.camera is not None
        there = old.camera @ Pose(np.asarray(pin.exp3(reference[3:])), reference[:3])
        _, t, w = pose_error(new.camera.R, new.camera.t, there.R, there.t, near[3:], True)
        return np.array((*t, *w))

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Error (6,), Jacobian (6, n) and drift of the camera's pose relative to the desired one."""
        if goal.camera is None:
            raise ValueError("a camera-pose task needs a goal with a camera pose")
        near, wanted, camera = np.zeros(3) if previous is None else previous[3:], goal.camera, state.camera
        E, e, w = pose_error(wanted.R, wanted.t, camera.R, camera.t, near, previous is not None)
        v, omega, drift = state.camera_twist[:3], state.camera_twist[3:], state.camera_drift
        w_dot, L, L_dot = rotation_vector_rate(w, omega)
        t_dot, t_ddot, w_ddot = pose_rates(E, L, L_dot, v, omega, drift[:3], drift[3:])
        J: Array = np.concatenate((turned(E, state.camera_J[:3]), turned(L, state.camera_J[3:])))
        velocity = np.array((*t_dot, *w_dot))
        return FeatureMotion(
            np.array((*e, *w)), J, velocity, np.array((*t_ddot, *w_ddot)), velocity - J @ state.robot.qd
        )


class ImagePoints(Feature):
    """Image-based servoing: s = the normalised coordinates (x₁, y₁, x₂, …) of the markers, 2m numbers.

    Parameters
    ----------
    interaction_matrix
        Which one makes J_s: that of the ``current`` image, as in eq. (24), that of the ``desired`` one, or the
        ``mean`` of both. The ṡ that damps the motion is J_s q̇ with the same one, and the drift its product with the
        camera's, as if it were constant: then the camera's twist V follows V̇ = −K_v V − K_p L† e, and moves along what
        the velocity law −K_p/K_v L† e of that matrix asks for. With the true ṡ, or with L̇ in the drift, it would not.

    Raises
    ------
    ConfigurationError
        if there is no interaction matrix of that name.
    """

    name = "image-points"

    def __init__(self, interaction_matrix: InteractionMatrix = "current") -> None:
        if interaction_matrix not in get_args(InteractionMatrix):
            raise unknown_name("interaction_matrix", interaction_matrix, get_args(InteractionMatrix))
        self.interaction_matrix = interaction_matrix

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """See :meth:`Feature.carried`."""
        return reference + (old.normalised - new.normalised).ravel()

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Error (2m,), Jacobian (2m, n) and drift of the markers' normalised coordinates."""
        image = state.normalised
        J, velocity, drift = image.J.reshape(-1, image.J.shape[2]), image.velocity.ravel(), image.drift.ravel()
        partial = velocity - J @ state.robot.qd
        if self.interaction_matrix != "current":
            L = goal.interaction
            if self.interaction_matrix == "mean":
                L = 0.5 * (L + interaction_matrix(image.position, state.depth).reshape(-1, 6))
            J, drift = L @ state.camera_J, L @ state.camera_drift
            velocity = J @ state.robot.qd + partial
        return FeatureMotion((image.position - goal.normalised).ravel(), J, velocity, drift, partial)


FEATURES: dict[str, type[Feature]] = {feature.name: feature for feature in (CameraPose, ImagePoints)}
"""Features by the name scenario files use."""
