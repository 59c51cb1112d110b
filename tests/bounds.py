"""Every law on the smallest and the emptiest problems there are; run with ``NUMBA_BOUNDSCHECK=1``.

Compiled code reads and writes wherever an index says. With that variable it raises IndexError
instead; functions that are called by their address report it as an exception that they cannot raise.
"""

from __future__ import annotations

import itertools
import sys
from collections import Counter
from typing import Any

import numpy as np

from vsconstraints.compiled import load
from vsconstraints.controllers import (
    CONTROLLERS,
    DEMANDS,
    RESOLVERS,
    VELOCITY_LAWS,
    Controller,
    Filter,
    Law,
    ResolvedRateAvoidance,
    Saturation,
    VelocityHierarchicalQP,
    VelocityQP,
)
from vsconstraints.errors import ConfigurationError
from vsconstraints.rows import Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

unraised: list[BaseException | None] = []  #: Errors in functions that are called by their address.
sys.unraisablehook = lambda error: unraised.append(error.exc_value)

BOXES = {"none": None, "wide": 100.0, "tight": 0.5, "zero": 0.0}


def problem(m: int, n: int, k: int, box: float | None, seed: int) -> tuple[Rows, Task]:
    """Rows that are outside, at and inside their boundaries, and a task at some speed."""
    rng = np.random.default_rng(seed)
    sigma = rng.normal(-0.2, 0.5, m)
    sigma_dot = rng.normal(0.0, 0.3, m)
    K = rng.uniform(0.2, 1.0, m)
    limits = {} if box is None else {"qdd_min": np.full(n, -box), "qdd_max": np.full(n, box)}
    rows = Rows(
        phi=sigma + K * sigma_dot,
        Lg=rng.normal(size=(m, n)),
        Lf=rng.normal(size=m),
        switching_gain=rng.uniform(0.5, 3.0, m),
        labels=tuple(f"row[{i}]" for i in range(m)),
        scale=rng.uniform(0.5, 1.5, m),
        sigma=sigma,
        sigma_dot=sigma_dot,
        K=K,
        **limits,
    )
    J = rng.normal(size=(k, n))
    J[:, seed % n] *= seed % 2  # now and then a joint that the task does not move
    error, error_rate = 0.2 * rng.normal(size=(2, k))
    return rows, Task(J, rng.normal(size=k), error, error_rate, qd=rng.normal(size=n))


def laws() -> list[Controller]:
    """Every law that needs no model of the scene."""
    resolvers = (
        *(resolver() for resolver in RESOLVERS),
        Filter(metric="task"),
        Saturation(scales=False),
    )
    pairs = [Law(demand(), resolver) for demand in DEMANDS for resolver in resolvers]
    return [
        *pairs,
        *(law() for law in CONTROLLERS.values() if "model" not in law().uses),
        VelocityQP(max_acceleration=5.0),
        VelocityHierarchicalQP(max_acceleration="limits"),
        ResolvedRateAvoidance(avoids="all", zone=0.5),
    ]


def alone() -> Counter[str]:
    """Answers of laws to single problems; how many there were of each status."""
    answers: Counter[str] = Counter()
    sizes = [
        (0, 1, 1),
        (0, 6, 6),
        (1, 1, 1),
        (1, 1, 3),
        (1, 6, 6),
        (1, 7, 6),
        (7, 3, 2),
        (4, 3, 0),
        (9, 6, 6),
    ]
    for law in laws():
        for (m, n, k), (_, box) in itertools.product(sizes, BOXES.items()):
            law.reset(period=0.01)
            for seed in range(3):
                command = law.command(*problem(m, n, k, box, seed))
                answers[command.status] += 1
                assert np.isfinite(command.qdd).all()
    return answers


def scenarios() -> Counter[str]:
    """Runs of all laws, with and without constraints and limits, and of scenes with everything that
    there is.
    """
    fewer: dict[str, Any] = {"duration": 0.05}
    limits = {"limits": {"acceleration": 0.1}}
    few = {"constraints": []}
    cases = [
        ("example-2d-fov", fewer),
        ("example-2d-fov", fewer | few),
        ("example-2d-fov", fewer | few | limits),
        ("example-2d-fov", fewer | limits),
        ("case-study-6r", fewer),
        ("case-study-6r", fewer | few | limits),
        ("panda-fov", fewer),
        ("moving-target-unknown", fewer),
        ("free-camera", fewer),
    ]
    endings: Counter[str] = Counter()
    for (name, changes), law in itertools.product(cases, CONTROLLERS):
        scenario = Scenario.load(name)
        for key, value in changes.items():
            scenario = scenario.with_override(key, value)
        if CONTROLLERS[law] in VELOCITY_LAWS:
            scenario = scenario.with_override("arm", {"command": "velocity", "lag": 0.01})
        try:
            run = simulate(scenario.setup(), CONTROLLERS[law]())
        except ConfigurationError as error:
            # such a law asks for something that the scene has not
            endings[f"refused: {error}"[:60]] += 1
            continue
        endings[run.status] += 1
        assert "IndexError" not in run.reason, (name, law, run.reason)
        assert "ZeroDivision" not in run.reason, (name, law, run.reason)
    return endings


if __name__ == "__main__":
    if load("compiler").compiles():
        assert load("compiler").numba.config.BOUNDSCHECK, "NUMBA_BOUNDSCHECK is not set"
    print(dict(alone()))
    print(dict(scenarios()))
    assert not unraised, unraised[0]
