"""``python -m checks.best [--scenes N] [--family F] [--laws NAMES] [--seconds S]``.

Classifies scenes of test set v1 as *reachable* (a motion is known that satisfies all rows and
settles at the goal), *separated* (it is proved that no such motion exists) or *unknown*, and finds
the best known motion, by its settling time. Motions are those of laws and, starting from them, of
optimal control (``pip install 'vsconstraints[best,evidence]'``). They are judged by the package's
own rows, at close intervals. Scenes in the table are not repeated, except unknown ones with
``--again``. ``--verify`` judges all motions in the table once more, without a solver.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from vsconstraints.bench.evidence import parquet
from vsconstraints.bench.evidence.parquet import Column
from vsconstraints.bench.evidence.work import Bench
from vsconstraints.bench.families import Drawn, Family
from vsconstraints.bench.families.family import LIMITED, NOMINAL, SHIPPED
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.comparisons.metrics import NEGLIGIBLE, score
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec
from vsconstraints.constraints import FieldOfView, ImageConstraint, Trace
from vsconstraints.errors import ConfigurationError, SceneError
from vsconstraints.robots.geometry import distances
from vsconstraints.rows import Array, BoolArray
from vsconstraints.simulation import Setup
from vsconstraints.vision.features import CameraPose

TABLE = SHIPPED / "testset-v1-best.parquet"  #: Table that is shipped with the package.
LAWS = "predictive,robust-hierarchical-qp,hierarchical-qp,cbf-filter"
#: Options as in the default comparison.
OPTIONS: Mapping[str, Mapping[str, Any]] = {"hierarchical-qp": {"rows": "barrier"}}

REACHABLE = "reachable"
SEPARATED = "separated"
UNKNOWN = "unknown"
LAWS_ONLY = "laws only"
COLUMNS = (
    Column("family", "text", category=True),
    Column("half", "text", category=True),
    Column("scene", "whole"),
    Column("outcome", "text", category=True),
    # "law NAME", "optimal control" or "proof: …", for the best motion
    Column("known_by", "text", category=True),
    Column("best_time_s", "number"),
    Column("law", "text", category=True),  # successful law that settles first
    Column("law_time_s", "number"),
    Column("law_space", "number"),  # greatest utilization of the successful laws
    Column("optimal_time_s", "number"),
    # limit on |q̈| in optimal control, or reason for its absence
    Column("acceleration", "text", category=True),
    # least time of the slowest joint alone, with the limits of actuators
    Column("least_time_s", "number"),
    Column("solve_s", "number"),
    Column("motion", "text"),  # motion of optimal control
)

PARTS = 20  #: Number of checked states in each interval, and longest time between two [s].
PERIOD = 1e-3
DIGITS = 4  #: Decimal digits of accelerations in the table.
#: Initial margin of rows between nodes, by unit.
MARGIN = {"px": 0.5, "m": 1e-3, "rad": 2e-3}
#: Number of attempts; each has a larger margin if the last motion was outside between nodes.
ROUNDS = 3
#: Half the diagonal of a pixel, and greatest depth of a violation that is neglected [px].
SLACK = 0.75
STARTS = 2  #: Number of valid motions from different guesses, of which the best one counts.


class Motion(NamedTuple):
    """Accelerations (K, n), each held for an interval (K,) [s], from a setup's start.

    Afterwards the arm stands still.
    """

    intervals: Array
    qdd: Array

    def states(self, q0: Array, qd0: Array, until: float = 0.0) -> tuple[Array, Array, Array]:
        """Times (S,), q and q̇ (S, n) at close intervals, at least up to ``until`` [s]."""
        h = np.append(self.intervals, max(until - self.intervals.sum(), 0.0))
        qdd = np.vstack((self.qdd, 0.0 * q0))
        begin = 0.0
        q = q0
        qd = qd0
        t = []
        states = []
        for duration, a in zip(h, qdd, strict=True):
            parts = max(PARTS, int(np.ceil(duration / PERIOD)))
            s = np.arange(parts)[:, None] * duration / parts
            t.append(begin + s[:, 0])
            states.append((q + s * qd + 0.5 * s**2 * a, qd + s * a))
            q = q + duration * qd + 0.5 * duration**2 * a
            qd = qd + duration * a
            begin = begin + duration
        t = [*t, [begin]]
        states = [*states, (q[None], qd[None])]
        return np.concatenate(t), *(np.concatenate(each) for each in zip(*states, strict=True))

    def text(self) -> str:
        """Return the motion as JSON; after :meth:`rounded` it can be read without loss."""
        return json.dumps([self.intervals.tolist(), self.qdd.tolist()], separators=(",", ":"))

    @classmethod
    def read(cls, text: str) -> Motion:
        """Read the motion from :meth:`text`."""
        return cls(*(np.array(part) for part in json.loads(text)))

    def rounded(self) -> Motion:
        """Round the motion to the digits of the table."""
        return Motion(self.intervals.round(DIGITS + 4), self.qdd.round(DIGITS) + 0.0)


class Judgement(NamedTuple):
    """Violation depth of a motion in each row (m,), as a fraction of L, and settling time [s].

    The settling time is NaN if the motion does not settle.
    """

    depth: Array
    settled: float

    @property
    def valid(self) -> bool:
        """True if all rows are satisfied, by the strict standard, and the goal is reached."""
        return bool((self.depth <= NEGLIGIBLE).all() and np.isfinite(self.settled))


def judged(setup: Setup, motion: Motion) -> Judgement:
    """Judge a motion by the package's own rows and scores.

    A marker behind the camera has an infinite depth.
    """
    constraints = setup.constraints
    goal = setup.task.goals[0]
    world = setup.world()
    follows = setup.scene.motion is not None
    end = (
        (setup.samples - 1) * setup.Ts
        if follows
        else motion.intervals.sum() + setup.tolerances.dwell_s
    )
    t, q, qd = motion.states(setup.q0, setup.qd0, end)
    try:
        steps = [world.evaluate(*at) for at in zip(t.tolist(), q, qd, strict=True)]
    except SceneError:
        return Judgement(np.full(len(constraints.labels), np.inf), np.nan)
    pixels, points, R, p = (
        np.stack([getattr(step, name) for step in steps])
        for name in ("pixels", "points", "camera_R", "camera_t")
    )
    trace = Trace(t, q, qd, pixels, points, setup.scene.camera.size, setup.scene)
    depth = -constraints.clearance(trace) / constraints.characteristic_length
    pose = distances(R, p, goal.camera) if goal.camera is not None else np.full((len(t), 2), np.nan)
    away = np.linalg.norm(pixels - goal.pixels, axis=2).max(axis=1)
    late = np.flatnonzero(~setup.reached(t, pose, away, qd))
    settled = 0.0 if not len(late) else t[late[-1] + 1] if late[-1] + 1 < len(t) else np.nan
    if end - settled < setup.tolerances.dwell_s - 1e-9:
        settled = np.nan
    return Judgement(np.where(np.isnan(depth), np.inf, depth).max(axis=0), float(settled))


def separated(setup: Setup) -> str:
    """Reason why no motion can solve a scene; empty if there is no proof.

    The reason is a marker that rows separate from its goal in the image. A marker's path in the
    image is continuous, whatever moves. A pixel counts as allowed if any point of its square may be
    allowed, so that the path leads through allowed pixels that touch each other. A marker is
    separated if no pixel at a pose within the goal's tolerances is connected to its first pixel.
    Moving rows, and tasks with several goals or with distortion, prove nothing here; nor does a
    field of view alone, or an obstacle without a field of view.
    """
    scene = setup.scene
    goal = setup.task.goals[0]
    distance, angle, near, _ = setup.goal_tolerances[0]
    rows = [
        c
        for c in setup.constraints.constraints
        if isinstance(c, ImageConstraint) and c.motion is None
    ]
    if len(setup.task.goals) != 1 or scene.camera.distortion is not None:
        return ""
    half = np.ceil(0.5 * np.asarray(scene.camera.size)) + 2.0
    u, v = (np.arange(-side, side + 1.0) for side in half)
    U, V = np.meshgrid(u, v)
    for i, first in enumerate(scene.glance(setup.q0)[0]):
        own = [c for c in rows if c.markers is None or i + 1 in c.markers]
        if len({isinstance(c, FieldOfView) for c in own}) != 2:
            continue
        allowed = np.all([_perhaps_allowed(c, u, v) for c in own], axis=0)
        parts, _ = ndimage.label(allowed, np.ones((3, 3)))
        column, row = np.rint(first + half).astype(int)
        if isinstance(setup.task.feature, CameraPose) and goal.camera is not None:
            x, y, z = goal.camera.inverse.act(scene.markers)[i]
            off = distance + angle * np.linalg.norm((x, y, z))
            near = (
                max(scene.camera.focal) * off * (1.0 + np.hypot(x, y) / z) / (z - off)
                if z > off
                else np.inf
            )
        there = np.hypot(U - goal.pixels[i, 0], V - goal.pixels[i, 1]) <= near + SLACK
        if parts[row, column] and parts[row, column] not in parts[there]:
            return f"marker {i + 1} is closed off from its goal in the image"
    return ""


def _perhaps_allowed(constraint: ImageConstraint, u: Array, v: Array) -> BoolArray:
    """Mask (b, a) of pixels around (u, v) that may have an allowed point; u (a,), v (b,).

    It uses the mean value theorem. The gradient is longest at a corner of the pixel if its length
    is convex, as for circles and hyperellipses.
    """
    corners = np.stack(
        np.meshgrid(np.append(u, u[-1] + 1.0) - 0.5, np.append(v, v[-1] + 1.0) - 0.5), axis=-1
    )
    steep = np.linalg.norm(constraint.gradient(corners), axis=-1)
    steepest = np.maximum.reduce([steep[:-1, :-1], steep[:-1, 1:], steep[1:, :-1], steep[1:, 1:]])
    allowed: BoolArray = constraint.sigma(np.stack(np.meshgrid(u, v), axis=-1)) <= SLACK * steepest
    return allowed


class Known(NamedTuple):
    """Run of a law and its scores."""

    law: str
    record: RunRecord
    result: Mapping[str, Any]

    @property
    def success(self) -> bool:
        """True if the run succeeds by the strict standard."""
        return self.result["status"] == "converged" and not self.result["violated"]

    @property
    def until(self) -> float:
        """Settling time, or end of the run [s]."""
        late = np.flatnonzero(~self.record.settled)
        t = self.record.trajectory.t
        return float(t[min(late[-1] + 1, len(t) - 1)] if len(late) else t[-1])

    @property
    def largest(self) -> Array:
        """Largest |q̈| of each joint until then (n,)."""
        path = self.record.trajectory
        most: Array = np.abs(path.qdd_command[path.t <= self.until]).max(axis=0)
        return most


def runs_of(bench: Bench, laws: Sequence[str]) -> list[Known]:
    """Run all laws on a scene; return successful ones first, by settling time."""
    baseline = bench.run(ControllerSpec(BASELINE))
    runs = []
    for law in laws:
        record = bench.run(ControllerSpec(law, options=OPTIONS.get(law, {})))
        runs.append(Known(law, record, score(record, baseline).result))
    runs.append(Known(BASELINE, baseline, score(baseline, baseline).result))
    order = {
        id(run): (not run.success, np.nan_to_num(run.result["settling_time_s"], nan=1e3))
        for run in runs
    }
    return sorted(
        (run for run in runs if len(run.record.trajectory.t) > 1), key=lambda run: order[id(run)]
    )


class Found(NamedTuple):
    """Valid motion, its settling time [s], and the limit on |q̈|; or None, NaN, and the reason."""

    motion: Motion | None
    settled: float
    limit: str


class Planner:
    """Optimal control of one scene after another; programs are reused for similar scenes."""

    def __init__(self, seconds: float, compiled: bool = False) -> None:
        from . import optimal  # only optimal control needs CasADi

        self.optimal = optimal
        self.seconds = seconds
        self.compiled = compiled
        self.programs: dict[str, Any] = {}

    def best(self, setup: Setup, limited: Setup | None, runs: Sequence[Known]) -> Found:
        """Return the best of the first :data:`STARTS` valid motions from different guesses.

        |q̈| is limited by the actuators, as in the condition ``limited``. If a family has no such
        limits, or no law succeeds and no motion is found, the largest |q̈| of each joint in the
        best run is the limit.
        """
        try:
            scene = self.optimal.written(setup)
        except self.optimal.NotCovered as what:
            return Found(None, np.nan, f"{LAWS_ONLY}: {what}")
        n = setup.scene.robot.n
        until = perf_counter() + self.seconds
        if scene.likeness not in self.programs:
            follows = setup.scene.motion is not None
            self.programs[scene.likeness] = self.optimal.Program(
                scene, n, follows, self.seconds, self.compiled
            )
            until = perf_counter() + self.seconds
        limits = (
            {} if limited is None else {"actuators": limited.limits.of_joint("acceleration", n)}
        )
        if not limits or not runs[0].success:
            limits["best run"] = runs[0].largest
        found: list[Found] = []
        for (said, limit), guess in product(
            limits.items(), guesses(self.optimal.Guess, setup, runs)
        ):
            if len(found) == STARTS or (found and found[0].limit != said) or perf_counter() > until:
                break
            motion, settled = self.refined(
                self.programs[scene.likeness], setup, scene, limit, guess, until
            )
            if motion is not None:
                found.append(Found(motion, settled, said))
        return min(
            found, key=lambda each: each.settled, default=Found(None, np.nan, "nothing found")
        )

    def refined(
        self, program: Any, setup: Setup, scene: Any, limit: Array, guess: Any, until: float
    ) -> tuple[Motion | None, float]:
        """Find a valid motion; margins grow if a motion is outside between its nodes."""
        constraints = setup.constraints
        length = setup.constraints.characteristic_length
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
    """Clearance of each row at the start, at rest (m,)."""
    pixels, points = setup.scene.glance(setup.q0)
    trace = Trace(
        np.zeros(1),
        setup.q0[None],
        setup.qd0[None],
        pixels[None],
        points[None],
        setup.scene.camera.size,
    )
    return np.maximum(setup.constraints.clearance(trace)[0], 0.0)


def guesses(kind: Any, setup: Setup, runs: Sequence[Known]) -> list[Any]:
    """Initial guesses of optimal control: best run, straight line to its end, other runs."""
    begin = []
    for run in runs:
        path = run.record.trajectory
        begin.append(kind(path.t, path.q, path.qd, run.until))
        if run is runs[0] and setup.scene.motion is None:
            s = np.linspace(0.0, 1.0, 101)[:, None]
            q = setup.q0 + (3.0 - 2.0 * s) * s**2 * (path.q[-1] - setup.q0)
            t = run.until * s[:, 0]
            begin.append(kind(t, q, np.gradient(q, t, axis=0), run.until))
    return begin


def line_of(
    scene: Drawn, setups: Mapping[str, Setup], laws: Sequence[str], planner: Planner | None
) -> dict[str, Any]:
    """Return the table's line of a scene, from its setups by condition."""
    runs = runs_of(Bench(scene, NOMINAL), laws)
    good = [run for run in runs if run.success]
    began = perf_counter()
    law = good[0] if good else None
    times = [run.result["settling_time_s"] for run in good]
    proof = "" if good else separated(setups[NOMINAL])
    found = Found(None, np.nan, "")
    if planner is not None and runs and not proof:
        found = planner.best(setups[NOMINAL], setups.get(LIMITED), runs)
    known = f"proof: {proof}" if proof else f"law {law.law}" if law else ""
    if found.motion is not None and not found.settled >= min(times, default=np.inf):
        known = "optimal control"
    return {
        "family": scene.family,
        "half": scene.half,
        "scene": scene.number,
        "outcome": SEPARATED if proof else REACHABLE if known else UNKNOWN,
        "known_by": known,
        "best_time_s": min([*times, *([found.settled] if found.motion else [])], default=np.nan),
        "law": law.law if law else "",
        "law_time_s": min(times, default=np.nan),
        "law_space": np.fmax.reduce([run.result["utilization"] for run in good], initial=np.nan),
        "optimal_time_s": found.settled,
        "acceleration": found.limit,
        "least_time_s": scene.least_time,
        "solve_s": perf_counter() - began,
        "motion": found.motion.text() if found.motion is not None else "",
    }


