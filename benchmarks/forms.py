"""Step of the case study in several forms, and a breakdown of the compiled form."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np

from vsconstraints.control import ControlStep
from vsconstraints.controllers import Controller, PotentialField, SlidingMode, Tracking
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Setup, Trajectory, simulate

from .appendix_b import AppendixB
from .part import CASE_STUDY, Effort, Part, Table, digits, hierarchical_qp, median_p99_max, ratios
from .steps import Walk, shortened
from .timing import UNIT, Array, Subject, Times, compare, in_turn

TEXT = """
The same samples of the case study, state in, command out, in several forms taken in turn. \
*Appendix B* is the paper's
algorithm in plain NumPy with two pseudoinverses (`benchmarks/appendix_b.py`). Some milliseconds \
of NumPy lie between
two calls of a compiled form, which finds the caches empty: it takes longer here than among its \
equals above.

The second table shows where the time goes: parts of one step, at one sample of the case study \
with three rows made
active.
"""


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("The case study's step in several forms", TEXT)
    scenario = shortened(Scenario.load(CASE_STUDY), effort.duration)
    setup = scenario.setup()
    run = simulate(setup, SlidingMode())
    laws: dict[str, Callable[[], Controller]] = {
        "sliding-mode": SlidingMode,
        "potential-field": PotentialField,
        "hierarchical-qp": lambda: hierarchical_qp("auto"),
        "hierarchical-qp with daqp": lambda: hierarchical_qp("daqp"),
    }
    walks: dict[str, Walk] = {}
    for name, law in laws.items():
        walks[name] = Walk(scenario.setup(), law(), run, effort.turns)
    subjects: dict[str, Subject] = {name: walk.in_one for name, walk in walks.items()}
    subjects["Appendix B in NumPy"] = appendix_b_walk(scenario, run, effort.turns)
    times = in_turn(subjects, effort.turns)
    unit = float(np.median(times[UNIT]))
    lines = []
    for name in subjects:
        total = Times(times[name], unit)
        part.keep(name, total)
        lines.append([name, median_p99_max(total), ratios(total), digits(total.spread)])
    part.tables.append(Table(["form", "µs: median / p99 / max", "ratio", "p99/median"], lines))
    part.tables.append(_where(part, setup, run, effort))
    return part


def appendix_b_walk(scenario: Scenario, run: Trajectory, turns: int) -> Subject:
    """Return a subject that times the transcription of Appendix B along the run."""
    law = AppendixB(scenario.tables)
    states = [
        (float(t), q.copy(), qd.copy()) for t, q, qd in zip(run.t, run.q, run.qd, strict=True)
    ]
    places = np.linspace(0, len(states) - 1, turns).astype(int)

    def turn(number: int) -> float:
        t, q, qd = states[places[number]]
        started = perf_counter_ns()
        law.step(t, q, qd)
        return perf_counter_ns() - started

    return turn


def three_active(setup: Setup, run: Trajectory) -> tuple[Rows, Task, tuple[float, Array, Array]]:
    """Rows and task at the sample with most active rows, with three rows made active.

    φ of the three greatest independent rows is raised to zero or above. The sample is returned too.
    """
    k = int(np.argmax(run.active.sum(axis=1)))
    state = (float(run.t[k]), run.q[k].copy(), run.qd[k].copy())
    step = ControlStep(setup.scene, setup.constraints, setup.task).evaluate(*state)
    phi = step.rows.phi.copy()
    # rows of both sides of a joint's range are opposite: only one is chosen
    chosen: list[int] = []
    for i in np.argsort(-phi):
        A = step.rows.Lg[[*chosen, i]]
        if np.linalg.matrix_rank(A) == len(A):
            chosen.append(int(i))
        if len(chosen) == 3:
            break
    phi[chosen] = np.maximum(phi[chosen], 0.0)
    others = np.setdiff1d(np.arange(len(phi)), chosen)
    phi[others] = np.minimum(phi[others], -1e-3)
    rows = Rows(
        phi, step.rows.Lg, step.rows.Lf, step.rows.switching_gain, step.rows.labels, step.rows.scale
    )
    return rows, step.task, state


def _where(part: Part, setup: Setup, run: Trajectory, effort: Effort) -> Table:
    rows, task, (t, q, qd) = three_active(setup, run)
    control, both = (ControlStep(setup.scene, setup.constraints, setup.task) for _ in range(2))
    to_command = ControlStep(setup.scene, setup.constraints, setup.task).bind(SlidingMode())
    law = SlidingMode()
    hierarchy = hierarchical_qp("auto")
    field = PotentialField()
    tracking = Tracking()
    m = len(rows.labels)
    n = task.J.shape[1]
    phi = rows.phi
    Lg = rows.Lg
    Lf = rows.Lf
    gain = rows.switching_gain
    scale = rows.scale
    J = task.J
    b = task.b
    qdd = np.empty(n)
    acted = np.empty(m, dtype=np.bool_)
    labels = rows.labels
    subjects: dict[str, Callable[[], object]] = {}
    bound_step = control.bound()
    if bound_step is not None:
        subjects["compiled function of rows and task"] = lambda: bound_step.evaluate(t, q, qd)
        bound = law.bind(rows, task, acted, qdd)
        if bound is not None:
            subjects["compiled function of the sliding mode"] = bound.solve
    subjects["ControlStep.command"] = lambda: both.command(law, t, q, qd)
    subjects["the function of ControlStep.bind"] = lambda: to_command(t, q, qd)
    subjects["ControlStep.evaluate"] = lambda: control.evaluate(t, q, qd)
    subjects["SlidingMode.command"] = lambda: law.command(rows, task)
    subjects["PotentialField.command"] = lambda: field.command(rows, task)
    subjects["Tracking.command"] = lambda: tracking.command(rows, task)
    subjects["HierarchicalQP.command"] = lambda: hierarchy.command(rows, task)
    subjects["making Rows and Task"] = lambda: (Rows(phi, Lg, Lf, gain, labels, scale), Task(J, b))
    subjects["making a Command"] = lambda: Command(qdd, "ok", acted, labels)
    times = compare(subjects, effort.turns)
    lines = []
    for name in subjects:
        part.keep(name, times[name])
        lines.append(
            [name, median_p99_max(times[name]), ratios(times[name]), digits(times[name].spread)]
        )
    return Table(
        [f"part ({m} rows, {n} joints)", "µs: median / p99 / max", "ratio", "p99/median"], lines
    )
