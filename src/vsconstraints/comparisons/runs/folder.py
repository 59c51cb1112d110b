"""Results folder, which holds one kind of results and is locked by one process at a time.

The module also selects the trajectories that are kept.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, TypeVar, cast, get_args

from ...errors import ConfigurationError, FolderTaken, unknown_name
from ...plugins import portable
from ...plugins.classes import code_named, untrusted
from ...plugins.regular_files import read_regular
from ...scenarios.reading import NOTHING, Table, checked, require_table
from .files import require_unchanged

Kind = Literal["a comparison", "evidence", "a tuning"]

MANIFEST = "manifest.json"  #: Description of the runs; every kind of results has one.
#: File that names the process that has locked the folder. It is never removed, and marks the
#: folder as a results folder.
LOCK = ".vsconstraints-lock"
#: Folders locked by this process, which could not lock the same file a second time.
_locked: set[Path] = set()


@contextmanager
def locked(folder: Path, kind: Kind) -> Iterator[None]:
    """Lock a folder, created if necessary, against other processes that store results in it.

    A process may lock the same folder again. Raises ConfigurationError if the folder cannot be
    created, contains other data, or is locked by another process; in these cases nothing in it is
    changed.
    """
    path = folder.absolute()
    if path in _locked:
        yield
        return
    there = kind_of(path)
    if there is not None and there != kind:
        problem = f"{path} holds {there}, not {kind}"
        raise FolderTaken(f"{problem}: give another folder with --out", problem)
    if there is None and path.is_dir() and any(path.iterdir()) and not (path / LOCK).is_file():
        nothing = f"no {kind.removeprefix('a ')} to continue"
        raise ConfigurationError(
            f"{path} is not empty and holds {nothing}: give a folder that is empty or new"
        )
    try:
        path.mkdir(parents=True, exist_ok=True)
        require_inside(path)
        lock = (path / LOCK).open("a+", encoding="utf-8")
    except ConfigurationError:
        raise
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"results cannot be stored in {folder}: {error}") from error
    with lock:
        try:
            portable.lock(lock, wait=False)
        except BlockingIOError:
            lock.seek(0)
            storing = f"process {lock.read().strip() or 'unknown'} is storing results in {folder}"
            raise ConfigurationError(
                f"{storing}: wait until it ends, or give another folder"
            ) from None
        except OSError:
            pass  # the file system does not support locks
        with suppress(OSError):  # disk full: the message for others then lacks the process id
            lock.truncate(0)
            lock.write(f"{os.getpid()}\n")
            lock.flush()
        _locked.add(path)
        try:
            yield
        finally:
            _locked.discard(path)


def make_folder(folder: Path, contents: str = "results") -> None:
    """Create a folder if it is missing; raises ConfigurationError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"{contents} cannot be written to {folder}: {error}") from error


def require_inside(folder: Path) -> None:
    """Raise ConfigurationError if a link in a folder leads out of it, so that writing would too."""
    whole = os.path.realpath(folder)
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = os.path.join(parent, name)
            if not os.path.islink(path):
                continue
            target = os.path.realpath(path)
            if os.path.commonpath([whole, target]) != whole:
                why = "where results would be written: replace it by its target"
                raise ConfigurationError(f"{path} is a link that leads out of the folder, {why}")


def kind_of(folder: Path) -> Kind | None:
    """Return the kind of results in a folder, from its manifest; None if none can be read."""
    manifest = manifest_of(folder)
    configuration = manifest.get("configuration")
    if "tuning" in manifest:
        return "a tuning"
    if not isinstance(configuration, dict):
        return None
    return "evidence" if "families" in configuration else "a comparison"


def manifest_of(folder: Path) -> dict[str, Any]:
    """Return the manifest of a folder; empty if none can be read."""
    try:
        manifest = read_manifest(folder / MANIFEST)
    except (OSError, ValueError, RecursionError):
        return {}
    return manifest if isinstance(manifest, dict) else {}


def read_manifest(path: Path) -> Any:
    """Read a manifest; raises OSError, ValueError or RecursionError if it cannot be read."""
    manifest = json.loads(read_regular(path).decode())
    json.dumps(manifest, ensure_ascii=False).encode()  # reports write its texts in UTF-8
    return manifest


