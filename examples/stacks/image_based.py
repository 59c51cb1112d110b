"""Image-based visual servoing with NumPy alone: python3 image_based.py is a whole stack."""

import json
import sys

import numpy as np

uses = ["camera", "goals", "target", "pixels", "pose", "jacobian"]
declaration = {"protocol": 1, "name": "image-based", "uses": uses, "output": "velocity"}
print(json.dumps(declaration), flush=True)
setup = json.loads(sys.stdin.readline())
if setup["camera"]["distortion"]["model"] != "none":
    sys.exit("this stack is for cameras without distortion")
f, c = np.reshape(setup["camera"]["intrinsics"], (2, 2))
markers = np.array(setup["target"]["markers"])
gain = setup["settings"].get("gain", 1.0)
for line in sys.stdin:
    now = json.loads(line)
    x, y = (np.array(now["pixels"]) - c).T / f[:, None]
    x_goal, y_goal = (np.array(setup["goals"][now["goal"]]["pixels"]) - c).T / f[:, None]
    pose = np.array(now["camera_in_target"])
    Z = (markers - pose[:3, 3]) @ pose[:3, 2]
    none = np.zeros(len(Z))
    L_x = np.stack((-1 / Z, none, x / Z, x * y, -1 - x * x, y), axis=1)
    L_y = np.stack((none, -1 / Z, y / Z, 1 + y * y, -x * y, -x), axis=1)
    error = np.concatenate((x - x_goal, y - y_goal))
    J = np.concatenate((L_x, L_y)) @ np.array(now["jacobian"])
    velocity = -gain * np.linalg.pinv(J) @ error
    print(json.dumps({"velocity": velocity.tolist()}), flush=True)
