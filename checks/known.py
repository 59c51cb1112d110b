"""``python -m checks.known [--scenes N]``: gain by known disturbances, cost of dead time.

It uses held-out scenes of test set v1. First, disturbed scenes in which one of the disturbances is
known: it is removed, and everything else stays the same, including the tolerances of goals. If all
are known, only the law itself is left: no law that must estimate the disturbances can be expected
to do better, so this is the bound for disturbed scenes.

Then scenes without disturbances in which images, or commands, are delayed by a dead time. A law
knows it or not (its options ``dead_time`` and ``command_delay``), also if there is no delay; images
may have a time stamp (dated). Last, predictive laws with plans of 10, 20 and 30 blocks.

Success is in per cent. Differences are paired, with McNemar's test, relative to the first condition
and the law that does not know the dead time.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from math import ceil
from multiprocessing import get_context
from typing import Any

import pandas as pd

from vsconstraints.bench.evidence.work import Batch, scored
from vsconstraints.bench.families import Drawn, Family
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.bench.statistics import mcnemar
from vsconstraints.bench.statistics.judged import OUTCOMES
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec

Tables = dict[str, Any]

DEAD_TIME = 0.035  #: Dead time [s].
OBSERVER = {"observer": 0.1}
PREDICTIVE = "predictive", "robust-predictive"
LAWS: Mapping[str, Mapping[str, Any]] = {
    "hierarchical-qp": {"rows": "barrier"},
    "robust-hierarchical-qp": {},
    "robust-hierarchical-qp-observer": {"type": "robust-hierarchical-qp", **OBSERVER},
    **{name: {} for name in PREDICTIVE},
}


def told(**options: float) -> Mapping[str, Mapping[str, Any]]:
    """Return all laws, and those without an observer also with these options."""
    return LAWS | {
        f"{name}, told": {"type": name, **LAWS[name], **options}
        for name in LAWS
        if "-obs" not in name
    }


DISTURBANCES: Mapping[str, tuple[str, ...]] = {
    "noise": ("pixel_noise",),
    "delay": ("delay",),
    "camera": (
        "focal_factor", "principal_point_error", "mount_translation_error", "mount_rotation_error",
        "depth_factor",
    ),
    "actuators": ("time_constant", "acceleration_noise"),
}  # fmt: skip


def without(*names: str) -> Callable[[Tables], Tables]:
    """Return a function that removes disturbances from a scenario's tables.

    ``"motion"`` stands for motion that the control takes for static.
    """
    gone = {key for name in names for key in DISTURBANCES.get(name, ())}

    def change(tables: Tables) -> Tables:
        kept = {key: value for key, value in tables["disturbances"].items() if key not in gone}
        tables = {**tables, "disturbances": kept}
        return _with_known_motion(tables) if "motion" in names else tables

    return change


def _with_known_motion(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {key: _with_known_motion(value) for key, value in data.items() if key != "known"}
    return [_with_known_motion(each) for each in data] if isinstance(data, list) else data


def late(key: str, **others: Any) -> Callable[[Tables], Tables]:
    """Return a function that delays images (``"delay"``) or commands by the dead time."""

    def change(tables: Tables) -> Tables:
        by: float = ceil(DEAD_TIME / tables["sampling_time"]) if key == "delay" else DEAD_TIME
        return {**tables, "disturbances": {**tables.get("disturbances", {}), key: by, **others}}

    return change


#: By name, the condition that is changed, and the change.
KNOWN = {
    "disturbed": ("disturbed", without()),
    **{f"{name} known": ("disturbed", without(name)) for name in (*DISTURBANCES, "motion")},
    "all known": ("disturbed", without(*DISTURBANCES, "motion")),
}
NOMINAL = {"nominal": ("nominal", lambda tables: tables)}


@dataclass(frozen=True)
class Changed:
    """Family whose scenes have other conditions."""

    family: Family
    study: str

    name = property(lambda self: self.family.name)
    folder = property(lambda self: self.family.folder)

    def set_up(self, number: int, half: str, seed: int) -> tuple[Drawn, Mapping[str, Any]]:
        """Set up a scene of the family with the conditions of the study."""
        scene = self.family.scene(number, half, seed)
        changes = STUDIES[self.study][0]
        return replace(
            scene, tables={name: change(scene.tables[of]) for name, (of, change) in changes.items()}
        ), {}


STUDIES: Mapping[str, tuple[Mapping[str, Any], Mapping[str, Mapping[str, Any]]]] = {
    "known": (KNOWN, LAWS),
    "images": (
        NOMINAL
        | {
            "late": ("nominal", late("delay")),
            "late, dated": ("nominal", late("delay", delay_known=True)),
        },
        told(**OBSERVER, dead_time=DEAD_TIME),
    ),
    "commands": (
        NOMINAL | {"late": ("nominal", late("command_delay"))},
        told(command_delay=DEAD_TIME),
    ),
    "horizons": (
        NOMINAL | {"disturbed": KNOWN["disturbed"]},
        {
            f"{law}-{blocks}": {"type": law, "horizon": blocks}
            for law in PREDICTIVE
            for blocks in (10, 20, 30)
        },
    ),
}


def _runs(task: Batch) -> Any:
    return scored(task).runs.to_pandas()


def measured(study: str, scenes: int) -> Any:
    """Return all runs of a study, with their success."""
    conditions, laws = STUDIES[study]
    entries = (
        ControllerSpec(BASELINE),
        *(ControllerSpec.from_table(name, {**table}, "laws") for name, table in laws.items()),
    )
    chosen = TestSet.load().chosen((), "held-out", scenes, None)
    tasks = [
        Batch(
            Changed(family, study),
            (number,),
            tuple(conditions),
            entries,
            "held-out",
            chosen["seed"],
        )
        for number in range(scenes)
        for family in chosen["families"]
    ]
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        runs = pd.concat(pool.map(_runs, tasks), ignore_index=True)
    return runs[runs["controller"] != BASELINE].assign(
        success=lambda runs: OUTCOMES["success"].flag(runs)
    )


def main(arguments: Sequence[str]) -> int:
    """Print the tables."""
    parser = ArgumentParser(prog="python -m checks.known", description=__doc__)
    parser.add_argument("--scenes", type=int, default=20, help="of each family")
    parser.add_argument("--study", choices=STUDIES, action="append")
    options = parser.parse_args(arguments)
    for study in options.study or STUDIES:
        runs = measured(study, options.scenes)
        first = next(iter(STUDIES[study][0]))
        wide = runs.pivot(
            index=["family", "scene", "controller"], columns="condition", values="success"
        )
        wide = wide[[*STUDIES[study][0]]].astype(float)
        print(f"\n{study}: {len(runs)} runs, success in per cent\n")
        for law in STUDIES[study][1]:
            own = wide.xs(law, level="controller")
            print(law)
            print(
                (100.0 * own.groupby("family", sort=False).mean()).to_string(
                    float_format="{:.0f}".format
                )
            )
            before = wide.xs(law.removesuffix(", told"), level="controller")[first] == 1.0
            for name in own:
                change = mcnemar(own[name] == 1.0, before)
                low = 100.0 * change.low
                high = 100.0 * change.high
                points = (
                    f"{100.0 * change.difference:+.1f} ({low:.1f} to {high:.1f}), p = "
                    f"{change.p:.2g}"
                )
                print(f"  {name}: {100.0 * own[name].mean():.1f}, {points}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
