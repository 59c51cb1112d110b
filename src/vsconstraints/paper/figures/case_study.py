"""Figs. 10 and 11: the case study over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...comparisons.run import Run
from ...reports.plots import FAINT, INK, REFERENCE, Sheet, above_legend, note, signal, symbol
from ..claims.case_study import BORDERS, EVENTS, RANGE, SPEED, SPHERE, at_once, phases
from . import lines as paper

SHORT = {RANGE: "joint 6 range", SPEED: "joint 2 speed", SPHERE: "sphere"}
SHORT |= {label: f"FOV, feature {i}" for i, label in enumerate(BORDERS, start=1)}


def frame_times(run: Run) -> list[float]:
    """Four instants that Fig. 12 shows: in the middle of three events at once, of the third feature's sliding, of the
    second feature's sliding in the second phase, and of the sphere's.
    """  # noqa: D205
    count = at_once(run)
    three = run.t[count == count.max()]
    spans = [(three[0], three[-1]), *phases(run, BORDERS[2])[0][:1], *phases(run, BORDERS[1])[1][:1]]
    spans += phases(run, SPHERE)[1][:1]
    return [float(run.t[np.argmin(np.abs(run.t - 0.5 * (a + b)))]) for a, b in spans]


def draw_tracks(case: Run) -> Sheet:
    """Fig. 10: tracks in the image, position and orientation errors."""
    sheet = Sheet(paper.LEFT)
    (ax,) = sheet.views(paper.image_size(case, 3.9))
    sheet.side_legend(paper.draw_tracks(ax, case))
    paper.pose_errors(sheet.panels(2, height=1.45, labels=("time [s]", "")), case)
    return sheet


def draw_signals(case: Run) -> Sheet:
    """Fig. 11: joints, speeds, max φ, and when each constraint is active."""
    sheet = Sheet(1.12)
    panels = sheet.panels(4, height=1.5, above=0.4, labels=("time [s]", ""))
    for ax, values, label, name, limited in (
        (panels[0], case.trajectory.q, "joint positions\n[rad]", "q", f"{RANGE}.upper"),
        (panels[1], case.trajectory.qd, "joint speeds\n[rad/s]", r"\dot{q}", f"{SPEED}.upper"),
    ):
        paper.signals(ax, case, values, (f"${name}_{k + 1}$" for k in range(values.shape[1])), label)
        paper.limits_around(ax, values)
        above_legend(ax, 6)
        # the limit that acts: the value that the row's joint had, and its clearance
        constraint: Any = case.constraint(limited)
        joint = int(constraint.joints[0])
        limit = float(np.median(values[:, joint - 1] + case.trajectory.clearance[:, case.index(limited)]))
        ax.axhline(limit, **REFERENCE | {"color": paper.COLOURS[joint - 1], "linewidth": 1.4}, zorder=1.7)
        note(ax, f"limit of joint {joint}", limit, across=0.26)
    signal(panels[2], case.t, case.trajectory.phi.max(axis=1), color=paper.BLUE, linewidth=1.2)
    paper.phi_axis(panels[2], case, (-0.2, 0.04), r"greatest $\phi_i$")
    _lanes(panels[3], case)
    for number, time in enumerate(frame_times(case), start=1):
        for ax in panels:
            ax.axvline(time, color="#666666", linestyle="--", linewidth=0.9, zorder=1.4)
        place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "ha": "center"}
        panels[3].annotate(f"frame {number}", (time, 1.0), (0, 2), **place, fontsize=8, color=FAINT)
    return sheet


def _lanes(ax: Any, run: Run) -> None:
    """When each event is active, and which are in the instants of Fig. 12."""
    shown = [event for event in EVENTS if any(phases(run, event))]
    for lane, event in enumerate(shown):
        for first, last in (span for phase in phases(run, event) for span in phase):
            ax.plot([first, last], [lane, lane], color=INK, linewidth=2.6, solid_capstyle="butt", zorder=3)
            inside = [time for time in frame_times(run) if first <= time <= last]
            ax.plot(inside, [lane] * len(inside), **symbol("o", "white", size=7.0), zorder=4)
    paper.over_time(ax, run)
    ax.set_yticks(range(len(shown)), [SHORT[event] for event in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0, pad=3)
