"""Code that depends on private parts of numba.

``tests/test_numba_internals.py`` tests the assumptions about them. ``pyproject.toml`` bounds
numba's version from above by the last one with which these tests have passed. Private parts are
needed for calls by address and structures at an address: numba's first-class functions would take
fifty arrays one by one, through a wrapper in C, and cannot be stored in records.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

numba = import_module("numba")  # not typed
codegen = import_module("numba.core.codegen")
machinery = import_module("numba.core.compiler_machinery")
ir = import_module("numba.core.ir")
ir_utils = import_module("numba.core.ir_utils")
untyped_passes = import_module("numba.core.untyped_passes")

if numba.config.DISABLE_JIT:
    raise RuntimeError("NUMBA_DISABLE_JIT is set")

#: True if ``NUMBA_BOUNDSCHECK`` requests an IndexError for accesses outside an array.
CHECKS_BOUNDS = bool(numba.config.BOUNDSCHECK)

VOID = numba.types.void
INT = numba.types.int64
FLOAT = numba.types.float64
VECTOR = FLOAT[::1]
MATRIX = FLOAT[:, ::1]


class Library(codegen.JITCodeLibrary):  # type: ignore[misc, name-defined]
    """Library of code that is not optimised separately.

    The compiled functions that contain the code optimise it again anyway.
    """

    _final_module: Any

    def _optimize_final_module(self) -> None:
        """Do nothing."""

    def _finalize_final_module(self) -> None:
        """Make machine code only of the place that numba requires for each function's environment.

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


def where(condition: Any, x: Any, y: Any) -> Any:
    """Return ``np.where``; compiled code makes no arrays of it for single numbers."""
    return np.where(condition, x, y)


@numba.extending.overload(where)  # type: ignore[untyped-decorator]
def _where(condition: Any, x: Any, y: Any) -> Any:
    def choose(condition: Any, x: Any, y: Any) -> Any:
        return x if condition else y

    def as_numpy(condition: Any, x: Any, y: Any) -> Any:
        return np.where(condition, x, y)

    numbers = numba.types.Boolean, numba.types.Number
    return choose if all(isinstance(each, numbers) for each in (condition, x, y)) else as_numpy


@machinery.register_pass(mutates_CFG=False, analysis_only=False)
class WhereOfNumbers(machinery.FunctionPass):  # type: ignore[misc, name-defined]
    """Replace ``np.where`` by :func:`where` in the functions of this package only.

    Another overload of ``np.where`` itself would change the results of other packages' functions.
    """

    _name = "where_of_numbers"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        """Replace the calls in a function. Return True if anything was replaced."""
        code = state.func_ir
        replaced = False
        for block in code.blocks.values():
            for assignment in block.find_insts(ir.Assign):
                if _is_where(code, assignment.value):
                    assignment.value = ir.Global("where", where, assignment.loc)
                    code._definitions[assignment.target.name] = [assignment.value]
                    replaced = True
        return replaced


def _is_where(code: Any, value: Any) -> bool:
    """Return True if a value is ``np.where``, as an attribute of NumPy or imported by name."""
    if isinstance(value, ir.Expr) and value.op == "getattr" and value.attr == "where":
        module = ir_utils.guard(ir_utils.get_definition, code, value.value)
        return getattr(module, "value", None) is np
    return isinstance(value, (ir.Global, ir.FreeVar)) and value.value is np.where


class PartCompiler(import_module("numba.core.compiler").Compiler):  # type: ignore[misc]
    """Compiler with a :class:`Library` and with :class:`WhereOfNumbers`."""

    def define_pipelines(self) -> Any:
        """Return numba's pipelines, with this library and this pass."""
        state = self.state
        state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.add_pass_after(WhereOfNumbers, untyped_passes.IRProcessing)
            pipeline.finalize()
        return pipelines


def part_of_others(function: Callable[..., Any], options: dict[str, Any]) -> None:
    """Let compiled functions call this one, which stays unchanged in Python."""
    inner = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": PartCompiler}
    numba.extending.register_jitable(**options, **inner)(function)


def jit(signature: Any, from_python: bool, options: dict[str, Any]) -> Callable[..., Any]:
    """Make a decorator that compiles for a signature and caches the result in numba's folder."""
    compiler: Callable[..., Any] = numba.njit(
        signature, cache=True, no_cfunc_wrapper=True, no_cpython_wrapper=not from_python, **options
    )
    return compiler


def address(function: Any) -> int:
    """Return the address of a compiled function of one signature.

    It is valid as long as the function is kept.
    """
    result = function.overloads[function.signatures[0]]
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


