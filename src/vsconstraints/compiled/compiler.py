"""Compilation of this package's functions, and their fallback to Python."""

from __future__ import annotations

import gc
import multiprocessing
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from ..formulas import FORMULAS
from . import COMPLAINT, MODULES, VARIABLE
from .cache import KEPT, KEPT_WITH_FORMULAS, CachedFunction, Formulas, any_compiled, state_of
from .checksums import remove_damaged, seal
from .signatures import Signature, flatten

F = TypeVar("F", bound=Callable[..., Any])

#: Value of the environment variable with which a process compiles everything without a helper.
SINGLE_PROCESS = "alone"
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

    Otherwise they run in Python, number by number, about 200 times slower, with the same results.
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
    reason, and nothing more is compiled in this process; see :func:`runnable`.
    """

    def decorate(function: F) -> F:
        global interface
        plain = in_python(function, signature if from_python else None)
        if interface is None:
            return plain
        register_formulas(*formulas)
        try:
            made = _compiled(function, interface.jit(signature, from_python, options), formulas)
        except Exception as error:
            if formulas:
                raise
            interface = None
            _warn(error)
            return plain
        if from_python:
            _in_python[made] = plain
        return made

    return decorate


#: What runs in place of a function that was compiled before the compiler failed.
_in_python: dict[Callable[..., Any], Callable[..., Any]] = {}


def runnable(function: F) -> F:
    """Return a function of :func:`compiled` as it may run with all functions that exist now.

    Functions compiled before the compiler failed run in Python after that: compiled code would
    jump to the address of a function that is not compiled. Python calls both kinds by address.
    """
    if interface is not None:
        return function
    return cast("F", _in_python.get(function, function))


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
    settings = f"{numba.__version__} {sys.version} {interface.settings()}"
    made = CachedFunction(function, state_of(settings, formulas), interface.cache_folder(function))
    if made.files:
        made.note_use()
    else:
        _announce(function, formulas, made.folder, any_compiled(made.folder, state_of(settings)))
        made.remove_old((KEPT_WITH_FORMULAS if formulas else KEPT) - 1)
    with made.lock(), interface.accelerator.without_vectorization():
        remove_damaged(made.files)
        result = _compile_or_read(jit, function)
        seal(made.files)
        return result


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


#: Kept, because Python warns about a process that nothing refers to.
_helpers: list[subprocess.Popen[bytes]] = []
_announced = False  #: True if this process has announced a compilation.


def _announce(
    function: Callable[..., Any], formulas: Formulas, folder: Path, has_others: bool
) -> None:
    """Announce once that something is compiled, and let another process compile the rest.

    ``has_others`` is true if other functions are compiled already.
    """
    global _announced
    # workers compile what their command has already announced
    if _announced or multiprocessing.parent_process() is not None:
        return
    _announced = True
    module = function.__module__.rpartition(".")[2]
    part = ".".join([module, *(formula.__name__ for formula in formulas)])
    what = (
        f"compiling more, from {part} on, which nothing has needed before"
        if has_others
        else "compiling the control step, once, for 10 to 30 s"
    )
    slow = (
        ""
        if interface.accelerator.is_known()
        else (f"; numba {numba.__version__} is newer than those whose compilation is accelerated")
    )
    note = f"vsconstraints: {what}{slow}; kept in {folder}"
    print(note, file=sys.stderr, flush=True)
    _share(name for name in reversed(MODULES) if name != module)


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
