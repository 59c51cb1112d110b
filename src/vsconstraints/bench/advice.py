"""Recommendation of a law for a scene, based on the runs of a study in similar scenes."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from itertools import chain
from typing import Any, NamedTuple

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
    ("sampling_time", 1),
    ("noise", 1),
    ("delay", 1),
    ("constraints", 1),
    ("sampling_time", 2),
    ("joints", 1),
    ("fixed_camera", 2),
    ("feature", 2),
    ("constraints", 2),
    ("joints", 2),
    ("noise", 2),
    ("limits", 2),
    ("delay", 2),
    ("wrong_model", 2),
    ("unknown_motion", 2),
    ("images", 2),
    ("mass", 2),
)
#: Number of steps up to which scenes still count as similar to the situation.
FAR = STEPS.index(("constraints", 2))


class Judged(NamedTuple):
    """Performance of a law in similar scenes."""

    law: ControllerSpec
    requires: tuple[str, ...]
    success: Rate
    tolerant: Rate
    loss: PairedRates  #: Success of the recommended law minus that of this law, paired by scene.
    best: bool  #: Not significantly different from the law with the highest success.
    call_us: float  #: Median time of a controller call [µs].


class SimilarScenes(NamedTuple):
    """Scenes of a study that are similar to a situation, and how they may differ from it."""

    scenes: Any  #: DataFrame with the keys of the scenes, each in its most similar condition.
    widened: tuple[str, ...]  #: See :class:`Advice`.
    unlike: tuple[str, ...]  #: See :class:`Advice`.


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
        if shared == every:
            return 0
        return 1 if 2 * shared >= every else 2
    if name == "joints":
        return min(abs(int(asked) - int(other)), 2)
    if isinstance(asked, bool | str) or min(asked, other) <= 0.0:
        return 0 if asked == other else 2
    ratio = max(asked, other) / min(asked, other)
    if ratio <= ALIKE:
        return 0
    return 1 if ratio <= NEAR else 2


def similar(scenes: Any, situation: Situation) -> SimilarScenes:
    """Select the scenes of a study that are similar to a situation.

    ``scenes`` is a DataFrame with the properties of each scene in each condition. The search takes
    the scenes that are nearest in all properties, then widens by one of :data:`STEPS` after the
    other, until it has found :data:`ENOUGH`.
    """
    scenes = scenes.reset_index(drop=True)
    # numbers of the steps that permit each scene: 0 at the start, then one for each property
    steps = scenes[[]].assign(start=0)
    unlike = []
    for name, asked in situation.specified.items():
        values = scenes[name].dropna().unique()
        unlike += _unlike(name, asked, values)
        if len(values):
            steps[name] = scenes[name].map(_permitting_steps(name, asked, values))
    # a scene is taken with the step that permits the last of its properties
    last_step = steps.max(axis=1, skipna=False)
    by_step = scenes.assign(step=last_step).sort_values("step", kind="stable")
    in_best_condition = by_step.drop_duplicates(SCENE)
    step = in_best_condition["step"]
    enough = step.head(ENOUGH)
    taken = in_best_condition[step <= enough.iloc[-1]]
    n_similar = int((step <= FAR).sum())
    if n_similar < ENOUGH:
        unlike.append(f"only {n_similar} scenes are similar, fewer than {ENOUGH}")
    widened = []
    used = {*steps.loc[taken.index].to_numpy().flat}
    for i, (name, how_far) in enumerate(STEPS, start=1):
        if i in used:
            extent = "similar" if how_far == 1 else "any"
            widened.append(f"{extent} {_in_words(name)}")
    return SimilarScenes(
        scenes=taken[[*SCENE, CONDITION]],
        widened=tuple(widened),
        unlike=tuple(unlike),
    )


def _permitting_steps(name: str, asked: Any, values: Iterable[Any]) -> dict[Any, int]:
    """Return for each value of a property the number of the step from which it is permitted.

    It is 0, permitted from the start, for the nearest values, however far they are from the one
    that is asked: a property that no scene shares does not distinguish these scenes.
    """
    distances = {value: distance(name, asked, value) for value in values}
    nearest = min(distances.values())
    steps = {}
    for value, how_far in distances.items():
        steps[value] = 0
        if how_far > nearest:
            steps[value] = 1 + STEPS.index((name, how_far))
    return steps


def _unlike(name: str, asked: Any, values: Collection[Any]) -> list[str]:
    """Return sentences if no scene of a study has a property, given its values in the study."""
    words = _in_words(name)
    if not len(values):
        return [f"the study has no {words}"]
    if name == "constraints":
        known = set(chain.from_iterable(values))
        return [f"no scene has {kind}" for kind in asked if kind not in known]
    if isinstance(asked, bool | str):
        return [] if asked in values else [f"no scene has {words}: {asked}"]
    least = min(values)
    greatest = max(values)
    if least <= asked <= greatest:
        return []
    return [f"{words} {asked:.3g}: {least:.3g} to {greatest:.3g} in all scenes"]


def _in_words(name: str) -> str:
    return name.replace("_", " ")


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
    names = []
    for name, information in requires.items():
        if may_use is None or set(information).issubset(may_use):
            names.append(name)
    if not names:
        raise ConfigurationError(
            f"every law of the study needs more than {', '.join(sorted(may_use or ()))}"
        )
    scenes, widened, unlike = similar(study.scenes, situation)
    runs = study.runs.merge(scenes)
    success = runs.pivot(index=SCENE, columns="controller", values="success")
    tolerant = runs.pivot(index=SCENE, columns="controller", values="tolerant_success")
    calls = runs.pivot(index=SCENE, columns="controller", values="call_us").median()
    overall = study.runs.groupby("controller")["success"].mean()
    weight = len(success) + ENOUGH
    score = (success.sum() + ENOUGH * overall) / weight
    names.sort(key=lambda name: -score[name])
    pair_count = math.comb(len(names), 2)
    confidence = simultaneous(0.95, pair_count)

    def loss(law: str, against: str) -> PairedRates:
        return mcnemar(success[against], success[law], confidence)

    first = names[0]
    best = []
    candidates = []
    for name in names:
        behind = loss(name, first)
        if distinguishable(behind.low, behind.high, behind.n):
            continue
        best.append(name)
        differences = success[first] * 1.0 - success[name]
        deviation = differences.std(ddof=0)
        standard_error = math.sqrt(len(success)) * deviation / weight
        if score[first] - score[name] <= margin * standard_error:
            candidates.append(name)

    def cost(name: str) -> tuple[bool, bool, float]:
        information = requires[name]
        return "model" in information, "L_fφ" in information, float(calls[name])

    chosen = min(candidates, key=cost)
    laws = []
    for name in sorted(names, key=lambda name: name != chosen):
        law = Judged(
            study.laws[name],
            requires[name],
            success=rate(success[name]),
            tolerant=rate(tolerant[name]),
            loss=loss(name, chosen),
            best=name in best,
            call_us=float(calls[name]),
        )
        laws.append(law)
    return Advice(
        laws=tuple(laws),
        families=tuple(dict.fromkeys(scenes["family"])),
        widened=widened,
        unlike=unlike,
    )
