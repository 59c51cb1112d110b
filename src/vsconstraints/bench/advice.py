"""Recommendation of a law for a scene, based on the runs of a study in similar scenes."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from ..comparisons.runs.spec import ControllerSpec
from ..errors import ConfigurationError
from .statistics import PairedRates, Rate, distinguishable, mcnemar, rate, simultaneous
from .study import CONDITION, SCENE, Situation, Study

#: Number of similar scenes used, if the study has as many. The mean over the whole study is added
#: with the same weight.
ENOUGH = 20
#: Standard errors of success by which a law with less required information may be worse.
MARGIN = 0.25
#: Two numbers are alike up to the first ratio, and near up to the second.
ALIKE = 2.0
NEAR = 4.0

#: Order in which the search is widened until it has found enough scenes. Each step permits one
#: property to be near (1) or arbitrary (2). Properties that affect success least come first.
STEPS = (
    ("sampling_time", 1), ("noise", 1), ("delay", 1), ("constraints", 1), ("sampling_time", 2),
    ("joints", 1), ("fixed_camera", 2), ("feature", 2), ("constraints", 2), ("joints", 2),
    ("noise", 2), ("limits", 2), ("delay", 2), ("wrong_model", 2), ("unknown_motion", 2),
    ("images", 2), ("mass", 2),
)  # fmt: skip
#: Number of steps up to which scenes still count as similar to the situation.
FAR = STEPS.index(("constraints", 2))


_RESULTS = "success", "tolerant_success", "call_us"


class Judged(NamedTuple):
    """Performance of a law in similar scenes."""

    law: ControllerSpec
    requires: tuple[str, ...]
    success: Rate
    tolerant: Rate
    loss: PairedRates  #: Success of the recommended law minus that of this law, paired by scene.
    best: bool  #: Not significantly different from the law with the highest success.
    call_us: float  #: Median time of a controller call [µs].


class Advice(NamedTuple):
    """Ranking of laws, the recommended one first, then by success, and the scenes it rests on."""

    laws: tuple[Judged, ...]
    families: tuple[str, ...]  #: Scenario families of the similar scenes.
    widened: tuple[str, ...]  #: Properties in which the scenes may differ from the situation.
    unlike: tuple[str, ...]  #: Properties of the situation that no scene of the study has.


def distance(name: str, asked: Any, other: Any) -> int:
    """Return 0 if two values of a property are alike, 1 if they are near, 2 otherwise.

    Numbers of joints are near if they differ by one. Sets of constraints are near if they have half
    of their types in common.
    """
    if name == "constraints":
        shared = len({*asked} & {*other})
        every = len({*asked} | {*other})
        return 0 if shared == every else 1 if 2 * shared >= every else 2
    if name == "joints":
        return min(abs(int(asked) - int(other)), 2)
    if isinstance(asked, bool | str) or min(asked, other) <= 0.0:
        return 0 if asked == other else 2
    ratio = max(asked, other) / min(asked, other)
    return int(ratio > ALIKE) + int(ratio > NEAR)


def similar(scenes: Any, situation: Situation) -> tuple[Any, tuple[str, ...], tuple[str, ...]]:
    """Select the scenes of a study that are similar to a situation.

    Return the keys of the scenes, each in the condition most similar to the situation, and
    ``widened`` and ``unlike`` of :class:`Advice`.
    """
    steps = {}
    reasons = []
    for name, asked in situation.specified.items():
        far = {value: distance(name, asked, value) for value in scenes[name].dropna().unique()}
        if not far:
            reasons.append(f"the study has no {name.replace('_', ' ')}")
            continue
        if name == "constraints":
            reasons += [
                f"no scene has {kind}" for kind in asked if not any(kind in kinds for kinds in far)
            ]
        elif isinstance(asked, bool | str) and asked not in far:
            reasons.append(f"no scene has {name.replace('_', ' ')}: {asked}")
        elif not isinstance(asked, bool | str) and not min(far) <= asked <= max(far):
            reasons.append(
                f"{name.replace('_', ' ')} {asked:.3g}: {min(far):.3g} to {max(far):.3g} in all "
                f"scenes"
            )
        # a property that no scene shares does not distinguish scenes at the smallest distance
        step = {
            value: 1 + STEPS.index((name, d)) if d > min(far.values()) else 0
            for value, d in far.items()
        }
        steps[name] = scenes[name].map(step)
    levels = scenes.assign(
        **steps, level=np.max([np.zeros(len(scenes), int), *steps.values()], axis=0)
    )
    levels = levels.sort_values("level", kind="stable").drop_duplicates(SCENE)
    taken = levels[levels["level"] <= levels["level"].iloc[min(ENOUGH, len(levels)) - 1]]
    if (like := int((levels["level"] <= FAR).sum())) < ENOUGH:
        reasons.append(f"only {like} scenes are similar, fewer than {ENOUGH}")
    reached = [
        STEPS[step - 1] for step in sorted({step for name in steps for step in taken[name]} - {0})
    ]
    widened = tuple(
        f"{('similar', 'any')[reach - 1]} {name.replace('_', ' ')}" for name, reach in reached
    )
    return taken[[*SCENE, CONDITION]], widened, tuple(reasons)


def advise(
    study: Study,
    situation: Situation,
    may_use: Collection[str] | None = None,
    margin: float = MARGIN,
) -> Advice:
    """Recommend a law for a situation, given the information that may be used.

    Only laws whose required information (:attr:`.Controller.uses`) is in ``may_use`` are
    considered. Laws are ordered by success in similar scenes; the mean over the whole study is
    added with the weight of :data:`ENOUGH` scenes. Candidates are the laws that do not differ
    significantly from the first one and are at most ``margin`` standard errors of the difference
    behind it. The candidate with the least required information is recommended: no model, no L_fφ,
    then the shortest call. Raises ConfigurationError if no law may be used.
    """
    requires = {name: law.make().uses for name, law in study.laws.items()}
    names = [name for name in requires if may_use is None or {*requires[name]} <= {*may_use}]
    if not names:
        raise ConfigurationError(
            f"every law of the study needs more than {', '.join(sorted(may_use or ()))}"
        )
    scenes, widened, reasons = similar(study.scenes, situation)
    runs = study.runs.merge(scenes)
    overall = study.runs.groupby("controller")["success"].mean()
    good, tolerant, calls = (
        runs.pivot(index=SCENE, columns="controller", values=c) for c in _RESULTS
    )
    score = (good.sum() + ENOUGH * overall) / (len(good) + ENOUGH)
    names.sort(key=lambda name: -score[name])
    confidence = simultaneous(0.95, math.comb(len(names), 2))
    first = names[0]

    def loss(law: str, against: str) -> PairedRates:
        return mcnemar(good[against], good[law], confidence)

    behind = {name: loss(name, first) for name in names}
    best = {name: not distinguishable(pair.low, pair.high, pair.n) for name, pair in behind.items()}
    error = {
        n: math.sqrt(len(good)) * (good[first] * 1.0 - good[n]).std(ddof=0) / (len(good) + ENOUGH)
        for n in names
    }
    near = [
        name for name in names if best[name] and score[first] - score[name] <= margin * error[name]
    ]
    call = {name: float(calls[name].median()) for name in names}
    chosen = min(
        near, key=lambda name: ("model" in requires[name], "L_fφ" in requires[name], call[name])
    )
    laws = tuple(
        Judged(
            study.laws[n],
            requires[n],
            rate(good[n]),
            rate(tolerant[n]),
            loss(n, chosen),
            best[n],
            call[n],
        )
        for n in sorted(names, key=lambda name: name != chosen)
    )
    return Advice(laws, tuple(dict.fromkeys(scenes["family"])), widened, reasons)
