"""Visual features: the camera's pose (PBVS) and the markers in the image (IBVS).

A feature turns a state and a goal into its error, Jacobian and drift; the law that makes a task of them is in
:mod:`vsconstraints.tracking`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .geometry import Pose, rotation_vector, rotation_vector_rate, skew
from .rows import Array
from .scene import State


@dataclass(frozen=True, slots=True)
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
        Desired pose of the camera in the base frame; None if only the image is given.
    """

    from_time: float
    pixels: Array
    normalised: Array
    camera: Pose | None = None


@dataclass(frozen=True, slots=True)
class FeatureMotion:
    """A feature vector s and how it moves.

    Attributes
    ----------
    error
        (k,) e = s − s_ref.
    J
        (k, n) J_s = ∂s/∂q.
    velocity
        (k,) ṡ.
    drift
        (k,) J̇_s q̇, exactly.
    """

    error: Array
    J: Array
    velocity: Array
    drift: Array


class Feature(ABC):
    """A visual feature vector s."""

    name: ClassVar[str]

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

    J_s = blkdiag(c*R_C, L_θu) J with J the Jacobian of the camera's twist in the camera frame.
    """

    name = "camera-pose"

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Error (6,), Jacobian (6, n) and drift of the camera's pose relative to the desired one."""
        if goal.camera is None:
            raise ValueError("a camera-pose task needs a goal with a camera pose")
        relative = goal.camera.inverse @ state.camera
        w = rotation_vector(relative.R, None if previous is None else previous[3:])
        twist = state.camera_J @ state.robot.qd
        v, omega = twist[:3], twist[3:]
        L, L_dot = rotation_vector_rate(w, omega)
        R, drift = relative.R, state.camera_drift
        return FeatureMotion(
            np.concatenate((relative.t, w)),
            np.concatenate((R @ state.camera_J[:3], L @ state.camera_J[3:])),
            np.concatenate((R @ v, L @ omega)),
            np.concatenate((R @ (drift[:3] + skew(omega) @ v), L @ drift[3:] + L_dot @ omega)),
        )


class ImagePoints(Feature):
    """Image-based servoing: s = the normalised coordinates (x₁, y₁, x₂, …) of the markers, 2m numbers."""

    name = "image-points"

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Error (2m,), Jacobian (2m, n) and drift of the markers' normalised coordinates."""
        image = state.normalised
        return FeatureMotion(
            (image.position - goal.normalised).ravel(),
            image.J.reshape(-1, image.J.shape[2]),
            image.velocity.ravel(),
            image.drift.ravel(),
        )


FEATURES: dict[str, type[Feature]] = {feature.name: feature for feature in (CameraPose, ImagePoints)}
"""Features by the name scenario files use."""
