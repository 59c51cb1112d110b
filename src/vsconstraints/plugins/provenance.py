"""What files a result was made from: their content, as it was just before Python read them."""

from __future__ import annotations

import hashlib
import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import source_from_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from .regular_files import demand_regular

#: absolute paths and hashes of what the files hold; the hash is empty where there is no file
Files = dict[str, str]

#: Folders of installed packages: their versions stand for their files, those of own parts apart.
INSTALLED = ("site-packages", "dist-packages")

_PYTHON = (sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib"))
_SYSTEM = ("/proc", "/sys", "/dev", "/run", "/etc")
_FOLDERS = (*_PYTHON, os.path.dirname(os.path.dirname(__file__)), *_SYSTEM)
#: Folders whose files are nobody's own: the standard library, this package, the system's.
LIBRARIES = tuple(os.path.join(os.path.realpath(folder), "") for folder in _FOLDERS)

#: Endings of the files in caches of compiled code, checksums included: the code itself is noted.
COMPILED = (".nbi", ".nbc", ".nbi.sha256", ".nbc.sha256")

_own_packages: set[str] = set()
#: Packages of own parts, and files that they read while they were imported, which happens once in a
#: process.
read_by_imports: Files = {}
#: Files that own parts have read in this process while they ran, as they were when they were read
#: last.
read_by_runs: Files = {}
written_by_runs: set[str] = set()  # what own parts write themselves is not what results depend on

_notes: list[tuple[Files, set[str]]] = []
#: What is being noted, and whether the audit hook is there: one serves the whole process, and none
#: can be removed.
_hooked = False


def digest(path: str | Path) -> str:
    """Hash of what a file holds; empty if there is no such file, it is a pipe or a device, or it
    cannot be read.
    """
    try:
        demand_regular(path)
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:16]
    except (OSError, ValueError):
        return ""


def digests(paths: Iterable[str | Path]) -> Files:
    """Hashes of files by their absolute paths."""
    return {path: digest(path) for path in map(os.path.realpath, paths)}


@contextmanager
def noted() -> Iterator[Files]:
    """Note the files that Python opens for reading meanwhile, each with its hash just before it is
    first opened.

    Source stands for the bytecode kept of it. Not noted are installed packages other than those of
    own parts, files that are written meanwhile or gone at the end, and what is read by other means
    than Python's ``open``.
    """
    global _hooked
    if not _hooked:
        sys.addaudithook(_note)
        _hooked = True
    files: Files = {}
    note = files, set[str]()
    _notes.append(note)
    try:
        yield files
    finally:
        _notes[:] = [another for another in _notes if another is not note]
        for path in [
            path for path, content in files.items() if content and not os.path.exists(path)
        ]:
            del files[path]


def add_to_notes(files: Files) -> None:
    """Add files that another process has read, on behalf of this one, to what is being noted
    here.
    """
    for noted_files, _ in _notes:
        for path, content in files.items():
            noted_files.setdefault(path, content)


@contextmanager
def noted_import(module: str) -> Iterator[None]:
    """Keep for :func:`imported` what is read while an own module is imported, modules that it
    imports included.
    """
    _own_packages.add(module.partition(".")[0])
    before = sys.dont_write_bytecode
    # bytecode is told from its source's size and second only: two edits in a second could be mixed
    # up
    sys.dont_write_bytecode = True
    try:
        with noted() as files:
            yield
    finally:
        sys.dont_write_bytecode = before
        for path, content in files.items():
            read_by_imports.setdefault(path, content)
    # what was there before, for example because the program that asked for the comparison imports
    # it
    for name, loaded in list(sys.modules.items()):
        file = getattr(loaded, "__dict__", {}).get("__file__")
        if isinstance(file, str) and name not in ("__main__", "__mp_main__"):
            path = os.path.realpath(file)
            if path not in read_by_imports and _own(path):
                read_by_imports[path] = digest(path)


def imported() -> Files:
    """What own modules have read while they were imported in this process; each file as it was
    then.
    """
    return dict(read_by_imports)


@contextmanager
def own_parts_noted() -> Iterator[Files]:
    """Note the files that own parts depend on; the table is complete when the block ends.

    These are the files that they read meanwhile, and all that they have read before in this
    process: a part may keep what it has read, and Python keeps the modules that it has imported.
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
    """Audit hook; it must not raise, since that would keep the file from being opened."""
    if event != "open" or not _notes or not isinstance(arguments[0], (str, bytes, os.PathLike)):
        return
    path, mode, flags = arguments
    notes = _notes[:]
    _notes.clear()  # not for what is opened here
    try:
        name = os.path.realpath(os.fsdecode(path))
        if name.endswith(".pyc"):
            name = source_from_cache(name)
        writes = (
            any(letter in mode for letter in "wax+") if mode else flags & (os.O_WRONLY | os.O_RDWR)
        )
        if _own(name) and not name.endswith(COMPILED):
            for files, written in notes:
                if writes:
                    written.add(name)
                    files.pop(name, None)
                elif name not in files and name not in written:
                    files[name] = digest(name)
    except Exception:  # whatever is wrong with the path, it is told by who opens it
        pass
    finally:
        _notes.extend(notes)


def _own(path: str) -> bool:
    for folder, inside in pairwise(path.split(os.sep)):
        if folder in INSTALLED:
            return inside.removesuffix(".py") in _own_packages
    return not path.startswith(LIBRARIES)
