"""Two figures: step times of every controller and scenario, and growth."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from vsconstraints.reports.plots import looks

from .part import Part


def draw(name: str, part: Part, folder: Path) -> None:
    """Draw the figure of a part, if it has one."""
    if not part.figure:
        return
    folder.mkdir(parents=True, exist_ok=True)
    figure = {"steps": _steps, "growth": _growth}[name](part)
    figure.savefig(folder / part.figure, dpi=120)
    plt.close(figure)


def _readable(axis: Axis) -> None:
    """Label a logarithmic axis that spans one or two decades: 0.1, 0.2, 0.5, 1 ..."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def _steps(part: Part) -> plt.Figure:
    """Draw the ratio of the total by scenario."""
    found: dict[str, dict[str, float]] = {}
    for key, value in part.numbers.items():
        match = re.fullmatch(r"(.+), (.+): ratio", key)
        if match:
            found.setdefault(match[2], {})[match[1]] = value
    scenarios = list(dict.fromkeys(name for values in found.values() for name in values))
    figure, axes = plt.subplots(
        figsize=(10.0, 1.6 + (0.1 + 0.05 * len(found)) * len(scenarios)), layout="constrained"
    )
    for i, (law, look) in enumerate(looks(list(found)).items()):
        # markers are shifted vertically, because several laws take the same time
        at = [scenarios.index(name) + 0.8 * ((i + 0.5) / len(found) - 0.5) for name in found[law]]
        # hollow if a law differs from another one only by its line
        face = {"mec": "w", "mew": 0.5} if look.line == "-" else {"mfc": "w", "mew": 1.2}
        axes.plot(
            list(found[law].values()), at, look.marker, color=look.colour, ms=5.5, label=law, **face
        )
    for row in range(1, len(scenarios)):
        axes.axhline(row - 0.5, color="0.85", linewidth=0.6, zorder=0)
    axes.set_yticks(range(len(scenarios)), scenarios)
    axes.set_ylim(len(scenarios) - 0.5, -0.5)
    axes.set_xscale("log")
    _readable(axes.xaxis)
    axes.grid(alpha=0.3, axis="x")
    axes.set_xlabel("median step time, state in, command out [numpy.linalg.pinv of 8×6]")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def _growth(part: Part) -> plt.Figure:
    """Draw the ratio over size, and the slope of linear growth."""
    found: dict[str, dict[str, dict[int, float]]] = {}
    for key, value in part.numbers.items():
        match = re.fullmatch(r"(\w+), (.+), (\d+): ratio", key)
        if match:
            found.setdefault(match[1], {}).setdefault(match[2], {})[int(match[3])] = value
    figure, panels = plt.subplots(
        1, max(len(found), 1), figsize=(13.0, 4.8), layout="constrained", squeeze=False, sharey=True
    )
    entries: dict[str, plt.Line2D] = {}
    for axes, (what, curves) in zip(panels[0], found.items(), strict=False):
        laws = looks(list(dict.fromkeys(name.partition(",")[0] for name in curves)))
        # entries of the same law follow each other in the legend
        for name in sorted(curves, key=lambda name: [*laws].index(name.partition(",")[0])):
            law, _, kind = name.partition(", ")
            line, label = ("--", f"{law}, image task") if kind == "image" else ("-", law)
            look = line + laws[law].marker
            curve = curves[name]
            # hollow markers, because two laws can take the same time
            (entries[label],) = axes.loglog(
                list(curve), list(curve.values()), look, color=laws[law].colour, mfc="none"
            )
        sizes = list(next(iter(curves.values())))
        least = min(curve[sizes[0]] for curve in curves.values())
        linear = [least * size / sizes[0] for size in sizes]
        (entries["linear growth"],) = axes.loglog(sizes, linear, ":", color="black")
        axes.set_xticks(sizes, [str(size) for size in sizes])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(f"number of {what}")
        axes.set_title("command alone" if what == "rows" else "state in, command out")
        axes.grid(alpha=0.3)
    _readable(panels[0][0].yaxis)
    panels[0][0].set_ylabel("median time [numpy.linalg.pinv of 8×6]")
    figure.legend(list(entries.values()), list(entries), loc="outside upper center", ncols=4)
    return figure
