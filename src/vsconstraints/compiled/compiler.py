"""How functions of this package are compiled, or left to Python, and where the result is kept."""

from __future__ import annotations

import gc
import hashlib
import inspect
import math
import multiprocessing
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, wraps
from importlib import import_module
from numbers import Real
from pathlib import Path
from types import CodeType, SimpleNamespace
from typing import Any, TypeVar, cast

import numpy as np

from ..formulas import FORMULAS
from ..plugins import portable
from . import COMPLAINT, MODULES, VARIABLE
from .checksums import remove_damaged, seal

F = TypeVar("F", bound=Callable[..., Any])
Formulas = Sequence[Callable[..., Any]]

#: Division by zero gives an infinity, as in NumPy; sums are never reordered, so that results repeat
#: bit by bit.
OPTIONS = {"error_model": "numpy", "fastmath": False}
#: For functions that make no arrays: counting references to every view of one takes as long as
#: computing.
IN_PLACE = {**OPTIONS, "_nrt": False}
#: Value of the environment variable with which a process compiles everything it needs by itself.
SINGLE_PROCESS = "alone"
#: States of a module's code that are kept compiled, those used last, without formulas of their own
#: and with them, and the length of their names' ends.
KEPT = 8
KEPT_PARTS = 64
HASH = 16
_warned: list[Exception] = []  #: Why nothing is compiled, once a warning has said so.


def _warn(error: Exception) -> None:
    if not _warned:
        _warned.append(error)
        warnings.warn(
            f"{COMPLAINT}, which is slower: {type(error).__name__}: {error} (set {VARIABLE}=0 to "
            f"say nothing)",
            RuntimeWarning,
            stacklevel=5,
        )


def _internals() -> Any:
    """:mod:`.numba_internals`; None where nothing is to be compiled, or numba is missing or
    broken.
    """
    if os.environ.get(VARIABLE, "").strip() == "0":
        return None
    try:
        return import_module(f"{__package__}.numba_internals")
    except Exception as error:  # whatever is wrong with the compiler, Python runs
        _warn(error)
        return None


internals = _internals()
numba: Any = internals and internals.numba
#: Types in signatures; None where nothing is compiled.
VOID, INT, FLOAT, VECTOR, MATRIX = (
    getattr(internals, name, None) for name in ("VOID", "INT", "FLOAT", "VECTOR", "MATRIX")
)
#: ``math`` for functions that run in Python: as compiled, they give NaN and infinity where ``math``
#: raises.
QUIET = SimpleNamespace(
    **{
        **vars(math),
        **{
            name: getattr(np, name)
            for name in ["sqrt", "sin", "cos", "exp", "expm1", "log", "copysign"]
        },
    }
)


def compiles() -> bool:
    """Whether functions are compiled; otherwise they run in Python, some 200 times slower, to the
    same results.
    """
    return internals is not None


def type_of(example: Any) -> Any:
    """The compiler's type of a structure of arrays."""
    return None if internals is None else numba.typeof(example)


def signature(result: Any, *arguments: Any) -> Any:
    """The signature of a function that takes these types."""
    return None if internals is None else result(*arguments)


def _as_compiled(function: Callable[..., Any]) -> None:
    """Let a function that stays in Python compute as if it were compiled."""
    if function.__globals__.get("math") is math:
        function.__globals__["math"] = QUIET


_registered: set[Callable[..., Any]] = set()  #: Formulas that compiled code can call.


def register_formulas(*formulas: Callable[..., Any]) -> None:
    """Let compiled code call these functions and every marked formula: see
    :mod:`vsconstraints.formulas`.
    """
    for function in (*FORMULAS, *formulas):
        if function not in _registered and internals is not None:
            _registered.add(function)
            internals.part_of_others(function, {"error_model": "numpy"})


def inner(function: F, options: dict[str, Any] = OPTIONS) -> F:
    """Let compiled functions call this one, which stays as it is in Python."""
    if internals is None:
        _as_compiled(function)
    else:
        internals.part_of_others(function, options)
    return function


