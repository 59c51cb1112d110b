"""Where controllers fail: how often and how, a typical and the worst scene, and single scenes made again."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

from ...comparisons.runs.spec import BASELINE
from ...errors import described
from ...rows.readable import counted
from ..drawing import picture
from ..figures import FIGURES, View
from ..groups import MAX_LAWS
from ..markdown import Table, code, enumeration, plain
from ..numbers import DASH, number
from ..plots import Figure
from ..results import reason_kind
from ..scenario import finer_unit
from .dataset import Dataset, rerun, setup_of
from .figures import WORST, Shown
from .formatting import percentage
from .ranking import ranking

MAX_KINDS = 3
MIN_SHARE = 0.02
"""Failures of fewer of a controller's failed runs than this are not named."""

TRACKS: Figure = next(figure for figure in FIGURES if figure.name == "tracks")

ORDER = {"converged": 0, "slow": 1, "unfinished": 2, "trapped": 3, "aborted": 4, "failed": 5}
"""Of statuses, the worst last."""


def failure_table(dataset: Dataset) -> str:
    """How many runs of each controller were no success, and the most frequent ways to fail."""
    lines = []
    for law in dataset.laws:
        own = dataset.runs[dataset.runs["controller"] == law]
        bad = own[~own["success"]]
        kinds: Counter[str] = Counter()
        columns = bad["status"], bad["violated"].fillna(""), bad["reason"].fillna("")
        for status, violated, reason in zip(*columns, strict=True):
            kinds[_failure_kind(str(status), str(violated), str(reason))] += 1
        named = [(kind, n) for kind, n in kinds.most_common(MAX_KINDS) if n >= MIN_SHARE * len(bad)]
        rest = len(bad) - sum(n for _, n in named)
        every = [*named, ("others", rest)] if rest else named
        texts = [f"{kind} {percentage(n / len(bad), 0)} %" for kind, n in every]
        lines.append([law, f"{len(bad)} of {len(own)}", "; ".join(texts) or DASH])
    return Table(["law", "runs without success", "how"], lines, 3)


def _failure_kind(status: str, violated: str, reason: str) -> str:
    """The kinds of rows a run violated or, if none, how it ended."""
    kinds = enumeration(sorted({plain(label.partition("[")[0]) for label in violated.split("; ") if label}))
    if status == "failed":
        return f"failed: {plain(reason_kind(reason))}" if reason else status
    return f"{kinds} violated" if kinds else f"{status}, no row violated"


