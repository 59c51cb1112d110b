"""Evidence read back from its folder: what statistics and reports are made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, get_args

from ...errors import ConfigurationError
from ...plugins.classes import code_named, untrusted
from ...scenarios.families import HALVES, SHIPPED, Drawn, Family
from ...scenarios.reading import Table, checked, demand_table
from ...simulation.trajectory import Outcome
from ..entries import demand_stored_names
from ..record import RunRecord
from ..runs.checksums import TRAJECTORIES, demand_inside, demand_unchanged
from ..runs.folder import MANIFEST, kind_of, manifest_of
from ..runs.keep import Keep
from ..runs.resources import most_samples
from ..stored import part
from . import parquet
from .campaign import MOST_SCENES
from .columns import TABLES
from .folder import shard_file, shard_names, stored_files
from .shards import demand_planned
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
    trusted
        Whether code that families and controllers name as ``module:Class`` may run.
    remarks
        What a reader should know: that there are no checksums, or that code is not run.
    """

    folder: Path
    manifest: Mapping[str, Any]
    trusted: bool = False
    remarks: tuple[str, ...] = ()

    @classmethod
    def load(cls, folder: Path, trust: bool = False) -> Evidence:
        """Read a folder; nothing that is named in it is imported unless it is trusted.

        Raises
        ------
        ConfigurationError
            that says what is missing in it, or is not what a campaign has stored.
        """
        if kind_of(folder) != "evidence":
            raise ConfigurationError(f"{folder} holds no evidence: {MANIFEST} is missing, or is not a campaign's")
        demand_inside(folder)
        manifest = manifest_of(folder)
        # trajectories are many: each is looked at where it is read
        tables = [path for path in stored_files(folder) if path.parent.name != TRAJECTORIES]
        remark = demand_unchanged(folder, tables, "finished" in manifest)
        _demand_readable(manifest, str(folder / MANIFEST))
        demand_planned(folder, shard_names(folder), manifest)
        configuration = manifest["configuration"]
        code = [] if trust else list(code_named([configuration["families"], configuration["controllers"]]))
        remarks = [str(untrusted("some of what is drawn", code))] if code else []
        return cls(folder, manifest, trust, tuple(filter(None, (remark, *remarks))))

    @property
    def families(self) -> dict[str, Family]:
        """The families as they were run, by name."""
        stored = self.manifest["configuration"]["families"]
        # folders of shipped families, which differ from machine to machine, are stored as seen from theirs
        return {
            name: Family(name, entry["tables"], SHIPPED / entry["folder"], self.trusted)
            for name, entry in stored.items()
        }

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
        """A run that was kept; None if its trajectory is not there, ConfigurationError if it is not what was stored."""
        if family not in self.families:
            return None
        path = trajectory_file(self.folder, RunKey(family, condition, scene, controller))
        demand_unchanged(self.folder, [path], "finished" in self.manifest)
        return RunRecord.load(path, most_samples(self.families[family].tables))

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


def _demand_readable(manifest: Mapping[str, Any], where: str) -> None:
    """Raise ConfigurationError if something in a manifest is not what a campaign writes there."""
    read = part(_Manifest, manifest, where)
    where += ".configuration"
    configuration = part(_Configuration, read.configuration, where)
    if not (0 < configuration.scenes <= MOST_SCENES and configuration.seed >= 0 and configuration.half in HALVES):
        raise ConfigurationError(
            f"{where}: scenes must be from 1 to {MOST_SCENES}, seed 0 or more and half one of {', '.join(HALVES)}"
        )
    for what, tables in (("family", configuration.families), ("controller", configuration.controllers)):
        demand_stored_names(what, tables, where)
    for name, entry in configuration.families.items():
        conditions = part(_Family, entry, f"{where}.families.{name}").conditions
        demand_stored_names("condition", conditions, f"{where}.families.{name}")
    for name, entry in configuration.controllers.items():
        at = f"{where}.controllers.{name}"
        checked(demand_table(entry, at).get("type", name), str, at, "type")


@dataclass(frozen=True)
class _Manifest:
    configuration: Table
    machine: Table = field(default_factory=dict)
    packages: Table = field(default_factory=dict)
    command: Sequence[str] = ()
    shard: tuple[int, int] = (1, 1)
    keep: Keep = "none"
    wall_time_s: float | None = None
    process_time_s: float | None = None
    runs_per_s: float | None = None
    runs: int = 0
    scenes: int = 0
    finished: int = 0


@dataclass(frozen=True)
class _Configuration:
    families: Table
    controllers: Table
    scenes: int
    half: str
    seed: int
    scenes_in: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class _Family:
    folder: str
    conditions: Sequence[str]
    tables: Table
