"""Several features as one, and 2½-D visual servoing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import ConfigurationError
from ...rows import Array
from ..scene import State
from .base import Feature, FeatureMotion, Goal
from .camera_pose import Rotation
from .depth import Depth
from .image_points import ImagePoints


class Stack(Feature):
    """Several features, one below the other: s = (s₁, s₂, …).

    The equality J_s q̈ = b is solved by least squares where it has more lines than the arm has
    joints. Components of other units then weigh as they are.
    """

    reached_by = "feature"

    def __init__(self, features: Sequence[Feature]) -> None:
        if not features:
            raise ConfigurationError("a stack needs one or more features")
        self.features = tuple(features)
        self.name = " + ".join(feature.name for feature in features)

    def size(self, markers: int) -> int:
        """Return the number of components of all features."""
        return sum(feature.size(markers) for feature in self.features)

    @property
    def parts(self) -> tuple[Feature, ...]:
        """Features of the stack, those of stacks in it included."""
        return tuple(part for feature in self.features for part in feature.parts)

    @property
    def remarks(self) -> list[str]:
        """Remarks of all features."""
        return [remark for feature in self.features for remark in feature.remarks]

    def check_goal(self, goal: Goal) -> None:
        """Raise ConfigurationError if a feature is not defined at a goal."""
        for feature in self.features:
            feature.check_goal(goal)

    def carried(self, reference: Array, old: Goal, new: Goal, near: Array) -> Array:
        """Return the reference relative to a new goal: see :meth:`Feature.carried`."""
        markers = len(old.normalised)
        references = self._split(reference, markers)
        nearby = self._split(near, markers)
        each = zip(self.features, references, nearby, strict=True)
        carried = [feature.carried(s, old, new, close) for feature, s, close in each]
        return np.concatenate(carried)

    def evaluate(self, state: State, goal: Goal, previous: Array | None) -> FeatureMotion:
        """Evaluate all features: see :meth:`Feature.evaluate`."""
        last: Sequence[Array | None] = [None] * len(self.features)
        if previous is not None:
            last = self._split(previous, len(state.depth))
        motions = []
        for feature, before in zip(self.features, last, strict=True):
            motions.append(feature.evaluate(state, goal, before))
        fields = zip(*motions, strict=True)
        return FeatureMotion(*(np.concatenate(parts) for parts in fields))

    def _split(self, values: Array, markers: int) -> list[Array]:
        """Split values (k,) by feature."""
        sizes = [feature.size(markers) for feature in self.features]
        return np.split(values, np.cumsum(sizes)[:-1])


class Hybrid(Stack):
    """2½-D visual servoing: s = (x, y, log(Z/Z*), θu of c*R_C), of one marker and the rotation.

    Image and depth of the marker determine the translation (Malis, Chaumette and Boudet 1999).
    """

    def __init__(self, marker: int = 1) -> None:
        super().__init__([ImagePoints(markers=[marker]), Depth([marker]), Rotation()])
        self.name = "2.5-d"
