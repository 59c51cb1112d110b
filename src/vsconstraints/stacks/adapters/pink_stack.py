# /// script
# requires-python = ">=3.10"
# dependencies = ["pin-pink==4.4.0", "daqp", "proxsuite", "msgspec", "numpy"]
# ///
"""Pink: differential inverse kinematics as a QP, with its own limits and barriers.

Settings
--------
gain
    Gain λ of the task [1/s]. Pink's own ``gain`` is the fraction λ T_s per period.
lm_damping
    Weight of the Levenberg–Marquardt damping of the task.
barrier_gain
    α of the barriers h = −σ of the field of view, dh/dt ≥ −α h [1/s]; 0 leaves them out.
acceleration_limit
    True adds Pink's ``AccelerationLimit`` with the limits of the scenario.
config_limit_gain
    Share of the distance to a range limit that a period may use; Pink's default is 0.5.
damping
    Weight of ‖Δq‖² in the QP.
solver
    Solver of qpsolvers.
"""

import numpy as np
import pink
import pink.exceptions
import pinocchio as pin
from pink.barriers import Barrier
from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
from pink.tasks import FrameTask, Task
from servoing import Scene, acceleration_limits, settings_of
from stack_io import NoAnswer, serve

#: Defaults of the settings.
DEFAULTS = {
    "solver": "daqp",
    "damping": 1e-8,
    "barrier_gain": 5.0,
    "gain": 2.0,
    "lm_damping": 1e-6,
    "config_limit_gain": 0.5,
    "acceleration_limit": False,
}


class ViewBarrier(Barrier):
    """h = −σ [px] of each marker and edge; the image is set in each period."""

    def __init__(self, rows, gain):
        super().__init__(dim=rows, gain=gain)
        self.h = np.zeros(rows)
        self.J = np.zeros((rows, 0))

    def compute_barrier(self, configuration):
        """Return h (4m,)."""
        return self.h

    def compute_jacobian(self, configuration):
        """Return dh/dq (4m, n)."""
        return self.J


class ImageTask(Task):
    """Markers in the image: error x − x* in normalised coordinates."""

    def __init__(self, features, gain, damping):
        super().__init__(cost=np.ones(features), gain=gain, lm_damping=damping)
        self.error = np.zeros(features)
        self.J = np.zeros((features, 0))

    def compute_error(self, configuration):
        """Return the error (2m,)."""
        return self.error

    def compute_jacobian(self, configuration):
        """Return its derivative (2m, n)."""
        return self.J

    def __repr__(self):
        """Return the name of the class."""
        return "ImageTask()"


class PinkStack:
    """Pink's ``solve_ik`` on the camera's pose or on image points."""

    name = f"pink {pink.__version__}"
    output = "velocity"
    features = ("camera-pose", "image-points")
    uses = (*Scene.uses, "urdf", "limits", "q", "qd", "pixels", "jacobian")

    def start(self, setup):
        """Build model, tasks, limits and barriers."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.period = setup["period"]
        self.solver = own["solver"]
        self.damping = own["damping"]
        self.barrier_gain = own["barrier_gain"]
        self.model = pin.buildModelFromXML(setup["urdf"])
        self.data = self.model.createData()
        self.tip = setup["tip"]
        gain = own["gain"] * self.period
        lm_damping = own["lm_damping"]
        if self.scene.feature == "image-points":
            features = 2 * len(self.scene.markers)
            self.task = ImageTask(features, gain, lm_damping)
        else:
            self.task = FrameTask(self.tip, 1.0, 1.0, gain=gain, lm_damping=lm_damping)
        self.limits = [
            ConfigurationLimit(self.model, own["config_limit_gain"]),
            VelocityLimit(self.model),
        ]
        self.acceleration = None
        if own["acceleration_limit"]:
            self.acceleration = AccelerationLimit(self.model, acceleration_limits(setup))
            self.limits.append(self.acceleration)
        self.last = None  # last velocity that was commanded, as Pink's examples take it

    def step(self, now):
        """Return q̇ (n,)."""
        q = np.array(now["q"])
        configuration = pink.Configuration(self.model, self.data, q)
        J = np.array(now["jacobian"])
        if isinstance(self.task, ImageTask):
            self.task.error, L = self.scene.image_error(now)
            self.task.J = L @ J
        else:
            tip = configuration.get_transform_frame_to_world(self.tip)
            goal = self.scene.tip_goal(now, tip.homogeneous)
            self.task.set_target(pin.SE3(goal))
        if self.acceleration is not None:
            last = np.array(now["qd"]) if self.last is None else self.last
            self.acceleration.set_last_integration(last, self.period)
        barriers = []
        sigma, A = self.scene.view_rows(now)
        if self.barrier_gain > 0.0 and len(sigma):
            # a new one in each period: a barrier keeps its values as long as q is the same
            barrier = ViewBarrier(len(sigma), self.barrier_gain)
            barrier.h = -sigma
            barrier.J = -A @ J
            barriers.append(barrier)
        try:
            self.last = pink.solve_ik(
                configuration,
                [self.task],
                self.period,
                solver=self.solver,
                damping=self.damping,
                limits=self.limits,
                barriers=barriers,
                safety_break=False,
            )
        except pink.exceptions.PinkError as error:
            self.last = None
            raise NoAnswer(f"{type(error).__name__}: {str(error)[:100]}") from error
        return self.last


if __name__ == "__main__":
    serve(PinkStack())
