"""Figs. 4 to 8: the planar arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import NullLocator

from ..claims.first_example import SECOND
from ..claims.trap_and_corners import BOWL_ROW, HEART, NOTCH, OTHER_ROW, TIP
from ..runs import Run
from .page import (
    BLUE,
    CYAN,
    DARK,
    GREEN,
    JOINTS,
    MAGENTA,
    RED,
    START,
    Page,
    clipped,
    end_symbol,
    image_handles,
    image_plane,
    inside_legend,
    line_handle,
    signal,
    symbol_handle,
    time_axis,
    track,
    zero_line,
)

VIEW = 3.7
MARKERS = ((BLUE, "o", "first feature"), (MAGENTA, "*", "second feature"))


def _tracks(ax: Any, run: Run, **look: Any) -> None:
    for i, (colour, symbol, _) in enumerate(MARKERS):
        track(ax, run, i, color=colour, **look)
        pixels = run.trajectory.features_px[:, i]
        end_symbol(ax, pixels[-1], symbol, DARK, "white", 6.0)
        end_symbol(ax, pixels[0], symbol, START, DARK, 6.2)


def _legend(boundary: str) -> list[Any]:
    return [
        *(line_handle(colour, "-", name) for colour, _, name in MARKERS),
        *(symbol_handle(symbol, START, f"start of the {name}") for _, symbol, name in MARKERS),
        *(symbol_handle(symbol, DARK, f"end of the {name}", "white") for _, symbol, name in MARKERS),
        *image_handles(boundary),
    ]


def _errors(position: Any, orientation: Any, run: Run) -> None:
    error = run.trajectory.error
    signal(position, run, error[:, 0], color=BLUE, label="$e_x$")
    signal(position, run, error[:, 1], color=MAGENTA, linestyle="--", label="$e_y$")
    time_axis(position, run, "position\nerror [m]")
    inside_legend(position, 2)
    signal(orientation, run, error[:, 5], color=RED, label=r"$e_\gamma$")
    time_axis(orientation, run, "orientation\nerror [rad]")
    inside_legend(orientation)


def draw_fov(fov: Run, path: Path) -> None:
    """Fig. 4: tracks; errors, joints and φ of the second feature."""
    page = Page([(VIEW, VIEW)], 4)
    image_plane(page.views[0], fov, upwards=True)
    _tracks(page.views[0], fov)
    page.legend(_legend("boundary of the FOV constraint"))
    position, orientation, joints, phi = page.panels
    _errors(position, orientation, fov)
    for k, line in enumerate(("-", "--", "-.")):
        signal(joints, fov, fov.trajectory.q[:, k], color=JOINTS[k], linestyle=line, label=f"$q_{k + 1}$")
    time_axis(joints, fov, "joint positions\n[rad]")
    inside_legend(joints, 3)
    _phi(phi, fov, ((SECOND, CYAN, "-", r"$\phi_{V,2}$"),))
    page.sheet.save(path)


def _phi(ax: Any, run: Run, rows: tuple[tuple[str, str, str, str], ...], low: float = -1.1, high: float = 0.2) -> None:
    for label, colour, line, name in rows:
        signal(
            ax,
            run,
            clipped(run.phi(label), low, high),
            color=colour,
            linestyle=line,
            label=name,
            zorder=3,
            linewidth=1.2,
        )
    zero_line(ax)
    time_axis(ax, run, "constraint\nfunction $\\phi$")
    ax.set_ylim(low, high)
    inside_legend(ax, loc="lower right")


def draw_fast(fast: Run, high: Run, path: Path) -> None:
    """Fig. 5: tracks and φ of the second feature for a small and a large switching gain."""
    page = Page([(VIEW, VIEW)], 2, columns=1, panel_height=1.7, row_gap=0.32)
    ax = page.views[0]
    image_plane(ax, fast, upwards=True)
    _tracks(ax, fast, linewidth=2.4)
    for i in range(2):
        track(ax, high, i, color="#F2A900", linestyle=(0, (3, 2)), linewidth=2.0, zorder=4.5)
    handles = [
        *(line_handle(colour, "-", f"{name}, $u^+$ = 10", 2.4) for colour, _, name in MARKERS),
        line_handle("#F2A900", (0, (3, 2)), "both features, $u^+$ = 50"),
        *_legend("boundary of the FOV constraint")[2:],
    ]
    page.legend(handles)
    for ax, low, top, what in ((page.panels[0], -1.1, 0.3, ""), (page.panels[1], -0.3, 0.2, ", near zero")):
        for run, colour, line, name in ((fast, BLUE, "-", "$u^+$ = 10"), (high, "#F2A900", "-", "$u^+$ = 50")):
            values = clipped(run.phi(SECOND), low, top)
            signal(ax, run, values, color=colour, linestyle=line, label=name, linewidth=1.4)
        zero_line(ax)
        time_axis(ax, fast, r"$\phi_{V,2}$" + what)
        ax.set_ylim(low, top)
    close = page.panels[1]
    bound = fast.bound(SECOND)
    close.axhspan(-bound, bound, color="#DCE6FA", linewidth=0.0, zorder=0.5, label="$\\pm T_s u^+$ for $u^+$ = 10")
    close.set_xlim(0.0, 2.0)
    page.panels[0].tick_params(labelbottom=True)
    inside_legend(page.panels[0], 2, loc="lower right")
    inside_legend(close, 1, loc="upper right")
    page.sheet.save(path)


def draw_bowl(bowl: Run, path: Path) -> None:
    """Fig. 6: the trap."""
    _with_detail(bowl, BOWL_ROW, "bowl", (-50.0, 86.0), 40.0, (-2.2, 0.3), path, OTHER_ROW)


def draw_convex(convex: Run, path: Path) -> None:
    """Fig. 7: the convex corner is passed."""
    _with_detail(convex, HEART, "heart", TIP, 25.0, (-2.2, 0.3), path)


def draw_concave(concave: Run, path: Path) -> None:
    """Fig. 8: the concave corner is not."""
    _with_detail(concave, HEART, "heart", NOTCH, 25.0, (-2.2, 1.1), path)


def _with_detail(
    run: Run,
    row: str,
    obstacle: str,
    centre: tuple[float, float],
    half: float,
    limits: tuple[float, float],
    path: Path,
    other: str = "",
) -> None:
    """Tracks with a detail within ``half`` of a centre [px], errors, and φ of the border's and the obstacle's row.

    The obstacle's row of the ``other`` feature gets a panel of its own, beside the first's.
    """
    panels = 4 if other else 3
    page = Page([(3.0, 3.0), (2.05, 2.05)], panels, columns=1, panel_height=1.2, views_top=0.3, view_gap=0.45)
    whole, detail = page.views
    image_plane(whole, run, upwards=True)
    _tracks(whole, run)
    u, v = centre
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    whole.plot(u + half * corners[:, 0], v + half * corners[:, 1], color=DARK, linewidth=0.9, zorder=7)
    image_plane(detail, run, centre=np.array(centre), half=half, upwards=True)
    track(detail, run, 0, color=BLUE)
    inside = np.where((run.sigma(row) > 0.0)[:, None], run.trajectory.features_px[:, 0], np.nan)
    detail.plot(*inside.T, color=RED, linewidth=2.6, zorder=5)
    detail.set_ylabel("")
    detail.set_title("detail", loc="left", fontsize=8.5, pad=3)
    for index, face, edge, order in ((-1, DARK, "white", 6.0), (0, START, DARK, 6.2)):
        place = run.trajectory.features_px[index, 0]
        if (np.abs(place - centre) < half).all():
            end_symbol(detail, place, "o", face, edge, order)
    handles = [
        *(line_handle(colour, "-", name) for colour, _, name in MARKERS),
        symbol_handle("o", START, "start"),
        symbol_handle("o", DARK, "end", "white"),
    ]
    if np.isfinite(inside).any():
        handles.append(line_handle(RED, "-", r"$\sigma$ > 0", 2.6))
    page.legend(handles, top=0.32)
    position, orientation, phi = page.panels[:3]
    _errors(position, orientation, run)
    rows = ((SECOND, CYAN, "-", "FOV, second feature"), (row, GREEN, "-.", f"{obstacle}, first feature"))
    _phi(phi, run, rows, *limits)
    for ax in page.panels[3:]:
        _far_beyond(
            ax, run, ((other, MAGENTA, f"{obstacle}, second feature"), (row, GREEN, f"{obstacle}, first feature"))
        )
    page.sheet.save(path)


def _far_beyond(ax: Any, run: Run, rows: tuple[tuple[str, str, str], ...]) -> None:
    """φ of rows, some of which leave their bands by orders of magnitude."""
    bound = run.bound(rows[0][0])
    for label, colour, name in rows:
        signal(ax, run, run.phi(label), color=colour, label=name, linewidth=1.2)
    ax.axhspan(-bound, bound, color="#DCE6FA", linewidth=0.0, zorder=0.5)
    time_axis(ax, run, "$\\phi$ of the bowl")
    ax.set_yscale("symlog", linthresh=bound)
    ax.set_yticks([-1e4, -1e2, -1.0, 0.0, 1.0, 1e2], ["−10⁴", "−100", "−1", "0", "1", "100"])
    ax.set_ylim(top=1e4)
    ax.yaxis.set_minor_locator(NullLocator())
    inside_legend(ax, loc="lower right")
