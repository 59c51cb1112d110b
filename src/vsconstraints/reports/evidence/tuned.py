"""What tuning found, and what it is worth on scenes that it has not seen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...comparisons.evidence.parquet import UNREADABLE
from ...errors import ConfigurationError, one_line
from ..markdown import plain, table
from ..numbers import DASH, number
from .drawing import shown
from .figures import FRONTS
from .material import Material
from .standing import standing
from .words import where

if TYPE_CHECKING:
    import pandas as pd

EVALUATIONS, HYPERVOLUMES = "evaluations.parquet", "hypervolumes.parquet"


def tuned(material: Material) -> str:
    """Default against tuned settings on the campaign's scenes; then the fronts that tuning found on its own."""
    parts = [_against(material), _fronts(material)]
    text = "\n\n".join(part for part in parts if part)
    return f"## Tuning\n\n{text}" if text else ""


def _against(material: Material) -> str:
    if not material.tuned:
        return ""
    lines = []
    for condition in material.conditions:
        one = standing(material, condition)
        for law, name in material.tuned.items():
            if {law, name} <= set(one.laws):
                pair = one.pair(name, law)
                told = f"{pair.difference.cell}" if pair.distinguishable else f"≈ {pair.difference.cell}"
                lines.append([where(condition), law, one.shares[law].cell, one.shares[name].cell, told])
    if not lines:
        return ""
    text = (
        "Success in per cent of the same scenes, none of which tuning has seen, with the settings that a law comes "
        "with and with tuned ones; ≈ where the two are not distinguishable."
    )
    if material.configuration.get("half") == "training":
        text = (
            "**These are training scenes:** tuned settings may have been sought on them, and nothing here says what "
            "they are worth. Success in per cent, with the settings that a law comes with and with tuned ones."
        )
    header = ["condition", "law", "as it comes", "tuned", "difference"]
    return f"{text}\n\n{table(header, lines, 2)}"


def _fronts(material: Material) -> str:
    folder = material.tuning
    if folder is None or not (folder / EVALUATIONS).is_file():
        return ""
    evaluations = _read(folder / EVALUATIONS, {"law", "chosen", "options", "feasible"})
    volumes = _read(folder / HYPERVOLUMES, {"law", "hypervolume"}) if (folder / HYPERVOLUMES).is_file() else None
    laws = list(dict.fromkeys(evaluations["law"].astype(str)))
    lines = []
    for law in laws:
        own = evaluations[evaluations["law"] == law]
        chosen = own[own["chosen"].astype(bool)]
        options = plain(str(chosen["options"].iloc[0]).strip("{}").replace('"', "")) if len(chosen) else DASH
        feasible = int(own["feasible"].astype(bool).sum())
        lines.append([law, str(len(own)), str(feasible), _volume(volumes, law), options or "as it comes"])
    text = (
        "On training scenes, with the same number of evaluations and the same tuner for every law. *Feasible* settings "
        "violate rows no more often than is allowed. *Hypervolume* is what a law's front dominates, the median over "
        "tuner seeds and the least and greatest; the setting is the one that was taken over."
    )
    header = ["law", "evaluations", "feasible", "hypervolume", "setting taken over"]
    figure = shown(material, FRONTS, evaluations, laws)
    return "\n\n".join(part for part in (text, table(header, lines), figure) if part)


def _read(path: Path, columns: set[str]) -> pd.DataFrame:
    """A table of a tuning; raises ConfigurationError if it cannot be read."""
    import pandas as pd

    try:
        found = pd.read_parquet(path)
    except UNREADABLE as error:
        raise ConfigurationError(f"{path} cannot be read: {one_line(str(error))}") from error
    if missing := columns.difference(found.columns):
        raise ConfigurationError(f"{path} cannot be read: it has no column {min(missing)}")
    return found


def _volume(volumes: pd.DataFrame | None, law: str) -> str:
    if volumes is None:
        return DASH
    own: Any = volumes[volumes["law"] == law]["hypervolume"].astype(float)
    if own.empty:
        return DASH
    middle = number(float(own.median()))
    return middle if len(own) == 1 else f"{middle} ({number(float(own.min()))}–{number(float(own.max()))})"


def tuning_folder(folder: Path, given: Path | None) -> Path | None:
    """The folder of the tuning that belongs to a campaign: the one that is given, or ``tuning`` in the campaign's."""
    own = folder / "tuning"
    return given if given is not None else own if own.is_dir() else None
