"""How functions of this package are compiled, and where the result is kept."""

from __future__ import annotations

import fcntl
import gc
import hashlib
import inspect
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..formulas import FORMULAS
from . import VARIABLE
from .embedded import Part

numba = import_module("numba")  # not typed

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS = {"error_model": "numpy", "fastmath": False}
"""Division by zero gives an infinity, as in NumPy; sums are never reordered, so that results repeat bit by bit."""


ALONE = "alone"
"""Value of the environment variable with which a process compiles everything it needs by itself."""

KEPT, KEPT_PARTS, HASH = 8, 64, 16
"""States of a module's code that are kept compiled, those used last, without formulas of their own and with them, and
the length of their names' ends."""

IN_PLACE = {**OPTIONS, "_nrt": False}
"""For functions that make no arrays: counting references to every view of one takes as long as computing."""


def part_of_others(function: F, options: dict[str, Any] = OPTIONS) -> F:
    """Let compiled functions call this one, which stays as it is in Python."""
    known: F = numba.extending.register_jitable(**options, no_cfunc_wrapper=True, pipeline_class=Part)(function)
    return known


FRAME = 2**17
"""Words of the frame behind which numba runs."""

INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": Part}
"""For functions that only compiled ones call."""

_known: set[Callable[..., Any]] = set()
"""Formulas that compiled code can call."""


@numba.extending.overload(np.where)  # type: ignore[untyped-decorator]
def _where(condition: Any, x: Any, y: Any) -> Any:
    """``np.where`` of single numbers makes no arrays."""

    def choose(condition: Any, x: Any, y: Any) -> Any:
        return x if condition else y

    numbers = numba.types.Boolean, numba.types.Number
    return choose if all(isinstance(each, numbers) for each in (condition, x, y)) else None


def know(*formulas: Callable[..., Any]) -> None:
    """Let compiled code call these functions and every marked formula: see :mod:`vsconstraints.formulas`."""
    for function in (*FORMULAS, *formulas):
        if function not in _known:
            _known.add(function)
            part_of_others(function, {"error_model": "numpy"})


def inner(function: F) -> F:
    """Compile for use by other compiled functions only."""
    compiled_function: F = numba.njit(**OPTIONS, **INNER)(function)
    return compiled_function


def in_place(function: F) -> F:
    """As :func:`inner`, for what makes no arrays."""
    compiled_function: F = numba.njit(**IN_PLACE, **INNER)(function)
    return compiled_function


def compiled(
    signature: Any,
    options: dict[str, Any] = OPTIONS,
    formulas: Sequence[Callable[..., Any]] = (),
    from_python: bool = True,
) -> Callable[[F], F]:
    """Compile for this signature, and keep the result on disk; ``options`` are :data:`OPTIONS` or :data:`IN_PLACE`.

    The function may call ``formulas`` beside the marked ones. Arguments of other types raise TypeError. What is only
    called by its address, not ``from_python``, compiles faster: whole structures take long to be taken apart.
    """

    def decorate(function: F) -> F:
        know(*formulas)
        before = numba.config.CACHE_DIR
        with _writable(cache_of(function, formulas)) as folder:
            numba.config.CACHE_DIR = str(folder)
            try:
                jit = numba.njit(
                    signature, cache=True, no_cfunc_wrapper=True, no_cpython_wrapper=not from_python, **options
                )
                with alone(folder):
                    try:
                        result: F = _compile_or_read(jit, function)
                    except Exception:  # a file that was cut short, for example on a full disk, can raise anything
                        kept = list(folder.rglob(f"*.{function.__name__}-*.nb[ci]"))
                        if not kept:
                            raise
                        for file in kept:
                            file.unlink()
                        result = _compile_or_read(jit, function)
            finally:
                numba.config.CACHE_DIR = before
        return result

    return decorate


