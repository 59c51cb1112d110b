"""Files that a result depends on: hashes of their content just before Python read them."""

from __future__ import annotations

import ast
import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import resolve_name, source_from_cache
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

from .regular_files import require_regular

#: Hashes of files' contents by absolute path; the hash is empty if the file does not exist.
Files = dict[str, str]

#: Folders of installed packages. Their versions identify their files, except for packages of
#: custom parts.
INSTALLED = ("site-packages", "dist-packages")

_PYTHON = (sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib"))
_SYSTEM = ("/proc", "/sys", "/dev", "/run", "/etc")
_FOLDERS = (*_PYTHON, os.path.dirname(os.path.dirname(__file__)), *_SYSTEM)
#: Folders without custom files: the standard library, this package, and the system's.
LIBRARIES = tuple(os.path.join(os.path.realpath(folder), "") for folder in _FOLDERS)

#: Suffixes of files of compiled code and their checksums, whose source is noted itself.
COMPILED = (".nbi", ".nbc", ".nbi.sha256", ".nbc.sha256")

#: Modules and packages of custom parts.
_own_modules: set[str] = set()
_own_packages: set[str] = set()
#: Files read during the import of custom parts, which happens once per process.
read_by_imports: Files = {}
#: Files that were opened during these imports, without those of modules imported earlier.
opened_by_imports: set[str] = set()
#: Files that running custom parts have read in this process, as they were at the last reading.
read_by_runs: Files = {}
written_by_runs: set[str] = set()  # results do not depend on files that custom parts write

#: Active notes: files with their hashes, and paths of files that were written.
_notes: list[tuple[Files, set[str]]] = []
#: True once the audit hook is installed. One hook serves the whole process, and hooks cannot be
#: removed.
_hooked = False


def digest(path: str | Path) -> str:
    """Return the hash of a file's content.

    It is empty if the file does not exist, is a pipe or a device, or cannot be read.
    """
    try:
        require_regular(path)
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:16]
    except (OSError, ValueError):
        return ""


def digests(paths: Iterable[str | Path]) -> Files:
    """Return hashes of files by their absolute paths."""
    return {path: digest(path) for path in map(os.path.realpath, paths)}


@contextmanager
def noted() -> Iterator[Files]:
    """Note the files that Python opens for reading in the block.

    Each is noted with its hash just before it is first opened. For cached bytecode, the source file
    is noted. Not noted are installed packages other than those of custom parts, files that are
    written in the block or missing at its end, and files that are not read with Python's ``open``.
    """
    global _hooked
    if not _hooked:
        sys.addaudithook(_note)
        _hooked = True
    files: Files = {}
    written = set[str]()
    note = files, written
    _notes.append(note)
    try:
        yield files
    finally:
        _notes[:] = [another for another in _notes if another is not note]
        for path, content in list(files.items()):
            if content and not os.path.exists(path):
                del files[path]


def add_to_notes(files: Files) -> None:
    """Add files that another process has read on behalf of this one to the active notes."""
    for noted_files, _ in _notes:
        for path, content in files.items():
            noted_files.setdefault(path, content)


@contextmanager
def noted_import(module: str) -> Iterator[None]:
    """Note files that are read while a custom module is imported, for :func:`imported`.

    Modules that it imports are included.
    """
    _own_packages.add(module.partition(".")[0])
    _own_modules.add(module)
    before = sys.dont_write_bytecode
    # bytecode is matched to its source by size and second only: two edits within a second could be
    # confused
    sys.dont_write_bytecode = True
    try:
        with noted() as files:
            yield
    finally:
        sys.dont_write_bytecode = before
        for path, content in files.items():
            read_by_imports.setdefault(path, content)
        opened_by_imports.update(files)
    # modules imported earlier, for example by the program that started the comparison
    for path in _loaded().values():
        if path not in read_by_imports and _is_custom(path):
            read_by_imports[path] = digest(path)


