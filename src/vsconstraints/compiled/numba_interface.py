"""Memory and functions at addresses, in compiled code, by numba's public interface alone.

Compiled code takes a structure of arrays by its address. :mod:`.memory` describes this memory as
a record: integers, floats, inner records, and for each array the address of its data and its shape.
A field of the structure is read when it is used.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..formulas import where
from . import accelerator
from .memory import memory_layout
from .signatures import ArrayType, Number, Reference, Signature

numba = import_module("numba")  # not typed
llvm = import_module("llvmlite.ir")

if numba.config.DISABLE_JIT:
    raise RuntimeError("NUMBA_DISABLE_JIT is set")

intrinsic = numba.extending.intrinsic
overload = numba.extending.overload
types = numba.types
literal_unroll = numba.literal_unroll

VOID = types.void
INT = types.int64
FLOAT = types.float64

#: Options of functions that only other compiled functions call, which make arrays or do not.
MAKES_ARRAYS = {"error_model": "numpy", **accelerator.PART}
PART = {**MAKES_ARRAYS, **accelerator.IN_PLACE}

WORD = llvm.IntType(64)  #: Addresses and integers.
WORD_SIZE = accelerator.WORD_SIZE


class Stored(types.Type):  # type: ignore[misc, name-defined]
    """Structure at an address.

    ``fields`` are offset [bytes] and type of each field, by name.
    """

    def __init__(self, name: str, fields: dict[str, tuple[int, Any]]) -> None:
        self.fields = fields
        super().__init__(name)


@numba.extending.register_model(Stored)
class _StoredModel(numba.extending.models.PrimitiveModel):  # type: ignore[misc, name-defined]
    """Representation of a structure by its address."""

    def __init__(self, manager, kind: Stored) -> None:
        super().__init__(manager, kind, WORD)


def stored_type(example, layout: np.dtype[Any]) -> Stored:
    """Return the type of structures like the example, whose memory has this layout."""
    fields = {}
    assert layout.fields is not None
    for name in example._fields:
        part = getattr(example, name)
        memory, offset = layout.fields[name][:2]
        if isinstance(part, tuple):
            kind = stored_type(part, memory)
        elif isinstance(part, np.ndarray):
            kind = types.Array(numba.from_dtype(part.dtype), part.ndim, "C")
        else:
            kind = FLOAT if memory.kind == "f" else INT
        fields[name] = offset, kind
        if not accelerator.USED:
            _add_attribute(name)
    described = [(name, offset, str(kind)) for name, (offset, kind) in fields.items()]
    digest = hashlib.sha256(repr(described).encode()).hexdigest()[:8]
    return Stored(f"{type(example).__name__}_{digest}", fields)


def numba_type(declared) -> Any:
    """Return the compiler's form of a declared type."""
    if isinstance(declared, Number):
        return getattr(types, declared.name)
    if isinstance(declared, ArrayType):
        dtype = getattr(types, declared.dtype)
        return types.Array(dtype, declared.ndim, "C", readonly=declared.readonly)
    if isinstance(declared, Reference):
        return stored_type(declared.example, memory_layout(declared.example))
    return types.Tuple([numba_type(part) for part in declared])


def numba_signature(declared: Signature) -> Any:
    """Return the compiler's form of a declared signature."""
    return numba_type(declared.result)(*[numba_type(part) for part in declared.arguments])


def part_of_others(function: Callable[..., Any], options: dict[str, Any]) -> None:
    """Let compiled functions call this one, which stays unchanged in Python."""
    numba.extending.register_jitable(**options, **accelerator.PART)(function)


def jit(signature: Signature, from_python: bool, options: dict[str, Any]) -> Callable[..., Any]:
    """Make a decorator that compiles for a signature and caches the result in numba's folder.

    Python calls the result, or compiled code calls it by its ``address``.
    """
    wanted = numba_signature(signature)
    compiler: Callable[..., Any]
    if from_python:
        compiler = numba.njit(wanted, cache=True, **accelerator.ENTRY, **options)
    else:
        compiler = numba.cfunc(wanted, cache=True, **options)
    return compiler


def settings() -> str:
    """Return the settings that compiled code depends on."""
    return f"{numba.config.BOUNDSCHECK} {accelerator.USED}"


