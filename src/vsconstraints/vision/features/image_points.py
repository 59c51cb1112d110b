"""Markers in the image (image-based servoing)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

from ...errors import unknown_name
from ...rows import Array
from ..scene import State, interaction_matrix
from .base import Feature, FeatureMotion, Goal, selected

InteractionMatrix = Literal["current", "desired", "mean"]
#: Weight of the interaction matrix at the goal; the rest is that of the current image.
SHARES: dict[str, float] = {"current": 0.0, "desired": 1.0, "mean": 0.5}


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
    markers
        Numbers of the markers, from 1; all by default. A selection is evaluated in NumPy.

    Raises
    ------
    ConfigurationError
        if the name of the interaction matrix is unknown.
    """

    name = "image-points"

    def __init__(
        self,
        interaction_matrix: InteractionMatrix = "current",
        markers: Sequence[int] | None = None,
    ) -> None:
        if interaction_matrix not in get_args(InteractionMatrix):
            raise unknown_name(
                "interaction_matrix", interaction_matrix, get_args(InteractionMatrix)
            )
        self.interaction_matrix = interaction_matrix
        self.markers = markers
        if markers is not None:
            self.reached_by = "feature"

    def size(self, markers: int) -> int:
        """Return 2m: two coordinates of each marker."""
        return 2 * len(selected(self.markers, markers, self.name))

    def check_goal(self, goal: Goal) -> None:
        """Raise ConfigurationError if the depths that the interaction matrix needs are unknown."""
        selected(self.markers, len(goal.normalised), self.name)
        if self.interaction_matrix != "current":
            _ = goal.interaction

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        markers = selected(self.markers, len(old.normalised), self.name)
        return reference + (old.normalised - new.normalised)[markers].ravel()

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate the feature in NumPy: see :meth:`Feature.evaluate`."""
        image = state.normalised
        markers = selected(self.markers, len(image.position), self.name)
        qd = state.robot.qd
        J = image.J[markers].reshape(-1, len(qd))
        velocity = image.velocity[markers].ravel()
        drift = image.drift[markers].ravel()
        partial = velocity - J @ qd
        share = SHARES[self.interaction_matrix]
        if share > 0.0:
            now = interaction_matrix(image.position, state.depth)
            L = (1.0 - share) * now + share * goal.interaction.reshape(now.shape)
            L = L[markers].reshape(-1, 6)
            J = L @ state.camera_J
            velocity = J @ qd + partial
            drift = L @ state.camera_drift
        error = (image.position - goal.normalised)[markers].ravel()
        return FeatureMotion(error, J, velocity, drift, partial)
