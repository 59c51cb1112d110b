"""Files that custom laws and constraints of a campaign load or read.

Their names are the same on every machine.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from ...comparisons.experiment import Entries
from ...errors import ConfigurationError
from ...plugins.classes import code_named, module_of, spec_of
from ...plugins.provenance import Files, digest, modules_of_imports, own_parts_noted
from ..families import Family

WORKING_FOLDER = "."  #: Name of the working directory in file names.
#: First word of the names of files that are found by importing a module.
IMPORT = "import "

Folders = Mapping[str, str]  #: Absolute paths of folders by name.


def has_own_parts(controllers: Entries, families: Sequence[Family]) -> bool:
    """True if a law, or a constraint of a family, does not come with the package."""
    return any(":" in entry.law for entry in controllers) or any(map(_own_constraints, families))


def own_folders(controllers: Entries, families: Sequence[Family]) -> Folders:
    """Return the folders of custom parts by name.

    A folder is named after the first module or family that comes from it. The working directory is
    included.
    """
    candidates = []
    for entry in controllers:
        if ":" in entry.law:
            module = module_of(entry.law)
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
    """Return the files with names that do not depend on the machine: ``FOLDER/PATH``.

    Files in none of the folders keep their absolute paths.
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
    """Return hashes of the current content of the named files on this machine.

    Names whose folder is unknown are left out. So are missing files with absolute paths: they may
    be files of another machine.
    """
    now: Files = {}
    for name in names:
        folder, _, inside = name.partition("/")
        if name.startswith(IMPORT):
            now[name] = digest(_source_file(name.removeprefix(IMPORT)))
        elif folder in folders:
            now[name] = digest(os.path.join(folders[folder], inside))
        elif os.path.isabs(name) and os.path.exists(name):
            now[name] = digest(name)
    return now


def changed(files: Files, others: Files) -> Iterator[str]:
    """Yield the names of files that have different contents in the two tables."""
    return (name for name, content in files.items() if others.get(name, content) != content)


def require_unchanged_files(files: Files, earlier: Files) -> None:
    """Raise ConfigurationError if the content of a file differs from that of earlier results."""
    for name in changed(files, earlier):
        why = "was changed while the campaign ran, or differs from one worker to another"
        what = f"the file {name}, which custom parts have loaded or read, {why}"
        raise ConfigurationError(
            f"{what}: run the campaign again in another folder, or with --fresh"
        )


def files_of_laws(controllers: Entries, folders: Folders) -> Files:
    """Return files that custom laws load and read when created, with names for any machine.

    These are files in the folders, and modules that the laws import from elsewhere, which are named
    ``import MODULE``. Other files outside the folders are left out.
    """
    laws = [entry for entry in controllers if ":" in entry.law]
    with own_parts_noted() as files:
        for entry in laws:
            entry.make()
    modules = modules_of_imports()
    found: Files = {}
    for name, content in named(files, folders).items():
        if not os.path.isabs(name):
            found[name] = content
        elif name in modules:
            found[IMPORT + modules[name]] = content
    return found


def _source_file(module: str) -> str:
    """Return the file that is imported as this module here, or an empty text if there is none."""
    spec = spec_of(module)
    return spec.origin or "" if spec else ""


def _own_constraints(family: Family) -> bool:
    return any(code_named(family.tables))
