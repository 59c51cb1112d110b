"""Time of the first call of each named controller [s], as JSON; run in a separate process."""

from __future__ import annotations

import json
import sys
from time import perf_counter


def first_calls(names: list[str]) -> dict[str, float]:
    """Time imports, setup, and the first and second step of each controller on the case study."""
    started = perf_counter()
    from vsconstraints.control import ControlStep
    from vsconstraints.controllers import make_controller
    from vsconstraints.scenarios import Scenario

    imported = perf_counter()
    setup = Scenario.load("case-study-6r").setup()
    built = perf_counter()
    control = ControlStep(setup.scene, setup.constraints, setup.task)
    step = control.evaluate(0.0, setup.q0, setup.qd0)
    evaluated = perf_counter()
    found = {"imports": imported - started, "setup": built - imported, "rows": evaluated - built}
    for name in names:
        law = make_controller(name)
        before = perf_counter()
        law.command(step.rows, step.task)
        found[name] = perf_counter() - before
    before = perf_counter()
    control.evaluate(0.002, setup.q0, setup.qd0)
    found["rows again"] = perf_counter() - before
    return found


if __name__ == "__main__":
    print(json.dumps(first_calls(sys.argv[1:])))
