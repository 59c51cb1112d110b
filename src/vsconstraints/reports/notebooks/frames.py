"""Runs as data frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...plugins.extras import demand
from ...simulation import Trajectory

if TYPE_CHECKING:
    import pandas as pd

OF_JOINTS = ("q", "qd", "qdd_command")
OF_ROWS = ("phi", "sigma", "clearance", "active")
SINGLE = ("feature_error_px", "saturated", "rows_time", "step_time")
"""Fields of a trajectory, by what their second axis counts."""


def frame_of(trajectory: Trajectory) -> pd.DataFrame:
    """A trajectory as a data frame with one line per sample, by its time [s]; units are those of the trajectory.

    Columns have two levels: what, and of what. ``frame["phi"]["fov[marker 2]"]`` is a row's φ, ``frame["q"]`` has
    columns ``joint 1``, ``joint 2``, …; what there is one of in a sample has an empty second level.

    Raises
    ------
    ConfigurationError
        if pandas is not installed.
    """
    demand("pandas")
    import pandas as pd

    columns: dict[tuple[str, str], Any] = {}

    def put(what: str, names: list[str], values: Any) -> None:
        columns.update({(what, name): values[:, i] for i, name in enumerate(names)})

    def numbered(name: str, values: Any) -> list[str]:
        return [f"{name} {i + 1}" for i in range(np.shape(values)[1])]

    for what in OF_JOINTS:
        put(what, numbered("joint", getattr(trajectory, what)), getattr(trajectory, what))
    put("error", numbered("feature", trajectory.error), trajectory.error)
    put("camera_error", ["distance [m]", "angle [rad]"], trajectory.camera_error)
    put("camera_position", ["x", "y", "z"], trajectory.camera_position)
    for axis, what in enumerate(("u_px", "v_px")):
        put(what, numbered("marker", trajectory.features_px), trajectory.features_px[:, :, axis])
    for what in OF_ROWS:
        put(what, list(trajectory.labels), getattr(trajectory, what))
    columns |= {(what, ""): getattr(trajectory, what) for what in SINGLE}
    frame = pd.DataFrame(columns, index=pd.Index(trajectory.t, name="t"))
    frame.columns = pd.MultiIndex.from_tuples(columns)
    return frame


def table_of(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Lines of a table as a data frame; raises ConfigurationError if pandas is not installed."""
    demand("pandas")
    import pandas as pd

    return pd.DataFrame(lines)
