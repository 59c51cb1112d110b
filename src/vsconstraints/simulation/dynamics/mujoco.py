"""The same arm in MuJoCo: its kinematics, inertia, bias and integration instead of this package's."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import TYPE_CHECKING, Any

import numpy as np

from ...compiled.arm import Arm
from ...compiled.arm_motion import know_motion, rub
from ...errors import ConfigurationError, described
from ...plugins.extras import demand
from ...robots.robot import Robot
from ...robots.urdf import UrdfSource
from ...rows import Array
from .engine import PinocchioEngine

if TYPE_CHECKING:
    from .plant import DynamicPlant

NOTHING = 1e-12
"""Mass and inertia of links that have none, which MuJoCo does not take [kg, kg m²]."""


class MujocoEngine(PinocchioEngine):
    """Moves an arm by MuJoCo, with the torques and the friction of the plant.

    A URDF is loaded directly, without its geometry, so that there is no contact; other robots are built body by body.

    Raises
    ------
    ConfigurationError
        if MuJoCo is not installed, or cannot take the robot.
    """

    def __init__(self, plant: DynamicPlant) -> None:
        super().__init__(plant)
        robot = plant.robot
        demand("physics")
        import mujoco

        self._mujoco = mujoco
        # it would write warnings, of motions without bounds, to a file; the loop tells of them
        mujoco.set_mju_user_warning(lambda _: None)
        try:
            spec, tip = self._of_urdf(robot, robot.source) if robot.source else self._of_chain(robot, plant)
            self._write(spec, tip, plant)
            self.model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ConfigurationError(f"plant: MuJoCo cannot take {robot.name}: {described(error)}") from error
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joint_names]
        self._at = np.array([int(joint.qposadr[0]) for joint in joints])
        self._v_at = np.array([int(joint.dofadr[0]) for joint in joints])
        self.model.dof_armature[self._v_at] = plant.model.armature
        # friction is the plant's, not the file's
        self.model.dof_damping[:], self.model.dof_frictionloss[:] = 0.0, 0.0

    def move(self, arm: Arm, q: Array, qd: Array, command: Array) -> None:
        """As :func:`vsconstraints.compiled.arm_motion.substep`; the torque is held."""
        data, at, v_at = self.data, self._at, self._v_at
        rub(arm, qd)
        data.qpos[at], data.qvel[v_at] = q, qd
        data.qfrc_applied[v_at] = arm.memory.torque - arm.friction
        self._mujoco.mj_step(self.model, data)
        q[:], qd[:] = data.qpos[at], data.qvel[v_at]
        know_motion(self, arm, q, qd)

    def _write(self, spec: Any, tip: Any, plant: DynamicPlant) -> None:
        mujoco, arm = self._mujoco, plant.arm
        spec.option.timestep, spec.option.gravity = arm.h, arm.true.gravity
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        off = mujoco.mjtDisableBit
        spec.option.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_AUTORESET
        payload = plant.dynamics.payload
        # a chain's last body has it already
        if tip is not None and payload is not None and payload.mass > 0.0:
            about = max(float(payload.inertia().inertia[0, 0]), NOTHING)
            ball = tip.add_body(name="payload", pos=payload.centre)
            ball.ipos, ball.explicitinertial = np.zeros(3), True
            ball.mass, ball.inertia = payload.mass, [about] * 3

    def _of_urdf(self, robot: Robot, source: UrdfSource) -> tuple[Any, Any]:
        """The URDF itself, with its locked joints fixed and without its geometry."""
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
        frame = robot.model.frames[robot.frame_id("tip")]
        return spec, spec.body(frame.name)

    def _of_chain(self, robot: Robot, plant: DynamicPlant) -> tuple[Any, Any]:
        """Body after body from the robot's model."""
        mujoco, spec = self._mujoco, self._mujoco.MjSpec()
        body, bodies = spec.worldbody, plant.arm.true
        for i, placement in enumerate(list(plant.model.jointPlacements)[1:]):
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
        return spec, None
