"""Single scenes: in each family the one that divides the laws most, with the tracks of all of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...comparisons.runs.spec import BASELINE
from ..figures import FIGURES, View
from ..groups import MAX_LAWS
from ..markdown import enumeration, plain
from ..plots import Figure
from .drawing import shown
from .material import Material
from .replay import again, setup_of
from .standing import standing

TRACKS: Figure = next(figure for figure in FIGURES if figure.name == "tracks")


def singles(material: Material) -> str:
    """One figure per family, in the first condition; nothing where figures are not wanted or laws never differ."""
    if not material.figures:
        return ""
    parts = [text for family in material.families if (text := _single(material, family))]
    if not parts:
        return ""
    how = "In each family the scene that divides the laws most, without success of some and with that of others."
    return "\n\n".join(("## Single scenes", f"{how} {TRACKS.reading}", *parts))


def telling(material: Material, family: str) -> int | None:
    """The number of the scene in which laws are divided most evenly; None if there is none in which they differ."""
    flags = material.paired(material.conditions[0], "success", [family]).astype(bool)
    share = flags.mean(axis=1)
    divided: Any = share[(share > 0.0) & (share < 1.0)]
    return None if divided.empty else int((divided - 0.5).abs().idxmin()[1])


def _single(material: Material, family: str) -> str:
    condition, scene = material.conditions[0], telling(material, family)
    if scene is None:
        return ""
    best = standing(material, condition, families=[family]).laws[:MAX_LAWS]
    laws = [law for law in material.laws if law in best]  # in this order they have the colours of other figures
    own: Any = material.paired(condition, "success", [family]).astype(bool).loc[(family, scene)]
    try:
        setup = setup_of(material.evidence, family, scene, condition)
        runs = {name: again(material.evidence, setup, name) for name in (BASELINE, *laws)}
    except Exception as error:  # own parts that are no longer there can raise anything
        why = f"{type(error).__name__}: {plain(str(error))}"
        return f"Scene {scene} of {plain(family)} could not be made again: {why}."
    did = enumeration([law for law in laws if own[law]]) or "none of these"
    title = f"{plain(family)} {scene}, {condition}"
    figure = replace(TRACKS, name=f"scene--{family}", title=title, caption=f"{title}. With success: {did}.")
    return shown(material, figure, View(setup, runs, (BASELINE, *laws)))
