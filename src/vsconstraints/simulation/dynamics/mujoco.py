"""The same arm in MuJoCo: its kinematics, inertia, bias and integration instead of this package's."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pinocchio as pin

from ...compiled.arm import BodyArrays
from ...errors import ConfigurationError, described
from ...plugins.extras import demand
from ...robots.robot import Robot
from ...robots.urdf import UrdfSource
from ...rows import Array
from .settings import ArmDynamics

NOTHING = 1e-12
"""Mass and inertia of links that have none, which MuJoCo does not take [kg, kg m²]."""


class MujocoArm:
    """Moves an arm in MuJoCo by the torques and the friction of the plant.

    A URDF is loaded directly, without its geometry, so that there is no contact; other robots are built body by body.

    Parameters
    ----------
    robot
        Whose kinematics it has.
    model, bodies
        Its bodies with their masses, the payload among them.
    dynamics
        Payload and gravity.
    h
        Substep [s].

    Raises
    ------
    ConfigurationError
        if MuJoCo is not installed, or cannot take the robot.
    """

    def __init__(self, robot: Robot, model: pin.Model, bodies: BodyArrays, dynamics: ArmDynamics, h: float) -> None:
        demand("physics")
        import mujoco

        self._mujoco = mujoco
        # it would write warnings of unbounded motions to a file; the loop reports them
        mujoco.set_mju_user_warning(lambda _: None)
        try:
            if robot.source:
                spec = self._of_urdf(robot, robot.source, dynamics)
            else:
                spec = self._of_chain(robot, model, bodies)
            spec.option.timestep, spec.option.gravity = h, bodies.gravity
            spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
            off = mujoco.mjtDisableBit
            spec.option.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_AUTORESET
            self.model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ConfigurationError(f"plant: MuJoCo cannot take {robot.name}: {described(error)}") from error
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joint_names]
        self._q_at = np.array([int(joint.qposadr[0]) for joint in joints])
        self._qd_at = np.array([int(joint.dofadr[0]) for joint in joints])
        self.model.dof_armature[self._qd_at] = model.armature
        # friction is the plant's, not the file's
        self.model.dof_damping[:], self.model.dof_frictionloss[:] = 0.0, 0.0

    def step(self, x: Array, torque: Array) -> None:
        """Integrate a substep of the state x (s, n), q and q̇ first, with held torques (n,)."""
        data = self.data
        data.qpos[self._q_at], data.qvel[self._qd_at] = x[0], x[1]
        data.qfrc_applied[self._qd_at] = torque
        self._mujoco.mj_step(self.model, data)
        x[0], x[1] = data.qpos[self._q_at], data.qvel[self._qd_at]

    def _of_urdf(self, robot: Robot, source: UrdfSource, dynamics: ArmDynamics) -> Any:
        """The URDF itself with the payload, its locked joints fixed and without its geometry."""
        root = ElementTree.parse(source.path).getroot()
        for link in root.iter("link"):
            for kind in ("visual", "collision"):
                for part in link.findall(kind):
                    link.remove(part)
        for joint in root.iter("joint"):
            name = str(joint.get("name"))
            if joint.get("type") != "fixed" and name not in robot.joint_names:
                if source.model.existJointName(name):
                    where = source.positions[source.model.joints[source.model.getJointId(name)].idx_q]
                    if where != 0.0:
                        raise ConfigurationError(
                            f"plant: MuJoCo takes joints locked at 0 only, not {name} at {where:g}"
                        )
                joint.set("type", "fixed")
                for mimic in joint.findall("mimic"):
                    joint.remove(mimic)
        compiler = ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler")
        compiler.set("fusestatic", "false")
        spec = self._mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
        payload = dynamics.payload
        if payload is not None and payload.mass > 0.0:
            about = max(float(payload.inertia().inertia[0, 0]), NOTHING)
            tip = spec.body(robot.model.frames[robot.frame_id("tip")].name)
            ball = tip.add_body(name="payload", pos=payload.centre)
            ball.ipos, ball.explicitinertial = np.zeros(3), True
            ball.mass, ball.inertia = payload.mass, [about] * 3
        return spec

    def _of_chain(self, robot: Robot, model: pin.Model, bodies: BodyArrays) -> Any:
        """Body after body from the robot's model."""
        mujoco, spec = self._mujoco, self._mujoco.MjSpec()
        body = spec.worldbody
        for i, placement in enumerate(list(model.jointPlacements)[1:]):
            body = body.add_body(name=f"body {i + 1}")
            quaternion = np.empty(4)
            mujoco.mju_mat2Quat(quaternion, np.array(placement.rotation).ravel())
            body.pos, body.quat = np.array(placement.translation), quaternion
            inertia = bodies.inertia[i] + NOTHING * np.eye(3)
            body.mass, body.ipos = max(bodies.mass[i], NOTHING), bodies.centre[i]
            body.fullinertia = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            body.explicitinertial = True
            kind = mujoco.mjtJoint.mjJNT_SLIDE if robot.prismatic[i] else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=robot.joint_names[i], type=kind, axis=[0.0, 0.0, 1.0])
        return spec
