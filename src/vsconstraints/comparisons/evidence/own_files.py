"""Files that the own laws and constraints of a campaign have loaded or read, named alike on every
machine.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from ...errors import ConfigurationError
from ...plugins.classes import code_named
from ...plugins.provenance import Files, digest, own_parts_noted
from ...scenarios.families import Family
from ..experiment import Entries

WORKING_FOLDER = "."  #: Stands for the working directory in the names of files.

Folders = Mapping[str, str]  #: Absolute folders by the names that stand for them.


def has_own_parts(controllers: Entries, families: Sequence[Family]) -> bool:
    """Return True if a law, or a part of a family's scenes, does not come with the package."""
    return any(":" in entry.law for entry in controllers) or any(map(_own_constraints, families))


def own_folders(controllers: Entries, families: Sequence[Family]) -> Folders:
    """Folders that own parts come from, named after the first module or family that comes from
    there.
    """
    candidates = []
    for entry in controllers:
        if ":" in entry.law:
            module = entry.law.partition(":")[0]
            candidates += [(module, entry.folder)] if entry.folder is not None else []
            candidates += [(module, file.parent) for file in entry.files]
    candidates += [(family.name, family.folder) for family in families if _own_constraints(family)]
    candidates.append((WORKING_FOLDER, Path()))
    folders: dict[str, str] = {}
    for name, path in candidates:
        folder = os.path.realpath(path)
        if folder not in folders.values():
            folders[name if name not in folders else f"{name} {len(folders) + 1}"] = folder
    return folders


def named(files: Files, folders: Folders) -> Files:
    """The same files by names that do not depend on where the folders are: ``FOLDER/PATH``.

    Files that are in none of the folders keep their absolute paths.
    """
    found = {}
    for path, content in files.items():
        inside = (
            f"{name}/{os.path.relpath(path, folder)}"
            for name, folder in folders.items()
            if os.path.commonpath([path, folder]) == folder
        )
        found[next(inside, path)] = content
    return found


def contents(names: Iterable[str], folders: Folders) -> Files:
    """Hashes of what files of these names hold now, on this machine.

    Left out are those in folders that are not among these, and those outside of all folders that
    are not there: they can be those of another machine.
    """
    now: Files = {}
    for name in names:
        folder, _, inside = name.partition("/")
        if folder in folders:
            now[name] = digest(os.path.join(folders[folder], inside))
        elif os.path.isabs(name) and os.path.exists(name):
            now[name] = digest(name)
    return now


def changed(files: Files, others: Files) -> Iterator[str]:
    """Names of the files that are in both tables with different contents."""
    return (name for name, content in files.items() if others.get(name, content) != content)


def demand_unchanged_files(files: Files, earlier: Files) -> None:
    """Raise ConfigurationError if a file has another content than earlier results were made
    with.
    """
    for name in changed(files, earlier):
        why = "was changed while the campaign ran, or differs from one worker to another"
        what = f"the file {name}, which own parts have loaded or read, {why}"
        raise ConfigurationError(
            f"{what}: run the campaign again in another folder, or with --fresh"
        )


def files_of_laws(controllers: Entries, folders: Folders) -> Files:
    """Files in these folders that own laws load and read when they are made."""
    with own_parts_noted() as files:
        for entry in controllers:
            if ":" in entry.law:
                entry.make()
    return {
        name: content for name, content in named(files, folders).items() if not os.path.isabs(name)
    }


def _own_constraints(family: Family) -> bool:
    return any(code_named(family.tables))
