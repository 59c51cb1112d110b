"""Success and failures of controllers in every situation, and figures of repeated scenes."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import BASELINE
from ...errors import described
from ...reports.figures import FIGURES, View
from ...reports.groups import MAX_LAWS
from ...reports.markdown import code, enumeration, plain
from ...reports.numbers import number
from ...reports.page import render_html
from ...reports.plots import Figure
from ...reports.results import reason_kind
from ...reports.scenario import finer_unit
from ...rows.readable import counted
from ..statistics.judged import UNSUCCESSFUL
from .dataset import Dataset, rerun, setup_of
from .ranking import Ranking, Share, ranking
from .tables import most_frequent, row_kinds

#: Most ways to fail in a cell, and their least share of a controller's failed runs.
MAX_REASONS = 3
MIN_SHARE = 0.02
#: Order of statuses, the worst last.
ORDER = {"converged": 0, "slow": 1, "unfinished": 2, "trapped": 3, "aborted": 4, "failed": 5}
#: Relative luminance of linear red, green and blue, and that above which black text has more
#: contrast than white (WCAG).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
BRIGHT = 0.179
TRACKS: Figure = next(figure for figure in FIGURES if figure.name == "tracks")


def kinds(runs: Any) -> list[tuple[str, int]]:
    """Return the most frequent ways in which runs were unsuccessful, with their counts."""
    texts = runs[["ending", "violated", "reason"]].fillna("").astype(str)
    counts = Counter[str]()
    for run in texts.itertuples(index=False):
        counts[_failure_kind(run.ending, run.violated, run.reason)] += 1
    return most_frequent(counts, MAX_REASONS, MIN_SHARE * len(runs))


def _failure_kind(ending: str, violated: str, reason: str) -> str:
    """Return the kinds of rows that a run violated or, without violation, its ending."""
    kinds = {plain(kind) for kind in row_kinds(violated)}
    if kinds:
        return f"{enumeration(sorted(kinds))} violated"
    if ending == "failed" and reason:
        return f"failed: {plain(reason_kind(reason))}"
    return ending


def worst_last(runs: Any) -> Any:
    """Sort runs: successful ones first, the slowest of these last, then by violation and ending."""
    depth = runs["violation_depth"].astype(float).fillna(0.0)
    ending = runs["status"].map(ORDER).fillna(len(ORDER))
    ascending = {"success": False, "depth": True, "order": True, "settling_time_s": True}
    return runs.assign(depth=depth, order=ending).sort_values(
        list(ascending), ascending=list(ascending.values()), kind="stable"
    )


def example_failures(dataset: Dataset) -> dict[str, dict[str, Any]]:
    """Return the typical (median) and the worst unsuccessful run of each controller that fails.

    Runs are ordered by violation depth and ending.
    """
    examples = {}
    failures = worst_last(dataset.runs[~dataset.runs["success"]])
    for law in dataset.laws:
        runs = failures[failures["controller"] == law]
        if len(runs):
            median_run = runs.iloc[(len(runs) - 1) // 2]
            examples[law] = {"typical": median_run, "worst": runs.iloc[-1]}
    return examples


def where(run: Any) -> str:
    """Return the scene of a run and its condition as text."""
    return f"{run['family']} {run['scene']}, {run['condition']}"


def reason_text(dataset: Dataset, run: Any) -> str:
    """Return why a run was unsuccessful, and the depth of its worst violation."""
    reasons = []
    if run["reason"]:
        reasons.append(plain(run["reason"]))
    rows = _violated_rows(dataset, run)
    if len(rows):
        # a table of an earlier version may lack the usage: then the first row is named
        usage = rows["usage_max"].astype(float).fillna(-np.inf)
        worst = rows.loc[usage.idxmax()]
        name = code(str(worst["constraint"]))
        unit, factor = finer_unit(str(worst["unit"]))
        depth = number(factor * float(worst["violation_depth"]))
        violation = f"violates {name} by {depth} {unit}"
        if len(rows) > 1:
            violation += f" and {counted(len(rows) - 1, 'other row')}"
        reasons.append(violation)
    elif run["violated"]:
        reasons.append(f"violates {plain(run['violated'])}")
    return "; ".join(reasons) or "the goal is not reached, no row is violated"


def _violated_rows(dataset: Dataset, run: Any) -> Any:
    """Return the lines of the rows that a run violated; the index of all lines is cached."""
    keys = ["family", "condition", "scene", "controller"]

    def violated() -> tuple[Any, Any]:
        rows = dataset.evidence.rows
        rows = rows[rows["violation_depth"] > 0.0]
        return rows, rows.groupby(keys, observed=True).indices

    rows, positions = dataset.once("violated rows", violated)
    return rows.iloc[positions.get(tuple(run[keys]), [])]


def divisive_scene(dataset: Dataset, family: str) -> int | None:
    """Return the number of the scene that divides controllers most evenly.

    Return None if all controllers agree on every scene.
    """
    success = dataset.paired(dataset.conditions[0], "success", [family]).astype(bool)
    share = success.mean(axis=1)
    divided: Any = share[(share > 0.0) & (share < 1.0)]
    if divided.empty:
        return None
    _, scene = (divided - 0.5).abs().idxmin()
    return int(scene)


def scene_figures(dataset: Dataset) -> list[str]:
    """Return the figure of the most divisive scene of each family, in the first condition.

    It shows the tracks of the best controllers and of the unconstrained baseline.
    """
    texts: list[str] = []
    if not dataset.figures:
        return texts
    condition = dataset.conditions[0]
    for family in dataset.families:
        scene = divisive_scene(dataset, family)
        if scene is None:
            continue
        best = ranking(dataset, condition, families=[family]).laws[:MAX_LAWS]
        # In this order they have the colours of other figures.
        laws = [law for law in dataset.laws if law in best]
        shown = (BASELINE, *laws)
        try:
            setup = setup_of(dataset.evidence, family, scene, condition)
            runs = {name: rerun(dataset.evidence, setup, name) for name in shown}
        except Exception as error:  # missing custom parts can raise anything
            problem = f"Scene {scene} of {plain(family)} could not be simulated again"
            texts.append(f"{problem}: {plain(described(error))}.")
            continue
        flags: Any = dataset.paired(condition, "success", [family]).astype(bool)
        success = flags.loc[(family, scene)]
        successful = enumeration([law for law in laws if success[law]])
        title = f"{plain(family)} {scene}, {condition}"
        figure = replace(
            TRACKS,
            name=f"scene--{family}",
            title=title,
            caption=f"{title}. Successful: {successful or 'none of these'}.",
        )
        texts.append(dataset.picture(figure, View(setup, runs, shown)))
    return texts


# --- Situations: a family in a condition ---


class Cell(NamedTuple):
    """Controller in a situation: success, endings of runs, and whether it is significantly ahead.

    ``front`` is True if it is among the best and others are significantly behind. ``worst`` is the
    scene of its worst run, with its ``status`` and, unless it is a success, the ``reason``.
    """

    share: Share
    front: bool
    endings: dict[str, int]
    worst: int
    status: str
    reason: str

    @property
    def colours(self) -> tuple[str, str]:
        """Colours of background and text.

        The background can also be read by colour-blind readers.
        """
        from matplotlib import colormaps
        from matplotlib.colors import to_hex

        rgb = np.array(colormaps["cividis"](self.share.value)[:3])
        # sRGB to linear light (IEC 61966-2-1)
        of_dark = rgb / 12.92
        of_bright = ((rgb + 0.055) / 1.055) ** 2.4
        linear = np.where(rgb <= 0.04045, of_dark, of_bright)
        luminance = linear @ LUMINANCE
        text = "#000" if luminance > BRIGHT else "#fff"
        return to_hex(rgb), text


class Situation(NamedTuple):
    """Family in a condition: success of controllers there, and a cell for each that has runs."""

    family: str
    condition: str
    ranked: Ranking
    cells: dict[str, Cell]


def situations(dataset: Dataset) -> list[Situation]:
    """Return all situations in the order of families and conditions; they are cached."""
    return dataset.once("situations", lambda: _situations(dataset))


def _situations(dataset: Dataset) -> list[Situation]:
    keys = ["family", "condition", "controller"]
    endings = dataset.runs[[*keys, "ending"]]
    counts = Counter(endings.itertuples(index=False, name=None))
    worst: dict[tuple[str, ...], Any] = {}
    last = worst_last(dataset.runs).groupby(keys, observed=True).tail(1)
    for _, run in last.iterrows():
        worst[tuple(run[keys])] = run
    found = []
    for family, condition in dataset.situations:
        ranked = ranking(dataset, condition, families=[family])
        cells = {}
        for law, share in ranked.shares.items():
            key = (family, condition, law)
            run = worst[key]
            run_endings = {}
            for ending in ("success", *UNSUCCESSFUL):
                run_endings[ending] = counts[*key, ending]
            cells[law] = Cell(
                share=share,
                front=law in ranked.front and ranked.next is not None,
                endings=run_endings,
                worst=int(run["scene"]),
                status=str(run["status"]),
                reason="" if run["success"] else reason_text(dataset, run),
            )
        if cells:
            found.append(Situation(family, condition, ranked, cells))
    return found


def heat_map(dataset: Dataset) -> str:
    """Return success as an HTML table with a colour for each cell.

    A cell links to its worst run. A click on a heading sorts the columns.
    """
    entries = dataset.configuration["controllers"]
    custom = set()
    for law in dataset.laws:
        kind = str(entries.get(law, {}).get("type", law))
        if ":" in kind:
            custom.add(law)
    return render_html(
        Path(__file__).with_name("heat-map.html"),
        dataset=dataset,
        situations=situations(dataset),
        custom=custom,
        laws=dataset.laws,
        endings=UNSUCCESSFUL,
    )


def situation_data(dataset: Dataset) -> list[dict[str, Any]]:
    """Return a line for each controller in each situation, for files.

    It has the success with its interval, and counts of endings.
    """
    lines = []
    for situation in situations(dataset):
        for law, cell in situation.cells.items():
            line = {
                "family": situation.family,
                "condition": situation.condition,
                "law": law,
                **cell.share.numbers("success"),
                "endings": cell.endings,
                "front": cell.front,
                "worst_scene": cell.worst,
            }
            lines.append(line)
    return lines