def _compile_or_read(jit: Any, function: F) -> F:
    """Let numba compile or read a function without what else takes a tenth of its time, and with bad luck a quarter.

    Garbage is not looked for: there is hardly any before the end. And CPython keeps frames in pieces of 16 kB: where
    calls cross the end of one over and over, memory is mapped and unmapped each time. Behind a large frame, which this
    function has, there is room for all.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        result: F = jit(function)
    finally:
        if collects:
            gc.enable()
    return result


_compile_or_read.__code__ = _compile_or_read.__code__.replace(co_stacksize=FRAME)


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """One process at a time: of workers that need the same function, one compiles it and the others read it."""
    with ExitStack() as stack:
        # where files cannot be locked each compiles for itself
        with suppress(OSError):
            fcntl.flock(stack.enter_context((folder / "lock").open("w")), fcntl.LOCK_EX)
        yield


def cache_folder(function: Callable[..., Any], formulas: Sequence[Callable[..., Any]] = ()) -> Path:
    """Where a compiled function is kept: one folder for each state of its code, the compiler, Python and the processor.

    Numba alone would compare the file of a function, and not see that one it calls has changed. The folder is made
    within ``NUMBA_CACHE_DIR`` if that is set, or else beside the code, or in the user's cache where that cannot be
    written. One that cannot be written but holds the function is as good.

    Raises
    ------
    OSError
        if none of these can be written.
    """
    state = hashlib.sha256()
    for file in sources():
        state.update(file.read_bytes())
    for formula in formulas:
        # the module of an own one may hold whatever it calls
        source = inspect.getsourcefile(formula)
        with suppress(OSError):
            state.update(Path(source or "").read_bytes())
        state.update(formula.__code__.co_code + repr(formula.__code__.co_consts).encode())
    processor = import_module("llvmlite.binding").get_host_cpu_name()
    state.update(f"{numba.__version__} {sys.version} {processor}".encode())
    made_for = "".join(f".{formula.__name__}" for formula in formulas)
    name = f"{function.__module__.rpartition('.')[2]}{made_for}-{state.hexdigest()[:HASH]}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    caches = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    candidates = [Path(chosen)] if chosen else [Path(__file__).parent / "__pycache__", caches / "vsconstraints"]
    for folder in candidates:
        with suppress(OSError):
            (folder / name).mkdir(parents=True, exist_ok=True)
        if os.access(folder / name, os.W_OK | os.X_OK):
            return folder / name
        if next((folder / name).rglob(f"*.{function.__name__}-*.nbi"), None) is not None:
            return folder / name
    raise OSError(f"no folder to keep compiled code in: cannot write {' or '.join(map(str, candidates))}")


@contextmanager
def _writable(folder: Path) -> Iterator[Path]:
    """The folder or, if it cannot be written, a copy of what it holds: numba insists on writing, even to read."""
    if os.access(folder, os.W_OK | os.X_OK):
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="vsconstraints-") as copy:
        for file in folder.rglob("*.nb[ci]"):
            target = copy / file.relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        yield Path(copy)


def sources() -> list[Path]:
    """Every file that compiled code may be made of; constants are compiled in, and leave no trace of their origin."""
    package = Path(__file__).parent.parent
    others = (
        "vision/distortion.py",
        "qp/least_residual.py",
        "qp/least_violation.py",
        "qp/lexicographic.py",
        "vision/pose_estimate.py",
        "rows/checks.py",
        "vision/scene.py",
    )
    folders = (package / "compiled", package / "formulas")
    return [
        *(file for folder in folders for file in sorted(folder.glob("*.py"))),
        *(package / other for other in others),
    ]


_announced = False
"""Whether this process has said that it compiles."""

_helpers: list[subprocess.Popen[bytes]] = []
"""Kept, since the end of a process that nobody holds is complained about."""


def cache_of(function: Callable[..., Any], formulas: Sequence[Callable[..., Any]]) -> Path:
    """The cache folder; says so, once, if it is empty, since filling it takes a while, and removes old ones."""
    global _announced
    folder = cache_folder(function, formulas)
    with suppress(OSError):
        os.utime(folder)
        states = folder.parent.glob(f"{folder.name.rpartition('-')[0]}-{'?' * HASH}")
        for old in sorted(states, key=lambda state: -state.stat().st_mtime)[KEPT_PARTS if formulas else KEPT :]:
            shutil.rmtree(old, ignore_errors=True)
    if not _announced and next(folder.rglob(f"*{function.__name__}*.nbi"), None) is None:
        _announced = True
        print(f"vsconstraints: compiling the control step, once; kept in {folder.parent}", file=sys.stderr, flush=True)
        _share(function.__module__.rpartition(".")[2])
    return folder


def _share(module: str) -> None:
    """Let another process compile the other modules in the meantime, so that they are there when they are needed.

    Locks keep the two from compiling the same; nothing waits for that process, which ends with this one, and nothing
    is lost if it fails.
    """
    if os.environ.get(VARIABLE) == ALONE or not sys.executable or (os.cpu_count() or 1) < 2:
        return
    package = __name__.rpartition(".")[0]
    code = (
        f"from {package.rpartition('.')[0]}.plugins.processes import end_with\nend_with({os.getpid()})\n"
        f"from {package} import MODULES, load\n"
        f"for name in reversed(MODULES):\n    if name != {module!r}:\n        load(name)"
    )
    nowhere = subprocess.DEVNULL
    path = os.pathsep.join(filter(None, sys.path))
    with suppress(OSError):
        _helpers.append(
            subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=nowhere,
                stdout=nowhere,
                stderr=nowhere,
                env={**os.environ, VARIABLE: ALONE, "PYTHONPATH": path},
            )
        )
