"""Where images come from while an arm moves: a camera with its detector, the scenario's simulated
one, or nothing.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigurationError, described, shown
from ..plugins.classes import beside
from ..rows import Array
from ..simulation import Setup
from ..simulation.image_sensor import ImageSensor
from ..vision.measurement import Measurement

ImageSource = Callable[[float, Array], Measurement | None]
"""Called in each period with the time [s] and the measured q (n,): what the newest image shows,
None before the first.

It must return at once: a camera is read, and its image searched, in a thread or process of its own.
``taken`` of the measurement is by the same clock as the time argument; pixels are those on the
sensor, from the image's centre, NaN for markers that were not found. The camera's pose will do
without pixels.
"""

SOURCES = SIMULATED, MODEL = "simulated", "model"


class SimulatedImages:
    """The scenario's camera: its noise, image period, delay and lost images, seen from where the
    arm is measured to be.

    With ``sensor = "images"`` images are rendered and searched for tags, which takes longer than a
    period, and ``renders`` says so. Raises ConfigurationError if the scenario's camera is believed
    to be another one than it is.
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
                "a simulated camera sees as the scenario's camera does: disturbances of "
                "calibration, mount, depth and "
                "target are for `compare`"
            )
        if setup.images is None:
            setup = replace(setup, disturbances=replace(wrong, delay_known=True))
        self._setup = setup
        self._sensor = setup.sensor()
        self._sample = 0
        self._world = setup.world()
        self.renders = isinstance(self._sensor, ImageSensor)

    def __call__(self, t: float, q: Array) -> Measurement | None:
        """What is seen, and when; a lost image leaves the last one."""
        scene = self._setup.scene
        k = self._sample
        self._sample += 1
        if isinstance(self._sensor, ImageSensor):
            seen = self._sensor.measured(k, q, np.zeros_like(q))
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
        """What a reader of the results should know of rendered images."""
        return self._sensor.remarks()


def image_source(name: str, setup: Setup, folder: Path | None = None) -> ImageSource | None:
    """The source of images, by its name; None where the image is predicted from the joints alone.

    ``simulated``, ``model``, or ``module:function`` for one's own, looked for in ``folder`` first:
    it takes the setup, and returns an :data:`ImageSource`. Raises ConfigurationError if there is
    none, or the own function fails.
    """
    if name == MODEL:
        return None
    if name == SIMULATED:
        return SimulatedImages(setup)
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        raise ConfigurationError(
            f"images come from simulated, model, or module:function, not {shown(name)}"
        )
    try:
        with chdir("."), beside(folder, Path()):
            source: Any = getattr(importlib.import_module(module), function)(setup)
    except (Exception, SystemExit) as error:  # own code can fail in any way
        raise ConfigurationError(f"images by {name}: {described(error)}") from error
    if not callable(source):
        raise ConfigurationError(
            f"images by {name}: it must return what can be called, not {shown(source)}"
        )
    own: ImageSource = source
    return own
