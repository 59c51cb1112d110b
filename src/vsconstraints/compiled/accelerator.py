"""Private parts of numba that make compilation and calls faster, with the same results.

They are used only with the versions of numba in :data:`KNOWN`. With another version, or with
``VSCONSTRAINTS_ACCELERATOR=0`` in the environment, everything uses numba's public interface alone.
With numba 0.68, compiling the control step takes 17 CPU s with them and 31 CPU s without.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

numba = import_module("numba")  # not typed

WORD_SIZE = 8  #: Size of an address, an integer or a float [bytes].
#: Environment variable. ``0`` turns the private parts off.
VARIABLE = "VSCONSTRAINTS_ACCELERATOR"
#: Versions of numba, without their last number, of which the private parts are as assumed.
KNOWN = ("0.61", "0.62", "0.63", "0.64", "0.65", "0.66", "0.67", "0.68")


def is_known() -> bool:
    """True if the private parts of the installed version of numba are as assumed."""
    return numba.__version__.rpartition(".")[0] in KNOWN


def is_used() -> bool:
    """True if private parts of numba are used in this process."""
    return is_known() and os.environ.get(VARIABLE, "").strip() != "0"


def _part_compiler() -> Any:
    """Return a compiler for functions that only other compiled functions call."""
    codegen = import_module("numba.core.codegen")

    class Library(codegen.JITCodeLibrary):  # type: ignore[misc, name-defined]
        """Library of code that is not optimised separately.

        The compiled functions that contain the code optimise it again anyway.
        """

        _final_module: Any

        def _optimize_final_module(self) -> None:
            """Do nothing."""

        def _finalize_final_module(self) -> None:
            """Make machine code only of the place that numba requires for each environment.

            These places are never read: environments serve exceptions with arguments, and Python
            objects.
            """
            whole = self._final_module
            common = codegen.ll.Linkage.common
            places = [
                variable.name for variable in whole.global_variables if variable.linkage == common
            ]
            self._final_module = codegen.ll.parse_assembly(
                "\n".join(f"@{name} = common global i64 0" for name in places)
            )
            super()._finalize_final_module()
            self._final_module = whole

    class PartCompiler(import_module("numba.core.compiler").Compiler):  # type: ignore[misc]
        """Compiler with a :class:`Library`."""

        def define_pipelines(self) -> Any:
            """Return numba's pipelines, with this library."""
            state = self.state
            state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
            return super().define_pipelines()

    return PartCompiler


USED = is_used()
#: Options of functions that only other compiled functions call.
PART: dict[str, Any] = (
    {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "pipeline_class": _part_compiler(),
    }
    if USED
    else {}
)
#: Options of functions that Python calls.
ENTRY: dict[str, Any] = {"no_cfunc_wrapper": True} if USED else {}
#: Options of functions that make no arrays: references to arrays are not counted.
IN_PLACE: dict[str, Any] = {"_nrt": False} if USED else {}


def read_fields(stored: type, load: Callable[..., Any]) -> None:
    """Let compiled code read fields of the types of class ``stored`` without calls of functions.

    ``load(builder, address, offset, type)`` loads a value from memory.
    """
    templates = import_module("numba.core.typing.templates")
    arrays = import_module("numba.np.arrayobj")

    @numba.extending.infer_getattr
    class Fields(templates.AttributeTemplate):  # type: ignore[misc, name-defined]
        """Types of the fields of a structure."""

        key = stored

        def generic_resolve(self, kind, name: str) -> Any:
            return kind.fields[name][1] if name in kind.fields else None

    @numba.extending.lower_getattr_generic(stored)  # type: ignore[untyped-decorator]
    def read(context, builder, kind, address, name: str) -> Any:
        offset, field = kind.fields[name]
        if isinstance(field, stored):
            return builder.add(address, address.type(offset))
        if not isinstance(field, numba.types.Array):
            return load(builder, address, offset, context.get_value_type(field))
        data_type = context.get_data_type(field.dtype)
        size = context.get_constant(numba.types.intp, context.get_abi_sizeof(data_type))
        data = load(builder, address, offset, data_type.as_pointer())
        shape = [
            load(builder, address, offset + WORD_SIZE * (1 + axis), address.type)
            for axis in range(field.ndim)
        ]
        strides = [size]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        array = arrays.make_array(field)(context, builder)
        arrays.populate_array(
            array, data, shape=shape, strides=strides, itemsize=size, meminfo=None
        )
        return array._getvalue()


def array_writer() -> Any:
    """Return the intrinsic ``write(structure, arrays)``; see :func:`.parts.set_fields`."""
    arrayobj = import_module("numba.np.arrayobj")

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]
    def write(typing_context, structure, arrays) -> Any:
        def generate(context, builder, signature, values) -> Any:
            address = values[0]
            offset = 0
            for i, kind in enumerate(arrays.types):
                value = builder.extract_value(values[1], i)
                array = arrayobj.make_array(kind)(context, builder, value)
                lengths = [builder.extract_value(array.shape, axis) for axis in range(kind.ndim)]
                for word in (builder.ptrtoint(array.data, address.type), *lengths):
                    place = builder.add(address, address.type(offset))
                    builder.store(word, builder.inttoptr(place, address.type.as_pointer()))
                    offset += WORD_SIZE
            return context.get_dummy_value()

        return numba.types.void(structure, arrays), generate

    return write


@contextmanager
def without_vectorization() -> Iterator[None]:
    """Compile without vectorization of loops.

    Loops run over a few joints or rows: vectorization makes no step faster, but compilation 10 %
    slower.
    """
    config = numba.config
    before = config.LOOP_VECTORIZE
    config.LOOP_VECTORIZE = 0 if USED else before
    try:
        yield
    finally:
        config.LOOP_VECTORIZE = before


def entry_point(function) -> Callable[..., Any]:
    """Return the compiled code of a function, without the search for the types of its arguments.

    The caller passes arguments of the types for which it is compiled.
    """
    if not USED:
        compiled: Callable[..., Any] = function
        return compiled
    code: Callable[..., Any] = function.overloads[function.signatures[0]].entry_point
    return code
