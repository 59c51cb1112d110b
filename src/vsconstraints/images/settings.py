"""Table ``sensor`` of a scenario whose controller sees images.

It states how the images are taken and evaluated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from ..errors import InvalidInput, format_value, unknown_name
from ..robots.geometry import require_sign
from ..simulation.occluders import OpaqueName

DetectorName = Literal["apriltag", "aruco"]
DepthName = Literal["pose", "model"]

LAST_ID = 586  #: Largest number of a tag: the family tag36h11 has 587 tags.


@dataclass(frozen=True)
class ImageSettings:
    """Settings of an image sensor.

    Images are rendered and tags are detected in them. The result is the controller's measurement.
    """

    made_by: ClassVar[str] = "vsconstraints.images.sensor:ImageSensor"
    rendered_by: ClassVar[str] = "vsconstraints.images.sensor:SceneRenderer"
    #: Images per second; each is taken at the first sample that is not before its time.
    rate_hz: float = 30.0
    latency_s: float = 0.03  #: Delay until an image can be used [s]; control waits for the first.
    detector: DetectorName = "apriltag"
    prediction: bool = True  #: True to extrapolate images by the known motion until the next one.
    #: Depth in an image: of the estimated "pose", of the "model", or a constant [m].
    depth: DepthName | float = "pose"
    noise: float = 2.0  #: Standard deviation of every grey level, of 256.
    blur_px: float = 0.5  #: Standard deviation of the lens's blur [px].
    light: float = 1.0  #: Factor on all grey levels; values above 255 are white.
    exposure_s: float = 0.0  #: Exposure time, during which moving objects are smeared [s].
    #: Delay of the last row behind the first [s]; 0 for a global shutter.
    rolling_s: float = 0.0
    tag_side_m: float | None = None  #: Side of a black square [m]; the largest possible if None.
    #: Numbers of the tags to detect, one per marker; 0, 1, … if None.
    tags: Sequence[int] | None = None
    #: Numbers of the tags that the board really has; equal to ``tags`` if None.
    printed: Sequence[int] | None = None
    opaque: Sequence[OpaqueName] = ("links", "bodies")  #: Further occluders of the tags.
    #: Time for which control uses the last usable image before it brakes [s].
    patience_s: float = 0.25

    def __post_init__(self) -> None:
        if self.detector not in get_args(DetectorName):
            raise unknown_name("detector of sensor", self.detector, get_args(DetectorName))
        if isinstance(self.depth, str) and self.depth not in get_args(DepthName):
            raise unknown_name("depth of sensor", self.depth, get_args(DepthName))
        depth = () if isinstance(self.depth, str) else ("depth",)
        positive = "rate_hz", "light", "tag_side_m", "patience_s", *depth
        least = "latency_s", "noise", "blur_px", "exposure_s", "rolling_s"
        require_sign(self, "sensor: ", positive=positive, zero_or_more=least)
        period = 1.0 / self.rate_hz
        for name in ("exposure_s", "rolling_s"):
            duration = getattr(self, name)
            if duration > period:
                raise InvalidInput(
                    f"sensor: {name} must not exceed the time between images, {period:.3g} s, not "
                    f"{format_value(duration)}"
                )
        for kind in self.opaque:
            if kind not in get_args(OpaqueName):
                raise unknown_name("entry of opaque of sensor", str(kind), get_args(OpaqueName))
        for name in ("tags", "printed"):
            ids = getattr(self, name)
            if ids is not None and not set(ids) <= set(range(LAST_ID + 1)):
                raise InvalidInput(
                    f"sensor: {name} must be numbers from 0 to {LAST_ID}, not "
                    f"{format_value(list(ids))}"
                )
        if self.tags is not None and len({*self.tags}) != len(self.tags):
            raise InvalidInput(
                f"sensor: tags must differ from one another, not {format_value(list(self.tags))}"
            )

    @property
    def random(self) -> bool:
        """True if anything is drawn from the seed."""
        return self.noise > 0.0

    def number(self, t: float) -> int:
        """Return the number of the last image that is due at t [s]."""
        return math.floor(t * self.rate_hz + 1e-6)

    def expected_tags(self, markers: int) -> tuple[int, ...]:
        """Return the numbers of the tags to detect for a number of markers."""
        return tuple(range(markers)) if self.tags is None else tuple(self.tags)
