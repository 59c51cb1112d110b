"""A camera as the compiled step has it."""

from __future__ import annotations

from ..robots.geometry import Pose
from ..vision.camera import Camera
from .structures import Step


def write_camera(step: Step, camera: Camera) -> None:
    """Write what pixels are, and where the camera is; where the tip is in the last body has to be written before."""
    record = step.camera[0]
    eye = camera.fixed or Pose(record["tip_R"].copy(), record["tip_t"].copy()) @ camera.mount.inverse
    for name, value in (
        ("R", eye.R), ("t", eye.t), ("fixed", camera.fixed is not None),
        ("focal", camera.focal), ("offset", camera.offset), ("depth_factor", 1.0),
    ):  # fmt: skip
        record[name] = value
