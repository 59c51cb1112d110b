"""Custom constraint given by a formula, compared with a built-in one of the same shape."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np

from vsconstraints.compiled import available, load
from vsconstraints.constraints import (
    Circle,
    Constraint,
    ConstraintSet,
    Curve,
    ForbiddenSphere,
    ImageConstraint,
    Occlusion,
    PointConstraint,
)
from vsconstraints.control import ControlStep
from vsconstraints.control.packing import StepArrays
from vsconstraints.controllers import SlidingMode
from vsconstraints.scenarios import Scenario
from vsconstraints.vision.scene import Scene

from .part import Effort, Part, Table, digits, microseconds
from .timing import UNIT, Subject, each_call, in_turn

TEXT = """
The UR5 with a single constraint, once built in and then as a user would write it: a formula for \
the value and its
derivatives, with a second one for the curvature or without, which is then taken from differences \
of the first. *rows*
is the compiled function of the constraint's rows alone, called from compiled code again and again \
at one state; *whole
step* is state in, command out, by the sliding mode. *× built-in* is the median as a multiple of \
the built-in one's.
"""

ROUNDS = 200
"""Number of calls of rows per turn: a single call is shorter than reading the clock."""

Number = float


class Disc(ImageConstraint):
    """Disc that markers must avoid, like :class:`.Occlusion` with a circle."""

    kind = "disc"

    def __init__(self) -> None:
        super().__init__(K=0.2, switching_gain=1.0, length=30.0)
        self.parameters = (30.0, 5.0, 7.0)

    @staticmethod
    def formula(
        u: Number, v: Number, r: Number, a: Number, b: Number
    ) -> tuple[Number, Number, Number]:
        """Value, positive inside, and its derivatives."""
        x = u - a
        y = v - b
        return 1.0 - (x * x + y * y) / (r * r), -2.0 * x / (r * r), -2.0 * y / (r * r)


class CurvedDisc(Disc):
    """Disc with a formula for its curvature."""

    @staticmethod
    def curvature_formula(  # the compiler requires scalar arguments
        u: Number, v: Number, r: Number, a: Number, b: Number, u_dot: Number, v_dot: Number
    ) -> Number:
        """Return ẏᵀHẏ."""
        return -2.0 / (r * r) * (u_dot * u_dot + v_dot * v_dot)


class Ball(PointConstraint):
    """Ball that the tip must avoid, like :class:`.ForbiddenSphere`."""

    kind = "ball"

    def __init__(self) -> None:
        super().__init__(K=0.2, switching_gain=1.0, length=0.1)
        self.parameters = (0.1, 0.3, 0.1, 0.9)

    @staticmethod
    def formula(
        x: Number, y: Number, z: Number, r: Number, a: Number, b: Number, c: Number
    ) -> tuple[Number, Number, Number, Number]:
        """Value, positive inside, and its derivatives."""
        x = x - a
        y = y - b
        z = z - c
        d = np.sqrt(x * x + y * y + z * z + 1e-12)
        return r - d, -x / d, -y / d, -z / d


class CurvedBall(Ball):
    """Ball with a formula for its curvature."""

    @staticmethod
    def curvature_formula(  # the compiler requires scalar arguments
        x: Number,
        y: Number,
        z: Number,
        r: Number,
        a: Number,
        b: Number,
        c: Number,
        u: Number,
        v: Number,
        w: Number,
    ) -> Number:
        """Return ẏᵀHẏ."""
        x = x - a
        y = y - b
        z = z - c
        d = np.sqrt(x * x + y * y + z * z + 1e-12)
        n = (x * u + y * v + z * w) / d
        return float((n * n - (u * u + v * v + w * w)) / d)


BUILT_IN = "built in"
CURVED = "own, with curvature"
PLAIN = "own, without"


def pairs() -> dict[str, dict[str, Constraint]]:
    """Return constraints by place, and by origin of their formula."""
    disc = Occlusion(Curve(Circle(30.0), (5.0, 7.0)), K=0.2, switching_gain=1.0)
    ball = ForbiddenSphere(centre=[0.3, 0.1, 0.9], radius=0.1, K=0.2, switching_gain=1.0)
    return {
        "image": {BUILT_IN: disc, CURVED: CurvedDisc(), PLAIN: Disc()},
        "robot point": {BUILT_IN: ball, CURVED: CurvedBall(), PLAIN: Ball()},
    }


def measure(effort: Effort) -> Part:
    """Measure this part; see the module."""
    part = Part("A constraint of one's own", TEXT)
    setup = Scenario.load("ur5-fov").setup()
    rows = repeated_rows()
    q = setup.q0
    qd = np.full(setup.scene.robot.n, 0.1)
    subjects: dict[str, Subject] = {}
    for where, constraints in pairs().items():
        for whose, constraint in constraints.items():
            scene = Scene(
                setup.scene.robot, setup.scene.camera, setup.scene.markers, constraint.points
            )
            limits = ConstraintSet([constraint], scene)
            step = ControlStep(scene, limits, setup.task).bind(SlidingMode())
            subjects[f"{where}, {whose}: whole step"] = each_call(
                lambda step=step: step(0.0, q, qd)
            )  # type: ignore[misc]
            if rows is not None:
                packed = StepArrays(scene, limits, setup.task)
                load("step").evaluate_step(packed.workspace, 0.0, q, qd)
                subjects[f"{where}, {whose}: rows"] = rows(packed)
    times = in_turn(subjects, effort.turns)
    unit = float(np.median(times[UNIT]))
    lines = []
    for where, constraints in pairs().items():
        for whose in constraints:
            line = [where, whose]
            for what in ("rows", "whole step"):
                if f"{where}, {whose}: {what}" not in times:
                    line += ["–", "–"]
                    continue
                median, of_built_in = (
                    float(np.median(times[f"{where}, {who}: {what}"])) for who in (whose, BUILT_IN)
                )
                part.numbers[f"{where}, {whose}, {what}: median"] = median
                part.numbers[f"{where}, {whose}, {what}: ratio"] = median / unit
                part.numbers[f"{where}, {whose}, {what}: over built-in"] = median / of_built_in
                line += [microseconds(median), digits(median / of_built_in)]
            lines.append(line)
    header = ["about", "constraint", "rows, µs", "× built-in", "whole step, µs", "× built-in"]
    part.tables.append(Table(header, lines, text_columns=2))
    return part


def repeated_rows() -> Callable[[StepArrays], Subject] | None:
    """Return a function that makes subjects which call the rows of a step's only constraint.

    None if there is no compiler.
    """
    parts = load("parts")
    compiler = load("compiler")
    if not available():
        return None
    call = parts.call_void_pointer

    @compiler.numba.njit(["void(int64, int64, int64)"], **compiler.IN_PLACE)  # type: ignore[untyped-decorator]
    def repeat(rows: int, step: int, times: int) -> None:
        for _ in range(times):
            call(rows, (step, 0))

    def subject(packed: StepArrays) -> Subject:
        rows = int(packed.step.parts[0]["address"])

        def turn(_: int) -> float:
            started = perf_counter_ns()
            repeat(rows, packed.workspace.address, ROUNDS)
            return (perf_counter_ns() - started) / ROUNDS

        return turn

    return subject
