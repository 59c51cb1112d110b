"""Access by address: workspaces, and functions that are compiled for one formula each.

Rows of constraints and laws vary from scene to scene. Each is compiled into a separate function and
called by its address. Therefore the step and the loop are compiled once for all constraints and
laws, including custom ones. Python does not call by address: functions take a :class:`.Workspace`
and check its type.
"""

from __future__ import annotations

import hashlib
import inspect
import time
import warnings
from collections.abc import Callable
from functools import partial, wraps
from typing import Any, TypeVar

from ..rows import Array, IntArray
from . import compiler, entry
from .cache import identify
from .compiler import IN_PLACE, OPTIONS, compiled, in_python, runnable
from .memory import require_workspace, structure_at
from .signatures import Signature
from .workspace import Size

F = TypeVar("F", bound=Callable[..., Any])

#: Functions by their addresses, as Python calls them.
_functions: dict[int, Callable[..., Any]] = {}


def address(function: Any) -> int:
    """Return the address of a function, valid as long as the function is kept.

    The function is compiled with ``from_python=False``, or stays in Python. Compiled code must not
    receive the address of one that stays in Python: :func:`checked` sees to it.
    """
    is_compiled = hasattr(function, "address")
    at = int(function.address) if is_compiled else id(function)
    _functions[at] = function.__wrapped__ if is_compiled else function
    return at


def call_void_pointer(address: int, arguments: tuple[Any, ...]) -> None:
    """Call a function that returns nothing by its address."""
    _functions[int(address)](*arguments)


def call_int_pointer(address: int, arguments: tuple[Any, ...]) -> int:
    """Call a function that returns an integer by its address."""
    code: int = _functions[int(address)](*arguments)
    return code


def to_fixed_tuple(array: Array, count: int) -> tuple[float, ...]:
    """Return the first ``count`` entries of an array as a tuple.

    Their number has to be known when a function is compiled.
    """
    return tuple(array[:count])


def matrix_at(numbers: Array, at: int, rows: int, columns: int) -> Array:
    """Return the matrix of the given shape that begins with entry ``at`` of a vector."""
    return numbers[at : at + rows * columns].reshape(rows, columns)


def monotonic(scratch: IntArray) -> float:
    """Return the time of a monotonic clock [s]; ``scratch`` (2,) is used by compiled code."""
    return time.monotonic()


def struct_loader(example: Any) -> Callable[[int], Any]:
    """Return a function that loads the structure at an address.

    The fields have the types of the example's.
    """

    def load_struct(address: int) -> Any:
        return structure_at(address)

    if compiler.interface is not None:
        compiler.interface.load_as(load_struct, example)
    return load_struct


def set_fields(structure: Any, arrays: tuple[Any, ...]) -> None:
    """Let the fields of a structure refer to these arrays, in the order of the fields."""
    for name, array in zip(vars(structure), arrays, strict=True):
        setattr(structure, name, array)


if compiler.interface is not None:
    compiler.interface.call_as(call_void_pointer, compiler.interface.VOID)
    compiler.interface.call_as(call_int_pointer, compiler.interface.INT)
    compiler.interface.fixed_tuple_as(to_fixed_tuple)
    compiler.interface.matrix_at_as(matrix_at)
    compiler.interface.monotonic_as(monotonic, getattr(time, "CLOCK_MONOTONIC", 1))
    compiler.interface.set_fields_as(set_fields)


def checked(*kinds: type, calls: int | None = None) -> Callable[[Any], Any]:
    """Make a decorator of a compiled function whose first arguments are addresses of structures.

    ``kinds`` are the classes of these structures. Python calls the result with workspaces instead:
    anything else raises InvalidInput. Its ``bind(*workspaces)`` checks them once, and returns a
    function of the other arguments for loops, whose types are only checked if ``typed``. If the
    function ``calls`` another one, it takes the address of that one first. Every function that
    calls others by their addresses is decorated, so that it is :func:`.runnable`; it is bound when
    the workspaces contain all addresses.
    """

    def decorate(function: Any) -> Any:
        called = [] if calls is None else [calls]

        def addresses(workspaces: tuple[Any, ...]) -> list[int]:
            structures = [
                require_workspace(*each, function.__name__)
                for each in zip(workspaces, kinds, strict=True)
            ]
            return called + structures

        @wraps(getattr(function, "py_func", function))
        def demanding(*arguments: Any) -> Any:
            structures = addresses(arguments[: len(kinds)])
            return runnable(function)(*structures, *arguments[len(kinds) :])

        def bind(*workspaces: Any, typed: bool = False) -> Callable[..., Any]:
            now = runnable(function)
            bound = partial(now if typed else entry(now), *addresses(workspaces))
            # the workspaces live as long as the function
            return _with(bound, workspaces=workspaces)

        return _with(demanding, bind=bind)

    return decorate


def _with(function: F, **attributes: Any) -> F:
    vars(function).update(attributes)
    return function


#: Loader of the :class:`.Step` at an address: entry points take one number instead of fifty arrays.
load_step = struct_loader(Size().step()[0])


def make_part(
    template: Callable[..., Any],
    formulas: tuple[Callable[..., Any] | None, ...],
    constants: tuple[int, ...],
    signature: Signature,
    options: dict[str, Any] = IN_PLACE,
) -> Any:
    """Compile the function ``template(*formulas, *constants)`` and cache it on disk.

    Compiled code calls it by its address. ``formulas`` are elementwise functions, or None if
    absent. The last two arguments are those of :func:`.compiled`.
    """
    function = template(*formulas, *constants)
    if compiler.interface is None:
        return in_python(function)
    own = tuple(formula for formula in formulas if formula is not None)
    # cached functions are found by their names, and numba's own counters differ between processes
    parts = b"\0".join(identify(part) for part in (*constants, *formulas))
    function.__name__ = f"{template.__name__}_{hashlib.sha256(parts).hexdigest()[:16]}"
    function.__qualname__ = function.__name__
    try:
        return compiled(signature, options, own, from_python=False)(function)
    except Exception:
        if options == OPTIONS:
            raise
        # the formula may make arrays
        return compiled(signature, OPTIONS, own, from_python=False)(function)


def warn_refused(formulas: tuple[Callable[..., Any] | None, ...], error: Exception) -> None:
    """Warn that the compiler refuses one of these formulas, which then runs in NumPy.

    The warning contains name, file and line of each formula, and the compiler's reason.
    """
    names = []
    remedy = ""
    for formula in formulas:
        if formula is None:
            continue
        code = formula.__code__
        file = inspect.getsourcefile(formula)
        names.append(f"{formula.__qualname__} ({file}, line {code.co_firstlineno})")
        if "where" in code.co_names:
            remedy = "; use vsconstraints.formulas.where in place of np.where"
    message = str(error)
    reasons = [line for line in message.splitlines()[1:] if line.strip()]
    reason = reasons[0] if reasons else message
    warnings.warn(
        f"the compiler refuses a formula, so that rows of {' and '.join(names)} are made in NumPy"
        f"{remedy}: {reason.strip()}",
        RuntimeWarning,
        stacklevel=3,
    )
