"""A constraint of your own, named in own-scenario.toml as horizon:Horizon."""

import numpy as np

from vsconstraints.constraints import ImageConstraint


class Horizon(ImageConstraint):
    """Keeps every marker below a line in the image: σ = (line − v) / 100 ≤ 0."""

    kind = "horizon"

    def __init__(self, *, line: float, K: float, switching_gain: float):
        super().__init__(K=K, switching_gain=switching_gain, length=100.0)
        self.line = line

    def sigma(self, y):
        return (self.line - y[..., 1]) / 100.0

    def gradient(self, y):
        return np.broadcast_to([0.0, -0.01], y.shape)
