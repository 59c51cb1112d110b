# /// script
# requires-python = ">=3.10"
# dependencies = ["machinevision-toolbox-python==2.4.1", "msgspec", "numpy"]
# ///
"""machinevision-toolbox-python: image-based servoing with its interaction matrix, without limits.

Its class ``IBVS`` simulates a camera of its own; here ``CentralCamera.visjac_p`` gives the camera's
velocity for the measured pixels, as in its step, and the pseudoinverse of the camera's Jacobian
gives the joint speeds.

Settings
--------
gain
    λ [1/s].
depth
    ``"current"``: depths of the present image; ``"desired"``: those at the goal.
"""

from importlib.metadata import version

import numpy as np
from machinevisiontoolbox import CentralCamera
from servoing import Scene, settings_of
from stack_io import serve

#: Defaults of the settings.
DEFAULTS = {
    "gain": 1.0,
    "depth": "current",
}


class MachineVisionStack:
    """``visjac_p`` on image points."""

    name = f"machinevision-toolbox {version('machinevision-toolbox-python')}"
    output = "velocity"
    features = ("image-points",)
    uses = (*Scene.uses, "q", "pixels", "jacobian")

    def start(self, setup):
        """Build the camera."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.gain = own["gain"]
        if own["depth"] not in ("current", "desired"):
            raise SystemExit(f"depth is current or desired, not {own['depth']!r}")
        self.desired = own["depth"] == "desired"
        f_u, f_v, c_u, c_v = setup["camera"]["intrinsics"]
        size = [int(side) for side in setup["camera"]["size"]]
        # focal lengths in pixels: pixels of 1 m
        self.camera = CentralCamera(f=[f_u, f_v], rho=1.0, pp=(c_u, c_v), imagesize=size)

    def step(self, now):
        """Return q̇ (n,)."""
        pixels = np.array(now["pixels"])
        goal = self.scene.goals[now["goal"]]
        wanted = np.array(goal["pixels"])
        # a goal has the camera's pose by the same name
        seen_from = goal if self.desired else now
        depth = self.scene.depth(seen_from)
        L = self.camera.visjac_p(pixels.T, depth)
        away = wanted - pixels
        velocity = self.gain * np.linalg.pinv(L) @ away.ravel()
        J = np.array(now["jacobian"])
        return np.linalg.pinv(J) @ velocity


if __name__ == "__main__":
    serve(MachineVisionStack())
