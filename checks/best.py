"""``python -m checks.best [--scenes N] [--family F] [--laws NAMES] [--seconds S]``: what can be done at all on test set v1.

Says of each scene whether it is *reachable* (a motion is known that satisfies all rows and settles at the goal),
*separated* (it is proved that there is none) or *unknown*, and the best known motion, by the time in which it settles.
Motions are those of laws and, from these, of optimal control (``pip install 'vsconstraints[best]'``); each is judged by
the package's own rows, many times in each interval. Scenes that are in the table are not done again; ``--verify``
judges all motions in it once more, without optimal control.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from vsconstraints.comparisons.evidence import parquet
from vsconstraints.comparisons.evidence.parquet import Column
from vsconstraints.comparisons.evidence.work import Bench
from vsconstraints.comparisons.metrics import score
from vsconstraints.comparisons.metrics.measured import NEGLIGIBLE
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec
from vsconstraints.constraints import FieldOfView, ImageConstraint, Trace
from vsconstraints.errors import SceneError
from vsconstraints.robots.geometry import distances
from vsconstraints.rows import Array, BoolArray
from vsconstraints.scenarios.families.family import LIMITED, NOMINAL, SHIPPED
from vsconstraints.scenarios.families.frozen import TestSet
from vsconstraints.simulation import Setup
from vsconstraints.vision.features import CameraPose

TABLE = SHIPPED / "testset-v1-best.parquet"  #: that comes with the package
LAWS = "predictive,robust-hierarchical-qp,hierarchical-qp,cbf-filter"
OPTIONS: Mapping[str, Mapping[str, Any]] = {"hierarchical-qp": {"rows": "barrier"}}  #: as in the default comparison

REACHABLE, SEPARATED, UNKNOWN = "reachable", "separated", "unknown"
LAWS_ONLY = "laws only"
COLUMNS = (
    Column("family", "text", category=True),
    Column("half", "text", category=True),
    Column("scene", "whole"),
    Column("outcome", "text", category=True),
    Column("known_by", "text", category=True),  # "law NAME", "optimal control" or "proof: …", of the best motion
    Column("best_time_s", "number"),
    Column("law", "text", category=True),  # that settles soonest of those that succeed
    Column("law_time_s", "number"),
    Column("law_space", "number"),  # the greatest utilization of the laws that succeed
    Column("optimal_time_s", "number"),
    Column("acceleration", "text", category=True),  # what limits |q̈| of optimal control, or why there is none
    Column("solve_s", "number"),
    Column("motion", "text"),  # of optimal control
)

PARTS, PERIOD = 20, 1e-3  #: a motion is judged as often in each interval, and at least once in so many seconds
DIGITS = 4  #: of accelerations, in the table
MARGIN = {"px": 0.5, "m": 1e-3, "rad": 2e-3}  #: that rows are kept at first between nodes, by their units
#: Half the diagonal of a pixel, what a polyline may be off its curve, and the depth that counts as none [px].
SLACK = 0.5 * np.sqrt(2.0) + 0.25
ROUNDS = 3  #: how often it is made larger where a motion turns out to be outside between its nodes


class Motion(NamedTuple):
    """Accelerations (K, n), each held for an interval (K,) [s], from a setup's start; then the arm stands still."""

    intervals: Array
    qdd: Array

    def states(self, q0: Array, qd0: Array, until: float = 0.0) -> tuple[Array, Array, Array]:
        """Times (S,), q and q̇ (S, n), close together; as far as ``until`` [s] at least."""
        h = np.append(self.intervals, max(until - self.intervals.sum(), 0.0))
        qdd, begin, q, qd, t = np.vstack((self.qdd, 0.0 * q0)), 0.0, q0, qd0, []
        states = []
        for duration, a in zip(h, qdd, strict=True):
            parts = max(PARTS, int(np.ceil(duration / PERIOD)))
            s = np.arange(parts)[:, None] * duration / parts
            t.append(begin + s[:, 0])
            states.append((q + s * qd + 0.5 * s**2 * a, qd + s * a))
            q, qd, begin = q + duration * qd + 0.5 * duration**2 * a, qd + duration * a, begin + duration
        t, states = [*t, [begin]], [*states, (q[None], qd[None])]
        return np.concatenate(t), *(np.concatenate(each) for each in zip(*states, strict=True))

    def text(self) -> str:
        """As JSON, from which it is read bit by bit once it is :meth:`rounded`."""
        return json.dumps([self.intervals.tolist(), self.qdd.tolist()], separators=(",", ":"))

    @classmethod
    def read(cls, text: str) -> Motion:
        """From :meth:`text`."""
        return cls(*(np.array(part) for part in json.loads(text)))

    def rounded(self) -> Motion:
        """To the digits of the table."""
        return Motion(self.intervals.round(DIGITS + 4), self.qdd.round(DIGITS) + 0.0)