_folders: dict[str, Path | None] = {}  #: Folders in which numba caches functions, by their files.


def cache_folder(function: Callable[..., Any]) -> Path | None:
    """Return the folder in which numba stores the code of a function; None if there is none."""
    file = inspect.getfile(function)
    if file not in _folders:
        try:
            _folders[file] = Path(numba.njit(cache=True)(function).stats.cache_path)
        except RuntimeError:
            _folders[file] = None
    return _folders[file]


_attributes: set[str] = set()  #: Names of fields that compiled code can read.


def _add_attribute(name: str) -> None:
    """Let compiled code read fields of this name."""
    if name in _attributes:
        return
    _attributes.add(name)

    @numba.extending.overload_attribute(  # type: ignore[untyped-decorator]
        Stored, name, jit_options=PART
    )
    def attribute(structure) -> Any:
        if name not in structure.fields:
            return None
        offset, kind = structure.fields[name]
        if isinstance(kind, types.Array):
            return _array_reader(offset, kind)
        return _reader(offset, kind)


def _load(builder, address, offset: int, kind) -> Any:
    """Load a value of an LLVM type, ``offset`` bytes after the address."""
    place = builder.add(address, llvm.Constant(WORD, offset))
    return builder.load(builder.inttoptr(place, kind.as_pointer()))


if accelerator.USED:
    accelerator.read_fields(Stored, _load)


def _loader(result, offset: int) -> Any:
    """Return the intrinsic that loads a value of a type, ``offset`` bytes after an address."""

    @intrinsic  # type: ignore[untyped-decorator]
    def load(typing_context, address) -> Any:
        def generate(context, builder, signature, values) -> Any:
            (base,) = values
            kind = context.get_value_type(result)
            return _load(builder, base, offset, kind)

        return result(address), generate

    return load


def _inner_address(kind: Stored, offset: int) -> Any:
    """Return the intrinsic for the structure that begins ``offset`` bytes within another one."""

    @intrinsic  # type: ignore[untyped-decorator]
    def refer(typing_context, structure) -> Any:
        def generate(context, builder, signature, values) -> Any:
            (base,) = values
            return builder.add(base, llvm.Constant(WORD, offset))

        return kind(structure), generate

    return refer


def _reader(offset: int, kind) -> Any:
    """Return the function that reads a number, or refers to an inner structure."""
    is_structure = isinstance(kind, Stored)
    load = _inner_address(kind, offset) if is_structure else _loader(kind, offset)

    def read(structure) -> Any:
        return load(structure)

    return read


def _array_reader(offset: int, kind) -> Any:
    """Return the function that makes an array of its address and its shape."""
    data = _loader(types.CPointer(kind.dtype), offset)
    shape = _loader(types.UniTuple(INT, kind.ndim), offset + WORD_SIZE)

    def read(structure) -> Any:
        return numba.carray(data(structure), shape(structure))

    return read


@intrinsic  # type: ignore[untyped-decorator]
def pointer_to_floats(typing_context, address) -> Any:
    """Convert an address to a pointer."""

    def generate(context, builder, signature, values) -> Any:
        (number,) = values
        pointer = context.get_value_type(signature.return_type)
        return builder.inttoptr(number, pointer)

    return types.CPointer(FLOAT)(types.intp), generate


@intrinsic  # type: ignore[untyped-decorator]
def write_word(typing_context, structure, offset, value) -> Any:
    """Write an integer to the memory of a structure."""

    def generate(context, builder, signature, values) -> Any:
        base, distance, word = values
        place = builder.add(base, distance)
        builder.store(word, builder.inttoptr(place, WORD.as_pointer()))
        return context.get_dummy_value()

    return VOID(structure, INT, INT), generate


@overload(where, jit_options=PART)  # type: ignore[untyped-decorator]
def _where(condition, x, y) -> Any:
    """Return the function that chooses a number, or makes an array."""

    def choose(condition, x, y) -> Any:
        return x if condition else y

    def as_numpy(condition, x, y) -> Any:
        return np.where(condition, x, y)

    number_types = types.Boolean, types.Number
    are_numbers = all(isinstance(part, number_types) for part in (condition, x, y))
    return choose if are_numbers else as_numpy


