"""``python -m checks.best [--scenes N] [--family F] [--laws NAMES] [--seconds S]``: what can be
done at all.

Says of scenes of test set v1 whether they are *reachable* (a motion is known that satisfies all
rows and settles at the goal), *separated* (it is proved that there is none) or *unknown*, and the
best known motion, by when it settles. These are motions of laws and, beginning with them, of
optimal control (``pip install 'vsconstraints[best,evidence]'``), which are judged by the package's
own rows, close together. Scenes that are in the table are not done again, unless ``--again`` says
so of the unknown ones. ``--verify`` judges all motions in the table once more, which needs no
solver.
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

from vsconstraints.comparisons.evidence import parquet
from vsconstraints.comparisons.evidence.parquet import Column
from vsconstraints.comparisons.evidence.work import Bench
from vsconstraints.comparisons.metrics import NEGLIGIBLE, score
from vsconstraints.comparisons.record import RunRecord
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec
from vsconstraints.constraints import FieldOfView, ImageConstraint, Trace
from vsconstraints.errors import ConfigurationError, SceneError
from vsconstraints.robots.geometry import distances
from vsconstraints.rows import Array, BoolArray
from vsconstraints.scenarios.families import Drawn, Family
from vsconstraints.scenarios.families.family import LIMITED, NOMINAL, SHIPPED
from vsconstraints.scenarios.families.frozen import TestSet
from vsconstraints.simulation import Setup
from vsconstraints.vision.features import CameraPose

TABLE = SHIPPED / "testset-v1-best.parquet"  #: that comes with the package
LAWS = "predictive,robust-hierarchical-qp,hierarchical-qp,cbf-filter"
#: as in the default comparison
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
    # "law NAME", "optimal control" or "proof: …", of the best motion
    Column("known_by", "text", category=True),
    Column("best_time_s", "number"),
    Column("law", "text", category=True),  # that settles soonest of those that succeed
    Column("law_time_s", "number"),
    Column("law_space", "number"),  # the greatest utilization of the laws that succeed
    Column("optimal_time_s", "number"),
    # what limits |q̈| of optimal control, or why there is none
    Column("acceleration", "text", category=True),
    # that the slowest joint by itself needs, with the limits of actuators
    Column("least_time_s", "number"),
    Column("solve_s", "number"),
    Column("motion", "text"),  # of optimal control
)

PARTS = 20  #: a motion is judged as often in each interval, and at least once in so many seconds
PERIOD = 1e-3
DIGITS = 4  #: of accelerations, in the table
#: that rows are kept at first between nodes, by their units
MARGIN = {"px": 0.5, "m": 1e-3, "rad": 2e-3}
#: how often a motion is sought, with a larger margin where it turns out to be outside between its
#: nodes
ROUNDS = 3
SLACK = 0.75  #: half the diagonal of a pixel, and the depth that counts as none [px]
STARTS = 2  #: valid motions from different guesses, of which the best one counts


class Motion(NamedTuple):
    """Accelerations (K, n), each held for an interval (K,) [s], from a setup's start; then the arm
    stands still.
    """

    intervals: Array
    qdd: Array

    def states(self, q0: Array, qd0: Array, until: float = 0.0) -> tuple[Array, Array, Array]:
        """Times (S,), q and q̇ (S, n), close together; as far as ``until`` [s] at least."""
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
    """How deep a motion is outside each row (m,), as a fraction of L, and when it has settled [s],
    NaN if not.
    """

    depth: Array
    settled: float

    @property
    def valid(self) -> bool:
        """Whether all rows are satisfied, by the strict standard, and the goal is reached."""
        return bool((self.depth <= NEGLIGIBLE).all() and np.isfinite(self.settled))


def judged(setup: Setup, motion: Motion) -> Judgement:
    """The motion by the package's own rows and scores; a marker behind the camera is as deep
    outside as can be.
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
    """Why no motion can solve a scene: the marker that rows close off from its goal in the image;
    empty if none is.

    A marker's path in the image is continuous, whatever moves. A pixel counts as allowed if any
    point of its square may be, so that the path leads through allowed pixels that touch each other.
    Closed off is a marker of which no pixel at a pose within the goal's tolerances is connected to
    the first one. Rows that move, and tasks in several goals or with distortion, prove nothing
    here; nor does a field of view alone, nor an obstacle that nothing keeps it near.
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
    """(b, a) whether a pixel around (u, v) may have an allowed point, of u (a,) and v (b,), by the
    mean value theorem.

    The gradient is longest at a corner of the pixel if its length is convex, as that of circles and
    hyperellipses is.
    """
    corners = np.stack(
        np.meshgrid(np.append(u, u[-1] + 1.0) - 0.5, np.append(v, v[-1] + 1.0) - 0.5), axis=-1
    )
    steep = np.linalg.norm(constraint.gradient(corners), axis=-1)
    steepest = np.maximum.reduce([steep[:-1, :-1], steep[:-1, 1:], steep[1:, :-1], steep[1:, 1:]])
    allowed: BoolArray = constraint.sigma(np.stack(np.meshgrid(u, v), axis=-1)) <= SLACK * steepest
    return allowed


class Known(NamedTuple):
    """A run of a law and what it scored."""

    law: str
    record: RunRecord
    result: Mapping[str, Any]

    @property
    def success(self) -> bool:
        """By the strict standard."""
        return self.result["status"] == "converged" and not self.result["violated"]

    @property
    def until(self) -> float:
        """When it has settled, or ends [s]."""
        late = np.flatnonzero(~self.record.settled)
        t = self.record.trajectory.t
        return float(t[min(late[-1] + 1, len(t) - 1)] if len(late) else t[-1])

    @property
    def largest(self) -> Array:
        """(n,) the largest |q̈| of each joint until then."""
        path = self.record.trajectory
        most: Array = np.abs(path.qdd_command[path.t <= self.until]).max(axis=0)
        return most


def runs_of(bench: Bench, laws: Sequence[str]) -> list[Known]:
    """All laws on a scene: those that succeed first, the soonest settled first of all."""
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
    """A valid motion, when it settles [s], and what limits |q̈|; none, NaN, and why there is
    none.
    """

    motion: Motion | None
    settled: float
    limit: str


class Planner:
    """Optimal control of one scene after the other; programs are kept for those that are alike."""

    def __init__(self, seconds: float, compiled: bool = False) -> None:
        from . import optimal  # CasADi is needed here only

        self.optimal = optimal
        self.seconds = seconds
        self.compiled = compiled
        self.programs: dict[str, Any] = {}

    def best(self, setup: Setup, limited: Setup | None, runs: Sequence[Known]) -> Found:
        """The best of the first :data:`STARTS` valid motions that are found from different guesses.

        |q̈| is limited by the actuators, as in the condition ``limited``. Where a family has none, or no law succeeds
        and nothing is found, it is limited by the largest of each joint in the best run.
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
        """A valid motion, with larger margins where one turns out to be outside between its
        nodes.
        """
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
    """(m,) clearance of each row at the start, at rest."""
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
    """Where optimal control begins: the best run, the straight line to its end, and the other
    runs.
    """
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
    """The table's line of a scene, with its setups by condition."""
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
    """The lines of a table, numbers that do not exist as NaN; ConfigurationError if it is not of
    this test set.
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
    """Which motions of the table are not what it says of them, judged once more."""
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
    """How many scenes there are of each outcome, and the best motions beside the best laws and the
    slowest joints.
    """
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
    """Print what the module's docstring says; the exit code is 1 if a motion of the table is not
    what it says.
    """
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
    """Which scene a line of the table is of."""
    return line["family"], line["half"], line["scene"]


if __name__ == "__main__":
    sys.exit(main())
