"""What is to be said of a start before a run begins: what keeps it from beginning, and what a reader should know."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..constraints import ImageConstraint
from ..errors import ConfigurationError
from .line_of_sight import LinesOfSight

if TYPE_CHECKING:
    from .setup import Setup


def remarks_at_start(setup: Setup) -> list[str]:
    """See :meth:`vsconstraints.simulation.Setup.check_start`, which says more of what is raised."""
    camera = setup.scene.camera
    state = setup.scene.evaluate(0.0, setup.q0, setup.qd0)
    pixels = state.pixels.position
    unseen = [
        f"marker {i + 1} at ({u:.0f}, {v:.0f}) px" for i, (u, v) in enumerate(pixels) if not camera.sees(pixels[i])
    ]
    if unseen:
        raise ConfigurationError(
            f"at the start, outside the image of {camera.size[0]:g} × {camera.size[1]:g} px: {', '.join(unseen)} "
            "from its centre"
        )
    remarks = _check_sight(setup)
    rows, sigma = setup.constraints.rows(state)
    first = 0
    for constraint, count, _ in setup.constraints.blocks():
        own = slice(first, first := first + count)
        refusal = constraint.refusal(sigma[own], rows.labels[own])
        if refusal:
            raise ConfigurationError(refusal)
    violated = [f"{rows.labels[i]} is violated at the start: σ = {sigma[i]:.3g}" for i in np.flatnonzero(sigma > 0.0)]
    return remarks + violated + _forbidden_goals(setup)


def _check_sight(setup: Setup) -> list[str]:
    try:
        lines = LinesOfSight(setup.scene)
    except ConfigurationError as error:
        return [f"lines of sight are not checked: {error}"]
    hidden = [f"marker {number} by {link}" for number, link in lines.hidden(setup.q0, 0.0)]
    if hidden and setup.on_hidden_markers == "refuse":
        raise ConfigurationError(
            f"at the start the robot itself hides markers from the camera: {', '.join(hidden)}; "
            'on_hidden_markers = "continue" runs it all the same'
        )
    return [f"at the start the robot itself hides markers: {', '.join(hidden)}"] if hidden else []


def _forbidden_goals(setup: Setup) -> list[str]:
    remarks = []
    for number, goal in enumerate(setup.task.goals, start=1):
        for constraint in setup.constraints.constraints:
            # what moves may be elsewhere by then
            if isinstance(constraint, ImageConstraint) and constraint.motion is None:
                forbidden = constraint.sigma(constraint.of_markers(goal.pixels)) > 0.0
                labels = constraint.labels(setup.scene)
                remarks += [f"goal {number} is forbidden by {labels[i]}" for i in np.flatnonzero(forbidden)]
    return remarks
