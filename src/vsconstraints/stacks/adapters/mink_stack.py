# /// script
# requires-python = ">=3.10"
# dependencies = ["mink==1.3.0", "daqp", "msgspec", "numpy"]
# ///
"""mink: differential inverse kinematics on MuJoCo as a QP, with its own limits.

Settings
--------
gain
    Gain λ of the task [1/s]. mink's own ``gain`` is the fraction λ T_s per period.
lm_damping
    Weight of the Levenberg–Marquardt damping of the task.
view_gain
    α of the rows dσ/dt ≤ −α σ of the field of view [1/s]; 0 leaves them out.
velocity_limit
    False leaves out the speed limits, as mink's default does.
config_limit_gain
    Share of the distance to a range limit that a period may use; mink's default is 0.95.
damping, solver
    Weight of ‖Δq‖² in the QP, and solver of qpsolvers.
"""

from importlib.metadata import version

import mink
import mujoco
import numpy as np
from servoing import Scene, from_limits, settings_of
from stack_io import NoAnswer, serve

# keep the tip's frame, which MuJoCo would merge with the last link
COMPILER = '<mujoco><compiler fusestatic="false"/></mujoco>'

#: Defaults of the settings.
DEFAULTS = {
    "solver": "daqp",
    "damping": 1e-8,
    "view_gain": 5.0,
    "gain": 2.0,
    "lm_damping": 1e-6,
    "config_limit_gain": 0.95,
    "velocity_limit": True,
}


class ViewLimit(mink.Limit):
    """Rows A J Δq ≤ −α T_s σ of the markers in the image, set in each period."""

    def __init__(self):
        self.G = None
        self.h = None

    def compute_qp_inequalities(self, configuration, dt):
        """Return the rows G Δq ≤ h."""
        return mink.Constraint(G=self.G, h=self.h)


class ImageTask(mink.Task):
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


class MinkStack:
    """``mink.solve_ik`` on the camera's pose or on image points."""

    name = f"mink {version('mink')}"
    output = "velocity"
    features = ("camera-pose", "image-points")
    uses = (*Scene.uses, "urdf", "limits", "q", "pixels", "jacobian")

    def start(self, setup):
        """Build model, task and limits."""
        own = settings_of(setup, DEFAULTS)
        self.scene = Scene(setup, self.features)
        self.period = setup["period"]
        self.solver = own["solver"]
        self.damping = own["damping"]
        self.view_gain = own["view_gain"]
        urdf = setup["urdf"].replace("</robot>", f"{COMPILER}</robot>")
        self.model = mujoco.MjModel.from_xml_string(urdf)
        self.tip = setup["tip"]
        gain = own["gain"] * self.period
        lm_damping = own["lm_damping"]
        self.image_task = None
        if self.scene.feature == "image-points":
            features = 2 * len(self.scene.markers)
            self.task = self.image_task = ImageTask(features, gain, lm_damping)
        else:
            self.task = mink.FrameTask(self.tip, "body", 1.0, 1.0, gain, lm_damping)
        self.limits = [mink.ConfigurationLimit(self.model, own["config_limit_gain"])]
        if own["velocity_limit"]:
            speeds = from_limits(setup["limits"]["velocity"], 1e6)
            names = dict(zip(setup["joints"], speeds, strict=True))
            self.limits.append(mink.VelocityLimit(self.model, names))
        self.view = ViewLimit()

    def step(self, now):
        """Return q̇ (n,)."""
        configuration = mink.Configuration(self.model, np.array(now["q"]))
        J = np.array(now["jacobian"])
        if self.image_task is not None:
            self.image_task.error, L = self.scene.image_error(now)
            self.image_task.J = L @ J
        else:
            tip = configuration.get_transform_frame_to_world(self.tip, "body")
            goal = self.scene.tip_goal(now, tip.as_matrix())
            self.task.set_target(mink.SE3.from_matrix(goal))
        limits = list(self.limits)
        sigma, A = self.scene.view_rows(now)
        if self.view_gain > 0.0 and len(sigma):
            self.view.G = A @ J
            self.view.h = -self.view_gain * self.period * sigma
            limits.append(self.view)
        try:
            return mink.solve_ik(
                configuration,
                [self.task],
                self.period,
                solver=self.solver,
                damping=self.damping,
                limits=limits,
            )
        except mink.MinkError as error:
            raise NoAnswer(f"{type(error).__name__}: {str(error)[:100]}") from error


if __name__ == "__main__":
    serve(MinkStack())
