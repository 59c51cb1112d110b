"""A compiler that fails in the middle of a process: no compiled code calls what is not compiled."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from vsconstraints.compiled import load

pytestmark = pytest.mark.skipif(not load("compiler").compiles(), reason="there is no compiler")


def lines_of(script: str, **variables: str) -> list[str]:
    """What a script prints in a process of its own; a crash of it fails the test."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-3000:]}"
    return done.stdout.splitlines()


FAIL = """
from vsconstraints.compiled import load

def fail():
    "From now on, the compiler fails."
    def refuse(*_):
        raise RuntimeError("provoked")
    load("compiler")._compiled = refuse
"""

CALLERS = """
import numpy as np
from vsconstraints.compiled.signatures import INT, VECTOR, signature

compiler, parts = load("compiler"), load("parts")

def caller():
    @parts.checked()
    @compiler.compiled(signature(INT, INT, VECTOR))
    def call(address, x):
        return parts.call_int_pointer(address, (x,))
    return call

def callee(answer):
    def called(x):
        return answer
    return compiler.compiled(signature(INT, VECTOR), from_python=False)(called)

x = np.zeros(3)
compiled = parts.address(callee(1))
call = caller()
bound = call.bind()
fail()
plain = parts.address(callee(2))
print(call(compiled, x), call(plain, x), bound(compiled, x))
print(call.bind()(compiled, x), call.bind(typed=True)(plain, x), caller()(compiled, x))
try:
    call(plain, [0.0])
except TypeError:
    print("refused")
"""


def test_compiled_functions_call_no_address_of_a_function_in_python(tmp_path) -> None:
    """Such an address is none of machine code: a compiled caller would end the process there."""
    out = lines_of(FAIL + CALLERS, NUMBA_CACHE_DIR=str(tmp_path), VSCONSTRAINTS_COMPILE="alone")
    assert out == ["1 2 1", "1 2 1", "refused"]


RUNS = """
import numpy as np
from vsconstraints.controllers import Barrier, Law
from vsconstraints.controllers.resolvers import Hierarchy, Projection
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

def run(scenario, resolver):
    setup = Scenario.load(scenario).with_override("duration", 0.004).setup()
    done = simulate(setup, Law(Barrier(1.0), resolver()))
    print(done.compiled, *done.qdd_command.ravel().tolist(), *done.phi.ravel().tolist())

for module in ("laws", "step", "closed_loop"):
    load(module)
run("ur5-fov", Projection)
FAILURE
run("ur5-fov", Hierarchy)
run("case-study-6r", Projection)
"""


def test_runs_after_a_failure_of_the_compiler_are_those_in_python() -> None:
    """Its compiled step and loop exist already, while resolver and rows do not."""
    expected = lines_of(FAIL + RUNS.replace("FAILURE", ""))
    found = lines_of(FAIL + RUNS.replace("FAILURE", "fail()"))
    assert [line.split()[0] for line in expected] == ["True"] * 3
    assert [line.split()[0] for line in found] == ["True", "False", "False"]
    for mine, theirs in zip(found, expected, strict=True):
        numbers = [np.array(line.split()[1:], dtype=float) for line in (mine, theirs)]
        np.testing.assert_allclose(*numbers, rtol=1e-9, atol=1e-10)