def intrinsic(
    function: Callable[..., Any], prefer_literal: bool = False
) -> Callable[[Callable[..., Any]], Any]:
    """Make a decorator of the definition that compiled code uses where Python calls ``function``.

    See ``numba.extending.intrinsic``.
    """

    def decorate(definition: Callable[..., Any]) -> None:
        templates = numba.core.typing.templates
        template = templates.make_intrinsic_template(
            function, definition, function.__name__, prefer_literal=prefer_literal
        )
        templates.infer_global(function, numba.types.Function(template))

    return decorate


class Stored(numba.types.Type):  # type: ignore[misc, name-defined]
    """Structure of arrays stored at an address, of which only the used fields are read.

    Code that handles whole structures takes several times as long to compile.
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
    # with reference counting, the returned field is one more reference
    return numba.core.imputils.impl_ret_borrowed(
        context, builder, kind.structure.types[i], builder.load(field)
    )


def load_as(function: Callable[..., Any], example: Any) -> None:
    """Let compiled code call ``function(address)`` to load the structure at an address.

    The fields have the types of the example's.
    """
    structure = numba.typeof(example)

    @intrinsic(function)
    def load(typing_context: Any, address: Any) -> Any:
        return Stored(structure)(address), lambda context, builder, signature, values: values[0]


def call_as(function: Callable[..., Any], result: Any) -> None:
    """Let compiled code call ``function(address, arguments)`` for the function at an address.

    Structures are passed as a whole.
    """

    @intrinsic(function)
    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            types = []
            unpacked = []
            for i, argument in enumerate(signature.args[1].types):
                value = builder.extract_value(values[1], i)
                if isinstance(argument, Stored):
                    argument = argument.structure
                    value = builder.load(
                        builder.inttoptr(value, context.get_value_type(argument).as_pointer())
                    )
                types.append(argument)
                unpacked.append(value)
            kind = context.call_conv.get_function_type(result, types)
            pointer = builder.inttoptr(values[0], kind.as_pointer())
            status, answer = context.call_conv.call_function(
                builder, pointer, result, types, unpacked
            )
            # only bounds checks raise in compiled code
            if CHECKS_BOUNDS:
                with builder.if_then(status.is_error):
                    context.call_conv.return_status_propagate(builder, status)
            return context.get_dummy_value() if result == VOID else answer

        return result(address, arguments), generate


def matrix_at_as(function: Callable[..., Any]) -> None:
    """Let compiled code call ``function(numbers, at, rows, columns)`` for a part of a vector.

    The references to the resulting matrix are not counted.
    """

    @intrinsic(function)
    def matrix_at(typing_context: Any, numbers: Any, at: Any, rows: Any, columns: Any) -> Any:
        kind = numba.types.Array(numbers.dtype, 2, "C")
        arrays = numba.np.arrayobj

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            begin = builder.gep(
                arrays.make_array(numbers)(context, builder, values[0]).data, [values[1]]
            )
            each = context.get_constant(
                numba.types.intp, context.get_abi_sizeof(context.get_data_type(numbers.dtype))
            )
            part = arrays.make_array(kind)(context, builder)
            strides = builder.mul(values[3], each), each
            arrays.populate_array(
                part, begin, shape=values[2:], strides=strides, itemsize=each, meminfo=None
            )
            return part._getvalue()

        return kind(numbers, *[numba.types.intp] * 3), generate


def fixed_tuple_as(function: Callable[..., Any]) -> None:
    """Let compiled code call ``function(array, count)`` for a tuple of fixed size.

    The size is known when the tuple is compiled.
    """
    intrinsic(function)(import_module("numba.np.unsafe.ndarray").to_fixed_tuple._defn)


def monotonic_as(function: Callable[..., Any], clock: int) -> None:
    """Let compiled code call ``function(scratch)`` for the time of a clock [s].

    ``scratch`` contains two integers.
    """
    clock_gettime = numba.types.ExternalFunction(
        "clock_gettime", numba.types.int32(numba.types.int32, numba.types.intp)
    )

    @numba.extending.overload(function, jit_options={"_nrt": False})  # type: ignore[untyped-decorator]
    def monotonic(scratch: Any) -> Any:
        def read(scratch: Any) -> float:
            clock_gettime(clock, scratch.ctypes.data)
            seconds: float = scratch[0] + 1e-9 * scratch[1]
            return seconds

        return read


def state_of(formulas: tuple[Any, ...]) -> bytes:
    """Return bytes that differ if formulas, or their closures, differ."""
    dumped: bytes = numba.core.serialize.dumps(formulas)
    return dumped
