"""A folder of results: of one kind, locked by one process at a time; whose trajectories are kept in it."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, cast, get_args

from ...errors import ConfigurationError, unknown_name

Kind = Literal["a comparison", "evidence", "a tuning"]

MANIFEST = "manifest.json"  #: Says what was run; every kind of results has one.
#: File that names the process that holds the folder. It stays, and says that what is there are results.
LOCK = ".vsconstraints-lock"
#: Folders that this process holds: locks are a process' own, and a second one of the same file would refuse itself.
_locked: set[Path] = set()


@contextmanager
def locked(folder: Path, kind: Kind) -> Iterator[None]:
    """Lock a folder, created if it does not exist, so that no other process stores anything in it meanwhile.

    A process may lock it more than once. The lock ends with the process. Raises ConfigurationError if the folder cannot
    be created, holds something else, or another process has locked it; nothing in it has been touched then.
    """
    path = folder.absolute()
    if path in _locked:
        yield
        return
    _demand_nothing_else(path, kind)
    try:
        path.mkdir(parents=True, exist_ok=True)
        demand_inside(path)
        lock = (path / LOCK).open("a+", encoding="utf-8")
    except ConfigurationError:
        raise
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"results cannot be stored in {folder}: {error}") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            raise ConfigurationError(
                f"process {lock.read().strip() or 'unknown'} is storing results in {folder}: "
                "wait until it ends, or give another folder"
            ) from None
        except OSError:
            pass  # a file system without locks
        with suppress(OSError):  # a full disk: others are refused without the process id
            lock.truncate(0)
            lock.write(f"{os.getpid()}\n")
            lock.flush()
        _locked.add(path)
        try:
            yield
        finally:
            _locked.discard(path)


def demand_inside(folder: Path) -> None:
    """Raise ConfigurationError if a link in a folder leads out of it: what is written to it would go elsewhere."""
    whole = os.path.realpath(folder)
    for at, folders, files in os.walk(folder):
        for path in (os.path.join(at, name) for name in (*folders, *files)):
            if os.path.islink(path) and os.path.commonpath([whole, os.path.realpath(path)]) != whole:
                raise ConfigurationError(
                    f"{path} is a link that leads out of the folder, where results would be written to: replace it "
                    "by what it leads to"
                )


def kind_of(folder: Path) -> Kind | None:
    """What a folder holds, by its manifest; None if there is none that can be read."""
    manifest = manifest_of(folder)
    configuration = manifest.get("configuration")
    if "tuning" in manifest:
        return "a tuning"
    if not isinstance(configuration, dict):
        return None
    return "evidence" if "families" in configuration else "a comparison"


def manifest_of(folder: Path) -> dict[str, Any]:
    """The manifest of a folder; empty if there is none that can be read."""
    try:
        manifest = read_manifest(folder / MANIFEST)
    except (OSError, ValueError, RecursionError):
        return {}
    return manifest if isinstance(manifest, dict) else {}


def read_manifest(path: Path) -> Any:
    """What a manifest holds; raises OSError, ValueError or RecursionError if it cannot be read."""
    manifest = json.loads(path.read_text(encoding="utf-8"))
    json.dumps(manifest, ensure_ascii=False).encode()  # what is made of it is written, in UTF-8
    return manifest


def _demand_nothing_else(path: Path, kind: Kind) -> None:
    there = kind_of(path)
    if there is not None and there != kind:
        raise ConfigurationError(f"{path} holds {there}, not {kind}: give another folder with --out")
    if there is None and path.is_dir() and any(path.iterdir()) and not (path / LOCK).is_file():
        raise ConfigurationError(
            f"{path} holds something, and no {kind.removeprefix('a ')} that could go on: give a folder that is empty "
            "or new"
        )


#: Runs whose trajectories are kept: none; those that failed or were aborted; of each kind of run the one with the
#: deepest violation, of equal ones the first; those that come first; all.
Keep = Literal["none", "failed", "worst", "first", "all"]

Line = TypeVar("Line", bound=Mapping[str, Any])


def demand_keep(keep: str) -> Keep:
    """The way to keep of this name; raises ConfigurationError if there is none."""
    if keep not in get_args(Keep):
        raise unknown_name("--keep", keep, get_args(Keep))
    return cast("Keep", keep)


def kept_lines(lines: Sequence[Line], keep: Keep, kind: Sequence[str], first: tuple[str, str]) -> list[Line]:
    """Lines of the runs whose trajectories are kept, of those with ``status`` and ``violation_depth``.

    ``kind`` are the columns that runs of one kind have in common; ``first`` are the column within which the lowest
    number counts as first, and that of the numbers.
    """
    if keep == "failed":
        return [line for line in lines if line["status"] in ("failed", "aborted")]
    if keep == "worst":
        worst: dict[tuple[Any, ...], Line] = {}
        violating = [line for line in lines if line["violation_depth"] > 0.0]  # not where it is NaN
        for line in sorted(violating, key=lambda line: line["violation_depth"], reverse=True):
            worst.setdefault(tuple(line[name] for name in kind), line)
        chosen = set(map(id, worst.values()))
        return [line for line in lines if id(line) in chosen]
    if keep == "first":
        group, number = first
        lowest: dict[Any, Any] = {}
        for line in lines:
            lowest[line[group]] = min(lowest.get(line[group], line[number]), line[number])
        return [line for line in lines if line[number] == lowest[line[group]]]
    return list(lines) if keep == "all" else []
