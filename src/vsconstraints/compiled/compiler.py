"""Compilation of this package's functions, their fallback to Python, and the disk cache."""

from __future__ import annotations

import gc
import hashlib
import inspect
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, wraps
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, TypeVar, cast

import numpy as np

from ..formulas import FORMULAS
from ..plugins import portable
from . import COMPLAINT, MODULES, VARIABLE
from .checksums import remove_damaged, seal
from .signatures import Signature, flatten

F = TypeVar("F", bound=Callable[..., Any])
Formulas = Sequence[Callable[..., Any]]

#: Value of the environment variable with which a process compiles everything without a helper.
SINGLE_PROCESS = "alone"
#: Number of states of a module's code whose compiled files are kept, most recently used first: of
#: functions without formulas of their own, and with them. Length of the hash in folder names.
KEPT = 8
KEPT_PARTS = 64
HASH = 16
_warned: list[Exception] = []  #: Reason why nothing is compiled, once a warning has given it.


def _warn(error: Exception) -> None:
    if not _warned:
        _warned.append(error)
        warnings.warn(
            f"{COMPLAINT}, which is slower: {type(error).__name__}: {error} (set {VARIABLE}=0 to "
            f"say nothing)",
            RuntimeWarning,
            stacklevel=5,
        )


def _interface() -> Any:
    """Return :mod:`.numba_interface`, or None if functions stay in Python.

    They stay in Python if the environment requires it, or if numba is missing or broken.
    """
    if os.environ.get(VARIABLE, "").strip() == "0":
        return None
    try:
        return import_module(f"{__package__}.numba_interface")
    except Exception as error:  # whatever the failure of the compiler, Python can run the functions
        _warn(error)
        return None


interface = _interface()
numba: Any = interface and interface.numba
#: Division by zero gives an infinity, as in NumPy. Sums are never reordered, so that results are
#: reproducible bit by bit.
OPTIONS = {"error_model": "numpy", "fastmath": False}
#: For functions that make no arrays.
IN_PLACE = {**OPTIONS, **(interface.accelerator.IN_PLACE if interface else {})}


def compiles() -> bool:
    """True if functions are compiled.

    Otherwise they run in Python, about 200 times slower, with the same results.
    """
    return interface is not None


_registered: set[Callable[..., Any]] = set()  #: Formulas that compiled code can call.


def register_formulas(*formulas: Callable[..., Any]) -> None:
    """Let compiled code call these functions and every marked formula.

    See :mod:`vsconstraints.formulas`.
    """
    for function in (*FORMULAS, *formulas):
        if function not in _registered and interface is not None:
            _registered.add(function)
            interface.part_of_others(function, {"error_model": "numpy"})


def inner(function: F, options: dict[str, Any] = OPTIONS) -> F:
    """Let compiled functions call this one, which stays unchanged in Python."""
    if interface is not None:
        interface.part_of_others(function, options)
    return function


def in_place(function: F) -> F:
    """Let compiled functions call this one, which makes no arrays; see :func:`inner`."""
    return inner(function, IN_PLACE)


def compiled(
    signature: Signature,
    options: dict[str, Any] = OPTIONS,
    formulas: Formulas = (),
    from_python: bool = True,
) -> Callable[[F], F]:
    """Make a decorator that compiles for this signature and caches the result on disk.

    ``options`` are :data:`OPTIONS` or :data:`IN_PLACE`. The function may call ``formulas`` besides
    the marked ones. Arguments of other types raise TypeError. Python does not call a function with
    ``from_python=False``: compiled code calls it by its address.

    If nothing is compiled, the function runs in Python. If the compiler fails for a function with
    ``formulas``, its error is raised. If it fails for another function, a RuntimeWarning gives the
    reason, and nothing more is compiled in this process.
    """

    def decorate(function: F) -> F:
        global interface
        if interface is None:
            return in_python(function, signature if from_python else None)
        register_formulas(*formulas)
        try:
            return _compiled(function, interface.jit(signature, from_python, options), formulas)
        except Exception as error:
            if formulas:
                raise
            interface = None
            _warn(error)
            return in_python(function, signature if from_python else None)

    return decorate