def read(table: Path, test_set: TestSet) -> list[dict[str, Any]]:
    """Read the lines of a table; missing numbers are NaN.

    Raises ConfigurationError if the table belongs to another test set.
    """
    if (known := parquet.facts_of(table).get("sha256")) != test_set.sha256:
        raise ConfigurationError(
            f"{table} is of the test set {known}, not of {test_set.sha256}: give another --table"
        )
    lines = parquet.read([table], COLUMNS).to_pylist()
    return [
        {name: np.nan if value is None else value for name, value in line.items()} for line in lines
    ]


def wrong(lines: Sequence[Mapping[str, Any]], test_set: TestSet) -> Iterator[str]:
    """Judge all motions of a table once more; yield deviations from the table."""
    families = {family.name: family for family in test_set.families}
    for line in lines:
        if line["motion"]:
            setups = families[line["family"]].set_up(line["scene"], line["half"])[1]
            motion = Motion.read(line["motion"])
            scene = " ".join(map(str, key(line)))
            found = judged(setups[NOMINAL], motion)
            if not (found.valid and abs(found.settled - line["optimal_time_s"]) < PERIOD):
                yield (
                    f"{scene}: settled after {found.settled:.4g} s, {found.depth.max():.2g} L "
                    f"outside"
                )
            if line["acceleration"] == "actuators":
                limit = setups[LIMITED].limits.of_joint("acceleration", motion.qdd.shape[1])
                if (np.abs(motion.qdd) > limit + 10.0**-DIGITS).any():
                    yield f"{scene}: beyond the limits of acceleration"


