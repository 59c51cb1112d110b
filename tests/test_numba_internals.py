"""What is assumed of private parts of numba, run on the installed version."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from vsconstraints.compiled import available, entry, load
from vsconstraints.compiled.structures import RowArrays, Size, StructWords, pack_struct
from vsconstraints.errors import InvalidInput

pytestmark = pytest.mark.skipif(not available(), reason="there is no compiler")


class Inner(NamedTuple):
    """A structure within a structure."""

    matrix: np.ndarray
    number: float


class Outer(NamedTuple):
    """Arrays of all kinds that structures hold, and numbers."""

    count: int
    vector: np.ndarray
    flags: np.ndarray
    inner: Inner
    records: np.ndarray


RECORD = np.dtype([("a", "f8", (2,)), ("b", "i8")])


def outer() -> Outer:
    """One with numbers in it."""
    records = np.zeros(3, RECORD)
    records["a"][2], records["b"][1] = (7.0, 8.0), 5
    return Outer(4, np.arange(5.0), np.array([True, False]), Inner(np.arange(6.0).reshape(2, 3), 2.5), records)


def test_compiled_code_reads_what_is_packed():
    """The layout of arrays, tuples and records in memory; Python reads the same by the same address."""
    compiler, parts = load("compiler"), load("parts")
    load_outer = parts.struct_loader(outer())

    def read(address: int) -> float:
        there = load_outer(address)
        there.inner.matrix[1, 2] = 50.0
        there.records[0].b = there.count
        total = there.inner.number + there.vector[3] + there.inner.matrix[1, 0] + there.records[2].a[1]
        return total + there.records[1].b + (100.0 if there.flags[0] and not there.flags[1] else 0.0)

    compiled_read = compiler.numba.njit("float64(int64)")(read)
    for function in (compiled_read, read):
        packed = outer()
        words = pack_struct(packed)
        assert function(words.ctypes.data) == 2.5 + 3.0 + 3.0 + 8.0 + 5.0 + 100.0
        assert (packed.inner.matrix[1, 2], packed.records["b"][0]) == (50.0, 4)


def test_functions_are_called_by_their_address():
    """By numba's convention of calls, with numbers, arrays and whole structures; in Python through a registry."""
    compiler, parts = load("compiler"), load("parts")
    numba = compiler.numba
    load_outer = parts.struct_loader(outer())

    @numba.njit(compiler.signature(compiler.INT, compiler.VECTOR, compiler.type_of(outer().inner)))
    def add(x: Any, inner: Any) -> int:
        x[0] += inner.number
        return x.size

    def use(function: int, address: int, x: Any) -> int:
        return parts.call_int_pointer(function, (x, load_outer(address).inner))

    packed = outer()
    words, x = pack_struct(packed), np.zeros(3)
    assert numba.njit("int64(int64, int64, float64[::1])")(use)(parts.address(add), words.ctypes.data, x) == 3
    assert use(parts.address(add), words.ctypes.data, x) == 3
    assert x[0] == 5.0


def test_parts_of_a_vector_are_matrices_and_tuples():
    compiler, parts = load("compiler"), load("parts")
    count = 3

    def read(numbers: Any) -> Any:
        part = parts.matrix_at(numbers, 2, 2, 3)
        part[1, 0] = 30.0
        return part[0, 0] + part[1, 2], parts.to_fixed_tuple(numbers[1:], count)

    for function in (compiler.numba.njit(read), read):
        numbers = np.arange(10.0)
        assert function(numbers) == (9.0, (1.0, 2.0, 3.0))
        assert numbers[5] == 30.0


def test_the_clock_goes_forward():
    compiler, parts = load("compiler"), load("parts")
    scratch = np.zeros(2, dtype=np.int64)
    clock = compiler.numba.njit(lambda scratch: parts.monotonic(scratch))
    times = [parts.monotonic(scratch), clock(scratch), parts.monotonic(scratch), clock(scratch)]
    assert times == sorted(times)
    assert times[-1] - times[0] < 100.0


def test_entry_points_are_found_without_a_look_at_types():
    step = load("step")
    words = pack_struct(Size(n=2).step()[0])
    function = entry(step.evaluate_step)
    assert function is not step.evaluate_step
    assert function(words.ctypes.data, 0.0, np.zeros(2), np.zeros(2)) == 0
    assert step.evaluate_step(words.ctypes.data, 0.0, np.zeros(3), np.zeros(3)) != 0


@pytest.mark.parametrize("address", [0, 8, "rows", "gone"])
def test_no_other_address_is_taken_from_python(address):
    """One at which nothing is, or something else, or something that does not live any more."""
    step, rows = load("step"), pack_struct(RowArrays(np.zeros(1), np.zeros((1, 1)), *(np.zeros(1),) * 8))
    at = {"rows": rows.ctypes.data, "gone": pack_struct(Size(n=1).step()[0]).ctypes.data}.get(address, address)
    for call in (
        lambda: step.evaluate_step(at, 0.0, np.zeros(1), np.zeros(1)),
        lambda: step.measure(at, np.zeros((1, 2)), np.ones(1), 0.0, 0.0),
        lambda: load("closed_loop").run(at, 0, 1, 0),
        lambda: load("laws").follow(at),
    ):
        with pytest.raises(InvalidInput, match="at the address"):
            call()


def test_words_live_as_long_as_what_they_are_of():
    words = pack_struct(outer())
    assert isinstance(words, StructWords)
    assert words.structure.count == 4
