"""Disk cache of compiled functions.

Numba stores the code of a function in files with its name: in ``NUMBA_CACHE_DIR`` if that is set,
otherwise beside the source or in the user's cache. It would notice changes of the function itself
only, and miss those of the functions that it calls. Therefore the names contain the state of all
code that a function may contain.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from ..plugins import portable
from .checksums import sum_file

Formulas = Sequence[Callable[..., Any]]

#: States of the code of which a function's compiled files are kept, the most recently used ones:
#: their number for a function without formulas of its own, and for one with them.
KEPT = 8
KEPT_WITH_FORMULAS = 64
HASH = 16  #: Length of the hash in the names of functions.
#: Files outside the folders ``compiled``, ``kernels`` and ``formulas`` that define constants of
#: compiled code, which contains no reference to them.
OTHERS = ("vision/distortion.py", "vision/scene.py", "rows/checks.py", "rows/tolerances.py")


def sources() -> list[Path]:
    """List every file that compiled code may be made of."""
    package = Path(__file__).parent.parent
    folders = (package / "compiled", *sorted(package.glob("*/kernels")), package / "formulas")
    files = (file for folder in folders for file in sorted(folder.glob("*.py")))
    return [*files, *(package / other for other in OTHERS)]


@cache
def _package_state(settings: str) -> bytes:
    """Hash of this package's code, the settings of the compiler, and the processor."""
    processor = import_module("llvmlite.binding").get_host_cpu_name()
    texts = b"".join(file.read_bytes() for file in sources())
    return hashlib.sha256(texts + f"{settings} {processor}".encode()).digest()


def _code_identity(code: CodeType) -> bytes:
    """Return bytes that identify the behaviour of a function and are equal in every process.

    The ``repr`` of its constants would differ: it contains the addresses of inner functions, and
    sets of strings in any order.
    """
    constants = []
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            constants.append(_code_identity(constant))
        elif isinstance(constant, frozenset):
            constants.append(repr(sorted(map(repr, constant))).encode())
        else:
            constants.append(repr(constant).encode())
    return b"\0".join([code.co_code, *constants])


def identify(value: Any) -> bytes:
    """Return bytes that differ if a value differs or, for a function, its code or its closure."""
    if isinstance(value, FunctionType):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        parts = [identify(part) for part in (*cells, *(value.__defaults__ or ()))]
        return b"\0".join([_code_identity(value.__code__), *parts])
    if isinstance(value, np.ndarray):
        return repr((value.dtype, value.shape)).encode() + value.tobytes()
    return repr(value).encode()


def state_of(settings: str, formulas: Formulas = ()) -> str:
    """Return the hash of all code that a function with these formulas may contain.

    ``settings`` describe the compiler.
    """
    state = hashlib.sha256(_package_state(settings))
    for formula in formulas:
        # the module of a custom formula may contain the functions that it calls
        with suppress(OSError):
            state.update(Path(inspect.getsourcefile(formula) or "").read_bytes())
        state.update(identify(formula))
    return state.hexdigest()[:HASH]


def _compiled_files(folder: Path, beginning: str) -> list[Path]:
    """List the compiled files in a folder whose names begin in this way."""
    with suppress(OSError):
        return [
            folder / name
            for name in os.listdir(folder)
            if name.startswith(beginning) and name.endswith((".nbi", ".nbc"))
        ]
    return []


def any_compiled(folder: Path, state: str) -> bool:
    """True if any function without formulas is compiled in this state of the code.

    Numba writes to a folder for each folder of sources: a ``__pycache__`` in it, or a folder in
    ``NUMBA_CACHE_DIR``.
    """
    name = f"*_{state}-*.nbi"
    if folder.name == "__pycache__":
        found = Path(__file__).parents[1].glob(f"**/__pycache__/{name}")
    else:
        found = folder.parent.glob(f"*/{name}")
    return any(found)


class CachedFunction:
    """Files of a function in a state of the code; ``folder`` is the one that numba writes to.

    Numba names them after the ``__qualname__`` of the function, which is changed.

    Raises
    ------
    OSError
        if no folder can be written, and the function is not in one that can be read.
    """

    def __init__(self, function: Callable[..., Any], state: str, folder: Path | None) -> None:
        module = Path(inspect.getfile(function)).stem
        self._function = f"{module}.{function.__name__}_"
        self._beginning = f"{self._function}{state}-"
        chosen = os.environ.get("NUMBA_CACHE_DIR")
        source = Path(chosen or Path(inspect.getfile(function)).parent / "__pycache__")
        if folder is None or not folder.is_relative_to(source):
            folder = self._copy_from(source, folder, bool(chosen))
        self.folder = folder
        function.__qualname__ = f"{function.__name__}_{state}"

    def _copy_from(self, source: Path, folder: Path | None, chosen: bool) -> Path:
        """Copy the files from a folder that cannot be written: numba would not read it."""
        filled = [
            file
            for place in (source, *source.glob("*"))
            if place.is_dir()
            for file in _compiled_files(place, self._beginning)
        ]
        if folder is None or (chosen and not filled):
            raise OSError(
                f"no folder to keep compiled code in: cannot write {source}; NUMBA_CACHE_DIR names "
                f"another one"
            )
        if not _compiled_files(folder, self._beginning):
            for file in (*filled, *map(sum_file, filled)):
                shutil.copy2(file, folder)
                (folder / file.name).chmod(0o644)
        return folder

    @property
    def files(self) -> list[Path]:
        """Files with the compiled code."""
        return _compiled_files(self.folder, self._beginning)

    def note_use(self) -> None:
        """Note that the files are used now, for :meth:`remove_old`."""
        with suppress(OSError):
            for file in self.files:
                os.utime(sum_file(file))

    def _state_of(self, file: Path) -> str:
        """Return the state of the code that a compiled file of the function belongs to."""
        return file.name.removeprefix(self._function)[:HASH]

    def remove_old(self, kept: int) -> None:
        """Remove the files of all states of the function but the most recently used ones."""
        used: dict[str, float] = {}
        files = _compiled_files(self.folder, self._function)
        for file in files:
            with suppress(OSError):
                state = self._state_of(file)
                time = sum_file(file).stat().st_mtime
                used[state] = max(used.get(state, 0.0), time)
        newest_first = sorted(used, key=lambda state: -used[state])
        old = newest_first[kept:]
        for file in files:
            if self._state_of(file) in old:
                file.unlink(missing_ok=True)
                sum_file(file).unlink(missing_ok=True)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Let one process compile the function and the others read it."""
        with ExitStack() as stack:
            # without file locks, each process compiles for itself
            with suppress(OSError):
                file = stack.enter_context((self.folder / f"{self._function}.lock").open("w"))
                portable.lock(file, wait=True)
            yield
