"""A run of a MuJoCo model, without vsconstraints: joints move straight to the goal.

``python examples/mujoco_run.py run.csv`` writes times, positions and speeds of the joints. Then
``vsconstraints score run.csv --scenario examples/my-arm.toml`` scores them.
"""

import csv
import re
import sys
from pathlib import Path

import mujoco
import numpy as np

START = np.array([0.0, 0.3, 1.4, 0.0, 1.3, 0.0])
GOAL = np.array([0.12, 0.35, 1.5, 0.1, 1.15, 1.4])
DURATION = 3.0  # of the motion [s], which ends at rest
STIFFNESS, DAMPING = 400.0, 40.0  # of the servo loops, for unit inertia [1/s², 1/s]


def arm() -> mujoco.MjModel:
    """The arm of the scenario; its links have no inertia in the URDF file."""
    text = (Path(__file__).parent / "six_axis.urdf").read_text()
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    body = f'><inertial><mass value="1"/>{inertia}</inertial></link>'
    return mujoco.MjModel.from_xml_string(re.sub(r'(<link name="\w+")/>', rf"\1{body}", text))


def main(path: str) -> None:
    model = arm()
    data = mujoco.MjData(model)
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(model.njnt)]
    data.qpos[:] = START
    mujoco.mj_forward(model, data)
    with open(path, "w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(["t", *(f"{n}.position" for n in names), *(f"{n}.velocity" for n in names)])
        while data.time < DURATION + 1.0:
            lines.writerow([data.time, *data.qpos, *data.qvel])
            share = min(data.time / DURATION, 1.0)
            wanted = START + share**3 * (10 - 15 * share + 6 * share**2) * (GOAL - START)
            pull = STIFFNESS * (wanted - data.qpos) - DAMPING * data.qvel
            torque = np.zeros(model.nv)
            mujoco.mj_mulM(model, data, torque, pull)
            data.qfrc_applied[:] = torque + data.qfrc_bias
            mujoco.mj_step(model, data)


main(sys.argv[1])
