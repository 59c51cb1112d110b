"""A comparison read back from its folder: what reports are made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ..controllers import CONTROLLERS, make_controller
from ..errors import ConfigurationError, VsconstraintsError, shown
from ..plugins.classes import code_named, untrusted
from ..scenarios import SHIPPED, Scenario
from ..scenarios.reading import Table, checked, demand_table, made, parameters
from .entries import demand_stored_names
from .folder import stored_files
from .metrics import CONSTRAINT_COLUMNS, RESULT_COLUMNS
from .record import RunRecord, run_file
from .runs.files import demand_inside, demand_unchanged
from .runs.folder import manifest_of, read_manifest
from .runs.machine import most_samples
from .tables import read_table

Part = TypeVar("Part")


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
    trusted
        Whether code that scenarios name as ``module:Class`` may run.
    remarks
        What a reader should know: that there are no checksums, or that code is not run.
    """

    folder: Path
    manifest: Mapping[str, Any]
    results: Sequence[Mapping[str, Any]]
    constraints: Sequence[Mapping[str, Any]]
    trusted: bool = False
    remarks: tuple[str, ...] = ()

    @classmethod
    def load(cls, folder: Path, trust: bool = False) -> StoredComparison:
        """Read a folder; nothing that is named in it is imported unless it is trusted.

        Raises
        ------
        ConfigurationError
            that says what is missing in it, or is not what a comparison has stored.
        """
        demand_inside(folder)
        for name in ("manifest.json", "results.csv", "constraints.csv"):
            if not (folder / name).is_file():
                raise ConfigurationError(f"{folder} holds no comparison: {name} is missing")
        remark = demand_unchanged(folder, stored_files(folder), "finished" in manifest_of(folder))
        manifest = _manifest(folder / "manifest.json")
        results = read_table(folder / "results.csv", RESULT_COLUMNS)
        constraints = read_table(folder / "constraints.csv", CONSTRAINT_COLUMNS)
        code = [] if trust else list(code_named(manifest["configuration"]["scenarios"]))
        remarks = [str(untrusted("some of what is drawn", code))] if code else []
        stored = cls(folder, manifest, results, constraints, trust, tuple(filter(None, (remark, *remarks))))
        for name, lines, own in (("results.csv", results, ()), ("constraints.csv", constraints, ("constraint",))):
            stored._check(folder / name, lines, ("scenario", "controller", "trial", *own))
        return stored

    def _check(self, path: Path, lines: list[dict[str, Any]], key: tuple[str, ...]) -> None:
        """Raise ConfigurationError if a line is of a run that the manifest does not hold, or there twice."""
        seen = set()
        scenarios, controllers = self.scenarios, set(self.controllers)
        trials = self.manifest["configuration"].get("trials", 1)
        for line in lines:
            scenario, controller, trial, *_ = own = tuple(line[name] for name in key)
            held = scenario in scenarios and controller in controllers and trial < trials
            if own in seen or not held:
                run = f"scenario {shown(scenario)}, controller {shown(controller)}, trial {trial:g}"
                raise ConfigurationError(
                    f"{path} has {run}{' twice' if held else ', which manifest.json beside it does not have'}"
                )
            seen.add(own)

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """The scenarios as they were run, by name, in the suite's order."""
        stored = self.manifest["configuration"]["scenarios"]
        # shipped scenarios are stored without the folder, which differs from machine to machine
        return {
            name: Scenario(name, entry["tables"], Path(entry["folder"]) if entry["folder"] else SHIPPED, self.trusted)
            for name, entry in stored.items()
        }

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, tracking alone first."""
        return tuple(self.manifest["configuration"]["controllers"])

    def run(self, scenario: str, controller: str, trial: int = 0) -> RunRecord | None:
        """A stored run; None if its trajectory is not there, or longer than its scenario lets a run be."""
        file = run_file(self.folder, scenario, controller, trial)
        return RunRecord.load(file, most_samples(self.scenarios[scenario].tables))


def _manifest(path: Path) -> dict[str, Any]:
    """What a manifest says; raises ConfigurationError if something in it is not what a comparison writes there."""
    try:
        manifest = read_manifest(path)
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    read = part(_Manifest, manifest, str(path))
    where = f"{path}.configuration"
    configuration = part(_Configuration, read.configuration, where)
    for key, value, least in (("trials", configuration.trials, 1), ("seed", configuration.seed, 0)):
        if value < least:
            raise ConfigurationError(f"{where}: {key} must be {least} or more")
    for what, names in (("scenario", configuration.scenarios), ("controller", configuration.controllers)):
        demand_stored_names(what, names, where)
    for name, scenario in configuration.scenarios.items():
        tables = part(_StoredScenario, scenario, f"{where}.scenarios.{name}").tables
        checked(tables.get("constraints", []), Sequence[Table], f"{where}.scenarios.{name}.tables", "constraints")
    for name, controller in configuration.controllers.items():
        _known_options(name, demand_table(controller, f"{where}.controllers.{name}"), f"{where}.controllers.{name}")
    return dict(manifest)


def _known_options(name: str, controller: Table, where: str) -> None:
    """Raise ConfigurationError if a registered law cannot be made with these options; own laws may be elsewhere."""
    kind = checked(controller.get("type", name), str, where, "type")
    if kind not in CONTROLLERS:
        return
    try:
        make_controller(kind, {key: value for key, value in controller.items() if key != "type"})
    except VsconstraintsError as error:
        raise ConfigurationError(f"{where}: {error}") from error


def part(kind: type[Part], value: object, where: str) -> Part:
    """What readers need of a manifest's table that says more; raises ConfigurationError for what is none of that."""
    table = demand_table(value, where)
    found: Part = made(kind, {name: table[name] for name in parameters(kind) if name in table}, where)
    return found


@dataclass(frozen=True)
class _Manifest:
    configuration: Table
    machine: Table = field(default_factory=dict)
    packages: Table = field(default_factory=dict)
    command: Sequence[str] = ()
    wall_time_s: float | None = None
    stored_before: float | None = None


@dataclass(frozen=True)
class _Configuration:
    scenarios: Table
    controllers: Table
    suite: str = ""
    title: str = ""
    trials: int = 1
    seed: int = 0


@dataclass(frozen=True)
class _StoredScenario:
    folder: str
    tables: Table
