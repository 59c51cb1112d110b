"""Image-based visual servoing with NumPy alone: python3 image_based.py is a whole stack."""

import json
import sys

import numpy as np

uses = ["camera", "goals", "target", "pixels", "pose", "jacobian"]
print(json.dumps({"protocol": 1, "name": "image-based", "uses": uses, "output": "velocity"}), flush=True)
setup = json.loads(sys.stdin.readline())
f, c = np.reshape(setup["camera"]["intrinsics"], (2, 2))
markers, gain = np.array(setup["target"]["markers"]), setup["settings"].get("gain", 1.0)
for line in sys.stdin:
    now = json.loads(line)
    x = (np.array(now["pixels"]) - c) / f
    wanted = (np.array(setup["goals"][now["goal"]]["pixels"]) - c) / f
    pose = np.array(now["camera_in_target"])
    Z = (markers - pose[:3, 3]) @ pose[:3, 2]
    L = [[[-1 / z, 0, u / z, u * v, -1 - u * u, v], [0, -1 / z, v / z, 1 + v * v, -u * v, -u]]
         for (u, v), z in zip(x, Z)]  # fmt: skip
    qd = -gain * np.linalg.pinv(np.concatenate(L) @ now["jacobian"]) @ (x - wanted).ravel()
    print(json.dumps({"velocity": qd.tolist()}), flush=True)