def in_python(function: F, signature: Signature | None = None) -> F:
    """Return the function as Python runs it, without floating-point warnings.

    If a signature is given, arrays and numbers of other types raise TypeError.
    """
    declared = flatten(signature.arguments) if signature is not None else []

    @wraps(function)
    def quiet(*arguments: Any) -> Any:
        for kind, argument in zip(declared, flatten(arguments), strict=False):
            if not kind.accepts(argument):
                raise TypeError(f"{function.__name__} does not take {argument!r}")
        with np.errstate(all="ignore"):
            return function(*arguments)

    return cast("F", quiet)


def _compiled(function: F, jit: Any, formulas: Formulas) -> F:
    config = numba.config
    before = config.CACHE_DIR, config.LOOP_VECTORIZE
    with _writable(cache_of(function, formulas)) as folder:
        # loops run over a few joints or rows: vectorisation makes no step faster, but compilation
        # 10 % slower
        config.CACHE_DIR = str(folder)
        config.LOOP_VECTORIZE = 0
        try:
            with compile_lock(folder):
                pattern = f"*.{function.__name__}-*.nb[ci]"
                remove_damaged([*folder.rglob(pattern)])
                result = _compile_or_read(jit, function)
                seal([*folder.rglob(pattern)])
                return result
        finally:
            config.CACHE_DIR, config.LOOP_VECTORIZE = before


def _compile_or_read(jit: Any, function: F) -> F:
    """Let numba compile or read a function without garbage collection.

    Hardly any garbage arises before the end.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        result: F = jit(function)
    finally:
        if collects:
            gc.enable()
    return result


@contextmanager
def compile_lock(folder: Path) -> Iterator[None]:
    """Lock a cache folder, so that one process compiles a function and the others read it."""
    with ExitStack() as stack:
        # without file locks, each process compiles for itself
        with suppress(OSError):
            portable.lock(stack.enter_context((folder / "lock").open("w")), wait=True)
        yield


@contextmanager
def _writable(folder: Path) -> Iterator[Path]:
    """Yield the folder or, if it cannot be written, a temporary copy of it.

    Numba needs a writable folder, even to read.
    """
    if os.access(folder, os.W_OK | os.X_OK):
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="vsconstraints-") as copy:
        shutil.copytree(folder, copy, copy_function=shutil.copyfile, dirs_exist_ok=True)
        for path in (Path(copy), *Path(copy).rglob("*")):
            path.chmod(0o755)
        yield Path(copy)


#: Files outside this folder and ``formulas`` that define constants of compiled code. Compiled code
#: contains no reference to them.
OTHERS = ("vision/distortion.py", "vision/scene.py", "rows/checks.py", "rows/tolerances.py")


def sources() -> list[Path]:
    """List every file that compiled code may be made of."""
    package = Path(__file__).parent.parent
    folders = (package / "compiled", package / "formulas")
    files = (file for folder in folders for file in sorted(folder.glob("*.py")))
    return [*files, *(package / other for other in OTHERS)]


@cache
def _state() -> bytes:
    """Hash of this package's code, the compiler, Python and the processor."""
    processor = import_module("llvmlite.binding").get_host_cpu_name()
    texts = b"".join(file.read_bytes() for file in sources())
    settings = f"{numba.config.BOUNDSCHECK} {interface.accelerator.USED}"
    made_by = f"{numba.__version__} {sys.version} {processor} {settings}"
    return hashlib.sha256(texts + made_by.encode()).digest()


def _meaning(code: CodeType) -> bytes:
    """Return bytes that identify the behaviour of a function and are equal in every process.

    The ``repr`` of its constants would differ: it contains the addresses of inner functions, and
    sets of strings in any order.
    """
    constants = []
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            constants.append(_meaning(constant))
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
        return b"\0".join([_meaning(value.__code__), *parts])
    if isinstance(value, np.ndarray):
        return repr((value.dtype, value.shape)).encode() + value.tobytes()
    return repr(value).encode()


