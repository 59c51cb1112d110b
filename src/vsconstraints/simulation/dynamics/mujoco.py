"""The same arm in MuJoCo: its kinematics, inertia, bias and integration instead of this package's."""

from __future__ import annotations

import numpy as np

from ...compiled.arm import BodyArrays
from ...errors import ConfigurationError, described
from ...plugins.extras import demand
from ...robots.robot import Robot
from ...rows import Array

NOTHING = 1e-12  #: Mass and inertia of links that have none, which MuJoCo does not take [kg, kg m²].


class MujocoArm:
    """Moves an arm in MuJoCo by the torques and the friction of the plant: bodies without geometry, so no contact.

    The payload is part of the last of the ``bodies``; ``h`` is a substep [s]. Raises ConfigurationError if MuJoCo is
    not installed, or cannot take the robot.
    """

    def __init__(self, robot: Robot, bodies: BodyArrays, h: float) -> None:
        demand("physics")
        import mujoco

        self._mujoco, spec = mujoco, mujoco.MjSpec()
        # it would write warnings of unbounded motions to a file; the loop reports them
        mujoco.set_mju_user_warning(lambda _: None)
        spec.option.timestep, spec.option.gravity = h, bodies.gravity
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        off = mujoco.mjtDisableBit
        spec.option.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_AUTORESET
        body, quaternion = spec.worldbody, np.empty(4)
        for i, name in enumerate(robot.joint_names):
            body = body.add_body(name=f"body {i + 1}")
            mujoco.mju_mat2Quat(quaternion, bodies.R[i].ravel())
            body.pos, body.quat = bodies.t[i], quaternion.copy()
            body.mass, body.ipos = max(bodies.mass[i], NOTHING), bodies.centre[i]
            inertia = bodies.inertia[i] + NOTHING * np.eye(3)
            body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            body.explicitinertial = True
            kind = mujoco.mjtJoint.mjJNT_SLIDE if bodies.prismatic[i] else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=name, type=kind, axis=bodies.axis[i])
        try:
            self.model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ConfigurationError(f"plant: MuJoCo cannot take {robot.name}: {described(error)}") from error
        self.model.dof_armature[:] = bodies.rotor
        self.data = mujoco.MjData(self.model)

    def step(self, x: Array, torque: Array) -> None:
        """Integrate a substep of the state x (s, n), q and q̇ first, with held torques (n,)."""
        data = self.data
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = x[0], x[1], torque
        self._mujoco.mj_step(self.model, data)
        x[0], x[1] = data.qpos, data.qvel
