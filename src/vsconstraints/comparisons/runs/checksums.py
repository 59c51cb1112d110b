"""SHA-256 of every file that results consist of, beside them, as ``sha256sum`` writes them and checks them."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ...errors import ConfigurationError
from .files import replaced

SUMS = "checksums.sha256"
"""Lines are added as files come, and written anew, the manifest's among them, when the command that makes them ends."""

LINE = re.compile(r"([0-9a-f]{64})  (.+)")

Sums = dict[str, str]
"""SHA-256 of files, by their names as seen from the folder."""

TRAJECTORIES = "trajectories"
"""Folder of what runs left, below that of the results."""

MOST_NAMED = 3
"""Files that a message names."""


def digests(folder: Path, paths: Iterable[Path]) -> Sums:
    """The hashes of files in a folder; those that are not there are left out."""
    found = {}
    for path in paths:
        if path.is_file():
            with path.open("rb") as file:
                found[path.relative_to(folder).as_posix()] = hashlib.file_digest(file, "sha256").hexdigest()
    return found


def recorded(folder: Path) -> Sums | None:
    """What is recorded in a folder; None if nothing is, as in those of older versions.

    A last line that was not written whole is left out: the process was ended meanwhile.

    Raises
    ------
    ConfigurationError
        if another line is none, or the file cannot be read.
    """
    path = folder / SUMS
    try:
        lines = path.read_bytes().decode().split("\n")
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    found = {}
    for number, line in enumerate(lines[:-1], start=1):
        if (parts := LINE.fullmatch(line)) is None:
            raise ConfigurationError(f"{path} was changed: line {number} is no checksum")
        found[parts[2]] = parts[1]
    return found


def write_sums(folder: Path, sums: Mapping[str, str]) -> None:
    """Replace what is recorded; raises OSError."""
    with replaced(folder / SUMS) as part:
        part.write_text(_text(sums), encoding="utf-8")


def add_sums(folder: Path, paths: Iterable[Path]) -> None:
    """Record files that have just been written, in one line each; raises OSError."""
    text = _text(digests(folder, paths))
    # in one piece: a process that is ended leaves all of it, or none
    with (folder / SUMS).open("ab", buffering=0) as file:
        file.write(text.encode())


def seal(folder: Path, paths: Iterable[Path]) -> None:
    """Record these files and no other, which are all that will not be written again; raises OSError.

    Those that are recorded are not read once more.
    """
    known, every = recorded(folder) or {}, list(paths)
    fresh = digests(folder, (path for path in every if path.relative_to(folder).as_posix() not in known))
    names = (path.relative_to(folder).as_posix() for path in every if path.is_file())
    write_sums(folder, {name: known.get(name) or fresh[name] for name in names})


def remove_changed(folder: Path, paths: Iterable[Path]) -> None:
    """Remove files that are not as they were stored, which a command is to make again; raises OSError.

    Where nothing is recorded, all are taken as they are.
    """
    if (sums := recorded(folder)) is not None:
        for name, digest in digests(folder, paths).items():
            if sums.get(name) != digest:
                (folder / name).unlink()


def _text(sums: Mapping[str, str]) -> str:
    return "".join(f"{digest}  {name}\n" for name, digest in sums.items())


@dataclass(frozen=True)
class Difference:
    """Files that are not as they were stored, by their names.

    Attributes
    ----------
    changed, missing, unknown
        Whose hash is another one; recorded but not there; there but not recorded.
    """

    changed: tuple[str, ...]
    missing: tuple[str, ...]
    unknown: tuple[str, ...]

    @classmethod
    def of(cls, folder: Path, sums: Mapping[str, str], paths: Iterable[Path]) -> Difference:
        """What these files of a folder are, against what is recorded of all of them."""
        found = digests(folder, paths)
        return cls(
            tuple(name for name, digest in found.items() if sums.get(name, digest) != digest),
            tuple(name for name in sums if name not in found and not (folder / name).is_file()),
            tuple(name for name in found if name not in sums),
        )

    def problems(self) -> list[str]:
        """A sentence for each kind, with the first few files."""
        kinds = {
            "not what was stored (checksums differ)": self.changed,
            "missing": self.missing,
            f"not in {SUMS} (put there later, or by a command that was ended)": self.unknown,
        }
        return [f"{what}: {_named(names)}" for what, names in kinds.items() if names]


def demand_unchanged(folder: Path, paths: Iterable[Path], finished: bool, all_there: bool = False) -> str:
    """What a reader should know of a folder's checksums; nothing where every file is as it was stored.

    Parameters
    ----------
    folder
        Of the results.
    paths
        The files that they consist of.
    finished
        Whether the command that makes them has ended; before that, those that it still writes are not recorded.
    all_there
        Whether no trajectory may be missing; reports name those that are.

    Raises
    ------
    ConfigurationError
        if one was changed, put there later, or is missing.
    """
    sums = recorded(folder)
    if sums is None:
        return f"{folder} carries no checksums: it cannot be told whether a file in it was changed"
    found = Difference.of(folder, sums, paths)
    needed = tuple(name for name in found.missing if all_there or not name.startswith(f"{TRAJECTORIES}/"))
    refused = replace(found, missing=needed, unknown=found.unknown if finished else ())
    if problems := refused.problems():
        raise ConfigurationError(
            f"{folder} is not whole: {'; '.join(problems)}. Put back what was stored, or "
            "give the command again that made it"
        )
    if found.unknown and not finished:
        return f"{folder} is not finished, without checksums yet: {_named(found.unknown)}"
    return ""


def _named(names: tuple[str, ...]) -> str:
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def demand_inside(folder: Path) -> None:
    """Raise ConfigurationError if a link in a folder leads out of it: what is written to it would go elsewhere."""
    whole = os.path.realpath(folder)
    for at, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = os.path.join(at, name)
            if os.path.islink(path) and os.path.commonpath([whole, os.path.realpath(path)]) != whole:
                raise ConfigurationError(
                    f"{path} is a link that leads out of the folder, where results would be written to: replace it "
                    "by what it leads to"
                )
