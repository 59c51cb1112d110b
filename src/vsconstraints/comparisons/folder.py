"""A comparison's folder: held by one process at a time, and never taken from anything else that is stored there."""

from __future__ import annotations

import csv
import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError
from .suite import Suite

LOCK = ".vsconstraints-lock"
"""File that names the process that holds the folder. It stays, and says that the folder is a comparison's."""

_held: set[Path] = set()


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder, made if it is not there, so that no other process stores anything in it meanwhile.

    A process may hold it more than once. The lock ends with the process, however that ends.

    Raises
    ------
    ConfigurationError
        if the folder cannot be made, holds something and no comparison, or another process holds it. Nothing in it has
        been touched then.
    """
    path = folder.absolute()
    if path in _held:
        yield
        return
    try:
        if path.is_dir() and any(path.iterdir()) and not _is_comparison(path):
            raise ConfigurationError(
                f"{path} holds something, and no comparison that could go on: give a folder that is empty or new"
            )
        path.mkdir(parents=True, exist_ok=True)
        lock = (path / LOCK).open("a+", encoding="utf-8")
    except (OSError, ValueError) as error:
        if isinstance(error, ConfigurationError):
            raise
        raise ConfigurationError(f"results cannot be stored in {folder}: {error}") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise ConfigurationError(
                f"process {lock.read().strip() or 'unknown'} is storing a comparison in {folder}: "
                "wait until it ends, or give another folder"
            ) from None
        except OSError:
            pass  # a file system without locks
        with suppress(OSError):  # a full disk: whoever is refused is not told by whom
            lock.truncate(0)
            lock.write(f"{os.getpid()}\n")
            lock.flush()
        _held.add(path)
        try:
            yield
        finally:
            _held.discard(path)


def demand_nothing_lost(folder: Path, suite: Suite) -> None:
    """Raise ConfigurationError if results in a folder would be lost to those of a suite.

    Lost are finished runs that are no part of it, or have other settings in it. Runs that are made again since the
    code, the machine or a file has changed are not lost: the same is asked of them.
    """
    if "families" in _dict(_manifest(folder).get("configuration")):
        raise ConfigurationError(f"{folder} holds evidence, not a comparison: give another folder with --out")
    earlier, now = _settings(_manifest(folder).get("configuration")), _settings(_plain(suite.resolved()))
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


def _is_comparison(folder: Path) -> bool:
    return (folder / LOCK).is_file() or "configuration" in _manifest(folder)


def _manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a folder; empty if there is none that can be read."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return _dict(manifest)


def _settings(configuration: object) -> dict[tuple[str, str], Any]:
    """What results depend on: the seed, and scenarios and controllers by their names."""
    if not isinstance(configuration, dict):
        return {}
    found: dict[tuple[str, str], Any] = {("seed", ""): configuration.get("seed")}
    for name, entry in _dict(configuration.get("scenarios")).items():
        tables = _dict(_dict(entry).get("tables"))
        found["scenario", name] = {key: tables[key] for key in tables if key not in ("title", "description")}
    return found | {("controller", name): entry for name, entry in _dict(configuration.get("controllers")).items()}


def _dict(data: object) -> dict[str, Any]:
    return data if isinstance(data, dict) else {}


def _plain(data: object) -> object:
    """Data as it comes back from JSON."""
    return json.loads(json.dumps(data, default=str))


def _finished(folder: Path) -> list[tuple[str, str, str]]:
    """Scenario, controller and trial of every line of results.csv that can be read."""
    try:
        with (folder / "results.csv").open(newline="", encoding="utf-8", errors="replace") as file:
            lines = list(csv.DictReader(file))
    except (OSError, csv.Error):
        return []
    return [
        (line["scenario"], line["controller"], line["trial"])
        for line in lines
        if all(line.get(name) for name in ("scenario", "controller", "trial"))
    ]
