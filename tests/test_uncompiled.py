"""The compiled functions as Python runs them, for debugging: the same commands, to rounding."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vsconstraints import compiled
from vsconstraints.compiled import available
from vsconstraints.control import ControlStep
from vsconstraints.controllers import Barrier, Law
from vsconstraints.controllers.resolvers import RESOLVERS
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

SCENARIOS = ("case-study-6r", "ur5-fov")
SAMPLES = 4


def numbers() -> dict[str, list[list[float]]]:
    """Of every resolver in every scenario: commands at states where rows act, and accelerations of
    a simulation.
    """
    found: dict[str, list[list[float]]] = {}
    for name in SCENARIOS:
        setup = Scenario.load(name).setup()
        step = ControlStep(setup.scene, setup.constraints, setup.task)
        for kind in RESOLVERS:
            random = np.random.default_rng(3)
            law = Law(Barrier(1.0), kind())
            commands = []
            for k in range(SAMPLES):
                q = setup.q0 + 0.02 * k * random.standard_normal(len(setup.q0))
                evaluation, command = step.command(
                    law, k * setup.Ts, q, 0.5 * random.standard_normal(len(q))
                )
                commands.append(
                    [
                        *command.qdd,
                        *evaluation.rows.phi,
                        *evaluation.rows.Lf,
                        *evaluation.rows.Lg.ravel(),
                    ]
                )
            found[f"{name}, {kind.name}: commands"] = np.array(commands).tolist()
            short = Scenario.load(name).with_override("duration", SAMPLES * setup.Ts).setup()
            run: Any = simulate(short, Law(Barrier(1.0), kind()))
            assert run.compiled == available(), "results say which form ran"
            found[f"{name}, {kind.name}: run"] = run.qdd_command[:SAMPLES].tolist()
    return found


@pytest.mark.skipif(not available(), reason="there is no compiler")
def test_python_runs_what_is_compiled():
    script = (
        f"import sys, json; sys.path.insert(0, {str(Path(__file__).parent)!r}); import "
        f"test_uncompiled as t\n"
    )
    script += "assert not t.available(); print(json.dumps(t.numbers()))"
    path = os.pathsep.join([str(Path(compiled.__file__).parents[2]), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        env={**os.environ, "VSCONSTRAINTS_COMPILE": "0", "PYTHONPATH": path},
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    in_python = json.loads(done.stdout)
    expected = numbers()
    assert in_python.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(in_python[name], values, rtol=1e-9, atol=1e-10, err_msg=name)
