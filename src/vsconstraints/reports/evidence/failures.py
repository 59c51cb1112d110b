"""Figures of single scenes made again: the worst run of each controller, and where controllers differ most."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...comparisons.runs.spec import BASELINE
from ...errors import described
from ..figures import FIGURES, View
from ..groups import MAX_LAWS
from ..markdown import enumeration, plain
from ..plots import Figure
from .dataset import Dataset, rerun, setup_of
from .figures import WORST, Shown
from .ranking import ranking
from .tables import example_failures

TRACKS: Figure = next(figure for figure in FIGURES if figure.name == "tracks")


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
