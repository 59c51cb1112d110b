"""Closed loop: simulated steps per second, with log or scores only, and trials per second."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from multiprocessing.synchronize import Barrier
from time import perf_counter

import numpy as np

from vsconstraints.bench.evidence import Campaign, scored
from vsconstraints.bench.evidence.work import make_batch
from vsconstraints.controllers import make_controller
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import score_run, simulate

from .part import CASE_STUDY, Effort, Part, Table, controllers, digits, microseconds
from .steps import shortened
from .timing import unit_subject, without_old_garbage

TEXT = """
Whole simulations of the case study, for two laws also of the UR5: the check of the start, every \
step with everything
that is logged, and the scores of the run afterwards. *Scores only* is the same without anything \
that is logged,
compiled whole. Runs of all laws and blocks of the unit are taken in turn; within both, one step \
or call follows another
at once.
"""

SCENES = """
One drawn scene of the UR5 after another, without disturbances, with all laws of the default \
comparison and tracking:
drawing, setups, runs and scores, in one process that has its code loaded.
"""

TRIALS = """
Trials of the case study with the sliding mode, each from another start, in warm worker processes: \
making the setup,
simulating, and nothing stored. *efficiency* is the rate per core, relative to one core.
"""

UNIT_CALLS = 200


def measure(effort: Effort) -> Part:
    """Measure simulated steps per second."""
    part = Part("Closed loop", TEXT)
    case_study, ur5 = (
        shortened(Scenario.load(name), effort.duration) for name in (CASE_STUDY, "ur5-fov")
    )
    runs = {name: (case_study.setup(), law) for name, law in controllers().items()}
    runs |= {
        f"{name}, UR5": (ur5.setup(), make_controller(name))
        for name in ("sliding-mode", "hierarchical-qp")
    }
    for setup, law in runs.values():
        simulate(setup, law)
        score_run(setup, law)
    walls: dict[str, list[float]] = {name: [] for name in runs}
    steps: dict[str, list[float]] = {name: [] for name in runs}
    scored: dict[str, list[float]] = {name: [] for name in runs}
    units: list[float] = []
    unit = unit_subject()
    samples = dict.fromkeys(runs, 0)
    with without_old_garbage():
        for _ in range(effort.repeats):
            for name, (setup, law) in runs.items():
                units.extend(1e-9 * np.array([unit(i) for i in range(UNIT_CALLS)]))
                started = perf_counter()
                run = simulate(setup, law)
                walls[name].append(perf_counter() - started)
                started = perf_counter()
                score_run(setup, law)
                scored[name].append(perf_counter() - started)
                samples[name] = len(run.t)
                steps[name].append(float((run.rows_time + run.step_time).mean()))
    of_unit = float(np.median(units))
    lines = []
    for name in runs:
        step = float(np.median(walls[name])) / samples[name]
        inside = float(np.median(steps[name]))
        alone = float(np.median(scored[name])) / samples[name]
        part.numbers[f"{name}, scores: median"] = alone
        part.numbers[f"{name}, scores: ratio"] = alone / of_unit
        part.numbers[f"{name}: median"] = step
        part.numbers[f"{name}: ratio"] = step / of_unit
        lines.append(
            [
                name,
                f"{1.0 / step:.0f}",
                microseconds(step),
                microseconds(inside),
                digits(step / of_unit),
                microseconds(alone),
                digits(alone / of_unit),
                f"{runs[name][0].Ts / step:.0f}",
            ]
        )
    header = [
        "controller",
        "steps per second",
        "µs a step",
        "of them rows and command",
        "ratio",
        "scores only, µs",
        "ratio",
    ]
    header += ["times real time"]
    part.tables.append(Table(header, lines))
    return part


def measure_scenes(effort: Effort) -> Part:
    """Measure the time of a drawn scene with all laws of the default comparison."""
    part = Part("Drawn scenes", SCENES)
    campaign = Campaign.load().changed(conditions=("nominal",))
    (family,) = (family for family in campaign.families if family.name == "ur5")
    times = []
    for number in range(2 + effort.trials // 4):
        started = perf_counter()
        runs = scored(make_batch(campaign, family, [number])).runs.num_rows
        times.append(perf_counter() - started)
    part.numbers["ur5: median"] = found = float(np.median(times[1:]))
    lines = [["ur5", str(len(times) - 1), str(runs), f"{found:.3f}"]]
    part.tables.append(Table(["family", "scenes", "runs of a scene", "s a scene (median)"], lines))
    return part


def measure_trials(effort: Effort) -> Part:
    """Measure trials per second."""
    part = Part("Trials per second", TRIALS)
    lines = []
    cores = [count for count in (1, 2) if count <= (os.cpu_count() or 1)]
    if effort.trials < len(cores) * 2:
        cores = cores[:1]
    for count in cores:
        # spawned, as in comparisons
        context = get_context("spawn")
        ready = context.Barrier(count + 1)
        with ProcessPoolExecutor(
            count, mp_context=context, initializer=_get_ready, initargs=(ready,)
        ) as pool:
            for _ in range(count):
                # a worker starts for each task if no worker is idle
                pool.submit(int)
            ready.wait(timeout=120.0)
            started = perf_counter()
            found = list(
                pool.map(partial(_trial, duration=effort.duration), range(1, effort.trials + 1))
            )
            rate = len(found) / (perf_counter() - started)
        part.numbers[f"{count} cores: trials per second"] = rate
        efficiency = rate / count / part.numbers["1 cores: trials per second"]
        lines.append([str(count), str(len(found)), digits(rate), f"{efficiency:.2f}"])
    part.tables.append(Table(["cores", "trials", "trials per second", "efficiency"], lines))
    return part


def _get_ready(ready: Barrier) -> None:
    """Load all code in a worker, and wait for the other workers."""
    _trial(0, 0.05)
    ready.wait(timeout=120.0)


def _trial(number: int, duration: float) -> int:
    """Number of samples of one trial."""
    scenario = shortened(Scenario.load(CASE_STUDY), duration)
    setup = scenario.with_override("start_deviation", 0.01).setup(number)
    return len(simulate(setup, make_controller("sliding-mode")).t)