class Judgement(NamedTuple):
    """How deep a motion is outside each row (m,), as a fraction of L, and when it has settled [s]; NaN if it has not."""

    depth: Array
    settled: float

    @property
    def valid(self) -> bool:
        """Whether all rows are satisfied, by the strict standard, and the goal is reached."""
        return bool((self.depth <= NEGLIGIBLE).all() and np.isfinite(self.settled))


def judged(setup: Setup, motion: Motion) -> Judgement:
    """The motion by the package's own rows and scores; a marker behind the camera is as deep outside as can be."""
    constraints, goal, world = setup.constraints, setup.task.goals[0], setup.world()
    follows = setup.scene.motion is not None
    end = (setup.samples - 1) * setup.Ts if follows else motion.intervals.sum() + setup.tolerances.dwell_s
    t, q, qd = motion.states(setup.q0, setup.qd0, end)
    try:
        steps = [world.evaluate(*at) for at in zip(t.tolist(), q, qd, strict=True)]
    except SceneError:
        return Judgement(np.full(len(constraints.labels), np.inf), np.nan)
    pixels, points, R, p = (
        np.stack([getattr(step, name) for step in steps]) for name in ("pixels", "points", "camera_R", "camera_t")
    )
    trace = Trace(t, q, qd, pixels, points, setup.scene.camera.size, setup.scene)
    depth = -constraints.clearance(trace) / constraints.characteristic_length
    pose = distances(R, p, goal.camera) if goal.camera is not None else np.full((len(t), 2), np.nan)
    away = np.linalg.norm(pixels - goal.pixels, axis=2).max(axis=1)
    late = np.flatnonzero(~setup.reached(t, pose, away, qd))
    settled = 0.0 if not len(late) else t[late[-1] + 1] if late[-1] + 1 < len(t) else np.nan
    if end - settled < setup.tolerances.dwell_s - setup.Ts:
        settled = np.nan
    return Judgement(np.where(np.isnan(depth), np.inf, depth).max(axis=0), float(settled))


