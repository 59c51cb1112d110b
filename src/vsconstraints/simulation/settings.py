"""Settings of plants and sensors that optional parts add, tables of a scenario.

A part registers the classes of its settings by table and type, see
:class:`vsconstraints.plugins.registry.Part`. What they describe is imported when a run needs it.
"""

from __future__ import annotations

from typing import ClassVar, Protocol


class PlantSettings(Protocol):
    """Table ``plant`` of a scenario: what moves the robot instead of eq. (6)."""

    #: Class of the plant, a :class:`.Plant`, as ``module:Class``. It is called with the robot,
    #: these settings, q (n,) and q̇ (n,) at the start, T_s [s], the joint limits or None, and the
    #: :class:`.LowLevelLoop` that it follows or None.
    made_by: ClassVar[str]


class SensorSettings(Protocol):
    """Table ``sensor`` of a scenario: the measurements of the controller."""

    #: Class of the sensor, a :class:`.Sensor`, as ``module:Class``. It is called with the scene,
    #: the disturbances, these settings, the renderer and T_s [s].
    made_by: ClassVar[str]
    #: Class of the renderer of images, as ``module:Class``. It is called with the scene, these
    #: settings, the constraints, q (n,) at the start and the seed.
    rendered_by: ClassVar[str]

    @property
    def latency_s(self) -> float:
        """Age of a measurement when it can be used [s]."""

    @property
    def random(self) -> bool:
        """True if anything is drawn from the seed."""