def in_place(function: F) -> F:
    """As :func:`inner`, for what makes no arrays."""
    return inner(function, IN_PLACE)


def compiled(
    signature: Any,
    options: dict[str, Any] = OPTIONS,
    formulas: Formulas = (),
    from_python: bool = True,
) -> Callable[[F], F]:
    """Compile for this signature, and keep the result on disk; ``options`` are :data:`OPTIONS` or
    :data:`IN_PLACE`.

    The function may call ``formulas`` beside the marked ones. Arguments of other types raise
    TypeError. What is only called by its address, not ``from_python``, compiles faster: whole
    structures take long to be taken apart.

    Where nothing is compiled, the function runs in Python. Where the compiler fails for a function
    without formulas of its own, a RuntimeWarning says why, and nothing more is compiled in this
    process.
    """

    def decorate(function: F) -> F:
        global internals
        if internals is None:
            return in_python(function, signature)
        register_formulas(*formulas)
        try:
            return _compiled(function, internals.jit(signature, from_python, options), formulas)
        except Exception as error:
            if formulas:
                raise
            internals = None
            _warn(error)
            return in_python(function, signature)

    return decorate


def in_python(function: F, signature: Any = None) -> F:
    """The function as Python runs it: it checks arrays and numbers if its signature is text, and
    never warns.
    """
    _as_compiled(function)
    checks = (
        _checks(signature) if isinstance(signature, str) and "UniTuple" not in signature else []
    )

    @wraps(function)
    def quiet(*arguments: Any) -> Any:
        flat = [x for each in arguments for x in (each if isinstance(each, tuple) else (each,))]
        for check, argument in zip(checks, flat, strict=False):
            if not check(argument):
                raise TypeError(f"{function.__name__} does not take {argument!r}")
        with np.errstate(all="ignore"):
            return function(*arguments)

    return cast("F", quiet)


def _checks(signature: str) -> list[Callable[[Any], bool]]:
    """Whether the arguments, and what is in tuples of them, fit as the compiler would see it."""

    def check(constant: str, d: str, dtype: str, layout: str) -> Callable[[Any], bool]:
        if not (constant or dtype):
            return lambda x: isinstance(x, (Real, np.bool_))
        kind = np.dtype((constant or dtype).replace("boolean", "bool"))
        ndim = int(d or layout.count(",") + 1)
        any_layout = bool(dtype) and "1" not in layout
        return lambda x: (
            isinstance(x, np.ndarray)
            and x.dtype == kind
            and x.ndim == ndim
            and (any_layout or x.flags.c_contiguous)
        )

    arguments = signature.partition("(")[2].replace("Tuple", "")
    parts = re.findall(
        r"Array\((\w+), (\d), 'C', readonly=True\)|(\w+)\[([:, 1]+)\]|\w+", arguments
    )
    return [check(*part) for part in parts]


def _compiled(function: F, jit: Any, formulas: Formulas) -> F:
    config = numba.config
    before = config.CACHE_DIR, config.LOOP_VECTORIZE
    with _writable(cache_of(function, formulas)) as folder:
        # loops are of a few joints or rows: vectors make no step faster, and compiling takes a
        # tenth longer
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
    """Let numba compile or read a function without looking for garbage, of which there is hardly
    any before the end.
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
    """One process at a time: of workers that need the same function, one compiles it and the others
    read it.
    """
    with ExitStack() as stack:
        # where files cannot be locked each compiles for itself
        with suppress(OSError):
            portable.lock(stack.enter_context((folder / "lock").open("w")), wait=True)
        yield


@contextmanager
def _writable(folder: Path) -> Iterator[Path]:
    """The folder or, if it cannot be written, a copy of what it holds: numba insists on writing,
    even to read.
    """
    if os.access(folder, os.W_OK | os.X_OK):
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="vsconstraints-") as copy:
        shutil.copytree(folder, copy, copy_function=shutil.copyfile, dirs_exist_ok=True)
        for path in (Path(copy), *Path(copy).rglob("*")):
            path.chmod(0o755)
        yield Path(copy)


#: Files outside this room and the formulas' of which compiled code takes constants, which leave no
#: trace in it.
OTHERS = ("vision/distortion.py", "vision/scene.py", "rows/checks.py", "rows/tolerances.py")


def sources() -> list[Path]:
    """Every file that compiled code may be made of."""
    package = Path(__file__).parent.parent
    folders = (package / "compiled", package / "formulas")
    files = (file for folder in folders for file in sorted(folder.glob("*.py")))
    return [*files, *(package / other for other in OTHERS)]


@cache
def _state() -> bytes:
    """Differs with the code of this package, the compiler, Python and the processor."""
    processor = import_module("llvmlite.binding").get_host_cpu_name()
    texts = b"".join(file.read_bytes() for file in sources())
    made_by = f"{numba.__version__} {sys.version} {processor} {internals.CHECKS_BOUNDS}"
    return hashlib.sha256(texts + made_by.encode()).digest()


def _meaning(code: CodeType) -> bytes:
    """Return bytes that differ with what a function does, and are the same in every process.

    The ``repr`` of its constants is not: inner functions show their addresses there, and sets of
    texts their order.
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


