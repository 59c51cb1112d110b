"""A comparison read back from its folder: what reports are made from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ..controllers import CONTROLLERS, make_controller
from ..errors import ConfigurationError, VsconstraintsError, shown
from ..plugins.classes import code_named, untrusted
from ..scenarios import SHIPPED, Scenario
from ..scenarios.reading import Table, checked, demand_table, from_table, parameters
from .experiment import demand_stored_names
from .folder import stored_files
from .metrics import CONSTRAINT_COLUMNS, RESULT_COLUMNS
from .record import RunRecord, run_file
from .runs.files import demand_unchanged
from .runs.folder import MANIFEST, demand_inside, manifest_of, read_manifest
from .runs.machine import most_samples
from .tables import read_table

Part = TypeVar("Part")


@dataclass(frozen=True)
class StoredComparison:
    """The results of a comparison.

    Attributes
    ----------
    folder
        Where they are stored.
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
        tables = {"results.csv": RESULT_COLUMNS, "constraints.csv": CONSTRAINT_COLUMNS}
        for name in (MANIFEST, *tables):
            if not (folder / name).is_file():
                raise ConfigurationError(f"{folder} holds no comparison: {name} is missing")
        manifest, remarks = read_folder(folder, stored_files(folder), _demand_readable, trust, ("scenarios",))
        results, constraints = (read_table(folder / name, columns) for name, columns in tables.items())
        for name, lines in zip(tables, (results, constraints), strict=True):
            _demand_planned(lines, manifest["configuration"], folder / name)
        return cls(folder, manifest, results, constraints, trust, remarks)

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
        """Names of the controllers, the unconstrained baseline first."""
        return tuple(self.manifest["configuration"]["controllers"])

    def run(self, scenario: str, controller: str, trial: int = 0) -> RunRecord | None:
        """A stored run; None if its trajectory is not there, or longer than its scenario allows."""
        file = run_file(self.folder, scenario, controller, trial)
        return RunRecord.load(file, most_samples(self.scenarios[scenario].tables))


def _demand_planned(lines: Iterable[Mapping[str, Any]], configuration: Mapping[str, Any], path: Path) -> None:
    """Raise ConfigurationError if a line is there twice, or of a run that is not in the manifest."""
    seen = set()
    for line in lines:
        scenario, controller, trial = run = line["scenario"], line["controller"], line["trial"]
        key = *run, line.get("constraint")
        planned = (
            scenario in configuration["scenarios"]
            and controller in configuration["controllers"]
            and trial < configuration.get("trials", 1)
        )
        if key in seen or not planned:
            named = f"scenario {shown(scenario)}, controller {shown(controller)}, trial {trial:g}"
            why = " twice" if planned else f", which {MANIFEST} beside it does not have"
            raise ConfigurationError(f"{path} has {named}{why}")
        seen.add(key)


def read_folder(
    folder: Path,
    files: Iterable[Path],
    demand_readable: Callable[[Mapping[str, Any], str], None],
    trust: bool,
    with_code: Sequence[str],
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The manifest of a folder of results whose files are as they were stored, and remarks for the reader.

    Parameters
    ----------
    folder, files
        The folder, and the files in it that are checked.
    demand_readable
        Raises ConfigurationError for a manifest, with its name, that holds something else than results of this kind.
    trust, with_code
        Whether code may run that these tables of the configuration name.

    Raises
    ------
    ConfigurationError
        for links that lead out of the folder, changed files, and a manifest that cannot be read.
    """
    demand_inside(folder)
    remark = demand_unchanged(folder, files, "finished" in manifest_of(folder))
    path = folder / MANIFEST
    try:
        manifest = read_manifest(path)
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    demand_readable(manifest, str(path))
    code = [] if trust else list(code_named([manifest["configuration"][name] for name in with_code]))
    remarks = (remark, str(untrusted("some of what is drawn", code)) if code else "")
    return dict(manifest), tuple(filter(None, remarks))


def _demand_readable(manifest: Mapping[str, Any], where: str) -> None:
    """Raise ConfigurationError if something in a manifest is not what a comparison writes there."""
    read = part(_Manifest, manifest, where)
    where += ".configuration"
    configuration = part(_Configuration, read.configuration, where)
    for key, value, least in (("trials", configuration.trials, 1), ("seed", configuration.seed, 0)):
        if value < least:
            raise ConfigurationError(f"{where}: {key} must be {least} or more")
    demand_stored_names({"scenario": configuration.scenarios, "controller": configuration.controllers}, where)
    for name, scenario in configuration.scenarios.items():
        tables = part(_StoredScenario, scenario, f"{where}.scenarios.{name}").tables
        checked(tables.get("constraints", []), Sequence[Table], f"{where}.scenarios.{name}.tables", "constraints")
    for name, controller in configuration.controllers.items():
        at = f"{where}.controllers.{name}"
        options = dict(demand_table(controller, at))
        law = checked(options.pop("type", name), str, at, "type")
        if law in CONTROLLERS:  # own laws may be elsewhere
            try:
                make_controller(law, options)
            except VsconstraintsError as error:
                raise ConfigurationError(f"{at}: {error}") from error


def part(kind: type[Part], value: object, where: str) -> Part:
    """The entries of a table that readers need, as a dataclass; raises ConfigurationError for wrong ones."""
    table = demand_table(value, where)
    entries: Part = from_table(kind, {name: table[name] for name in parameters(kind) if name in table}, where)
    return entries


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
