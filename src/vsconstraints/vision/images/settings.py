"""The table ``sensor`` of a scenario whose controller sees images: how they are taken and
evaluated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from ...errors import InvalidInput, shown, unknown_name
from ...robots.geometry import demand_sign

DetectorName = Literal["apriltag", "aruco"]
DepthName = Literal["pose", "model"]
OpaqueName = Literal["links", "bodies", "regions"]

LAST_ID = 586  #: The family tag36h11 has 587 tags.


@dataclass(frozen=True)
class ImageSettings:
    """Images are rendered, tags in them detected, and what that says is what a controller
    believes.
    """

    #: Images a second; each is taken at the first sample that is not before its time.
    rate_hz: float = 30.0
    latency_s: float = 0.03  #: How long after that it can be used [s]. The first is waited for.
    detector: DetectorName = "apriltag"
    prediction: bool = True  #: Whether images are moved on by the known motion until the next one.
    #: In an image: by the "pose" that explains it, the "model", or always this [m].
    depth: DepthName | float = "pose"
    noise: float = 2.0  #: Standard deviation of every grey level, of 256.
    blur_px: float = 0.5  #: Standard deviation of the lens's blur [px].
    light: float = 1.0  #: Factor on all grey levels; what exceeds 255 is white.
    exposure_s: float = 0.0  #: How long the shutter is open: things that move are smeared [s].
    #: How much later the last row is taken than the first; 0 is a global shutter [s].
    rolling_s: float = 0.0
    tag_side_m: float | None = None  #: Of the tags' black squares [m]; as large as can be if None.
    #: Numbers of the tags that are looked for, one per marker; 0, 1, … if None.
    tags: Sequence[int] | None = None
    #: Numbers of those that the board really has; the same if None.
    printed: Sequence[int] | None = None
    opaque: Sequence[OpaqueName] = ("links", "bodies")  #: What hides tags besides what occludes.
    #: How long control goes on with the last usable image before it brakes [s].
    patience_s: float = 0.25

    def __post_init__(self) -> None:
        if self.detector not in get_args(DetectorName):
            raise unknown_name("detector of sensor", self.detector, get_args(DetectorName))
        if isinstance(self.depth, str) and self.depth not in get_args(DepthName):
            raise unknown_name("depth of sensor", self.depth, get_args(DepthName))
        depth = () if isinstance(self.depth, str) else ("depth",)
        positive = "rate_hz", "light", "tag_side_m", "patience_s", *depth
        least = "latency_s", "noise", "blur_px", "exposure_s", "rolling_s"
        demand_sign(self, "sensor: ", positive=positive, zero_or_more=least)
        for name in ("exposure_s", "rolling_s"):
            if getattr(self, name) > 1.0 / self.rate_hz:
                raise InvalidInput(
                    f"sensor: {name} must not exceed the time between images, "
                    f"{1.0 / self.rate_hz:.3g} s, not "
                    f"{shown(getattr(self, name))}"
                )
        for kind in self.opaque:
            if kind not in get_args(OpaqueName):
                raise unknown_name("entry of opaque of sensor", str(kind), get_args(OpaqueName))
        for name in ("tags", "printed"):
            ids = getattr(self, name)
            if ids is not None and not all(int(one) == one and 0 <= one <= LAST_ID for one in ids):
                raise InvalidInput(
                    f"sensor: {name} must be numbers from 0 to {LAST_ID}, not {shown(list(ids))}"
                )
        if self.tags is not None and len({*self.tags}) != len(self.tags):
            raise InvalidInput(
                f"sensor: tags must differ from one another, not {shown(list(self.tags))}"
            )

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


#: Types of sensors that scenario files know; without one, markers are measured as ``disturbances``
#: say.
SENSORS: dict[str, type[ImageSettings]] = {"images": ImageSettings}
