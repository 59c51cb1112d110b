"""A folder of results as one side of a difference, whether it holds chosen scenarios or drawn scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError, unknown_name
from .. import StoredComparison
from ..evidence import RUNS, SCENES, Evidence
from ..metrics import RESULT_COLUMNS
from ..runs.folder import kind_of
from ..statistics import SCENE


@dataclass(frozen=True)
class Side:
    """One of two comparisons.

    Attributes
    ----------
    folder, manifest
        Where it is stored, and what was run.
    runs
        pandas.DataFrame, one line for each run, with the columns of results.csv behind those of ``key``.
    scene
        Columns that say which scene a run is of.
    group
        Those of them by which results are told apart: none, or family and condition.
    unit
        What the manifest counts, ``runs`` or ``scenes``: as many as were asked for, and as many as are finished.
    drawn
        pandas.Series of what was drawn for each scene, as text, by the columns of ``scene`` but the condition; None
        where scenes are chosen.
    remarks
        What a reader should know of what is stored.
    """

    folder: Path
    manifest: Mapping[str, Any]
    runs: Any
    scene: tuple[str, ...]
    group: tuple[str, ...]
    unit: str
    drawn: Any
    remarks: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, ...]:
        """Columns that say which run it is."""
        return (*self.scene, "controller")

    @classmethod
    def load(cls, folder: Path, renamed: Mapping[str, str] | None = None) -> Side:
        """Read a folder of ``compare`` or of ``evidence``.

        Parameters
        ----------
        folder
            Where it is.
        renamed
            Other names for some of its controllers.

        Raises
        ------
        ConfigurationError
            if it holds neither, or no such controller.
        """
        side = _drawn(folder) if kind_of(folder) == "evidence" else _chosen(folder)
        return _renamed(side, renamed or {})


def _chosen(folder: Path) -> Side:
    import pandas

    stored = StoredComparison.load(folder, trust=True)  # nothing of it is built
    runs = pandas.DataFrame(stored.results, columns=list(RESULT_COLUMNS))
    runs["trial"] = runs["trial"].astype(int)
    return Side(folder, stored.manifest, runs, ("scenario", "trial"), (), "runs", None, stored.remarks)


def _drawn(folder: Path) -> Side:
    evidence = Evidence.load(folder, trust=True)  # nothing of it is drawn
    # what has few values may have others on the other side
    runs = evidence.runs.astype({column.name: "str" for column in RUNS if column.category})
    scenes = evidence.scenes.astype({column.name: "str" for column in SCENES if column.category})
    drawn = scenes.set_index(["family", "half", "scene"])["values"]
    return Side(folder, evidence.manifest, runs, SCENE, ("family", "condition"), "scenes", drawn, evidence.remarks)


def _renamed(side: Side, names: Mapping[str, str]) -> Side:
    if not names:
        return side
    configuration = side.manifest["configuration"]
    controllers = configuration["controllers"]
    for old, new in names.items():
        if old not in controllers:
            raise unknown_name(f"controller of {side.folder}", old, controllers)
        if new in controllers:
            raise ConfigurationError(f"{old} cannot be called {new}: {side.folder} has a controller of that name")
    tables = {names.get(name, name): table for name, table in controllers.items()}
    manifest = {**side.manifest, "configuration": {**configuration, "controllers": tables}}
    return replace(side, manifest=manifest, runs=side.runs.assign(controller=side.runs["controller"].replace(names)))