def imported() -> Files:
    """Return the files that custom modules read during their import in this process.

    Each file has the hash that it had then.
    """
    return dict(read_by_imports)


def modules_of_imports() -> dict[str, str]:
    """Return custom modules and those that they have imported in this process, by source file.

    Included are those that the program had imported before, as far as import statements or global
    names of the custom modules show them. Libraries, and what they import, are left out.
    """
    file_of = _loaded()
    waiting = [
        name for name, file in file_of.items() if file in opened_by_imports or name in _own_modules
    ]
    reached = set(waiting)
    module_of: dict[str, str] = {}
    while waiting:
        name = waiting.pop(0)
        file = file_of[name]
        if not _is_custom(file):
            continue
        module_of[file] = name
        for other in sorted(_imported_by(sys.modules[name])):
            if other in file_of and other not in reached:
                reached.add(other)
                waiting.append(other)
    return module_of


def _loaded() -> dict[str, str]:
    """Return the source files of the modules that this process has imported, by module."""
    file_of = {}
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__dict__", {}).get("__file__")
        if isinstance(file, str) and name not in ("__main__", "__mp_main__"):
            file_of[name] = _resolved(file)
    return file_of


@cache
def _resolved(file: str) -> str:
    """Return the path of a module's file without symbolic links, found once for each file."""
    return os.path.realpath(file)


def _imported_by(module: ModuleType) -> set[str]:
    """Return the names of modules that a module imports, also inside functions, and of packages."""
    named = {value.__name__ for value in vars(module).values() if isinstance(value, ModuleType)}
    try:
        tree = ast.parse(Path(str(module.__file__)).read_bytes())
    except (OSError, SyntaxError, ValueError):  # a compiled module, or a file that was removed
        tree = ast.Module([], [])
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            relative = "." * node.level + (node.module or "")
            try:
                base = resolve_name(relative, module.__package__ or "")
            except ImportError:  # outside a package this import fails, and may be expected to
                continue
            named |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
    parts = [name.split(".") for name in named]
    return {".".join(part[:end]) for part in parts for end in range(1, len(part) + 1)}


@contextmanager
def own_parts_noted() -> Iterator[Files]:
    """Note the files that custom parts depend on; the table is complete when the block ends.

    These are the files read in the block, and all files that custom parts have read before in this
    process: a part may keep data that it has read, and Python keeps imported modules.
    """
    files: Files = {}
    with noted() as read:
        written = _notes[-1][1]
        yield files
    written_by_runs.update(written)
    read_by_runs.update(read)
    known = {**read_by_runs, **imported()}
    files.update({path: content for path, content in known.items() if path not in written_by_runs})


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    """Audit hook, which must not raise: an error would prevent the file from being opened."""
    if event != "open" or not _notes or not isinstance(arguments[0], (str, bytes, os.PathLike)):
        return
    path, mode, flags = arguments
    notes = _notes[:]
    _notes.clear()  # files opened below are not noted
    try:
        name = os.path.realpath(os.fsdecode(path))
        if name.endswith(".pyc"):
            name = source_from_cache(name)
        writes = (
            any(letter in mode for letter in "wax+") if mode else flags & (os.O_WRONLY | os.O_RDWR)
        )
        if _is_custom(name) and not name.endswith(COMPILED):
            for files, written in notes:
                if writes:
                    written.add(name)
                    files.pop(name, None)
                elif name not in files and name not in written:
                    files[name] = digest(name)
    except Exception:  # an invalid path is reported by the code that opens it
        pass
    finally:
        _notes.extend(notes)


def _is_custom(path: str) -> bool:
    """True for a file of no library: in none of :data:`LIBRARIES`, nor of an installed package.

    Packages of custom parts are no libraries, even if they are installed.
    """
    for folder, inside in pairwise(path.split(os.sep)):
        if folder in INSTALLED:
            return inside.removesuffix(".py") in _own_packages
    return not path.startswith(LIBRARIES)
