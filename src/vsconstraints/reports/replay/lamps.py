"""What of a scene a row is about, and when it is lit because of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np

from ...constraints import Collision, ForbiddenRegion
from .frames import OFF, Frames, Lights
from .run import ReplayRun

Thing = Literal["marker", "joint", "obstacle"]


@dataclass(frozen=True)
class Lamp:
    """A thing that is lit.

    Attributes
    ----------
    what, number
        A marker or a joint, counted from 1, or an obstacle: the place of its constraint in the list.
    run
        Of which run, for joints and for markers that the robot carries; the first one for what runs share.
    lights
        (F,) what it says in each frame.
    """

    what: Thing
    number: int
    run: int
    lights: Lights


def lamps_of(runs: Sequence[ReplayRun], frames: Frames) -> list[Lamp]:
    """The lamps of everything that is lit at all; markers and obstacles are lit by the rows of any run."""
    found: dict[tuple[Thing, int, int], Lights] = {}
    for k, run in enumerate(runs):
        lights = frames.lights(run)
        for i, thing in enumerate(things_of(run)):
            if thing is not None and lights[:, i].any():
                carried = thing[0] == "marker" and run.setup.scene.camera.fixed is not None
                own = k if thing[0] == "joint" or carried else 0
                key = (*thing, own)
                found[key] = np.maximum(found.get(key, np.full(len(frames.t), OFF, dtype=np.uint8)), lights[:, i])
    return [Lamp(*key, lights) for key, lights in found.items()]


def things_of(run: ReplayRun) -> list[tuple[Thing, int] | None]:
    """(m,) what each row is about: a marker, a joint or an obstacle, with its number; None if it is none of them."""
    blocks = run.setup.constraints.blocks()
    owners = chain.from_iterable([k] * count for k, (_, count, _) in enumerate(blocks))
    return [_thing(run, label, owner) for label, owner in zip(run.setup.constraints.labels, owners, strict=True)]


def _thing(run: ReplayRun, label: str, owner: int) -> tuple[Thing, int] | None:
    if isinstance(run.setup.constraints.constraints[owner], ForbiddenRegion | Collision):
        return "obstacle", owner
    named = re.search(r"(marker|joint) (\d+)\]", label)
    if named is None:
        return None
    what: Thing = "marker" if named[1] == "marker" else "joint"
    number, most = int(named[2]), len(run.setup.scene.markers) if what == "marker" else run.setup.scene.robot.n
    return (what, number) if number <= most else None
