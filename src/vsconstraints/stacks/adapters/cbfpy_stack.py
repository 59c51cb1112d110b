# /// script
# requires-python = ">=3.10"
# dependencies = ["cbfpy==0.1.0", "msgspec", "numpy"]
# ///
"""cbfpy: control barrier functions in JAX, as a filter of resolved-rate control.

The joints are integrators, q̇ = u. The barriers are the ranges, and the field of view linearised at
the measured image, which is exact for a velocity law. Speeds are the bounds of the QP.

Settings
--------
gain
    Gain λ of the task [1/s].
barrier_gain
    α of all barriers [1/s].
"""

import os

os.environ.setdefault("JAX_ENABLE_X64", "1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

from importlib.metadata import version

import numpy as np
from cbfpy import CBF, CBFConfig
from servoing import Scene, axis_and_angle, from_limits, inverse, settings_of
from stack_io import serve

#: Defaults of the settings.
DEFAULTS = {
    "gain": 2.0,
    "barrier_gain": 5.0,
}


class Joints(CBFConfig):
    """Integrators with barriers of range and view."""

    def __init__(self, lower, upper, speed, rows, gain):
        self.lower = lower
        self.upper = upper
        self.gain = gain
        n = len(lower)
        blank = np.zeros(rows), np.zeros((rows, n)), np.zeros(n)
        super().__init__(n=n, m=n, u_min=-speed, u_max=speed, init_args=blank)

    def f(self, z, *args):
        """Return the drift (n,): none."""
        return 0.0 * z

    def g(self, z, *args):
        """Return the input matrix (n, n)."""
        return np.eye(len(self.lower))

    def h_1(self, z, view, rates, at):
        """Return the barriers: range, and view (r,) with its derivative (r, n) at q (n,)."""
        import jax.numpy as jnp

        return jnp.concatenate((z - self.lower, self.upper - z, view + rates @ (z - at)))

    def alpha(self, h, *args):
        """Return the decay of the barriers."""
        return self.gain * h


class CbfpyStack:
    """``CBF.safety_filter`` of q̇ = J† (−λ e) for the camera's pose or image points."""

    name = f"cbfpy {version('cbfpy')}"
    output = "velocity"
    features = ("camera-pose", "image-points")
    uses = (*Scene.uses, "limits", "q", "pixels", "jacobian")

    def start(self, setup):
        """Build and compile the filter."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.gain = own["gain"]
        barrier_gain = own["barrier_gain"]
        limits = setup["limits"]
        lower = from_limits(limits["lower"], -1e6)
        upper = from_limits(limits["upper"], 1e6)
        speed = from_limits(limits["velocity"], 1e3)
        rows = 0
        if self.scene.half_size is not None:
            rows = 4 * len(self.scene.markers)
        config = Joints(lower, upper, speed, rows, barrier_gain)
        self.filter = CBF.from_config(config)

    def step(self, now):
        """Return q̇ (n,)."""
        J = np.array(now["jacobian"])
        q = np.array(now["q"])
        if self.scene.feature == "image-points":
            error, L = self.scene.image_error(now)
            J_s = L @ J
            rate = -self.gain * error
        else:
            J_s = J
            rate = self.gain * self.twist(now)
        wanted = np.linalg.pinv(J_s) @ rate
        sigma, A = self.scene.view_rows(now)
        barrier = -sigma
        barrier_J = -A @ J
        return np.asarray(self.filter.safety_filter(q, wanted, barrier, barrier_J, q))

    def twist(self, now):
        """Return the twist (6,) along which the camera moves straight to the goal in 1 s."""
        goal = self.scene.goals[now["goal"]]
        wanted = np.array(goal["camera_in_target"])
        camera = np.array(now["camera_in_target"])
        away = inverse(camera) @ wanted
        axis, angle = axis_and_angle(away[:3, :3])
        size = np.linalg.norm(axis)
        # the axis has the length 2 sin θ
        factor = angle / size if size > 1e-12 else 0.5
        return np.concatenate((away[:3, 3], factor * axis))


if __name__ == "__main__":
    serve(CbfpyStack())