def cache_candidates() -> list[Path]:
    """List where compiled code may be kept.

    That is ``NUMBA_CACHE_DIR`` if it is set, or else beside the code or in the user's cache, which
    a user without a home does not have.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return [Path(chosen)]
    beside = Path(__file__).parent / "__pycache__"
    users = os.path.expanduser(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    # without a home the text stays as it is
    return [beside] if users.startswith("~") else [beside, Path(users) / "vsconstraints"]


def cache_folder(function: Callable[..., Any], formulas: Formulas = ()) -> Path:
    """Where a compiled function is kept: one folder for each state of its code, the compiler,
    Python and the processor.

    Numba by itself would compare the file of a function, and not see that one it calls has changed.
    The folder is made in the first of :func:`cache_candidates` that can be written. One that cannot
    be written but holds the function is as good.

    Raises
    ------
    OSError
        if none of these can be written.
    """
    state = hashlib.sha256(_state())
    for formula in formulas:
        # the module of an own one may hold whatever it calls
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


#: Kept, since the end of a process that nobody holds is complained about.
_helpers: list[subprocess.Popen[bytes]] = []
_announced: set[Path] = set()  #: Caches of which this process has said that it fills them.


def cache_of(function: Callable[..., Any], formulas: Formulas) -> Path:
    """Return the cache folder, and remove old ones; say so if the function has to be compiled."""
    folder = cache_folder(function, formulas)
    with suppress(OSError):
        os.utime(folder)
        states = folder.parent.glob(f"{folder.name.rpartition('-')[0]}-{'?' * HASH}")
        for old in sorted(states, key=lambda state: -state.stat().st_mtime)[
            KEPT_PARTS if formulas else KEPT :
        ]:
            shutil.rmtree(old, ignore_errors=True)
    missing = next(folder.rglob(f"*{function.__name__}*.nbi"), None) is None
    # the workers of a command compile what it has announced
    if missing and folder.parent not in _announced and multiprocessing.parent_process() is None:
        _announced.add(folder.parent)
        part = folder.name.rpartition("-")[0]
        print(f"vsconstraints: {_announcement(part, folder.parent)}", file=sys.stderr, flush=True)
        own = function.__module__.rpartition(".")[2]
        _share(name for name in reversed(MODULES) if name != own)
    return folder


def _announcement(part: str, kept_in: Path) -> str:
    """Return what is compiled: the control step if nothing is there yet, or what it lacks."""
    state = hashlib.sha256(_state()).hexdigest()[:HASH]
    if next(kept_in.glob(f"*-{state}/**/*.nbi"), None) is None:
        return f"compiling the control step, once, for 10 to 30 s; kept in {kept_in}"
    return f"compiling more, from {part} on, which nothing has needed before; kept in {kept_in}"


def _share(modules: Iterable[str]) -> None:
    """Let another process compile these modules in the meantime, so that they are there when they
    are needed.

    Locks keep the two from compiling the same; nothing waits for that process, which ends with this
    one, and nothing is lost if it fails.
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
