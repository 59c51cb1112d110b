"""Figures of a report: one of the whole comparison, and the list of those of each scenario."""

from ..plots import Figure
from .overview import draw_trade_off
from .signals import draw_acceleration, draw_errors, draw_phi
from .tracks import draw_tracks
from .view import View

__all__ = ["FIGURES", "OVERVIEW", "View"]
#: Drawn from :class:`~vsconstraints.reports.results.Results`.
OVERVIEW = Figure.named("trade-off", draw_trade_off)
TRACKS = Figure.named("tracks", draw_tracks)
PHI = Figure.named("phi", draw_phi)
ERRORS = Figure.named("errors", draw_errors)
ACCELERATION = Figure.named("acceleration", draw_acceleration)
#: Figures of each scenario in the order of the report, before those that parts register; drawn
#: from a :class:`View`.
FIGURES = (TRACKS, PHI, ERRORS, ACCELERATION)
