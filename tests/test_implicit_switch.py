"""What the implicit switch with strict priorities promises, in one random start of each scenario of
its suite.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from vsconstraints.comparisons import Suite
from vsconstraints.comparisons.metrics import score
from vsconstraints.comparisons.run import perform
from vsconstraints.compiled import available

SUITE = Suite.load(Path(__file__).parents[1] / "comparisons" / "implicit-switch.toml")

LESS = {"panda-fov": 0.005}
"""By how much less of the space than the paper's law, which lets rows overshoot, it may use in a
scenario.
"""


@pytest.mark.skipif(not available(), reason="there is no compiler: this would take minutes")
@pytest.mark.parametrize("scenario", [scenario.name for scenario in SUITE.scenarios])
def test_the_implicit_switch_keeps_the_papers_promise_without_its_price(scenario: str) -> None:
    runs = {
        spec.controller.name: perform(spec).record
        for spec in SUITE.with_baseline().runs()
        if (spec.name, spec.trial) == (scenario, 1)
    }
    found: dict[str, dict[str, Any]] = {
        law: score(run, runs["tracking"]).result for law, run in runs.items()
    }
    paper, barrier, switch = (
        found[law] for law in ("sliding-mode", "hierarchical-qp", "implicit-switch")
    )
    assert (switch["status"], switch["violated"]) == ("converged", "")
    assert switch["acceleration_variation"] < 1.5 * barrier["acceleration_variation"]
    assert switch["acceleration_variation"] < 0.035 * paper["acceleration_variation"]
    assert switch["utilization"] >= paper["utilization"] - LESS.get(scenario, 0.0)
    uses = next(entry.make().uses for entry in SUITE.controllers if entry.name == "implicit-switch")
    assert uses == ("T_s",)
