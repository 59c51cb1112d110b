"""Memory and functions that compiled code uses by their addresses."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from vsconstraints.compiled import load
from vsconstraints.compiled.memory import Workspace, zeros
from vsconstraints.compiled.signatures import INT, VECTOR, Reference, signature
from vsconstraints.compiled.workspace import RowArrays, Size
from vsconstraints.errors import InvalidInput

pytestmark = pytest.mark.skipif(not load("compiler").compiles(), reason="there is no compiler")


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
    assert out.size == 2 * 2 + 4 * (1 + 2 + 1 + 1 + 1) + 6 * 2 + 6 * 3 + 0 + 2 + 3 * 2 + 0 + 9 + 3
    step.rows.Lg[3, 1] = 5.0
    step.camera_t[2] = 7.0
    assert (out[4 + 4 + 7], out[-1]) == (5.0, 7.0), "outputs are parts of one array"


def test_a_structure_can_refer_to_other_arrays():
    compiler = load("compiler")
    parts = load("parts")
    load_inner = parts.struct_loader(outer().inner)

    class Pair(NamedTuple):
        """A vector and a matrix."""

        vector: np.ndarray
        matrix: np.ndarray

    load_pair = parts.struct_loader(Pair(np.zeros(1), np.zeros((1, 1))))

    def refer(pair: int, source: int, vector: Any) -> float:
        shared = load_pair(pair)
        parts.set_fields(shared, (vector, load_inner(source).matrix))
        return shared.vector[3] + shared.matrix[1, 2] + len(shared.vector)

    for function in (compiler.numba.njit(refer), refer):
        pair = Workspace(Pair(np.zeros(1), np.zeros((1, 1))))
        inner = Workspace(outer().inner)
        assert function(pair.address, inner.address, np.arange(4.0)) == 3.0 + 5.0 + 4.0


BY_ADDRESS = "reads_what or called_by or parts_of_a_vector or clock or refer_to_other"


def test_all_this_works_without_private_parts_of_numba():
    environment = {**os.environ, "VSCONSTRAINTS_ACCELERATOR": "0"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-n",
        "0",
        "-m",
        "",
        "-k",
        BY_ADDRESS,
        __file__,
    ]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout
    assert "5 passed" in done.stdout


NEWER = """
import numba
numba.__version__ = "0.999.1"
from vsconstraints.compiled import accelerator, load
assert load("polylines").search.signatures
assert not accelerator.USED
"""


def test_a_newer_numba_is_used_without_its_private_parts_and_a_note_says_so(tmp_path: Path):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", NEWER],
        env={
            **os.environ,
            "NUMBA_CACHE_DIR": str(tmp_path),
            "VSCONSTRAINTS_COMPILE": "alone",
        },
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "numba 0.999.1 is newer than those whose compilation is accelerated" in done.stderr


def test_a_users_own_compiled_function_is_compiled_as_without_this_package():
    compiler = load("compiler")
    choose = compiler.numba.njit(lambda x: np.where(x > 0.0, x, 0.5))
    assert isinstance(choose(-1.0), np.ndarray)


def test_a_structure_with_an_array_in_another_order_is_refused():
    with pytest.raises(InvalidInput, match="contiguous"):
        Workspace(Inner(np.zeros((2, 3)).T, 1.0))


def test_an_axis_without_a_length_is_refused_by_its_name() -> None:
    """Without any lengths a structure only shows its types."""
    assert zeros(RowArrays).Lg.shape == (1, 1)
    rows = zeros(RowArrays, {"m": 3, "n": 2, "limits": 0})
    assert (rows.Lg.shape, rows.qdd_min.shape) == ((3, 2), (0,))
    for missing in ("m", "n", "limits"):
        known = {axis: 1 for axis in ("m", "n", "limits") if axis != missing}
        told = f"axis '{missing}' has no length; axes with one are {', '.join(known)}"
        with pytest.raises(InvalidInput, match=told):
            zeros(RowArrays, known)
