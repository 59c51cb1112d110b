"""The table ``sensor`` of a scenario whose controller sees images: how they are taken and evaluated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ...errors import InvalidInput, shown, unknown_name

DetectorName = Literal["apriltag", "aruco"]
DepthName = Literal["pose", "model"]
OpaqueName = Literal["links", "bodies", "regions"]

LAST_ID = 586
"""The family tag36h11 has 587 tags."""


@dataclass(frozen=True)
class ImageSettings:
    """Images are rendered, tags in them detected, and what that says is what a controller believes.

    Attributes
    ----------
    rate_hz
        Images a second; each is taken at the first sample that is not before its time.
    latency_s
        How long after that it can be used: exposure, transfer and detection [s]. The first is waited for.
    detector
        ``"apriltag"``, or OpenCV's ``"aruco"``.
    prediction
        Whether what an image shows is moved on by the known motion until the next one; it is held if not.
    depth
        Of the markers: that of the ``"pose"`` that explains the image, that of the scene as the control's ``"model"``
        has it, or always the same number [m].
    noise
        Standard deviation of every grey level, of 256.
    blur_px
        Standard deviation of the lens's blur [px].
    light
        Factor on all grey levels; what exceeds 255 is white.
    exposure_s
        How long the shutter is open: things that move are smeared [s].
    rolling_s
        How much later the last row of an image is taken than the first; 0 is a global shutter [s].
    tag_side_m
        Side of the tags' black squares [m]; as large as the markers' distances let it be if None.
    tags
        Numbers of the tags that are looked for, one per marker; 0, 1, 2, … if None.
    printed
        Numbers of those that the board really has; the same if None.
    opaque
        What stands before the tags besides what occludes: the arm's own ``"links"``, ``"bodies"`` of collision
        constraints, forbidden ``"regions"`` that have an end.
    patience_s
        How long the control goes on with an image that is the last that could be used, before the arm is braked [s].
    """

    rate_hz: float = 30.0
    latency_s: float = 0.03
    detector: DetectorName = "apriltag"
    prediction: bool = True
    depth: DepthName | float = "pose"
    noise: float = 2.0
    blur_px: float = 0.5
    light: float = 1.0
    exposure_s: float = 0.0
    rolling_s: float = 0.0
    tag_side_m: float | None = None
    tags: Sequence[int] | None = None
    printed: Sequence[int] | None = None
    opaque: Sequence[OpaqueName] = ("links", "bodies")
    patience_s: float = 0.25

    def __post_init__(self) -> None:
        if self.detector not in get_args(DetectorName):
            raise unknown_name("detector of sensor", self.detector, get_args(DetectorName))
        if isinstance(self.depth, str) and self.depth not in get_args(DepthName):
            raise unknown_name("depth of sensor", self.depth, get_args(DepthName))
        for name in ("rate_hz", "light", "tag_side_m", "patience_s", "depth"):
            value = getattr(self, name)
            if not (value is None or isinstance(value, str) or (np.isfinite(value) and value > 0.0)):
                raise InvalidInput(f"sensor: {name} must be positive, not {shown(value)}")
        for name in ("latency_s", "noise", "blur_px", "exposure_s", "rolling_s"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise InvalidInput(f"sensor: {name} must be zero or more, not {shown(value)}")
        for name in ("exposure_s", "rolling_s"):
            if getattr(self, name) > 1.0 / self.rate_hz:
                raise InvalidInput(
                    f"sensor: {name} must not exceed the time between images, {1.0 / self.rate_hz:.3g} s, not "
                    f"{shown(getattr(self, name))}"
                )
        for kind in self.opaque:
            if kind not in get_args(OpaqueName):
                raise unknown_name("entry of opaque of sensor", str(kind), get_args(OpaqueName))
        for name in ("tags", "printed"):
            ids = getattr(self, name)
            if ids is not None and not all(int(one) == one and 0 <= one <= LAST_ID for one in ids):
                raise InvalidInput(f"sensor: {name} must be numbers from 0 to {LAST_ID}, not {shown(list(ids))}")
        if self.tags is not None and len({*self.tags}) != len(self.tags):
            raise InvalidInput(f"sensor: tags must differ from one another, not {shown(list(self.tags))}")

    @property
    def random(self) -> bool:
        """Whether anything is drawn from the seed."""
        return self.noise > 0.0

    def number(self, t: float) -> int:
        """Number of the last image whose time has come at t [s]."""
        return math.floor(t * self.rate_hz + 1e-6)

    def looked_for(self, markers: int) -> tuple[int, ...]:
        """Numbers of the tags of so many markers."""
        return tuple(range(markers)) if self.tags is None else tuple(self.tags)


SENSORS: dict[str, type[ImageSettings]] = {"images": ImageSettings}
"""Types of sensors that scenario files know; without one, markers are measured as ``disturbances`` say."""