@dataclass(frozen=True)
class StoredResults:
    """Results in their folder, with their manifest.

    If they are ``trusted``, code that they name as ``module:Class`` may run. ``remarks`` inform the
    reader that checksums are missing, or that code is not run.
    """

    folder: Path
    manifest: Mapping[str, Any]
    trusted: bool = False
    remarks: tuple[str, ...] = ()

    with_code: ClassVar[tuple[str, ...]]  #: Tables of the configuration that may name code.

    @classmethod
    def load(cls, folder: Path, trust: bool = False) -> Self:
        """Read a folder; code that is named in it is imported only if it is trusted.

        Raises ConfigurationError that names the problem if a file is missing, was changed or is
        invalid, or if a link leads out of the folder.
        """
        files = cls._files(folder)
        require_inside(folder)
        remark = require_unchanged(folder, files, "finished" in manifest_of(folder))
        path = folder / MANIFEST
        try:
            manifest = read_manifest(path)
        except (OSError, ValueError, RecursionError) as error:
            raise ConfigurationError(f"{path} cannot be read: {error}") from error
        cls._require_readable(manifest, str(path))
        code = (
            []
            if trust
            else list(code_named([manifest["configuration"][name] for name in cls.with_code]))
        )
        remarks = remark, str(untrusted("some of what is drawn", code)) if code else ""
        stored = cls(folder, dict(manifest), trust, tuple(filter(None, remarks)))
        stored._require_planned()
        return stored

    @classmethod
    def _files(cls, folder: Path) -> Sequence[Path]:
        """List the files whose checksums are verified.

        Raises ConfigurationError if the folder contains no results of this kind.
        """
        raise NotImplementedError

    @classmethod
    def _require_readable(cls, manifest: Mapping[str, Any], where: str) -> None:
        """Raise ConfigurationError if an entry of a manifest is invalid."""
        raise NotImplementedError

    def _require_planned(self) -> None:
        """Raise ConfigurationError unless all lines of all tables belong to the manifest."""
        raise NotImplementedError

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, the unconstrained baseline first."""
        return tuple(self.manifest["configuration"]["controllers"])


def entries(
    value: object, where: str, needed: Mapping[str, Any], others: Mapping[str, Any] = NOTHING
) -> Table:
    """Return the entries of a table that readers need, with checked types.

    ``needed`` and ``others`` map required and optional keys to types. Raises ConfigurationError for
    a missing key or a wrong type.
    """
    table = require_table(value, where)
    for name in needed:
        if name not in table:
            raise ConfigurationError(f"{where}: the key {name!r} is missing")
    kinds = {**needed, **others}
    return {
        name: checked(table[name], kind, where, name)
        for name, kind in kinds.items()
        if name in table
    }


#: Runs whose trajectories are kept. ``worst`` is the run with the deepest violation of each kind of
#: run, if a row was violated.
Keep = Literal["none", "failed", "worst", "first", "all"]

Line = TypeVar("Line", bound=Mapping[str, Any])


def parse_keep(keep: str) -> Keep:
    """Return the selection of this name; raises ConfigurationError if it is unknown."""
    if keep not in get_args(Keep):
        raise unknown_name("--keep", keep, get_args(Keep))
    return cast("Keep", keep)


def kept_lines(
    lines: Sequence[Line], keep: Keep, kind: Sequence[str], first: tuple[str, str]
) -> list[Line]:
    """Select the lines of the runs whose trajectories are kept.

    Lines have the columns ``status`` and ``violation_depth``. ``kind`` are the columns that runs of
    one kind have in common. ``first`` is a pair of columns: a group, and the number that is lowest
    for the first runs of the group.
    """
    if keep == "failed":
        return [line for line in lines if line["status"] in ("failed", "aborted")]
    if keep == "worst":
        outside = [line for line in lines if line["violation_depth"] > 0.0]  # not where it is NaN
        worst: dict[tuple[Any, ...], Line] = {}
        for line in sorted(outside, key=lambda line: -line["violation_depth"]):
            worst.setdefault(tuple(line[name] for name in kind), line)
        return list(worst.values())
    if keep == "first":
        group, number = first
        lowest: dict[Any, float] = {}
        for line in lines:
            lowest[line[group]] = min(line[number], lowest.get(line[group], math.inf))
        return [line for line in lines if line[number] == lowest[line[group]]]
    return list(lines) if keep == "all" else []
