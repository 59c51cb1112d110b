"""Memory and functions that compiled code uses by their addresses."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from vsconstraints.compiled import available, load
from vsconstraints.compiled.signatures import INT, VECTOR, Reference, signature
from vsconstraints.compiled.workspace import RowArrays, Size, Workspace
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
    records["a"][2] = (7.0, 8.0)
    records["b"][1] = 5
    return Outer(
        4,
        np.arange(5.0),
        np.array([True, False]),
        Inner(np.arange(6.0).reshape(2, 3), 2.5),
        records,
    )


def test_compiled_code_reads_what_is_packed():
    """Numbers, arrays, inner structures and records; Python reads the same by the same address."""
    compiler = load("compiler")
    parts = load("parts")
    load_outer = parts.struct_loader(outer())

    def read(address: int) -> float:
        there = load_outer(address)
        there.inner.matrix[1, 2] = 50.0
        there.records[0].b = there.count
        total = (
            there.inner.number + there.vector[3] + there.inner.matrix[1, 0] + there.records[2].a[1]
        )
        return (
            total + there.records[1].b + (100.0 if there.flags[0] and not there.flags[1] else 0.0)
        )

    compiled_read = compiler.numba.njit("float64(int64)")(read)
    for function in (compiled_read, read):
        packed = outer()
        workspace = Workspace(packed)
        assert function(workspace.address) == 2.5 + 3.0 + 3.0 + 8.0 + 5.0 + 100.0
        assert (packed.inner.matrix[1, 2], packed.records["b"][0]) == (50.0, 4)


def test_functions_are_called_by_their_address():
    """With numbers, arrays and structures; in Python through a registry."""
    compiler = load("compiler")
    parts = load("parts")
    numba = compiler.numba
    load_outer = parts.struct_loader(outer())

    @compiler.compiled(signature(INT, VECTOR, Reference(outer().inner)), from_python=False)
    def add(x: Any, inner: Any) -> int:
        x[0] += inner.number
        return x.size

    def use(function: int, address: int, x: Any) -> int:
        return parts.call_int_pointer(function, (x, load_outer(address).inner))

    packed = outer()
    workspace = Workspace(packed)
    x = np.zeros(3)
    assert (
        numba.njit("int64(int64, int64, float64[::1])")(use)(
            parts.address(add), workspace.address, x
        )
        == 3
    )
    assert use(parts.address(add), workspace.address, x) == 3
    assert x[0] == 5.0


def test_parts_of_a_vector_are_matrices_and_tuples():
    compiler = load("compiler")
    parts = load("parts")
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
    compiler = load("compiler")
    parts = load("parts")
    scratch = np.zeros(2, dtype=np.int64)
    clock = compiler.numba.njit(lambda scratch: parts.monotonic(scratch))
    times = [parts.monotonic(scratch), clock(scratch), parts.monotonic(scratch), clock(scratch)]
    assert times == sorted(times)
    assert times[-1] - times[0] < 100.0


def test_functions_for_loops_take_a_workspace_once():
    step = load("step")
    workspace = Workspace(Size(n=2).step()[0])
    evaluate = step.evaluate_step.bind(workspace)
    assert evaluate(0.0, np.zeros(2), np.zeros(2)) == 0
    assert step.evaluate_step.bind(workspace, typed=True)(0.0, np.zeros(2), np.zeros(2)) == 0
    assert step.evaluate_step(workspace, 0.0, np.zeros(3), np.zeros(3)) != 0
    with pytest.raises(TypeError):
        step.evaluate_step.bind(workspace, typed=True)(0.0, np.zeros(2, np.int64), np.zeros(2))


@pytest.mark.parametrize("what", [0, 8, None, "address", "rows", "tuple"])
def test_functions_take_nothing_but_workspaces_of_their_kind(what):
    """No number, not even the address of a workspace that is there, and no workspace of another
    structure.
    """
    there = Workspace(Size(n=1).step()[0])
    rows = RowArrays(np.zeros(1), np.zeros((1, 1)), *(np.zeros(1),) * 8)
    given = {"address": there.address, "rows": Workspace(rows), "tuple": there.structure}.get(
        what, what
    )
    for call in (
        lambda: load("step").evaluate_step(given, 0.0, np.zeros(1), np.zeros(1)),
        lambda: load("step").measure(given, np.zeros((1, 2)), np.ones(1), 0.0, 0.0),
        lambda: load("step").evaluate_step.bind(given),
        lambda: load("closed_loop").run(given, 0, 1, 0),
        lambda: load("laws").follow(given),
        lambda: load("from_state").command_by.bind(there, given, given),
    ):
        with pytest.raises(InvalidInput, match="takes a workspace of"):
            call()


def test_every_declared_array_is_made_with_its_type_and_shape():
    """By hand, for a step of two joints, three markers, four rows and six features, whose q̈ has a
    box.
    """
    step, out = Size(n=2, M=3, m=4, k=6, parts=1, parameters=5, limited=True).step()
    shapes = {
        "joints": (2,),
        "goal_points": (1, 6),
        "parameters": (1, 5),
        "bodies": (3,),
        "which": (4,),
        "last_J": (6, 2),
    }
    assert {name: getattr(step, name).shape for name in shapes} == shapes
    assert (step.rows.qdd_max.shape, step.task.rest.shape, step.which.dtype) == (
        (2,),
        (0,),
        np.int64,
    )
    assert step.parts.dtype["motion"]["velocity"].shape == (3,)
    assert out.size == 2 * 2 + 4 * (1 + 2 + 1 + 1 + 1) + 6 * 2 + 6 * 3 + 0 + 3 * 2 + 0 + 9 + 3
    step.rows.Lg[3, 1] = 5.0
    step.camera_t[2] = 7.0
    assert (out[4 + 4 + 7], out[-1]) == (5.0, 7.0), "outputs are parts of one array"
