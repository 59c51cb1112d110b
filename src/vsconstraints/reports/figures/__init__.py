"""Figures of a report: one of a whole comparison, and the table of those of each scenario."""

from ..plots import Figure
from .overview import draw_trade_off
from .signals import draw_acceleration, draw_disturbance, draw_errors, draw_phi
from .tracks import draw_tracks
from .view import View

__all__ = ["DISTURBANCE", "FIGURES", "OVERVIEW", "View"]

#: Drawn from :class:`~vsconstraints.reports.results.Results`.
OVERVIEW = Figure("trade-off", "utilization against acceleration variation",
    "Each small marker is one run that converged: how much of the allowed space it used while tracking alone is "
    "outside, and how much its command chattered. The lower right corner is best. Each controller's "
    "run that is nearest to its medians is large. Hollow: a row was violated.", draw_trade_off)  # fmt: skip

TRACKS = Figure("tracks", "the markers' tracks", "Tracks of the markers in the image.", draw_tracks,
    reading="**Tracks**: what is far outside the image is cut off. The square is shown enlarged beside its panel: "
    "it is where a controller is deepest outside by less than 5 % of the image or, if none is, where one that acts is "
    "nearest to a boundary.")  # fmt: skip

PHI = Figure("phi", "φ", "φ of the rows that matter, and when each row holds the arm back.", draw_phi,
    reading="**φ** is drawn relative to one switching step T_s u⁺, linear up to ±2 and logarithmic beyond; lines "
    "show the greatest value in short windows, shades the range. Allowed is below 0; the yellow band is ± one "
    "step. The bars below show when each row holds the arm back, short gaps closed. Rows are shown that are "
    "challenged or violated, and bars for rows that act.")  # fmt: skip

ERRORS = Figure("errors", "the errors", "Errors over time.", draw_errors,
    reading="**Errors** are drawn on a logarithmic axis. Where lines coincide, the later ones lie as thinner lines "
    "on the earlier ones.")  # fmt: skip

ACCELERATION = Figure("acceleration", "the commanded acceleration", "Commanded joint acceleration.", draw_acceleration,
    reading="**Commanded acceleration**: mean (lines) and range (shades) in short windows, linear up to ±1 rad/s² "
    "and logarithmic beyond, with the same axis for all controllers.")  # fmt: skip

#: Of each scenario, in the order in which a report shows them; drawn from a :class:`View`.
FIGURES = (TRACKS, PHI, ERRORS, ACCELERATION)
#: Of each scenario whose arm has a mass; drawn from a :class:`View`.
DISTURBANCE = Figure("disturbance", "what an arm with mass made of the commands",
    "What the arm's mass, controller, friction and gears made of the commands: d_c = q̈ − C(q̈_c) of eq. (6), its "
    "range in short windows, linear up to ±0.01 rad/s² and logarithmic beyond. C is the first-order lag that "
    "leaves the least; its time constant and the root mean square of d_c are those of the joint where they are "
    "greatest.", draw_disturbance)  # fmt: skip
