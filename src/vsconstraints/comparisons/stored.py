"""A comparison read back from its folder: what reports are made from."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError
from ..scenarios import SHIPPED, Scenario
from .record import RunRecord, run_file
from .tables import read_table


@dataclass(frozen=True)
class StoredComparison:
    """What a comparison left in its folder.

    Attributes
    ----------
    folder
        Where.
    manifest
        version, git_commit, command, started, seed, configuration, machine, packages, wall_time_s, runs, finished.
    results, constraints
        The lines of results.csv and constraints.csv (see :func:`read_table`).
    """

    folder: Path
    manifest: dict[str, Any]
    results: list[dict[str, Any]]
    constraints: list[dict[str, Any]]

    @classmethod
    def load(cls, folder: Path) -> StoredComparison:
        """Read a folder; raises ConfigurationError that says what is missing in it."""
        for name in ("manifest.json", "results.csv", "constraints.csv"):
            if not (folder / name).is_file():
                raise ConfigurationError(f"{folder} holds no comparison: {name} is missing")
        try:
            manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        except ValueError as error:
            raise ConfigurationError(f"{folder / 'manifest.json'} cannot be read: {error}") from error
        if not isinstance(manifest, dict) or "configuration" not in manifest:
            raise ConfigurationError(f"{folder / 'manifest.json'} is not of a comparison: it has no 'configuration'")
        return cls(folder, manifest, read_table(folder / "results.csv"), read_table(folder / "constraints.csv"))

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenarios as they were run, by name, in the suite's order."""
        stored = self.manifest["configuration"]["scenarios"]
        # shipped scenarios are stored without the folder, which differs from machine to machine
        return {
            name: Scenario(name, entry["tables"], Path(entry["folder"]) if entry["folder"] else SHIPPED)
            for name, entry in stored.items()
        }

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, tracking alone first."""
        return tuple(self.manifest["configuration"]["controllers"])

    def run(self, scenario: str, controller: str, trial: int = 0) -> RunRecord | None:
        """A stored run; None if its trajectory is not there."""
        return RunRecord.load(run_file(self.folder, scenario, controller, trial))
