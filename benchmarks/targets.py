"""Targets of the benchmark, and the verdict on each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .growth import LINEAR
from .measured import GIVEN
from .own import CURVED
from .part import CASE_STUDY, Part, Table, digits, microseconds
from .stacks import BUDGETS, DECLARED

ALL = list(GIVEN)[-1]

BUSY = 1.5
"""p99 / median of the unit above which the machine is busy, so that tails are not significant."""


@dataclass(frozen=True)
class Target:
    """Upper bound on a number of a part.

    Attributes
    ----------
    what
        Description.
    part, number
        Name of the part, and of the number in it.
    most
        Upper bound.
    unit
        Unit of the number; empty for ratios to the unit.
    tail
        True if the number is significant only on an idle machine.
    """

    what: str
    part: str
    number: str
    most: float
    unit: str = ""
    tail: bool = False


COMMAND_ALONE = 0.15
"""Upper bound for laws in closed form, for rows and task that are given."""

TARGETS = (
    Target(
        "sliding mode, case study, state in, command out",
        "steps",
        f"{CASE_STUDY}, sliding-mode: ratio",
        0.22,
    ),
    Target("potential field, the same", "steps", f"{CASE_STUDY}, potential-field: ratio", 0.22),
    Target(
        "potential field with priority, the same",
        "steps",
        f"{CASE_STUDY}, potential-field-priority: ratio",
        0.22,
    ),
    Target("sliding mode, UR5, the same", "steps", "ur5-fov, sliding-mode: ratio", 0.18),
    Target("hierarchical QP, UR5, the same", "steps", "ur5-fov, hierarchical-qp: ratio", 0.22),
    Target("CBF filter, UR5, the same", "steps", "ur5-fov, cbf-filter: ratio", 0.20),
    Target(
        "hierarchical QP, 30 joints, the same",
        "growth",
        "joints, hierarchical-qp, pose, 30: ratio",
        1.5,
    ),
    Target(
        "hierarchical QP, 7 joints",
        "growth",
        "joints, hierarchical-qp, pose: 7 over 6",
        1.3,
        "× 6 joints",
    ),
    Target(
        "hierarchical QP, exact, the same", "steps", f"{CASE_STUDY}, hierarchical-qp: ratio", 0.35
    ),
    Target(
        "hierarchical QP, active rows, the same",
        "steps",
        f"{CASE_STUDY}, hierarchical-qp-active: ratio",
        0.35,
    ),
    Target(
        "predictive control, 10 blocks, the same", "steps", f"{CASE_STUDY}, predictive: ratio", 4.0
    ),
    Target(
        "predictive control, 30 blocks, the same",
        "steps",
        f"{CASE_STUDY}, predictive-30: ratio",
        12.0,
    ),
    Target(
        "predictive control, 50 blocks, the same",
        "steps",
        f"{CASE_STUDY}, predictive-50: ratio",
        25.0,
    ),
    Target("any demand with priority: beyond the paper's law", "laws", "priority: extra", 0.05),
    Target(
        "any demand with hierarchy: beyond the hierarchical QP", "laws", "hierarchy: extra", 0.05
    ),
    Target(
        "measured pixels, depth and time: beyond without",
        "measured",
        f"{CASE_STUDY}, {ALL}: extra",
        0.05,
    ),
    Target("the same, image task of the UR5", "measured", f"ur5-image, {ALL}: extra", 0.05),
    *(
        Target(
            f"own {what} constraint, {done}",
            "own",
            f"{what}, {CURVED}, {done}: over built-in",
            1.2,
            "× built-in",
        )
        for what in ("image", "robot point")
        for done in ("rows", "whole step")
    ),
    *(
        Target(
            f"{law}, command alone, three active rows",
            "forms",
            f"{law}.command: ratio",
            COMMAND_ALONE,
        )
        for law in ("SlidingMode", "PotentialField", "Tracking")
    ),
    Target("HierarchicalQP, the same", "forms", "HierarchicalQP.command: ratio", 0.35),
    *(
        Target(
            f"a stack {place}, beside its own time: {measurements}",
            "stacks",
            f"{measurements}, {place}: µs",
            budget,
            "µs",
        )
        for measurements in DECLARED
        for place, budget in BUDGETS.items()
    ),
    Target(
        "one step of the closed loop, scores only, sliding mode",
        "loop",
        "sliding-mode, scores: ratio",
        0.12,
    ),
    Target("the same, UR5", "loop", "sliding-mode, UR5, scores: ratio", 0.2),
    Target(
        "one simulated step, logging included, sliding mode", "loop", "sliding-mode: ratio", 0.4
    ),
    Target("`vsconstraints --help`", "startup", "vsconstraints --help: median", 0.4, "s"),
    Target("drawn scene of the UR5, all default laws", "scenes", "ur5: median", 0.2, "s"),
    Target("default comparison, whole process", "comparison", "whole process, cached", 12.0, "s"),
    Target(
        "the same, nothing compiled before", "comparison", "whole process, first ever", 35.0, "s"
    ),
    Target("CPU spent compiling for it", "comparison", "compiling: CPU", 20.0, "s"),
    *(
        Target(
            f"growth with {what}, {law}{kind}",
            "growth",
            f"{what}, {law}{kind}: last slope",
            LINEAR,
            "slope",
        )
        for what, kinds in (("rows", ("",)), ("markers", (", pose", ", image")))
        for kind in kinds
        for law in ("sliding-mode", "potential-field", "hierarchical-qp")
    ),
    Target(
        "p99 / median, every law and scenario",
        "steps",
        "greatest p99/median",
        3.0,
        "× median",
        tail=True,
    ),
)


def judged(parts: Mapping[str, Part]) -> Table:
    """Return the table of targets, with the measured values and the verdicts."""
    steps = parts.get("steps")
    noise = steps.numbers.get("unit: p99/median", 0.0) if steps else 0.0
    lines = []
    for target in TARGETS:
        part = parts.get(target.part)
        value = part.numbers.get(target.number) if part else None
        if value is None:
            verdict = "not measured"
        elif value <= target.most:
            verdict = "met"
        elif target.tail and noise > BUSY:
            verdict = "not judged: the machine was busy"
        else:
            verdict = "**not met**"
        unit = f" {target.unit}" if target.unit else ""
        found = "–" if value is None else f"{digits(value)}{unit}"
        lines.append([target.what, f"{target.most:g}{unit}", found, _time(part, target), verdict])
    return Table(["", "at most", "measured", "µs", ""], lines)


def _time(part: Part | None, target: Target) -> str:
    """Median time [µs] behind a ratio; empty for a number that is no ratio to the unit."""
    what, _, kind = target.number.rpartition(": ")
    return (
        microseconds(part.numbers[f"{what}: median"])
        if part and kind == "ratio" and target.number in part.numbers
        else ""
    )