def summary(lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a table: scenes by outcome, and best motions relative to laws and slowest joints."""
    names = (REACHABLE, SEPARATED, UNKNOWN)
    yield (
        f"| family | scenes | {' | '.join(names)} | solved | sooner | to best law | to least "
        f"time | solve [s] |"
    )
    yield "|---|" + "---:|" * 9
    for family in [*dict.fromkeys(line["family"] for line in lines), "all"]:
        own = [line for line in lines if family in (line["family"], "all")]
        to_law = np.array([line["optimal_time_s"] / line["law_time_s"] for line in own])
        own_limits = [line for line in own if line["acceleration"] == "actuators"]
        to_least = np.array([line["optimal_time_s"] / line["least_time_s"] for line in own_limits])
        counts = [len(own), *(sum(line["outcome"] == name for line in own) for name in names)]
        counts += [sum(bool(line["motion"]) for line in own), int((to_law < 1.0).sum())]
        ratios = [
            f"{np.median(of):.2f}" if len(of := each[np.isfinite(each)]) else ""
            for each in (to_law, to_least)
        ]
        seconds = f"{np.median([line['solve_s'] for line in own]):.1f}"
        yield f"| {' | '.join([family, *map(str, counts), *ratios, seconds])} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the results described by the module; return 1 if a motion deviates from the table."""
    parser = argparse.ArgumentParser(prog="python -m checks.best", description=__doc__)
    parser.add_argument("--scenes", type=int, default=10, help="of each family, from the first one")
    parser.add_argument(
        "--family", action="append", default=[], help="one of several; all if not given"
    )
    parser.add_argument(
        "--scene", action="append", default=[], help="FAMILY:NUMBER, instead of --scenes"
    )
    parser.add_argument("--half", default="held-out")
    parser.add_argument("--laws", default=LAWS, help="in the order in which they are run")
    parser.add_argument(
        "--seconds",
        type=float,
        default=30.0,
        help="of optimal control for each scene; 0: laws only",
    )
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument(
        "--compiled", action="store_true", help="with a C compiler: for many scenes"
    )
    parser.add_argument("--again", action="store_true", help="scenes whose outcome is unknown")
    parser.add_argument(
        "--verify",
        action="store_true",
        help="judge all motions in the table once more, and do nothing else",
    )
    asked = parser.parse_args(arguments)
    test_set = TestSet.load()
    lines = read(asked.table, test_set) if asked.table.exists() else []
    if asked.verify:
        problems = list(wrong(lines, test_set))
        print("\n".join([*summary(lines), *problems]))
        return 1 if problems else 0
    if asked.seconds > 0.0 and find_spec("casadi") is None:
        parser.error(
            "optimal control needs CasADi: pip install 'vsconstraints[best]'; --seconds 0 does "
            "without it"
        )
    planner = Planner(asked.seconds, asked.compiled) if asked.seconds > 0.0 else None
    chosen = test_set.chosen(asked.family, asked.half, asked.scenes, None)
    wanted = list(product(range(asked.scenes), chosen["families"]))
    if asked.scene:
        wanted = [named_scene(text, test_set) for text in asked.scene]
    there = {key(line) for line in lines if not (asked.again and line["outcome"] == UNKNOWN)}
    for number, family in wanted:
        if (family.name, asked.half, number) not in there:
            line = line_of(*family.set_up(number, asked.half), asked.laws.split(","), planner)
            lines = sorted([line, *(other for other in lines if key(other) != key(line))], key=key)
            facts = {"version": test_set.version, "sha256": test_set.sha256}
            parquet.write(asked.table, parquet.table(COLUMNS, lines), facts)
            print(
                f"{family.name} {number}: {line['outcome']}, {line['known_by']}, "
                f"{line['best_time_s']:.3f} s",
                flush=True,
            )
    print("\n".join(summary(lines)))
    return 0


def named_scene(text: str, test_set: TestSet) -> tuple[int, Family]:
    """Return the number and the family that ``FAMILY:NUMBER`` names; raises ConfigurationError."""
    name, _, number = text.partition(":")
    families = {family.name: family for family in test_set.families}
    if name not in families or not number.isdecimal():
        raise ConfigurationError(
            f"--scene takes FAMILY:NUMBER, such as {next(iter(families))}:3, not {text!r}"
        )
    return int(number), families[name]


def key(line: Mapping[str, Any]) -> tuple[str, str, int]:
    """Return the scene of a line of the table, as its key."""
    return line["family"], line["half"], line["scene"]


if __name__ == "__main__":
    sys.exit(main())