def separated(setup: Setup) -> str:
    """Why no motion can solve a scene: what closes a marker off from its goal in the image; empty if nothing is found.

    A marker's path in the image is continuous, whatever moves. Squares of one pixel count as allowed where any point of
    them is: by their centre's distance to the boundary, which is overestimated by :data:`SLACK`. Paths through allowed
    points then lead through squares that touch. Closed off is a marker none of whose pixels at poses within the goal's
    tolerances lie in squares that are connected to its first one. Rows that move are left out.
    """
    scene, goal, (distance, angle, near, _) = setup.scene, setup.task.goals[0], setup.goal_tolerances[0]
    if len(setup.task.goals) != 1:
        return ""
    still = [c for c in setup.constraints.constraints if isinstance(c, ImageConstraint) and c.motion is None]
    half = np.ceil(0.5 * np.asarray(scene.camera.size)) + 2.0
    u, v = (np.arange(-side, side + 1.0) for side in half)
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
    start = scene.glance(setup.q0)[0]
    for i, pixel in enumerate(start):
        rows = [c for c in still if c.markers is None or i + 1 in c.markers]
        # a field of view bounds what is filled, and alone closes nothing off
        if all(isinstance(c, FieldOfView) for c in rows) or not any(isinstance(c, FieldOfView) for c in rows):
            continue
        allowed = np.ones(len(grid), dtype=np.bool_)
        for c in rows:
            everywhere = np.repeat(grid, len(start), axis=1)
            trace = Trace(np.zeros(len(grid)), *[grid[:, :0, 0]] * 2, everywhere, everywhere, scene.camera.size, scene)
            at = i if c.markers is None else c.markers.index(i + 1)
            allowed &= c.clearance(trace, slice(0, 0))[:, at] > -SLACK
        parts, _ = ndimage.label(allowed.reshape(len(v), len(u)), np.ones((3, 3)))
        column, row = np.rint(pixel + half).astype(int)
        reach = near
        if isinstance(setup.task.feature, CameraPose):
            P = goal.camera.inverse.act(scene.markers)[i]
            off = distance + angle * np.linalg.norm(P)
            if off >= P[2]:
                continue
            slope = 1.0 + np.linalg.norm(P[:2]) / P[2]
            reach = max(scene.camera.focal) * off * slope / (P[2] - off)
        there = np.hypot(*np.moveaxis(grid[:, 0] - goal.pixels[i], -1, 0)).reshape(parts.shape) <= reach + SLACK
        if parts[row, column] and not (parts[there] == parts[row, column]).any():
            return f"marker {i + 1} is closed off from its goal in the image"
    return ""



class Known(NamedTuple):
    """A run of a law and what it scored."""

    law: str
    record: RunRecord
    result: Mapping[str, Any]

    @property
    def success(self) -> bool:
        """By the strict standard."""
        return self.result["status"] == "converged" and not self.result["violated"]


def runs_of(bench: Bench, laws: Sequence[str]) -> list[Known]:
    """All laws on a scene: those that succeed first, the soonest settled first of all."""
    baseline = bench.run(ControllerSpec(BASELINE))
    runs = []
    for law in laws:
        record = bench.run(ControllerSpec(law, options=OPTIONS.get(law, {})))
        runs.append(Known(law, record, score(record, baseline).result))
    runs.append(Known(BASELINE, baseline, score(baseline, baseline).result))
    order = {id(run): (not run.success, np.nan_to_num(run.result["settling_time_s"], nan=1e3)) for run in runs}
    return sorted((run for run in runs if len(run.record.trajectory.t) > 1), key=lambda run: order[id(run)])


class Planner:
    """Optimal control of one scene after the other; programs are kept for those that are alike."""

    def __init__(self, seconds: float) -> None:
        from . import optimal  # CasADi is there where it is needed

        self.optimal, self.seconds, self.programs = optimal, seconds, dict[str, Any]()

    def best(self, setup: Setup, limited: Setup | None, runs: Sequence[Known]) -> tuple[Motion | None, float, str]:
        """The best valid motion that is found in the time that there is, when it settles, and what limits |q̈|."""
        began, optimal = perf_counter(), self.optimal
        try:
            scene = optimal.written(setup)
        except optimal.NotCovered as what:
            return None, np.nan, f"{LAWS_ONLY}: {what}"
        n, best = setup.scene.robot.n, (None, np.inf, "")
        if scene.likeness not in self.programs:
            self.programs[scene.likeness] = optimal.Program(scene, n, setup.scene.motion is not None, self.seconds)
            began = perf_counter()
        program = self.programs[scene.likeness]
        actuators = np.full(n, np.inf) if limited is None else limited.limits.of_joint("acceleration", n)
        for guess, largest in guesses(optimal.Guess, setup, runs):
            for limit, said in ((actuators, "actuators"), (largest, "guess")):
                if not np.isfinite(limit).all() or (said == "guess" and (best[0] or np.isfinite(actuators).all())):
                    continue
                motion, settled = self.refined(program, setup, scene, limit, guess, began + self.seconds)
                if motion is not None and settled < best[1]:
                    best = motion, settled, said
            if perf_counter() - began > self.seconds:
                break
        return best

    def refined(
        self, program: Any, setup: Setup, scene: Any, limit: Array, guess: Any, until: float
    ) -> tuple[Motion | None, float]:
        """A valid motion, with larger margins where one turns out to be outside between its nodes."""
        constraints, length = setup.constraints, setup.constraints.characteristic_length
        margin = np.array([MARGIN.get(unit, 0.0) for unit in constraints.units])
        margin = np.minimum(margin, 0.5 * room(setup))
        for _ in range(ROUNDS):
            plan = program(setup, scene, limit, margin, guess)
            if plan is None:
                break
            motion = Motion(*plan).rounded()
            found = judged(setup, motion)
            if found.valid:
                return motion, found.settled
            if not np.isfinite(found.depth).all() or perf_counter() > until:
                break
            margin = margin + 1.5 * np.maximum(found.depth, 0.0) * length
            t, q, qd = motion.states(setup.q0, setup.qd0)
            guess = self.optimal.Guess(t, q, qd, motion.intervals[: self.optimal.INTERVALS].sum())
        return None, np.nan


