"""The figures of reports, of runs at hand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...comparisons.metrics import Score
from ...errors import ConfigurationError, unknown_name
from ..figures import FIGURES, View
from ..selection import Weights, active_rows, relevant_rows


@dataclass(frozen=True)
class Plots:
    """What can be drawn of runs of one scenario, each a figure of matplotlib.

    Attributes
    ----------
    view
        The runs.
    """

    view: View

    def tracks(self) -> Any:
        """The markers' tracks in the image, with the boundaries of constraints in it."""
        return self._drawn("tracks", self.view)

    def rows(self, *labels: str) -> Any:
        """φ of rows over time, relative to one switching step T_s u⁺, and when rows hold the arm back.

        Parameters
        ----------
        labels
            Of the rows; those that are challenged or violated if none is given.

        Raises
        ------
        ConfigurationError
            if there is no row of that label, or none that held the arm back.
        """
        known = dict.fromkeys(label for run in self.view.runs.values() for label in run.trajectory.labels)
        for label in labels:
            if label not in known:
                raise unknown_name("row", label, known)
        view = replace(self.view, phi_rows=labels, lane_rows=labels) if labels else self.view
        return self._drawn("phi", view)

    def errors(self) -> Any:
        """Errors of the camera's pose or of the markers over time."""
        return self._drawn("errors", self.view)

    def command(self) -> Any:
        """Commanded joint accelerations over time, their means and ranges in short windows."""
        return self._drawn("acceleration", self.view)

    def _drawn(self, name: str, view: View) -> Any:
        if not view.runs:
            raise ConfigurationError("there is nothing to draw: no run left a trajectory")
        (figure,) = (one for one in FIGURES if one.name == name)
        drawn = figure.drawn(view)
        if drawn is None:
            raise ConfigurationError(f"there is nothing to draw of {figure.title}: no row is challenged or acts")
        return drawn

    def __repr__(self) -> str:
        return f"<Plots of {', '.join(self.view.shown) or 'no run'}: tracks(), rows(), errors(), command()>"


def rows_of(score: Score) -> dict[str, tuple[str, ...]]:
    """Which rows figures of one run show, as a view takes them."""
    weights: Weights = {
        str(line["constraint"]): (bool(line["challenged"]) or line["violation_depth"] > 0.0, line["active_time_s"])
        for line in score.constraints
    }
    return {"phi_rows": relevant_rows(weights), "lane_rows": active_rows(weights)}
