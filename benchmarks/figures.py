"""Two figures: step times of every controller and scenario, and growth."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import NullFormatter

from vsconstraints.reports.style import looks

from .part import Part


def draw(name: str, part: Part, folder: Path) -> None:
    """Draw the figure of a part, if it has one."""
    if not part.figure:
        return
    folder.mkdir(parents=True, exist_ok=True)
    figure = {"steps": _steps, "growth": _growth}[name](part)
    figure.savefig(folder / part.figure, dpi=120)
    plt.close(figure)


def _steps(part: Part) -> plt.Figure:
    """Ratio of the total by scenario."""
    found: dict[str, dict[str, float]] = {}
    for key, value in part.numbers.items():
        match = re.fullmatch(r"(.+), (.+): ratio", key)
        if match:
            found.setdefault(match[2], {})[match[1]] = value
    scenarios = list(dict.fromkeys(name for values in found.values() for name in values))
    figure, axes = plt.subplots(figsize=(10.0, 1.6 + 0.28 * len(scenarios)), layout="constrained")
    for law, look in looks(list(found)).items():
        at = [scenarios.index(name) for name in found[law]]
        axes.plot(list(found[law].values()), at, look.marker, color=look.colour, label=law)
    axes.set_yticks(range(len(scenarios)), scenarios)
    axes.set_xscale("log")
    axes.invert_yaxis()
    axes.grid(alpha=0.3)
    axes.set_xlabel("median step time, state in, command out [numpy.linalg.pinv of 8×6]")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


def _growth(part: Part) -> plt.Figure:
    """Ratio over size, and the slope of linear growth."""
    found: dict[str, dict[str, dict[int, float]]] = {}
    for key, value in part.numbers.items():
        match = re.fullmatch(r"(\w+), (.+), (\d+): ratio", key)
        if match:
            found.setdefault(match[1], {}).setdefault(match[2], {})[int(match[3])] = value
    figure, panels = plt.subplots(1, max(len(found), 1), figsize=(13.0, 4.5), layout="constrained", squeeze=False)
    for axes, (what, curves) in zip(panels[0], found.items(), strict=False):
        laws = looks(list(dict.fromkeys(name.partition(",")[0] for name in curves)))
        for name, curve in curves.items():
            law, _, kind = name.partition(", ")
            line = "--" if kind == "image" else "-"
            axes.loglog(list(curve), list(curve.values()), line + laws[law].marker, color=laws[law].colour, label=name)
        sizes = list(next(iter(curves.values())))
        top = max(curve[sizes[-1]] for curve in curves.values())
        axes.loglog(sizes, [top * size / sizes[-1] for size in sizes], ":", color="black", label="linear")
        axes.set_xticks(sizes, [str(size) for size in sizes])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(f"number of {what}")
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=8)
    panels[0][0].set_ylabel("median time [numpy.linalg.pinv of 8×6]")
    return figure
