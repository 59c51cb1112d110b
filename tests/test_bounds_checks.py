"""No compiled code leaves its arrays: every law with bounds checks on problems without rows, joints
or room.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest


def output(script: str | Path, **variables: str) -> str:
    """What a script prints in a process of its own."""
    words = ["-c", script] if isinstance(script, str) else [str(script)]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", *words],
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def test_no_law_leaves_its_arrays() -> None:
    assert "'ok'" in output(Path(__file__).with_name("bounds.py"), NUMBA_BOUNDSCHECK="1")


WITHOUT_ROWS = """
import numpy as np
from vsconstraints.controllers import PredictiveControl
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

scenario = Scenario.load("example-2d-fov").with_override("duration", 0.02).with_override("constraints", [])
run = simulate(scenario.with_override("limits", {"acceleration": 0.05}).setup(), PredictiveControl())
print(run.status, run.reason, np.abs(run.qdd_command).max())
assert len(run.t) > 1 and np.isclose(np.abs(run.qdd_command).max(), 0.05)
"""


@pytest.mark.parametrize("compiled", ["0", "1"])
def test_a_plan_without_any_row_is_within_its_box(compiled: str) -> None:
    """Uncompiled, its division by the number of rows was a ZeroDivisionError."""
    assert "ZeroDivision" not in output(WITHOUT_ROWS, VSCONSTRAINTS_COMPILE=compiled)


BEYOND = """
import sys
import numpy as np
from vsconstraints.compiled import load
from vsconstraints.compiled.signatures import INT, VECTOR, signature

compiler, parts = load("compiler"), load("parts")

@compiler.compiled(signature(INT, VECTOR), from_python=False)
def beyond(x):
    x[x.size] = 1.0
    return 0

@compiler.compiled(signature(INT, INT, VECTOR))
def call(address, x):
    return parts.call_int_pointer(address, (x,))

sys.unraisablehook = lambda raised: print(raised.exc_type.__name__)
call(parts.address(beyond), np.zeros(3))
"""


def test_bounds_checks_see_code_that_is_called_by_its_address(tmp_path: Path) -> None:
    """They report the error, although a function that is called by its address cannot raise it."""
    script = tmp_path / "beyond.py"
    script.write_text(BEYOND, encoding="utf-8")
    assert output(script, NUMBA_BOUNDSCHECK="1", NUMBA_CACHE_DIR=str(tmp_path)) == "IndexError\n"
