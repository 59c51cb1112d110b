"""Motions and disturbances as scenario files describe them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from ..motion import Motion, TargetMotion
from ..rows import Array
from ..simulation.disturbances import Disturbances
from .section import Section


def read_motion(section: Section) -> Motion:
    """The displacement that a ``motion`` table of a constraint describes."""
    motion = _translation(section)
    section.finish()
    return motion


def read_target_motion(section: Section, markers: Array) -> TargetMotion:
    """The motion that the target's ``motion`` table describes; by default it turns about the markers' mean."""
    motion = TargetMotion(
        _translation(section),
        section.array("angular_velocity", np.zeros(3), (3,)),
        section.array("centre", markers.mean(axis=0), (3,)),
    )
    section.finish()
    return motion


def _translation(section: Section) -> Motion:
    return Motion(
        section.array("velocity", None),
        amplitude=section.array("amplitude", None),
        frequency=float(section.number("frequency", 0.0)),
        phase=float(section.number("phase", 0.0)),
        known=section.take("known", bool, True),
    )


def read_disturbances(section: Section, seed: tuple[int, ...]) -> Disturbances:
    """What a ``disturbances`` table describes; numbers per joint may be given as one."""
    defaults = Disturbances()
    values: dict[str, Any] = {}
    for field in fields(Disturbances):
        name, default = field.name, getattr(defaults, field.name)
        if name == "seed":
            continue
        if name == "gradient_error_rows":
            values[name] = tuple(section.strings(name, list(default)))
        elif isinstance(default, tuple):
            one = name == "acceleration" and isinstance(section.peek(name), int | float)
            values[name] = (section.number(name),) if one else tuple(section.array(name, np.array(default)).tolist())
        elif isinstance(default, bool):
            values[name] = section.take(name, bool, default)
        elif isinstance(default, int):
            values[name] = section.take(name, int, default)
        else:
            values[name] = float(section.number(name, default))
    section.finish()
    return Disturbances(**values, seed=seed)
