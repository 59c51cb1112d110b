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
    has_own_law = any(":" in entry.law for entry in controllers)
    return has_own_law or any(map(_has_own_constraints, families))


def own_folders(controllers: Entries, families: Sequence[Family]) -> Folders:
    """Return the folders of custom parts by name.

    A folder is named after the first module or family that comes from it. The working directory is
    included.
    """
    candidates: list[tuple[str, Path]] = []
    for entry in controllers:
        if ":" in entry.law:
            module = module_of(entry.law)
            if entry.folder is not None:
                candidates.append((module, entry.folder))
            candidates += [(module, file.parent) for file in entry.files]
    for family in families:
        if _has_own_constraints(family):
            candidates.append((family.name, family.folder))
    candidates.append((WORKING_FOLDER, Path()))
    folders: dict[str, str] = {}
    for name, path in candidates:
        folder = os.path.realpath(path)
        if folder in folders.values():
            continue
        if name in folders:
            name = f"{name} {len(folders) + 1}"
        folders[name] = folder
    return folders


def named(files: Files, folders: Folders) -> Files:
    """Return the files with names that do not depend on the machine: ``FOLDER/PATH``.

    Files in none of the folders keep their absolute paths.
    """
    return {_name_in(folders, path): content for path, content in files.items()}


def _name_in(folders: Folders, path: str) -> str:
    """Return the name of a file in the first folder that contains it, or else its path."""
    for name, folder in folders.items():
        if os.path.commonpath([path, folder]) == folder:
            return f"{name}/{os.path.relpath(path, folder)}"
    return path


def current_hashes(names: Iterable[str], folders: Folders) -> Files:
    """Return hashes of the current content of the named files, of those known on this machine."""
    paths = {name: _path_named(name, folders) for name in names}
    return {name: digest(path) for name, path in paths.items() if path is not None}


def _path_named(name: str, folders: Folders) -> str | None:
    """Return the path of a file named as by :func:`named` or :func:`files_of_laws`.

    It is None if the folder is unknown, and for a missing file with an absolute path, which may be
    a file of another machine. It is empty for a module that cannot be imported here.
    """
    if name.startswith(IMPORT):
        return _source_file(name.removeprefix(IMPORT))
    folder, _, inside = name.partition("/")
    if folder in folders:
        return os.path.join(folders[folder], inside)
    is_of_this_machine = os.path.isabs(name) and os.path.exists(name)
    return name if is_of_this_machine else None


def changed(files: Files, others: Files) -> Iterator[str]:
    """Yield the names of files that have different contents in the two tables."""
    return (name for name, content in files.items() if others.get(name, content) != content)


def require_unchanged_files(files: Files, earlier: Files) -> None:
    """Raise ConfigurationError if the content of a file differs from that of earlier results."""
    for name in changed(files, earlier):
        raise ConfigurationError(
            f"the file {name}, which custom parts have loaded or read, was changed while the "
            "campaign ran, or differs from one worker to another: run the campaign again in "
            "another folder, or with --fresh"
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
    if spec is None:
        return ""
    return spec.origin or ""


def _has_own_constraints(family: Family) -> bool:
    return any(code_named(family.tables))
