"""``python -m checks.reported FOLDER [NAME]...``: what users of other packages report, as scenes.

Each scene states in our words what an issue of another project describes. The command runs the
stack that the issue is about and laws of this package in it, and prints what each of them does, and
whether the report reproduces. FOLDER contains the environments of the adapters (``python -m
vsconstraints.stacks.environments FOLDER pink mink placo oink``) and, as ``visp_stack``, the program
of ``controllers/visp``. A stack without its environment is left out.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vsconstraints.comparisons.runs.spec import ControllerSpec, stack_law
from vsconstraints.rows import Array
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import Trajectory, simulate
from vsconstraints.stacks.environments import interpreter

VELOCITY_LAWS: dict[str, dict[str, Any]] = {"velocity-qp": {}, "velocity-hierarchical-qp": {}}
RANGE = {"type": "joint-range", "K": 0.1, "switching_gain": 1.0}
SPEED = {"type": "joint-speed", "switching_gain": 10.0}
JOINT = 0  # the joint whose range the scenes narrow; it moves from 0.664 to 0.1 rad


class Report(NamedTuple):
    """A report of users as a scene.

    ``measure`` returns a number of a run, ``unit`` describes it, and the report reproduces if that
    number of its first stack is at least ``reproduced``. It reproduces in part only if the scene
    ``differs`` from the one of the report, or if the same is true of the stack ``control``, which
    lacks what the report blames.
    """

    issue: str
    says: str
    changes: dict[str, Any]
    stacks: dict[str, dict[str, Any]]
    laws: dict[str, dict[str, Any]]
    measure: Callable[[Trajectory], float]
    unit: str
    reproduced: float
    differs: str = ""
    control: str = ""


def last_second(run: Trajectory) -> Array:
    """Return the samples (N,) of the last second of a run."""
    last: Array = np.flatnonzero(run.t >= run.t[-1] - 1.0)
    return last


def swing(run: Trajectory) -> float:
    """Return the peak-to-peak motion of the narrowed joint in the last second [mrad]."""
    return 1e3 * float(np.ptp(run.q[last_second(run), JOINT]))


def depth_at_end(run: Trajectory) -> float:
    """Return how far the narrowed joint ends outside its range [mrad]; 0 if it is inside."""
    return 1e3 * max(0.0, float(run.q[-1, JOINT]) - UPPER)


def excursion(run: Trajectory) -> float:
    """Return how far the narrowed joint was below its range [mrad]; 0 if it never was."""
    return 1e3 * max(0.0, LOWER - float(run.q[:, JOINT].min()))


def reversals(run: Trajectory) -> float:
    """Return the greatest number of changes of sign of a joint's speed."""
    signs = np.sign(np.where(np.abs(run.qd) > 1e-3, run.qd, 0.0))
    return float(max(_changes(signs[:, joint]) for joint in range(signs.shape[1])))


def _changes(signs: Array) -> int:
    moving = signs[signs != 0.0]
    return int((moving[1:] != moving[:-1]).sum())


LOWER, UPPER = 0.3, 0.65  # ends of the narrowed range [rad]; the start is 14 mrad above UPPER
FAST_ARM = {"command": "velocity", "acceleration": 1000.0}