def example_failures(dataset: Dataset, law: str) -> tuple[Any, Any] | None:
    """The median and the last of a controller's runs without success, by depth and ending; None if there is none."""
    runs = dataset.runs[(dataset.runs["controller"] == law) & ~dataset.runs["success"]]
    if runs.empty:
        return None
    depth, ending = runs["violation_depth"].astype(float).fillna(0.0), runs["status"].map(ORDER).fillna(len(ORDER))
    ordered = runs.assign(depth=depth, ending=ending).sort_values(["depth", "ending"], kind="stable")
    return ordered.iloc[(len(ordered) - 1) // 2], ordered.iloc[-1]


def example_table(dataset: Dataset) -> str:
    """The typical and the worst failure of each controller; empty if none fails."""
    lines = []
    for law in dataset.laws:
        for name, run in zip(("typical", "worst"), example_failures(dataset, law) or (), strict=False):
            where = f"{run['family']} {run['scene']}, {run['condition']}"
            lines.append([law, name, where, str(run["status"]), _reason(dataset, run)])
    return Table(["law", "failure", "scene", "status", "reason"], lines, 5) if lines else ""


def _reason(dataset: Dataset, run: Any) -> str:
    """Why a run was no success, and which row it violated by how much."""
    parts = [plain(str(run["reason"]))] if run["reason"] else []
    rows = dataset.evidence.rows
    for name in ("family", "condition", "scene", "controller"):
        rows = rows[rows[name] == run[name]]
    rows = rows[rows["violation_depth"] > 0.0]
    if len(rows):
        worst = rows.loc[rows["usage_max"].astype(float).idxmax()]
        unit, factor = finer_unit(str(worst["unit"]))
        more = f" and {counted(len(rows) - 1, 'other row')}" if len(rows) > 1 else ""
        depth = number(factor * float(worst["violation_depth"]))
        parts.append(f"violates {code(str(worst['constraint']))} by {depth} {unit}{more}")
    elif run["violated"]:
        parts.append(f"violates {plain(str(run['violated']))}")
    return "; ".join(parts) or "the goal is not reached, no row is violated"


def replay_example(dataset: Dataset) -> str:
    """Python that makes the worst run of the first controller again; empty if none fails."""
    for law in dataset.laws:
        if examples := example_failures(dataset, law):
            run = examples[1]
            which = f'family="{run["family"]}", scene={run["scene"]}, condition="{run["condition"]}"'
            return (
                "from vsconstraints.reports.evidence import replay\n\n"
                f'record = replay(".", {which}, controller="{run["controller"]}")'
            )
    return ""


def worst_figure(dataset: Dataset) -> str:
    """The worst runs, simulated again; a run that cannot be is named."""
    shown, problems = [], []
    for law in dataset.laws:
        examples = example_failures(dataset, law)
        if not dataset.figures or examples is None:
            continue
        run = examples[1]
        try:
            setup = setup_of(dataset.evidence, str(run["family"]), int(run["scene"]), str(run["condition"]))
            records = [rerun(dataset.evidence, setup, name) for name in (law, BASELINE)]
        except Exception as error:  # own parts that are no longer there can raise anything
            problems.append(f"The worst run of {law} could not be simulated again: {plain(described(error))}.")
            continue
        shown.append(Shown(law, f"{run['family']} {run['scene']}, {run['condition']}", setup, *records))
    figure = picture(WORST, dataset.folder / "figures", dataset.formats, shown, dataset.laws) if shown else ""
    return "\n\n".join(text for text in (figure, *problems) if text)


def divisive_scene(dataset: Dataset, family: str) -> int | None:
    """The number of the scene that divides controllers most evenly; None if there is none in which they differ."""
    flags = dataset.paired(dataset.conditions[0], "success", [family]).astype(bool)
    share = flags.mean(axis=1)
    divided: Any = share[(share > 0.0) & (share < 1.0)]
    return None if divided.empty else int((divided - 0.5).abs().idxmin()[1])


def scene_figures(dataset: Dataset) -> list[str]:
    """In each family the tracks of all controllers on the most divisive scene, in the first condition."""
    if not dataset.figures:
        return []
    return [text for family in dataset.families if (text := _scene_figure(dataset, family))]


def _scene_figure(dataset: Dataset, family: str) -> str:
    condition, scene = dataset.conditions[0], divisive_scene(dataset, family)
    if scene is None:
        return ""
    first = ranking(dataset, condition, families=[family]).laws[:MAX_LAWS]
    laws = [law for law in dataset.laws if law in first]  # in this order they have the colors of other figures
    success: Any = dataset.paired(condition, "success", [family]).astype(bool).loc[(family, scene)]
    try:
        setup = setup_of(dataset.evidence, family, scene, condition)
        runs = {name: rerun(dataset.evidence, setup, name) for name in (BASELINE, *laws)}
    except Exception as error:  # own parts that are no longer there can raise anything
        return f"Scene {scene} of {plain(family)} could not be simulated again: {plain(described(error))}."
    title = f"{plain(family)} {scene}, {condition}"
    successful = enumeration([law for law in laws if success[law]]) or "none of these"
    figure = replace(TRACKS, name=f"scene--{family}", title=title, caption=f"{title}. Successful: {successful}.")
    view = View(setup, runs, (BASELINE, *laws))
    return picture(figure, dataset.folder / "figures", dataset.formats, view)
