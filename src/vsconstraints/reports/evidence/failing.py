"""Where each law fails: how often in which way, a typical and the worst scene, and how to make them again."""

from __future__ import annotations

from collections import Counter
from typing import Any

from ...comparisons.runs.spec import BASELINE
from ...rows.readable import counted
from ..markdown import code, enumeration, plain, table
from ..numbers import DASH, number
from ..results import reason_kind
from ..scenario import FINER
from .drawing import shown
from .figures import WORST, Shown
from .material import Material
from .replay import again, setup_of
from .words import percentage

MOST_KINDS = 3
LEAST_SHARE = 0.02
"""Ways to fail of fewer of a law's failures than this are not named."""


def failing(material: Material) -> str:
    """Two tables, a figure, and the lines that make runs again."""
    parts = ["## Where each law fails"]
    chosen = {law: found for law in material.laws if (found := picked(material, law))}
    if not chosen:
        return f"{parts[0]}\n\nNo law failed in any run."
    lines = [[law, *_ways(material, law)] for law in material.laws]
    parts.append(table(["law", "runs without success", "in which way"], lines, 3))
    parts.append(
        "The worst run of a law is the one that is outside a row by the greatest share of its length L or, if it "
        "violates none, the last of its failures. The typical one is the median of its failures in the same order."
    )
    scenes = []
    for law, (typical, worst) in chosen.items():
        for name, run in (("typical", typical), ("worst", worst)):
            which = f"{run['family']} {run['scene']}, {run['condition']}"
            scenes.append([law if name == "typical" else "", name, which, str(run["status"]), reason(material, run)])
    parts.append(table(["law", "", "scene", "ended", "what happened"], scenes, 5))
    law, (_, worst) = next(iter(chosen.items()))
    parts.append(
        "Any of these runs is made again, with its whole trajectory, by what the columns say; for example the worst "
        f"one of {law}, in this folder:\n\n```python\n{line_to_replay(worst)}\n```"
    )
    if material.figures:
        parts.append(_figure(material, {law: worst for law, (_, worst) in chosen.items()}))
    return "\n\n".join(part for part in parts if part)


def line_to_replay(run: Any) -> str:
    """Python that makes a run again."""
    given = f'family="{run["family"]}", scene={run["scene"]}, condition="{run["condition"]}"'
    return (
        "from vsconstraints.reports.evidence import replay\n\n"
        f'record = replay(".", {given}, controller="{run["controller"]}")'
    )


def picked(material: Material, law: str) -> tuple[Any, Any] | None:
    """The typical and the worst of a law's runs without success; None if there is none."""
    runs = material.runs[(material.runs["controller"] == law) & ~material.runs["success"]]
    if runs.empty:
        return None
    order = {"converged": 0, "slow": 1, "unfinished": 2, "trapped": 3, "aborted": 4, "failed": 5}
    ordered = runs.assign(
        depth=runs["violation_depth"].astype(float).fillna(0.0), ending=runs["status"].map(order).fillna(6)
    ).sort_values(["depth", "ending"], kind="stable")
    return ordered.iloc[(len(ordered) - 1) // 2], ordered.iloc[-1]


def reason(material: Material, run: Any) -> str:
    """What a run's reason says, and by how much it left which row."""
    parts = [plain(str(run["reason"]))] if run["reason"] else []
    rows = material.evidence.rows
    own = rows[
        (rows["family"] == run["family"])
        & (rows["condition"] == run["condition"])
        & (rows["scene"] == run["scene"])
        & (rows["controller"] == run["controller"])
        & (rows["violation_depth"] > 0.0)
    ]
    if len(own):
        worst = own.loc[own["usage_max"].astype(float).idxmax()]
        unit, factor = FINER.get(str(worst["unit"]), (plain(str(worst["unit"])), 1.0))
        by = f"{number(factor * float(worst['violation_depth']))} {unit}"
        more = f" and {counted(len(own) - 1, 'other row')}" if len(own) > 1 else ""
        parts.append(f"outside {code(str(worst['constraint']))} by {by}{more}")
    elif run["violated"]:
        parts.append(f"outside {plain(str(run['violated']))}")
    return "; ".join(parts) or "the goal is not reached, no row is violated"


def _ways(material: Material, law: str) -> list[str]:
    """How many of a law's runs have no success, and the commonest ways."""
    own = material.runs[material.runs["controller"] == law]
    bad = own[~own["success"]]
    if bad.empty:
        return [f"0 of {len(own)}", DASH]
    ways: Counter[str] = Counter()
    for status, violated, why in zip(bad["status"], bad["violated"].fillna(""), bad["reason"].fillna(""), strict=True):
        ways[_way(str(status), str(violated), str(why))] += 1
    named = [(way, n) for way, n in ways.most_common(MOST_KINDS) if n >= LEAST_SHARE * len(bad)]
    left = len(bad) - sum(n for _, n in named)
    every = [*named, ("others", left)] if left else named
    told = [f"{way} {percentage(n / len(bad), 0)} %" for way, n in every]
    return [f"{len(bad)} of {len(own)}", "; ".join(told)]


def _way(status: str, violated: str, why: str) -> str:
    """A way to fail: which kinds of rows the run left or, if none, how it ended."""
    kinds = enumeration(sorted({plain(label.partition("[")[0]) for label in violated.split("; ") if label}))
    if status == "failed":
        return f"failed: {plain(reason_kind(why))}" if why else status
    return f"{kinds} violated" if kinds else f"{status}, all rows kept"


def _figure(material: Material, worst: dict[str, Any]) -> str:
    """The worst runs, simulated again; a run that cannot be is named."""
    found, problems = [], []
    for law, run in worst.items():
        try:
            setup = setup_of(material.evidence, str(run["family"]), int(run["scene"]), str(run["condition"]))
            made = [again(material.evidence, setup, name) for name in (law, BASELINE)]
        except Exception as error:  # own parts that are no longer there can raise anything
            why = f"{type(error).__name__}: {plain(str(error))}"
            problems.append(f"The worst run of {law} could not be made again: {why}.")
            continue
        which = f"{run['family']} {run['scene']}, {run['condition']}"
        found.append(Shown(law, which, setup, *made))
    return "\n\n".join([text for text in (shown(material, WORST, found, material.laws), *problems) if text])
