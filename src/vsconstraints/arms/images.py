"""Sources of images while an arm moves: a camera with its detector, a simulated one, or none."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigurationError, described, format_value
from ..plugins.classes import beside
from ..rows import Array
from ..simulation import Setup
from ..vision.measurement import Measurement

ImageSource = Callable[[float, Array], Measurement | None]
"""Function called in each period with the time [s] and the measured q (n,).

It returns the content of the newest image, None before the first. It must return at once: read the
camera and search its image in a separate thread or process. ``taken`` of the measurement is by the
same clock as the time argument. Pixels are those on the sensor, relative to the image's centre, NaN
for markers that were not found. The camera's pose may be given instead of pixels.
"""

SOURCES = SIMULATED, MODEL = "simulated", "model"


class SimulatedImages:
    """Simulated camera of the scenario, with noise, image period, delay and lost images.

    It sees the scene from the measured joint positions. With ``sensor = "images"`` images are
    rendered and searched for tags, which takes longer than a period; then ``renders`` is True.
    Raises ConfigurationError if the scenario's camera model differs from the camera.
    """

    def __init__(self, setup: Setup) -> None:
        wrong = setup.disturbances
        if (
            wrong.intrinsics
            or wrong.distortion
            or wrong.mount
            or wrong.target
            or wrong.depth_factor != 1.0
        ):
            raise ConfigurationError(
                "the simulated camera is the scenario's: disturbances of calibration, mount, "
                "depth and target apply to `compare` only"
            )
        if setup.images is None:
            setup = replace(setup, disturbances=replace(wrong, delay_known=True))
        self._setup = setup
        self._sensor = setup.sensor()
        self._sample = 0
        self._world = setup.world()
        self.renders = self._sensor.renders

    def __call__(self, t: float, q: Array) -> Measurement | None:
        """Return pixels and time of the newest image; a lost image leaves the previous one."""
        scene = self._setup.scene
        k = self._sample
        self._sample += 1
        if self.renders:
            seen = self._sensor.measured(k, q, np.zeros_like(q))
            assert seen is not None
            assert seen.pixels is not None
            pixels = scene.camera.distort(seen.pixels)
            return (
                None
                if self._sensor.blind
                else Measurement(pixels, seen.depth, seen.taken, seen.camera)
            )
        world = self._world.evaluate(t, q, np.zeros_like(q))
        image = self._sensor.measured(k, q, np.zeros_like(q), world) or Measurement(
            world.pixels, None, t
        )
        assert image.pixels is not None
        return Measurement(scene.camera.distort(image.pixels), None, image.taken)

    def remarks(self) -> list[str]:
        """Remarks on rendered images for the reader of the results."""
        return self._sensor.remarks()


def image_source(name: str, setup: Setup, folder: Path | None = None) -> ImageSource | None:
    """Return the image source of a given name; None if images are predicted from the joints.

    ``simulated``, ``model``, or ``module:function`` for a custom source. The module is searched for
    in ``folder`` first; the function takes the setup and returns an :data:`ImageSource`. Raises
    ConfigurationError if it does not exist or fails.
    """
    if name == MODEL:
        return None
    if name == SIMULATED:
        return SimulatedImages(setup)
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        raise ConfigurationError(
            f"--images must be simulated, model, or module:function, not {format_value(name)}"
        )
    try:
        with chdir("."), beside(folder, Path()):
            source: Any = getattr(importlib.import_module(module), function)(setup)
    except (Exception, SystemExit) as error:  # custom code can fail in any way
        raise ConfigurationError(f"images by {name}: {described(error)}") from error
    if not callable(source):
        raise ConfigurationError(
            f"images by {name}: it must return a callable, not {format_value(source)}"
        )
    checked_source: ImageSource = source
    return checked_source
