"""Folder of a comparison: its files, protection against data loss, and reading for reports."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..controllers import registered_laws
from ..errors import ConfigurationError, FolderTaken, StorageError, VsconstraintsError, format_value
from ..scenarios import SHIPPED, Scenario
from ..scenarios.reading import Table, checked
from .experiment import require_names
from .metrics import constraint_columns, result_columns
from .record import RunRecord, run_file, stored_run
from .runs.files import TRAJECTORIES, plain, require_unchanged, seal
from .runs.folder import MANIFEST, Keep, StoredResults, entries, kept_lines, manifest_of
from .runs.identity import differences, in_words
from .runs.machine import most_samples
from .runs.spec import ControllerSpec, RunSpec
from .suite import Suite
from .tables import read_table

#: Functions that return the columns of each table.
TABLES = {"results.csv": result_columns, "constraints.csv": constraint_columns}

Number = float | None
Texts = Sequence[str]

#: Additional file that a run on an arm stores in its folder.
ARM_LOG = Path("arm", "log.npz")
ON_ARM = re.compile(r"(?:^|; )(on [\w-]+://[^;]*)")  #: Part of the reason of a run on an arm.


def stored_files(folder: Path) -> list[Path]:
    """List the files of a comparison, except reports; some may not exist."""
    named = (folder / name for name in (MANIFEST, *TABLES, str(ARM_LOG)))
    return [*named, *sorted((folder / TRAJECTORIES).glob("*.npz"))]


def require_nothing_lost(folder: Path, suite: Suite) -> None:
    """Raise ConfigurationError if finished runs are not in a suite or have other settings in it."""
    earlier = _settings(manifest_of(folder).get("configuration"))
    now = _settings(plain(suite.resolved()))
    planned = {_texts(run) for run in suite.runs()}
    for scenario, controller, trial in _finished(folder):
        parts = ("seed", f"scenario {scenario}", f"controller {controller}")
        before = {part: earlier[part] for part in parts if part in earlier}
        changes = list(differences(before, {part: now.get(part) for part in before}))
        if (scenario, controller, trial) not in planned:
            why = "is not part of this one"
        elif changes:
            why = f"has other settings in this one: {in_words(changes)}"
        else:
            continue
        lost = (
            f"{folder} holds another comparison, which would be lost: {scenario} with "
            f"{controller}, trial {trial}"
        )
        instead = "Give another folder with --out, or --fresh to replace the folder's content"
        raise FolderTaken(f"{lost}, {why}. {instead}", f"{lost}, {why}")


def require_arm_kept(folder: Path, runs: Iterable[RunSpec], fresh: bool = False) -> None:
    """Raise ConfigurationError if a run on an arm would be replaced by a simulation."""
    if not (folder / ARM_LOG).is_file():
        return
    require_unchanged(folder, stored_files(folder), "finished" in manifest_of(folder))
    planned = {_texts(run): run for run in runs}
    for key, reason in _finished(folder).items():
        driven = ON_ARM.search(reason)
        run = planned.get(key)
        is_kept = not fresh and run is not None and stored_run(run, folder) is not None
        if driven and not is_kept:
            scenario, controller, _ = key
            lost = (
                f"{folder} holds a run {driven[1]}, {scenario} with {controller}, which a "
                "simulation would replace"
            )
            why = "code, settings or files have changed"
            instead = "or --fresh was given. Give another folder with --out"
            raise FolderTaken(f"{lost}: {why}, {instead}", f"{lost}: {why}")


def _texts(run: RunSpec) -> tuple[str, str, str]:
    """Return the key of a run as its line of results.csv has it."""
    scenario, controller, trial = run.key
    return scenario, controller, str(trial)


def _settings(configuration: Any) -> dict[str, Any]:
    """Extract the settings that results depend on from a manifest's configuration.

    These are the seed, and each scenario and controller. Invalid entries are ignored.
    """
    settings = {}
    with suppress(KeyError, TypeError, AttributeError):
        settings["seed"] = configuration["seed"]
        for name, entry in configuration["controllers"].items():
            settings[f"controller {name}"] = entry
        for name, entry in configuration["scenarios"].items():
            texts = ("title", "description")
            tables = entry["tables"].items()
            settings[f"scenario {name}"] = {key: value for key, value in tables if key not in texts}
    return settings


def _finished(folder: Path) -> dict[tuple[str, str, str], str]:
    """Return the keys of all readable lines of results.csv, with their reasons.

    A key consists of scenario, controller and trial.
    """
    reasons = {}
    try:
        with (folder / "results.csv").open(newline="", encoding="utf-8", errors="replace") as file:
            for line in csv.DictReader(file):
                scenario = line.get("scenario")
                controller = line.get("controller")
                trial = line.get("trial")
                if scenario and controller and trial:
                    reasons[scenario, controller, trial] = line.get("reason") or ""
    except (OSError, csv.Error):
        return {}
    return reasons


def keep_trajectories(folder: Path, keep: Keep) -> int:
    """Remove all trajectories of a stored comparison except those to keep and those on an arm.

    Return the number of trajectories that remain. Raises ConfigurationError if the folder contains
    no comparison, StorageError if a trajectory cannot be removed.
    """
    lines = read_table(folder / "results.csv", result_columns())
    driven = [line for line in lines if ON_ARM.search(line["reason"])]
    kept = kept_lines(lines, keep, ("scenario", "controller"), ("scenario", "trial"))
    files = {
        run_file(folder, line["scenario"], line["controller"], int(line["trial"]))
        for line in (*kept, *driven)
    }
    stored = set((folder / TRAJECTORIES).glob("*.npz"))
    try:
        for path in stored - files:
            path.unlink(missing_ok=True)
        seal(folder, stored_files(folder))
    except OSError as error:
        raise StorageError(
            f"trajectories that are not to be kept stay in {folder}: {error}"
        ) from error
    return len(stored & files)


@dataclass(frozen=True)
class StoredComparison(StoredResults):
    """Results of a comparison in their folder."""

    with_code = ("scenarios",)

    @cached_property
    def results(self) -> Sequence[Mapping[str, Any]]:
        """Lines of results.csv."""
        return read_table(self.folder / "results.csv", result_columns())

    @cached_property
    def constraints(self) -> Sequence[Mapping[str, Any]]:
        """Lines of constraints.csv."""
        return read_table(self.folder / "constraints.csv", constraint_columns())

    @cached_property
    def scenarios(self) -> dict[str, Scenario]:
        """Scenarios as they were run, by name, in the suite's order."""
        scenarios = {}
        for name, entry in self.manifest["configuration"]["scenarios"].items():
            # shipped scenarios are stored without the folder, which differs from machine to machine
            folder = Path(entry["folder"]) if entry["folder"] else SHIPPED
            scenarios[name] = Scenario(name, entry["tables"], folder, self.trusted)
        return scenarios

    @property
    def warnings(self) -> Mapping[str, Sequence[str]]:
        """Warnings about scenarios before their runs, by name: see :meth:`.Suite.warnings`."""
        warnings: Mapping[str, Sequence[str]] = self.manifest.get("warnings", {})
        return warnings

    @property
    def notes(self) -> tuple[str, ...]:
        """Warnings as sentences, each of which names its scenario."""
        return tuple(f"{name}: {text}" for name, texts in self.warnings.items() for text in texts)

    def run(self, scenario: str, controller: str, trial: int = 0) -> RunRecord | None:
        """Load a run; None if its trajectory is missing or longer than its scenario allows."""
        file = run_file(self.folder, scenario, controller, trial)
        return RunRecord.load(file, most_samples(self.scenarios[scenario].tables))

    @classmethod
    def _files(cls, folder: Path) -> Sequence[Path]:
        for name in (MANIFEST, *TABLES):
            if not (folder / name).is_file():
                raise ConfigurationError(f"{folder} holds no comparison: {name} is missing")
        return stored_files(folder)

    def _require_planned(self) -> None:
        configuration = self.manifest["configuration"]
        for name, lines in zip(TABLES, (self.results, self.constraints), strict=True):
            seen = set()
            for line in lines:
                scenario = line["scenario"]
                controller = line["controller"]
                trial = line["trial"]
                key = scenario, controller, trial, line.get("constraint")
                known = (
                    scenario in configuration["scenarios"]
                    and controller in configuration["controllers"]
                )
                planned = known and trial < configuration.get("trials", 1)
                if key in seen or not planned:
                    named = (
                        f"scenario {format_value(scenario)}, controller "
                        f"{format_value(controller)}, trial {trial:g}"
                    )
                    why = " twice" if planned else f", which {MANIFEST} beside it does not have"
                    raise ConfigurationError(f"{self.folder / name} has {named}{why}")
                seen.add(key)

    @classmethod
    def _require_readable(cls, manifest: Mapping[str, Any], where: str) -> None:
        others = {
            "machine": Table,
            "packages": Table,
            "command": Texts,
            "wall_time_s": Number,
            "stored_before": Number,
            "warnings": Table,
        }
        manifest = entries(manifest, where, {"configuration": Table}, others)
        for name, texts in manifest.get("warnings", {}).items():
            checked(texts, Sequence[str], f"{where}.warnings", name)
        where += ".configuration"
        tables = {"scenarios": Table, "controllers": Table}
        configuration = entries(
            manifest["configuration"],
            where,
            tables,
            {"suite": str, "title": str, "trials": int, "seed": int},
        )
        for key, least in (("trials", 1), ("seed", 0)):
            if configuration.get(key, least) < least:
                raise ConfigurationError(f"{where}: {key} must be {least} or more")
        for what in ("scenario", "controller"):  # figures are named after them
            require_names(what, configuration[f"{what}s"], f"{where}: ")
        for name, scenario in configuration["scenarios"].items():
            at = f"{where}.scenarios.{name}"
            own = entries(scenario, at, {"folder": str, "tables": Table})["tables"]
            checked(own.get("constraints", []), Sequence[Table], f"{at}.tables", "constraints")
        for name, controller in configuration["controllers"].items():
            entry = ControllerSpec.from_table(name, controller, f"{where}.controllers")
            if entry.law in registered_laws():  # custom laws may not exist on this machine
                try:
                    entry.make()
                except VsconstraintsError as error:
                    raise ConfigurationError(f"{where}.controllers.{name}: {error}") from error
