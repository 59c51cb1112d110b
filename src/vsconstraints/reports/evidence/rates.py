"""How often each law succeeds and violates: of all families together, and family by family."""

from __future__ import annotations

from math import ceil

import numpy as np

from ...comparisons.metrics import NEGLIGIBLE, TOLERANCES, TOLERANT
from ...comparisons.statistics import rate
from ..figures.overview import HeatMap, draw_heat_map
from ..markdown import bold, table
from ..numbers import DASH, of_length
from ..plots import Figure
from .drawing import shown
from .material import Material
from .opening import success_cells
from .standing import Standing, standing
from .words import Share, of_scenes, percentage, where

ENDINGS = (("slow",), ("trapped",), ("unfinished",), ("failed", "aborted"))
"""How runs end that do not converge, those in one column together."""

FAMILIES = 6
"""A table shows no more families than this; of several tables each shows as many, or one more."""

MAP = Figure(
    "families",
    "success by family and law",
    "Success in each family, condition by condition, in per cent of its scenes.",
    draw_heat_map,
)


def rates(material: Material) -> str:
    """Two tables per condition, and the heat map of all."""
    parts = ["## How often laws succeed and violate"]
    parts.append(
        "*Success*: all rows kept and the goal reached. *Violated*: a row was deeper outside than "
        f"{of_length(NEGLIGIBLE)}, whether the goal was reached or not. The same with {of_length(TOLERANT)} tolerated "
        "stands beside it and in the next table. The last columns say how runs ended that did not converge; those that "
        "failed or were aborted count nowhere but here and as no success. **Bold** is the best of a column where it "
        "is distinguishable from all others; ≈ marks the best and what is not distinguishable from it. Laws that only "
        "failed are not compared by violations: who does nothing violates nothing."
    )
    parts.append(shown(material, MAP, family_map(material)))
    for condition in material.conditions:
        one = standing(material, condition)
        if one.scenes:
            parts += [f"### {where(condition)}", _together(material, one)]
            if len(material.families_of(condition)) > 1:
                parts += _by_family(material, condition)
    return "\n\n".join(part for part in parts if part)


def _together(material: Material, one: Standing) -> str:
    tolerant = standing(material, one.condition, "tolerant success")
    kept = standing(material, one.condition, "kept")
    runs = material.among(one.condition)
    lines = []
    for law, cell in zip(one.laws, success_cells(one, one.laws), strict=True):
        statuses = runs[runs["controller"] == law]["status"]
        endings = [str(int(statuses.isin(ending).sum())) for ending in ENDINGS]
        lines.append([law, cell, *success_cells(tolerant, [law]), _violated(material, kept, law), *endings])
    text = f"{of_scenes(one.scenes, one.families)}; success and violated in per cent, the others in runs."
    header = ["law", "success", f"at {of_length(TOLERANT)}", "violated", *map(" or ".join, ENDINGS)]
    return f"{text}\n\n{table(header, lines)}\n\n{_by_tolerance(material, one)}"


def _by_tolerance(material: Material, one: Standing) -> str:
    """How often each law succeeds at each tolerance, and violates by the tolerant standard."""
    least, kept = material.paired(one.condition, "tolerance"), standing(material, one.condition, "tolerant kept")
    lines = []
    for law in one.laws:
        shares = [percentage(float((least[law].astype(float) <= each).mean()), 1) for each in TOLERANCES]
        lines.append([law, *shares, _violated(material, kept, law)])
    header = ["law", *(f"{100.0 * each:g} %" for each in TOLERANCES), f"violated at {of_length(TOLERANT)}"]
    text = "Success in per cent, with the depth tolerated that the head of the column says, in % of L."
    return f"{text}\n\n{table(header, lines)}"


def _violated(material: Material, kept: Standing, law: str) -> str:
    cell, going = kept.shares[law].complement.cell, kept.among(material.going(kept.condition))
    if len(going.laws) < 2 or law not in going.front:
        return cell
    return bold(cell) if len(going.front) == 1 else f"≈ {cell}"


def _by_family(material: Material, condition: str) -> list[str]:
    """Success and violations in each family; several tables where there are many families."""
    families = material.families_of(condition)
    parts = []
    for what, column in (("Success", "success"), ("Violated", "kept")):
        for names in np.array_split(np.array(families), ceil(len(families) / FAMILIES)):
            chosen = names.tolist()
            each = {name: standing(material, condition, column, [name]) for name in chosen}
            lines = []
            for law in material.laws:
                cells = []
                for one in each.values():
                    if law not in one.laws:
                        cells.append(DASH)
                    elif column == "success":
                        cells.append(success_cells(one, [law])[0])
                    else:
                        cells.append(_violated(material, one, law))
                lines.append([law, *cells])
            parts.append(f"{what} in each family, in per cent:\n\n" + table(["law", *chosen], lines))
    return parts


def family_map(material: Material) -> HeatMap:
    """Success of every law in every family and condition."""
    rows: list[str] = []
    values, breaks = [], []
    for condition in material.conditions:
        breaks.append(len(rows))
        for family in material.families_of(condition):
            flags = material.paired(condition, "success", [family]).astype(bool)
            rows.append(f"{family}, {condition}")
            shares = flags.mean()  # none of no scene
            values.append([float(shares.get(law, np.nan)) for law in material.laws])
    grid = np.array(values).reshape(len(rows), len(material.laws))
    texts = [[percentage(value, 0) for value in line] for line in grid]
    return HeatMap(rows, material.laws, grid, texts, ("no success", "success in all scenes"), breaks[1:])


def share_of(flags: object) -> Share:
    """The share of flags that are set, with its exact interval."""
    return Share.of(rate(flags))  # type: ignore[arg-type]
