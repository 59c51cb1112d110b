"""How controllers fail: tables, and figures of single scenes made again, the worst and those that divide them most."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

from ...comparisons.runs.spec import BASELINE
from ...errors import described
from ...rows.readable import counted
from ..figures import FIGURES, View
from ..groups import MAX_LAWS
from ..markdown import Table, code, enumeration, plain
from ..numbers import DASH, number
from ..plots import Figure
from ..results import reason_kind
from ..scenario import finer_unit
from .dataset import Dataset, rerun, setup_of
from .figures import WORST, Shown
from .ranking import percentage, ranking

#: Ways to fail in a cell, and of how many of a controller's failed runs at least.
MAX_REASONS, MIN_SHARE = 3, 0.02
#: Of statuses, the worst last.
ORDER = {"converged": 0, "slow": 1, "unfinished": 2, "trapped": 3, "aborted": 4, "failed": 5}

TRACKS: Figure = next(figure for figure in FIGURES if figure.name == "tracks")


def failure_table(dataset: Dataset) -> Table:
    """How many runs of each controller were no success, and the most frequent ways to fail."""
    lines = []
    for law in dataset.laws:
        own = dataset.of_law(law)
        bad = own[~own["success"]]
        columns = (bad[name].fillna("").astype(str) for name in ("ending", "violated", "reason"))
        kinds = Counter(_failure_kind(*run) for run in zip(*columns, strict=True))
        named = [(kind, n) for kind, n in kinds.most_common(MAX_REASONS) if n >= MIN_SHARE * len(bad)]
        named += [("others", len(bad) - sum(n for _, n in named))]
        texts = [f"{kind} {percentage(n / len(bad), 0)} %" for kind, n in named if n]
        lines.append([law, f"{len(bad)} of {len(own)}", "; ".join(texts) or DASH])
    return Table(["law", "runs without success", "how"], lines, 3)


def _failure_kind(ending: str, violated: str, reason: str) -> str:
    """The kinds of rows a run violated or, if none, how it ended."""
    if kinds := sorted({plain(label.partition("[")[0]) for label in violated.split("; ") if label}):
        return f"{enumeration(kinds)} violated"
    return f"failed: {plain(reason_kind(reason))}" if ending == "failed" and reason else ending


def worst_last(runs: Any) -> Any:
    """Runs by depth of violation and ending, the successful before all others and of these the slowest last."""
    depth, ending = runs["violation_depth"].astype(float).fillna(0.0), runs["status"].map(ORDER).fillna(len(ORDER))
    by = ["success", "depth", "order", "settling_time_s"]
    return runs.assign(depth=depth, order=ending).sort_values(by, ascending=[False, True, True, True], kind="stable")


def example_failures(dataset: Dataset) -> dict[str, dict[str, Any]]:
    """By controller that fails, its typical (median) and worst run without success, by depth and ending."""
    examples, failures = {}, worst_last(dataset.runs[~dataset.runs["success"]])
    for law in dataset.laws:
        runs = failures[failures["controller"] == law]
        if len(runs):
            examples[law] = {"typical": runs.iloc[(len(runs) - 1) // 2], "worst": runs.iloc[-1]}
    return examples


def example_table(dataset: Dataset) -> Table:
    """The typical and the worst failure of each controller."""
    lines = [
        [
            law,
            name,
            f"{run['family']} {run['scene']}, {run['condition']}",
            str(run["status"]),
            reason_text(dataset, run),
        ]
        for law, examples in example_failures(dataset).items()
        for name, run in examples.items()
    ]
    return Table(["law", "failure", "scene", "status", "reason"], lines, 5)


def reason_text(dataset: Dataset, run: Any) -> str:
    """Why a run was no success, and which row it violated by how much."""
    parts, keys = [plain(run["reason"])] if run["reason"] else [], ["family", "condition", "scene", "controller"]

    def violated() -> tuple[Any, Any]:
        rows = dataset.evidence.rows[dataset.evidence.rows["violation_depth"] > 0.0]
        return rows, rows.groupby(keys, observed=True).indices

    every, places = dataset.once("violated rows", violated)
    rows = every.iloc[places.get(tuple(run[keys]), [])]
    if len(rows):
        worst = rows.loc[rows["usage_max"].astype(float).idxmax()]
        unit, factor = finer_unit(str(worst["unit"]))
        more = f" and {counted(len(rows) - 1, 'other row')}" if len(rows) > 1 else ""
        depth = number(factor * float(worst["violation_depth"]))
        parts.append(f"violates {code(str(worst['constraint']))} by {depth} {unit}{more}")
    elif run["violated"]:
        parts.append(f"violates {plain(run['violated'])}")
    return "; ".join(parts) or "the goal is not reached, no row is violated"


def worst_figures(dataset: Dataset) -> list[str]:
    """The figure of the worst runs, simulated again; a run that cannot be is named."""
    shown, problems = [], []
    for law, examples in example_failures(dataset).items() if dataset.figures else ():
        run = examples["worst"]
        try:
            setup = setup_of(dataset.evidence, str(run["family"]), int(run["scene"]), str(run["condition"]))
            records = [rerun(dataset.evidence, setup, name) for name in (law, BASELINE)]
        except Exception as error:  # own parts that are no longer there can raise anything
            problems.append(f"The worst run of {law} could not be simulated again: {plain(described(error))}.")
        else:
            shown.append(Shown(law, f"{run['family']} {run['scene']}, {run['condition']}", setup, *records))
    return [dataset.picture(WORST, shown, dataset.laws) if shown else "", *problems]


def divisive_scene(dataset: Dataset, family: str) -> int | None:
    """The number of the scene that divides controllers most evenly; None if there is none in which they differ."""
    share = dataset.paired(dataset.conditions[0], "success", [family]).astype(bool).mean(axis=1)
    divided: Any = share[(share > 0.0) & (share < 1.0)]
    return None if divided.empty else int((divided - 0.5).abs().idxmin()[1])


def scene_figures(dataset: Dataset) -> list[str]:
    """In each family the tracks of all controllers on the most divisive scene, in the first condition."""
    texts, condition = [], dataset.conditions[0]
    for family in dataset.families if dataset.figures else ():
        scene = divisive_scene(dataset, family)
        if scene is None:
            continue
        first = ranking(dataset, condition, families=[family]).laws[:MAX_LAWS]
        laws = [law for law in dataset.laws if law in first]  # in this order they have the colors of other figures
        try:
            setup = setup_of(dataset.evidence, family, scene, condition)
            runs = {name: rerun(dataset.evidence, setup, name) for name in (BASELINE, *laws)}
        except Exception as error:  # own parts that are no longer there can raise anything
            texts.append(f"Scene {scene} of {plain(family)} could not be simulated again: {plain(described(error))}.")
            continue
        success: Any = dataset.paired(condition, "success", [family]).astype(bool).loc[(family, scene)]
        successful = enumeration([law for law in laws if success[law]]) or "none of these"
        title = f"{plain(family)} {scene}, {condition}"
        figure = replace(TRACKS, name=f"scene--{family}", title=title, caption=f"{title}. Successful: {successful}.")
        texts.append(dataset.picture(figure, View(setup, runs, (BASELINE, *laws))))
    return texts