def load_as(function: Callable[..., Any], example) -> None:
    """Let compiled code call ``function(address)`` for the structure at an address.

    The fields have the types of the example's.
    """
    structure = numba_type(Reference(example))

    @intrinsic  # type: ignore[untyped-decorator]
    def refer(typing_context, address) -> Any:
        return structure(INT), lambda context, builder, signature, values: values[0]

    @overload(function, jit_options=PART)  # type: ignore[untyped-decorator]
    def load(address) -> Any:
        def implementation(address) -> Any:
            return refer(address)

        return implementation


def set_fields_as(function: Callable[..., Any]) -> None:
    """Let compiled code call ``function(structure, arrays)``.

    It writes where the arrays, a plain tuple, are in memory to the fields of the structure, in
    their order.
    """
    write: Any = accelerator.array_writer() if accelerator.USED else None

    @overload(function, jit_options=PART)  # type: ignore[untyped-decorator]
    def set_fields(structure, arrays) -> Any:
        def accelerated(structure, arrays) -> Any:
            write(structure, arrays)

        def implementation(structure, arrays) -> Any:
            offset = 0
            for array in literal_unroll(arrays):
                write_word(structure, offset, array.ctypes.data)
                offset += WORD_SIZE
                for length in array.shape:
                    write_word(structure, offset, length)
                    offset += WORD_SIZE

        return accelerated if accelerator.USED else implementation


def call_as(function: Callable[..., Any], result) -> None:
    """Let compiled code call ``function(address, arguments)`` for the C function at an address."""

    @intrinsic  # type: ignore[untyped-decorator]
    def call_pointer(typing_context, address, arguments) -> Any:
        count = len(arguments)

        def generate(context, builder, signature, values) -> Any:
            number, packed = values
            given = [builder.extract_value(packed, i) for i in range(count)]
            types_given = [value.type for value in given]
            result_type = context.get_value_type(result)
            function_type = llvm.FunctionType(result_type, types_given)
            pointer = builder.inttoptr(number, function_type.as_pointer())
            answer = builder.call(pointer, given)
            return context.get_dummy_value() if result == VOID else answer

        return result(INT, arguments), generate

    @overload(function, jit_options=PART)  # type: ignore[untyped-decorator]
    def call(address, arguments) -> Any:
        def implementation(address, arguments) -> Any:
            return call_pointer(address, arguments)

        return implementation


def matrix_at_as(function: Callable[..., Any]) -> None:
    """Let compiled code call ``function(numbers, at, rows, columns)`` for a part of a vector.

    The references to the resulting matrix are not counted.
    """

    @overload(function, jit_options=MAKES_ARRAYS)  # type: ignore[untyped-decorator]
    def matrix_at(numbers, at, rows, columns) -> Any:
        def implementation(numbers, at, rows, columns) -> Any:
            begin = pointer_to_floats(numbers.ctypes.data + WORD_SIZE * at)
            return numba.carray(begin, (rows, columns))

        return implementation


def fixed_tuple_as(function: Callable[..., Any]) -> None:
    """Let compiled code call ``function(array, count)`` for a tuple of fixed size.

    The size is known when the tuple is compiled. The array is contiguous.
    """

    @overload(function, prefer_literal=True, jit_options=PART)  # type: ignore[untyped-decorator]
    def to_tuple(array, count) -> Any:
        is_known = isinstance(count, types.IntegerLiteral)
        if array.layout != "C" or not is_known:
            return None
        numbers = types.UniTuple(array.dtype, count.literal_value)
        load = _loader(numbers, 0)

        def implementation(array, count) -> Any:
            return load(array.ctypes.data)

        return implementation


def monotonic_as(function: Callable[..., Any], clock: int) -> None:
    """Let compiled code call ``function(scratch)`` for the time of a clock [s].

    ``scratch`` contains two integers.
    """
    clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.intp))

    @overload(function, jit_options=PART)  # type: ignore[untyped-decorator]
    def monotonic(scratch) -> Any:
        def read(scratch) -> float:
            clock_gettime(clock, scratch.ctypes.data)
            seconds: float = scratch[0] + 1e-9 * scratch[1]
            return seconds

        return read
