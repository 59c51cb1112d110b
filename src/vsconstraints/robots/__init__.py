"""Arms: ready-made ones, from DH tables, from URDF files; their kinematics, limits and shapes."""

from .catalogue import (
    READY_MADE,
    free_camera,
    kuka_kr6,
    panda,
    planar_3r,
    ready_made,
    ur5,
    viper_s650,
)

__all__ = [
    "READY_MADE",
    "free_camera",
    "kuka_kr6",
    "panda",
    "planar_3r",
    "ready_made",
    "ur5",
    "viper_s650",
]
