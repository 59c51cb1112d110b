"""Visual features with their goals: the camera's pose, markers in the image, and functions of both.

The pose and all markers are evaluated by :mod:`vsconstraints.compiled.visual_task`, which builds
the task. Other features are evaluated in NumPy.
"""

from .area import AreaCentroid
from .base import Feature, FeatureMotion, Goal, MinimumJerk
from .camera_pose import CameraPose, Rotation
from .depth import Depth
from .ellipse import Ellipse
from .image_points import ImagePoints, InteractionMatrix
from .line import Line
from .polar import Polar
from .segment import Segment
from .stack import Hybrid, Stack
from .view import View, ViewFeature

__all__ = [
    "FEATURES",
    "AreaCentroid",
    "CameraPose",
    "Depth",
    "Ellipse",
    "Feature",
    "FeatureMotion",
    "Goal",
    "Hybrid",
    "ImagePoints",
    "InteractionMatrix",
    "Line",
    "MinimumJerk",
    "Polar",
    "Rotation",
    "Segment",
    "Stack",
    "View",
    "ViewFeature",
]

#: Features by their names in scenario files; a file may also name ``module:Class``.
FEATURES: dict[str, type[Feature]] = {
    "camera-pose": CameraPose,
    "image-points": ImagePoints,
    "polar": Polar,
    "depth": Depth,
    "line": Line,
    "segment": Segment,
    "ellipse": Ellipse,
    "area-centroid": AreaCentroid,
    "rotation": Rotation,
    "2.5-d": Hybrid,
}