def room(setup: Setup) -> Array:
    """(m,) clearance of each row at the start, at rest."""
    pixels, points = setup.scene.glance(setup.q0)
    trace = Trace(np.zeros(1), setup.q0[None], setup.qd0[None], pixels[None], points[None], setup.scene.camera.size)
    return np.maximum(setup.constraints.clearance(trace)[0], 0.0)


def guesses(kind: Any, setup: Setup, runs: Sequence[Known]) -> Any:
    """Where optimal control begins, and the largest |q̈| there (n,): runs, and the straight line to the end of the first."""
    for run in runs:
        path = run.record.trajectory
        late = np.flatnonzero(~run.record.settled)
        T = path.t[min(late[-1] + 1, len(path.t) - 1)] if len(late) else path.t[-1]
        largest = np.abs(path.qdd_command[path.t <= T]).max(axis=0)
        yield kind(path.t, path.q, path.qd, T), largest
        if run is runs[0] and setup.scene.motion is None:
            s = np.linspace(0.0, 1.0, 101)[:, None]
            q = setup.q0 + (3.0 - 2.0 * s) * s**2 * (path.q[-1] - setup.q0)
            t = T * s[:, 0]
            yield kind(t, q, np.gradient(q, t, axis=0), T), largest


def line_of(family: Any, half: str, number: int, laws: Sequence[str], planner: Planner | None) -> dict[str, Any]:
    """The table's line of a scene."""
    scene, setups = family.set_up(number, half)
    setup, began = setups[NOMINAL], perf_counter()
    runs = runs_of(Bench(scene, NOMINAL, scene.setup(NOMINAL)), laws)
    good = [run for run in runs if run.success]
    law_time = good[0].result["settling_time_s"] if good else np.nan
    spaces = [run.result["utilization"] for run in good if np.isfinite(run.result["utilization"])]
    proof = "" if good else separated(setup)
    motion, time, why = None, np.nan, ""
    began = perf_counter()
    if planner is not None and not proof:
        motion, time, why = planner.best(setup, setups.get(LIMITED), runs)
    known = f"law {good[0].law}" if good else f"proof: {proof}" if proof else ""
    if motion is not None and not time >= law_time:
        known = "optimal control"
    return {
        "family": family.name,
        "half": half,
        "scene": number,
        "outcome": SEPARATED if proof else REACHABLE if known else UNKNOWN,
        "known_by": known,
        "best_time_s": np.fmin(law_time, time if motion is not None else np.nan),
        "law": good[0].law if good else "",
        "law_time_s": law_time,
        "law_space": max(spaces, default=np.nan),
        "optimal_time_s": time if motion is not None else np.nan,
        "acceleration": why,
        "solve_s": perf_counter() - began,
        "motion": motion.text() if motion is not None else "",
    }