def cache_candidates() -> list[Path]:
    """List the folders in which compiled code may be stored.

    This is ``NUMBA_CACHE_DIR`` if it is set. Otherwise it is a folder beside the code, then the
    user's cache, which a user without a home does not have.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return [Path(chosen)]
    beside = Path(__file__).parent / "__pycache__"
    users = os.path.expanduser(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    # without a home, ``~`` is not expanded
    return [beside] if users.startswith("~") else [beside, Path(users) / "vsconstraints"]


def cache_folder(function: Callable[..., Any], formulas: Formulas = ()) -> Path:
    """Return the folder in which a compiled function is stored.

    Each state of the function's code, the compiler, Python and the processor has its own folder.
    Numba alone would compare only the file of the function, and would miss changes of the functions
    that it calls. The folder is created in the first of :func:`cache_candidates` that can be
    written. A folder that cannot be written but contains the function is accepted as well.

    Raises
    ------
    OSError
        if none of these can be written.
    """
    state = hashlib.sha256(_state())
    for formula in formulas:
        # the module of a custom formula may contain the functions that it calls
        with suppress(OSError):
            state.update(Path(inspect.getsourcefile(formula) or "").read_bytes())
        state.update(_meaning(formula.__code__))
    made_for = "".join(f".{formula.__name__}" for formula in formulas)
    name = f"{function.__module__.rpartition('.')[2]}{made_for}-{state.hexdigest()[:HASH]}"
    candidates = cache_candidates()
    for folder in candidates:
        with suppress(OSError):
            (folder / name).mkdir(parents=True, exist_ok=True)
        if os.access(folder / name, os.W_OK | os.X_OK):
            return folder / name
        if next((folder / name).rglob(f"*.{function.__name__}-*.nbi"), None) is not None:
            return folder / name
    refused = " or ".join(map(str, candidates))
    raise OSError(
        f"no folder to keep compiled code in: cannot write {refused}; NUMBA_CACHE_DIR names "
        f"another one"
    )


#: Kept, because Python warns about a process that nothing refers to.
_helpers: list[subprocess.Popen[bytes]] = []
_announced: set[Path] = set()  #: Caches that this process has announced to fill.


def cache_of(function: Callable[..., Any], formulas: Formulas) -> Path:
    """Return the cache folder and remove old ones; announce a compilation if it is needed."""
    folder = cache_folder(function, formulas)
    with suppress(OSError):
        os.utime(folder)
        states = folder.parent.glob(f"{folder.name.rpartition('-')[0]}-{'?' * HASH}")
        for old in sorted(states, key=lambda state: -state.stat().st_mtime)[
            KEPT_PARTS if formulas else KEPT :
        ]:
            shutil.rmtree(old, ignore_errors=True)
    missing = next(folder.rglob(f"*{function.__name__}*.nbi"), None) is None
    # workers compile what their command has already announced
    if missing and folder.parent not in _announced and multiprocessing.parent_process() is None:
        _announced.add(folder.parent)
        part = folder.name.rpartition("-")[0]
        print(f"vsconstraints: {_announcement(part, folder.parent)}", file=sys.stderr, flush=True)
        own = function.__module__.rpartition(".")[2]
        _share(name for name in reversed(MODULES) if name != own)
    return folder


def _announcement(part: str, kept_in: Path) -> str:
    """Return the message about a compilation: of the control step, or of a missing part."""
    state = hashlib.sha256(_state()).hexdigest()[:HASH]
    if next(kept_in.glob(f"*-{state}/**/*.nbi"), None) is None:
        return f"compiling the control step, once, for 10 to 30 s; kept in {kept_in}"
    return f"compiling more, from {part} on, which nothing has needed before; kept in {kept_in}"


def _share(modules: Iterable[str]) -> None:
    """Let another process compile these modules in parallel.

    Locks keep the two processes from compiling the same function. No process waits for the other
    one, which ends with this one. Nothing is lost if it fails.
    """
    if (
        os.environ.get(VARIABLE) == SINGLE_PROCESS
        or not sys.executable
        or (os.cpu_count() or 1) < 2
    ):
        return
    package = __name__.rpartition(".")[0]
    code = (
        f"from {package.rpartition('.')[0]}.plugins.processes import "
        f"end_with\nend_with({os.getpid()})\n"
        f"from {package} import load\nfor name in {[*modules]!r}:\n    load(name)"
    )
    environment = {
        **os.environ,
        VARIABLE: SINGLE_PROCESS,
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    command = [sys.executable, "-c", code]
    nowhere = subprocess.DEVNULL
    with suppress(OSError):
        _helpers.append(
            subprocess.Popen(
                command, stdin=nowhere, stdout=nowhere, stderr=nowhere, env=environment
            )
        )


def compile_ahead(modules: Sequence[str]) -> None:
    """Let another process compile these modules too, if this one found nothing compiled."""
    if modules and _helpers:
        _share(modules)
