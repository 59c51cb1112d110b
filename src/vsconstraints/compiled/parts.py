"""Parts that compiled code calls without knowing them: rows of a constraint, a law, made for one formula each.

What varies is compiled into a function of its own, and called by its address. So the step and the loop are compiled
once for all constraints and laws, those of users among them.
"""

from __future__ import annotations

import hashlib
import inspect
import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from .compiler import IN_PLACE, compiled, numba

VOID, INT = numba.types.void, numba.types.int64


@lru_cache(maxsize=256)
def address(function: Any) -> int:
    """Where a compiled function of one signature begins; it stays there as long as the function is kept.

    Numba looks for it for as long as ten control steps take.
    """
    result = function.overloads[function.signatures[0]]
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


class Stored(numba.types.Type):  # type: ignore[misc, name-defined]
    """A structure of arrays that is stored: of its fields, only those are read that are asked for.

    Code that has whole structures at hand takes several times as long to compile.
    """

    def __init__(self, structure: Any) -> None:
        self.structure = structure
        super().__init__(name=f"Stored({structure})")


@numba.extending.register_model(Stored)
class _StoredModel(numba.extending.models.PrimitiveModel):  # type: ignore[misc, name-defined]
    def __init__(self, manager: Any, kind: Stored) -> None:
        super().__init__(manager, kind, manager.lookup(INT).get_value_type())


@numba.extending.infer_getattr
class _StoredFields(numba.core.typing.templates.AttributeTemplate):  # type: ignore[misc, name-defined]
    key = Stored

    def generic_resolve(self, kind: Stored, name: str) -> Any:
        field = kind.structure.types[kind.structure.fields.index(name)]
        return Stored(field) if isinstance(field, numba.types.BaseNamedTuple) else field


@numba.extending.lower_getattr_generic(Stored)  # type: ignore[untyped-decorator]
def _read(context: Any, builder: Any, kind: Stored, value: Any, name: str) -> Any:
    i = kind.structure.fields.index(name)
    begin = builder.inttoptr(value, context.get_value_type(kind.structure).as_pointer())
    field = numba.core.cgutils.gep_inbounds(builder, begin, 0, i)
    if isinstance(kind.structure.types[i], numba.types.BaseNamedTuple):
        return builder.ptrtoint(field, value.type)
    # where references are counted, what is given back counts as one more
    return numba.core.imputils.impl_ret_borrowed(context, builder, kind.structure.types[i], builder.load(field))


def _caller(result: Any) -> Any:
    """A function (address, arguments) for compiled code, which calls what begins there with a tuple of arguments.

    Stored structures are passed whole.
    """

    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            types, unpacked = [], []
            for i, given in enumerate(signature.args[1].types):
                value = builder.extract_value(values[1], i)
                if isinstance(given, Stored):
                    given = given.structure
                    value = builder.load(builder.inttoptr(value, context.get_value_type(given).as_pointer()))
                types.append(given)
                unpacked.append(value)
            kind = context.call_conv.get_function_type(result, types)
            function = builder.inttoptr(values[0], kind.as_pointer())
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
    from_python: bool = False,
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
    from_python
        Whether Python calls it too.
    """
    function = template(*formulas, *constants)
    given = tuple(formula for formula in formulas if formula is not None)
    # functions from the disk are found by their names, of which every process counts its own
    made_of = hashlib.sha256(repr(constants).encode() + numba.core.serialize.dumps(formulas)).hexdigest()[:16]
    function.__name__ = function.__qualname__ = f"{function.__name__}_{made_of}"
    return compiled(signature, options, given, from_python)(function)


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


def thaw_as(structure: Any) -> Any:
    """A function for compiled code that gives back the structure of that type which :func:`.frozen` has put there."""

    def thaw(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return values[0]

        return Stored(structure)(address), generate

    return numba.extending.intrinsic(thaw)
