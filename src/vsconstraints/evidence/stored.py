"""Evidence read back from its folder: what statistics and reports are made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, get_args

from ..comparisons.record import RunRecord
from ..errors import ConfigurationError
from ..families import SHIPPED, Drawn, Family
from ..runs.folder import MANIFEST, kind_of, manifest_of
from ..simulation.trajectory import Outcome
from . import parquet
from .columns import TABLES
from .folder import shard_file, shard_names
from .trajectories import RunKey, trajectory_file


@dataclass(frozen=True)
class Evidence:
    """What a campaign left in its folder.

    Attributes
    ----------
    folder
        Where.
    manifest
        version, git_commit, command, started, configuration, machine, packages, wall_time_s, runs, runs_per_s, ….
    """

    folder: Path
    manifest: Mapping[str, Any]

    @classmethod
    def load(cls, folder: Path) -> Evidence:
        """Read a folder; raises ConfigurationError that says what is missing in it."""
        if kind_of(folder) != "evidence":
            raise ConfigurationError(f"{folder} holds no evidence: {MANIFEST} is missing, or is not a campaign's")
        return cls(folder, manifest_of(folder))

    @property
    def families(self) -> dict[str, Family]:
        """The families as they were run, by name."""
        stored = self.manifest["configuration"]["families"]
        # folders of shipped families, which differ from machine to machine, are stored as seen from theirs
        return {name: Family(name, entry["tables"], SHIPPED / entry["folder"]) for name, entry in stored.items()}

    @property
    def conditions(self) -> tuple[str, ...]:
        """The conditions in which scenes were run, in the order in which families name them."""
        stored = self.manifest["configuration"]["families"].values()
        return tuple(dict.fromkeys(name for entry in stored for name in entry["conditions"]))

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, tracking alone first."""
        return tuple(self.manifest["configuration"]["controllers"])

    @cached_property
    def runs(self) -> Any:
        """A DataFrame with one line for each run, in the order of families, conditions, scenes and controllers."""
        return self._table("runs")

    @cached_property
    def rows(self) -> Any:
        """A DataFrame with one line for each row of a run that was challenged, acted or was left."""
        return self._table("rows")

    @cached_property
    def scenes(self) -> Any:
        """A DataFrame with one line for each scene."""
        return self._table("scenes")

    def drawn(self, family: str, scene: int) -> Drawn:
        """A scene as it was run, drawn again."""
        configuration = self.manifest["configuration"]
        return self.families[family].scene(scene, configuration["half"], configuration["seed"])

    def record(self, family: str, condition: str, scene: int, controller: str) -> RunRecord | None:
        """A run that was kept; None if its trajectory is not there."""
        return RunRecord.load(trajectory_file(self.folder, RunKey(family, condition, scene, controller)))

    def _table(self, name: str) -> Any:
        import pandas as pd

        columns = TABLES[name]
        files = [shard_file(self.folder, name, shard) for shard in shard_names(self.folder)]
        found = parquet.read(files, columns).to_pandas()
        orders: dict[str, Sequence[str]] = {
            "family": tuple(self.families),
            "condition": self.conditions,
            "controller": self.controllers,
            "status": get_args(Outcome),
        }
        for column in columns:
            if column.category:
                order = orders.get(column.name, sorted(found[column.name].unique()))
                found[column.name] = pd.Categorical(found[column.name], order)
        keys = [key for key in ("family", "condition", "scene", "controller") if key in found]
        # rows of a run stay in their order
        return found.sort_values(keys, kind="stable", ignore_index=True)
