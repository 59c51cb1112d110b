"""Scenes of the geometry of the paper's two experiments (section 10), drawn at random and selected by geometry alone.

The paper does not print where robot and target were. ``examples/draw_experiment_scenes.py`` draws an arm with its
camera looking down; a horizontal screen in what the camera sees from the goal; and by how much the start is off. A
scene is one of the experiment's geometry if ideal tracking would take exactly one marker across the boundary. No
simulation takes part, and no error of a gradient. Drawing takes a minute, so that the scenes are kept in
``experiment_scenes.json`` beside this file, with how many draws were rejected, and why.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple


class Experiment(NamedTuple):
    """One of the two experiments: the shipped scenario's name, and the kind of its visibility rows."""

    scenario: str
    kind: str


EXPERIMENTS = (Experiment("experiment-1-pbvs", "fov"), Experiment("experiment-2-ibvs", "occlusion"))

KEPT = Path(__file__).with_name("experiment_scenes.json")
"""By scenario: ``scenes``, entries by dotted keys, and ``rejected``, how many draws by reason."""


@cache
def kept_scenes() -> dict[str, Any]:
    """What :data:`KEPT` says."""
    kept: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8"))
    return kept
