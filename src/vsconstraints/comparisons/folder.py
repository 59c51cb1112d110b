"""The files of a comparison's folder: which would be lost to another comparison, and whose trajectories are kept."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, StorageError
from .metrics import RESULT_COLUMNS
from .record import run_file, stored_run
from .runs.files import TRAJECTORIES, demand_unchanged, plain, seal
from .runs.folder import MANIFEST, Keep, Kinds, kept_lines, manifest_of
from .runs.spec import RunSpec
from .suite import Suite
from .tables import read_table

ARM_LOG = Path("arm", "log.npz")
"""What a run on an arm leaves in its folder beside what all runs do."""

ON_ARM = re.compile(r"on [\w-]+://[^;]*")
"""How the reason of a run on an arm begins."""

KINDS = Kinds(("scenario", "controller"), "trial", "scenario")


def stored_files(folder: Path) -> list[Path]:
    """The files that a comparison consists of, reports apart, where they are there."""
    named = (folder / name for name in (MANIFEST, "results.csv", "constraints.csv", ARM_LOG))
    return [*named, *sorted((folder / TRAJECTORIES).glob("*.npz"))]


def demand_nothing_lost(folder: Path, suite: Suite) -> None:
    """Raise ConfigurationError if finished runs in a folder are no part of a suite, or have other settings in it.

    Runs that are repeated because code, machine or a file has changed are not lost.
    """
    earlier, now = _settings(manifest_of(folder).get("configuration")), _settings(plain(suite.resolved()))
    planned = {(scenario, controller, str(trial)) for scenario, controller, trial in (run.key for run in suite.runs())}
    for scenario, controller, trial in _finished(folder):
        parts = ("seed", ""), ("scenario", scenario), ("controller", controller)
        if (scenario, controller, trial) not in planned:
            why = "is no part of this one"
        elif any(earlier.get(part, now.get(part)) != now.get(part) for part in parts):
            why = "has other settings in this one"
        else:
            continue
        raise ConfigurationError(
            f"{folder} holds another comparison, which would be lost: {scenario} with {controller}, trial {trial}, "
            f"{why}. Give another folder with --out, or --fresh to replace what is there"
        )


def demand_arm_kept(folder: Path, runs: Iterable[RunSpec], fresh: bool = False) -> None:
    """Raise ConfigurationError if a run on an arm would be made again, which only a simulation would be."""
    if not (folder / ARM_LOG).is_file():
        return
    demand_unchanged(folder, stored_files(folder), "finished" in manifest_of(folder))
    planned = {(run.key[0], run.key[1], str(run.key[2])): run for run in runs}
    for key, reason in _finished(folder).items():
        driven, run = ON_ARM.match(reason), planned.get(key)
        if driven and (fresh or run is None or stored_run(run, folder) is None):
            raise ConfigurationError(
                f"{folder} holds a run {driven[0]}, {key[0]} with {key[1]}, which a simulation would replace: "
                "code, settings or files have changed, or --fresh was given. Give another folder with --out"
            )


def _settings(configuration: object) -> dict[tuple[str, str], Any]:
    """What results depend on: the seed, and scenarios and controllers by their names."""
    if not isinstance(configuration, dict):
        return {}
    settings = {("controller", name): entry for name, entry in _dict(configuration.get("controllers")).items()}
    for name, entry in _dict(configuration.get("scenarios")).items():
        tables = _dict(_dict(entry).get("tables"))
        settings["scenario", name] = {key: tables[key] for key in tables if key not in ("title", "description")}
    return {**settings, ("seed", ""): configuration.get("seed")}


def _dict(data: object) -> dict[str, Any]:
    return data if isinstance(data, dict) else {}


def _finished(folder: Path) -> dict[tuple[str, str, str], str]:
    """Scenario, controller and trial of every line of results.csv that can be read, and its reason."""
    names = ("scenario", "controller", "trial")
    try:
        with (folder / "results.csv").open(newline="", encoding="utf-8", errors="replace") as file:
            lines = [line for line in csv.DictReader(file) if all(line.get(name) for name in names)]
    except (OSError, csv.Error):
        return {}
    return {(line["scenario"], line["controller"], line["trial"]): line.get("reason") or "" for line in lines}


def keep_trajectories(folder: Path, keep: Keep) -> int:
    """Remove the trajectories of all other runs of a stored comparison; how many stay.

    The same command would repeat those runs. Runs on an arm stay, since no command repeats them. Raises
    ConfigurationError if there is no comparison in the folder, StorageError if a trajectory cannot be removed.
    """
    lines = read_table(folder / "results.csv", RESULT_COLUMNS)
    driven = [line for line in lines if ON_ARM.match(line["reason"])]
    files = {
        run_file(folder, line["scenario"], line["controller"], int(line["trial"]))
        for line in (*kept_lines(lines, keep, KINDS), *driven)
    }
    stored = set((folder / TRAJECTORIES).glob("*.npz"))
    try:
        for path in stored - files:
            path.unlink(missing_ok=True)
        seal(folder, stored_files(folder))
    except OSError as error:
        raise StorageError(f"trajectories that are not to be kept stay in {folder}: {error}") from error
    return len(stored & files)
