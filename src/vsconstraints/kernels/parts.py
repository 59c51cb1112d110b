"""Parts that compiled code calls without knowing them: rows of a constraint, a law, made for one formula each.

What varies is compiled into a function of its own, and called by its address. So the step and the loop are compiled
once for all constraints and laws, those of users among them.
"""

from __future__ import annotations

import hashlib
import inspect
import warnings
from collections.abc import Callable
from typing import Any

from .compiler import IN_PLACE, compiled, numba

VOID, INT = numba.types.void, numba.types.int64

BYTES = 1 << 14
"""So many are enough for a structure of some two hundred arrays."""


def address(function: Any) -> int:
    """Where a compiled function of one signature begins; it stays there as long as the function is kept."""
    result = function.overloads[function.signatures[0]]
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


def _caller(result: Any) -> Any:
    """A function (address, arguments) for compiled code, which calls what begins there with a tuple of arguments."""

    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            types = list(signature.args[1].types)
            kind = context.call_conv.get_function_type(result, types)
            function = builder.inttoptr(values[0], kind.as_pointer())
            unpacked = [builder.extract_value(values[1], i) for i in range(len(types))]
            _, answer = context.call_conv.call_function(builder, function, result, types, unpacked)
            return context.get_dummy_value() if result == VOID else answer

        return result(address, arguments), generate

    return numba.extending.intrinsic(call)


call, ask = _caller(VOID), _caller(INT)
"""Call by address a function that returns nothing, and one that returns an integer: ``call(address, (a, b))``."""


def make_part(
    template: Callable[..., Any],
    formulas: tuple[Callable[..., Any] | None, ...],
    constants: tuple[int, ...],
    signature: Any,
    options: dict[str, Any] = IN_PLACE,
) -> Any:
    """The function that ``template(*formulas, *constants)`` gives, compiled for a signature and kept on disk.

    Parameters
    ----------
    template
        A function of a module of this package that returns a function which calls the formulas.
    formulas
        Elementwise functions, see :mod:`vsconstraints.formulas`; None where there is none.
    constants
        What else the template is made with, such as the number of parameters of a formula.
    signature
        Of the function.
    options
        Of the compiler: :data:`.IN_PLACE` for what makes no arrays, else :data:`.OPTIONS`.
    """
    function = template(*formulas, *constants)
    given = tuple(formula for formula in formulas if formula is not None)
    # functions from the disk are found by their names, of which every process counts its own
    made_of = hashlib.sha256(repr(constants).encode() + numba.core.serialize.dumps(formulas)).hexdigest()[:16]
    function.__name__ = function.__qualname__ = f"{function.__name__}_{made_of}"
    return compiled(signature, options, given)(function)


def tell_refused(formulas: tuple[Callable[..., Any] | None, ...], error: Exception) -> None:
    """Warn that the compiler refuses one of these formulas, by name, file and line, and why: it runs in NumPy."""
    names = " and ".join(
        f"{formula.__qualname__} ({inspect.getsourcefile(formula)}, line {formula.__code__.co_firstlineno})"
        for formula in formulas
        if formula is not None
    )
    reason = next((line for line in str(error).splitlines()[1:] if line.strip()), str(error))
    warnings.warn(
        f"the compiler refuses a formula, so that rows of {names} are made in NumPy: {reason.strip()}",
        RuntimeWarning,
        stacklevel=3,
    )


def _store(typing_context: Any, structure: Any, buffer: Any) -> Any:
    """Write where the arrays of a structure are to a buffer of :data:`BYTES` (uint8); returns their number of bytes.

    The arrays are not copied. They, and the buffer, must live as long as its address is used.
    """

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = context.get_value_type(structure)
        begin = context.make_array(buffer)(context, builder, values[1]).data
        builder.store(values[0], builder.bitcast(begin, kind.as_pointer()))
        return context.get_constant(INT, context.get_abi_sizeof(kind))

    return INT(structure, buffer), generate


store = numba.extending.intrinsic(_store)
"""For compiled code, see :func:`_store`."""


def thaw_as(structure: Any) -> Any:
    """A function for compiled code that gives back the structure of that type which :func:`store` has put there."""

    def thaw(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kind = context.get_value_type(structure)
            found = builder.load(builder.inttoptr(values[0], kind.as_pointer()))
            # where references are counted, what is given back counts as one more
            return numba.core.imputils.impl_ret_borrowed(context, builder, structure, found)

        return structure(address), generate

    return numba.extending.intrinsic(thaw)
