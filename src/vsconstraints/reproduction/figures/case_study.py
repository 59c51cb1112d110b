"""Figs. 10 and 11: the case study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...rows import Array
from ..claims.case_study import BORDERS, EVENTS, RANGE, SPEED, SPHERE, at_once, phases, switch_sample
from ..runs import Run
from .page import (
    AXES,
    BLUE,
    DARK,
    JOINTS,
    START,
    SYMBOLS,
    Page,
    end_symbol,
    image_handles,
    image_plane,
    inside_legend,
    limits_around,
    line_handle,
    signal,
    symbol_handle,
    time_axis,
    track,
    zero_line,
)

VIEW = 3.9
COLOURS = ("#1447C4", "#C2188F", "#2E8B3D", "#E07B00")
"""One colour for each of the four features."""

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


def draw_tracks(case: Run, path: Path) -> None:
    """Fig. 10: tracks in the image, position and orientation errors."""
    page = Page([(VIEW, VIEW)], 2, columns=1)
    ax = page.views[0]
    image_plane(ax, case)
    pixels = case.trajectory.features_px
    k = switch_sample(case)
    for i, (colour, symbol) in enumerate(zip(COLOURS, SYMBOLS, strict=True)):
        track(ax, case, i, color=colour)
        end_symbol(ax, pixels[k, i], symbol, "white", DARK, 6.0)
        end_symbol(ax, pixels[-1, i], symbol, DARK, "white", 6.1)
        end_symbol(ax, pixels[0, i], symbol, START, DARK, 6.2)
    features = [line_handle(colour, "-", f"feature {i + 1}") for i, colour in enumerate(COLOURS)]
    for handle, symbol in zip(features, SYMBOLS, strict=True):
        handle.set(marker=symbol, markerfacecolor="white", markeredgecolor=DARK, markersize=10 if symbol == "*" else 7)
    ends = [
        symbol_handle("o", START, "start"),
        symbol_handle("o", "white", "end of phase 1"),
        symbol_handle("o", DARK, "end of phase 2", "white"),
    ]
    page.legend([*features, *ends, *image_handles("boundary of the FOV constraint")])
    for ax, first, unit, names in (
        (page.panels[0], 0, "position\nerror [m]", "xyz"),
        (page.panels[1], 3, "orientation\nerror [rad]", (r"\alpha", r"\beta", r"\gamma")),
    ):
        for j, ((colour, line), name) in enumerate(zip(AXES, names, strict=True)):
            signal(ax, case, case.trajectory.error[:, first + j], color=colour, linestyle=line, label=f"$e_{{{name}}}$")
        time_axis(ax, case, unit)
        inside_legend(ax, 3, loc="upper right")
    page.sheet.save(path)


def draw_signals(case: Run, path: Path) -> None:
    """Fig. 11: joints, speeds, max φ, and when each constraint is active."""
    page = Page([], 4, columns=1, panel_height=1.5, row_gap=0.42, views_top=0.45, left=1.12)
    positions, speeds, phi, lanes = page.panels
    trajectory = case.trajectory
    for ax, values, unit, name in (
        (positions, trajectory.q, "joint positions\n[rad]", "q"),
        (speeds, trajectory.qd, "joint speeds\n[rad/s]", r"\dot{q}"),
    ):
        for k in range(values.shape[1]):
            signal(ax, case, values[:, k], color=JOINTS[k], label=f"${name}_{k + 1}$", linewidth=1.3)
        time_axis(ax, case, unit)
        limits_around(ax, float(values.min()), float(values.max()))
        ax.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.02), ncols=6, handlelength=1.4, columnspacing=1.2, fontsize=8.5
        )
    _limit(positions, case, f"{RANGE}.upper", JOINTS[5])
    _limit(speeds, case, f"{SPEED}.upper", JOINTS[1])
    _most_phi(phi, case)
    _lanes(lanes, case)
    frames = frame_times(case)
    for number, time in enumerate(frames, start=1):
        for ax in page.panels:
            ax.axvline(time, color="#666666", linestyle="--", linewidth=0.9, zorder=1.4)
        lanes.annotate(
            f"frame {number}", (time, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 2),
            textcoords="offset points", ha="center", va="bottom", fontsize=8, color="#444444",
        )  # fmt: skip
    page.sheet.save(path)


def _limit(ax: Any, run: Run, label: str, colour: str) -> None:
    """Dashed line at the limit that acts: the value that the row's joint had where its clearance was least."""
    constraint: Any = run.constraint(label)
    joint = int(constraint.joints[0])
    values = run.trajectory.qd if label.startswith("speed") else run.trajectory.q
    clearance = run.trajectory.clearance[:, run.index(label)]
    limit = float(np.median(values[:, joint - 1] + clearance))
    ax.axhline(limit, color=colour, linestyle=(0, (4, 2)), linewidth=1.4, zorder=1.7)
    ax.annotate(
        f"limit of joint {joint}", (0.27, limit), xycoords=("axes fraction", "data"), xytext=(0, 2),
        textcoords="offset points", ha="left", va="bottom", fontsize=8, color=DARK,
    )  # fmt: skip


def _most_phi(ax: Any, run: Run) -> None:
    most: Array = run.trajectory.phi.max(axis=1)
    signal(ax, run, most, color=BLUE, linewidth=1.2)
    zero_line(ax)
    time_axis(ax, run, r"greatest $\phi_i$")
    ax.set_ylim(-0.2, 0.04)


def _lanes(ax: Any, run: Run) -> None:
    shown = [event for event in EVENTS if any(phases(run, event))]
    frames = frame_times(run)
    for lane, event in enumerate(shown):
        for first, last in (span for phase in phases(run, event) for span in phase):
            ax.plot([first, last], [lane, lane], color=DARK, linewidth=2.6, solid_capstyle="butt", zorder=3)
            for time in frames:
                if first <= time <= last:
                    ax.plot(time, lane, "o", color="white", markeredgecolor=DARK, markersize=7, zorder=4)
    time_axis(ax, run, "")
    ax.set_yticks(range(len(shown)), [SHORT[event] for event in shown])
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.set_ylabel("")
    ax.tick_params(axis="y", length=0, pad=3)
