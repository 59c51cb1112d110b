# /// script
# requires-python = ">=3.10"
# dependencies = ["cbfpy==0.1.0", "numpy"]
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
from servoing import Scene, axis_and_angle, from_limits, inverse
from stack_io import serve


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
    uses = (
        "limits", "camera", "target", "goals", "constraints", "q", "pixels", "pose", "jacobian",
    )  # fmt: skip

    def start(self, setup):
        """Build and compile the filter."""
        own = setup["settings"]
        self.scene = Scene(setup)
        self.gain = own.get("gain", 2.0)
        limits = setup["limits"]
        lower = from_limits(limits["lower"], -1e6)
        upper = from_limits(limits["upper"], 1e6)
        speed = from_limits(limits["velocity"], 1e3)
        rows = 0 if self.scene.half_size is None else 4 * len(self.scene.markers)
        config = Joints(lower, upper, speed, rows, own.get("barrier_gain", 5.0))
        self.filter = CBF.from_config(config)

    def step(self, now):
        """Return q̇ (n,)."""
        J = np.array(now["jacobian"])
        q = np.array(now["q"])
        if self.scene.feature == "image-points":
            error, L = self.scene.image_error(now)
            wanted = np.linalg.pinv(L @ J) @ (-self.gain * error)
        else:
            wanted = np.linalg.pinv(J) @ (self.gain * self.twist(now))
        sigma, A = self.scene.view_rows(now)
        return np.asarray(self.filter.safety_filter(q, wanted, -sigma, -A @ J, q))

    def twist(self, now):
        """Return the twist (6,) along which the camera moves straight to the goal in 1 s."""
        goal = np.array(self.scene.goals[now["goal"]]["camera_in_target"])
        away = inverse(np.array(now["camera_in_target"])) @ goal
        axis, angle = axis_and_angle(away[:3, :3])
        size = np.linalg.norm(axis)
        turn = axis * (angle / size) if size > 1e-12 else 0.5 * axis
        return np.concatenate((away[:3, 3], turn))


if __name__ == "__main__":
    serve(CbfpyStack())