REPORTS = {
    "pink-159": Report(
        issue="pink#159",
        says="a joint at its position limit oscillates on hardware, not in simulation; here a "
        "command acts 10 ms late",
        changes={
            "constraints": [{**RANGE, "joints": [1], "lower": [LOWER], "upper": [6.28]}, SPEED],
            "arm": FAST_ARM,
            "disturbances": {"command_delay": 0.01},
            "duration": 3.0,
        },
        stacks={
            "pink": {"adapter": "pink", "barrier_gain": 0.0},
            "pink, config_limit_gain 0.02": {
                "adapter": "pink",
                "barrier_gain": 0.0,
                "config_limit_gain": 0.02,
            },
            "mink": {"adapter": "mink", "view_gain": 0.0},
        },
        laws=VELOCITY_LAWS | {"hierarchical-qp": {}},
        measure=swing,
        unit="mrad peak to peak in the last second",
        reproduced=5.0,
    ),
    "pink-206": Report(
        issue="pink#206",
        says="a start just outside the range makes the problem infeasible, and nothing brings "
        "the arm back",
        changes={
            "constraints": [{**RANGE, "joints": [1], "lower": [-6.28], "upper": [UPPER]}, SPEED],
            "arm": FAST_ARM,
            "duration": 2.0,
        },
        stacks={
            "pink": {"adapter": "pink", "barrier_gain": 0.0},
            "mink": {"adapter": "mink", "view_gain": 0.0},
        },
        laws=VELOCITY_LAWS | {"hierarchical-qp": {}},
        measure=depth_at_end,
        unit="mrad outside at the end",
        reproduced=1.0,
    ),
    "visp-1946": Report(
        issue="visp#1946",
        says="avoidance of joint limits is off when the primary task is fast, when it is needed "
        "most",
        changes={
            "constraints": [{**RANGE, "joints": [1], "lower": [LOWER], "upper": [1.2]}, SPEED],
            "arm": FAST_ARM,
            "duration": 4.0,
        },
        stacks={
            "ViSP, gain 4": {"command": ["visp_stack"], "avoidance": 1.0, "gain": 4.0},
            "ViSP, gain 0.5": {"command": ["visp_stack"], "avoidance": 1.0, "gain": 0.5},
            "ViSP, gain 4, without avoidance": {"command": ["visp_stack"], "gain": 4.0},
        },
        laws={"resolved-rate-avoidance": {"gain": 4.0}, "velocity-qp": {"gain": 4.0}},
        measure=excursion,
        unit="mrad beyond the limit",
        reproduced=5.0,
    ),
    "roboplan-250": Report(
        issue="roboplan#250",
        says="with acceleration limits the arm oscillates about the goal",
        changes={
            "constraints": [RANGE, SPEED],
            "arm": {"command": "velocity", "acceleration": 8.0},
            "limits": {"acceleration": 8.0},
            "duration": 6.0,
        },
        stacks={
            "OInK, gain 50": {"adapter": "oink", "acceleration_limit": True, "gain": 50.0},
            "OInK, gain 5": {"adapter": "oink", "acceleration_limit": True, "gain": 5.0},
            "OInK, gain 50, without limits": {"adapter": "oink", "gain": 50.0},
        },
        laws={
            "velocity-qp, gain 50": {
                "type": "velocity-qp",
                "gain": 50.0,
                "max_acceleration": 8.0,
            },
            "velocity-qp, gain 5": {"type": "velocity-qp", "gain": 5.0, "max_acceleration": 8.0},
            "hierarchical-qp": {},
        },
        measure=reversals,
        unit="changes of direction of one joint",
        reproduced=10.0,
        control="OInK, gain 50, without limits",
    ),
    "placo-7": Report(
        issue="placo#7",
        says="the arm vibrates at a hard constraint, self-collision in the report; here the edge "
        "of the image, with commands that act 10 ms late",
        changes={"arm": FAST_ARM, "disturbances": {"command_delay": 0.01}, "duration": 2.0},
        stacks={
            "placo, full step to the edge": {"adapter": "placo", "gain": 4.0, "view_gain": 500.0},
            "placo, view_gain 5": {"adapter": "placo", "gain": 4.0, "view_gain": 5.0},
        },
        laws=VELOCITY_LAWS | {"hierarchical-qp": {}},
        measure=reversals,
        unit="changes of direction of one joint",
        reproduced=20.0,
        differs="the edge of the image in place of a self-collision, and late commands",
    ),
}


def spec_of(name: str, options: dict[str, Any], folder: Path) -> ControllerSpec | None:
    """Return a stack with its environment below a folder, or None if it is not there."""
    own = dict(options)
    if "adapter" in own:
        python = interpreter(folder, own["adapter"])
        if not python.exists():
            return None
        own["python"] = str(python)
    else:
        program = folder / own["command"][0]
        if not program.exists():
            return None
        own["command"] = [str(program)]
    return ControllerSpec(name, stack_law(), own)


def law_of(name: str, options: dict[str, Any]) -> ControllerSpec:
    """Return a law of a report; its type is its name unless the options have one."""
    own = dict(options)
    return ControllerSpec(name, own.pop("type", name), own)


def verdict(report: Report, numbers: Mapping[str, float]) -> str:
    """Say whether a report reproduces, from the numbers of those stacks that have run."""
    first = next(iter(report.stacks))
    if first not in numbers:
        return "not run"
    if not numbers[first] >= report.reproduced:
        return "does NOT reproduce"
    if report.differs:
        return f"reproduces in part: the scene has {report.differs}"
    if numbers.get(report.control, 0.0) >= report.reproduced:
        return f"reproduces in part: so does {report.control}"
    return "reproduces"


def show(report: Report, folder: Path) -> None:
    """Run a scene, and print the numbers of its stacks and laws, and the verdict."""
    print(f"\n{report.issue}: {report.says}")
    scenario = Scenario.load("ur5-fov")
    for key, value in report.changes.items():
        scenario = scenario.with_override(key, value)
    specs = [spec_of(name, options, folder) for name, options in report.stacks.items()]
    laws = [law_of(name, options) for name, options in report.laws.items()]
    numbers = {}
    for spec in [*specs, *laws]:
        if spec is None:
            continue
        run = simulate(scenario.setup(), spec.make())
        number = report.measure(run) if len(run.t) > 1 else np.nan
        silent = [text for text in run.reason.split("; ") if text.startswith("no answer")]
        note = "; ".join([run.status, *silent])
        print(f"  {spec.name:34} {number:9.1f} {report.unit} ({note[:120]})", flush=True)
        numbers[spec.name] = number
    print(f"  {report.issue} {verdict(report, numbers)}")


def main(arguments: Sequence[str]) -> int:
    """Run the named reports, or all of them; the exit code is that of a wrong call, 2, or 0."""
    if not arguments or set(arguments[1:]) - set(REPORTS):
        print(__doc__, f"\nNames: {', '.join(REPORTS)}")
        return 2
    for name in arguments[1:] or REPORTS:
        show(REPORTS[name], Path(arguments[0]).absolute())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
