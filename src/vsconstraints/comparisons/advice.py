"""Which law for a scene: what a study says of scenes like it, and what another choice loses."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..errors import ConfigurationError, VsconstraintsError
from ..scenarios import Scenario
from .evidence import Evidence, parquet
from .evidence.parquet import KEYS, Column, Kind
from .runs.spec import BASELINE, ControllerSpec
from .statistics import OUTCOMES, PairedRates, Rate, distinguishable, mcnemar, rate, simultaneous

SHIPPED = Path(__file__).with_name("study.parquet")  #: the study that comes with the package
FORMAT = 1  #: of a study's table: another number is another version's
ENOUGH = 20  #: scenes that advice rests on, where the study has them; all others together count as many
MARGIN = 1.0  #: standard errors that a law which requires less may lose
ALIKE, NEAR = 2.0, 4.0  #: factors between two numbers that are alike, and near

#: What may differ of scenes, one after the other, until there are enough: 1 is near, 2 is anything. First is what laws'
#: success depends on least.
STEPS = (
    ("sampling_time", 1), ("noise", 1), ("delay", 1), ("constraints", 1), ("sampling_time", 2), ("joints", 1),
    ("fixed_camera", 2), ("feature", 2), ("constraints", 2), ("joints", 2), ("noise", 2), ("limits", 2), ("delay", 2),
    ("wrong_model", 2), ("unknown_motion", 2), ("images", 2), ("mass", 2),
)  # fmt: skip
FAR = STEPS.index(("constraints", 2))  #: steps after which scenes are no longer like the one that is asked about


@dataclass(frozen=True)
class Situation:
    """A scene in a condition, as laws meet it; None is what is not said, and is like anything."""

    joints: int | None = None
    feature: str | None = None
    fixed_camera: bool | None = None  #: Fixed in space, not carried by the robot.
    constraints: tuple[str, ...] | None = None  #: Their types, sorted.
    sampling_time: float | None = None  #: T_s [s].
    delay: float | None = None  #: How old an image is when it can be used [s].
    noise: float | None = None  #: Standard deviation of a pixel coordinate [px].
    unknown_motion: bool | None = None  #: Of the target or of something forbidden.
    wrong_model: bool | None = None  #: Whether calibration, depths, gradients or actuation are not as believed.
    limits: bool | None = None  #: Of accelerations.
    mass: bool | None = None  #: Of the arm.
    images: bool | None = None  #: Whether the control sees rendered images.

    @classmethod
    def of(cls, scenario: Scenario) -> Situation:
        """That of a scenario; raises what :meth:`.Scenario.setup` raises."""
        setup = scenario.setup()
        own, images = setup.disturbances, setup.images
        types = {str(table["type"]) for table in scenario.tables.get("constraints", ())}
        delay = own.delay * (own.image_period or setup.Ts) if images is None else images.latency_s
        delay += own.command_delay
        unknown = setup.constraints.has_unknown_motion(setup.scene)
        believed = own.intrinsics, own.distortion, own.mount, own.target, own.depth_factor != 1.0, own.gradient_error
        wrong = any((*believed, own.time_constant, own.acceleration_noise, *own.acceleration))
        return cls(
            setup.scene.robot.n, setup.task.feature.name, setup.scene.camera.fixed is not None, tuple(sorted(types)),
            setup.Ts, delay, own.pixel_noise, unknown, wrong, setup.limits.any, setup.dynamics is not None,
            images is not None,
        )  # fmt: skip

    @property
    def said(self) -> dict[str, Any]:
        """What is not None, by name."""
        return {name: value for name, value in vars(self).items() if value is not None}


SCENE, CONDITION = ["family", "scene"], "condition"  #: conditions of a scene are not independent of each other
_KINDS: Mapping[str, Kind] = {"int": "whole", "float": "number", "bool": "flag"}
_SITUATION = [Column(field.name, _KINDS.get(str(field.type).partition(" ")[0], "text")) for field in fields(Situation)]
_RESULTS = Column("success", "flag"), Column("tolerant_success", "flag"), Column("call_us", "number")
#: Of a study's table, which has one line for each run of a law: its keys, its situation, and what came of it.
COLUMNS = (*KEYS, *_SITUATION, *_RESULTS, Column("settling_time_s", "number"))


@dataclass(frozen=True)
class Study:
    """Runs of laws, a DataFrame with :data:`COLUMNS`, and the laws' settings by the names that runs have."""

    runs: Any
    laws: Mapping[str, ControllerSpec]

    @classmethod
    def load(cls, path: Path = SHIPPED, trust: bool = False, on_scene: Callable[[int, int], Any] = max) -> Study:
        """A table that was kept, or a folder of ``vsconstraints evidence``, whose scenes are set up again.

        Raises ConfigurationError that names what cannot be read, is another version's, or holds no run of a law.
        """
        facts = {} if path.is_dir() else parquet.facts_of(path)
        if facts and (facts.get("study") != FORMAT or not isinstance(facts.get("controllers"), dict)):
            why = f"its format is {facts.get('study')}, not {FORMAT}; --keep makes one of a folder of evidence"
            raise ConfigurationError(f"{path} is no study of this version: {why}")
        if facts:
            runs, laws = parquet.read([path], COLUMNS).to_pandas(), facts["controllers"]
        else:
            runs, laws = _of_evidence(Evidence.load(path, trust), on_scene)
        specs = {name: ControllerSpec.from_table(name, own) for name, own in laws.items()}
        for name, law in specs.items():
            try:
                law.make()
            except VsconstraintsError as error:
                raise ConfigurationError(f"{path}: the law {name} is another version's: {error}") from error
        whole = runs.groupby([*SCENE, CONDITION])["controller"].agg(lambda own: sorted(own) == sorted(specs))
        if not specs or not len(runs) or not whole.all():
            why = "it is empty" if whole.all() else "not every law has one run in each scene"
            raise ConfigurationError(f"{path} is no study of laws that come with the package: {why}")
        return cls(runs, specs)

    def keep(self, path: Path) -> None:
        """Write the table, which :meth:`load` reads; raises OSError."""
        laws = {name: law.table for name, law in self.laws.items()}
        facts = {"study": FORMAT, "version": __version__, "controllers": laws}
        parquet.write(path, parquet.table(COLUMNS, self.runs.to_dict("records")), facts)

    @cached_property
    def scenes(self) -> Any:
        """A DataFrame with one line for each scene in each condition: its keys and its situation."""
        scenes = self.runs.drop_duplicates([*SCENE, CONDITION])[[*SCENE, CONDITION, *vars(Situation())]]
        return scenes.assign(constraints=[tuple(filter(None, text.split("; "))) for text in scenes["constraints"]])


def _of_evidence(evidence: Evidence, on_scene: Callable[[int, int], Any]) -> tuple[Any, dict[str, Any]]:
    if (version := evidence.manifest.get("version")) != __version__:
        why = f"is of version {version}, and scenes of {__version__} may be others: let that version --keep its table"
        raise ConfigurationError(f"{evidence.folder} {why}")
    laws = evidence.manifest["configuration"]["controllers"].items()
    shipped = {name: dict(own) for name, own in laws if name != BASELINE and ":" not in own.get("type", name)}
    runs, lines = evidence.runs[evidence.runs["controller"].isin(shipped)], []
    runs = runs.assign(
        success=OUTCOMES["success"].flag(runs),
        tolerant_success=OUTCOMES["tolerant success"].flag(runs),
        settling_time_s=runs["settling_time_s"].round(2),
        call_us=[float(f"{each:.2g}") for each in runs["step_time_median_us"]],
    )
    scenes = runs.groupby(SCENE, observed=True)
    for done, ((family, number), own) in enumerate(scenes):
        on_scene(done, len(scenes))
        scene = evidence.drawn(family, number)
        for condition, each in own.groupby(CONDITION, observed=True):
            known = Situation.of(scene.scenario(condition)).said
            known["constraints"] = "; ".join(known["constraints"])
            lines += [{**line, **known} for line in each.to_dict("records")]
    return parquet.table(COLUMNS, lines).to_pandas(), shipped


class Judged(NamedTuple):
    """A law in similar scenes."""

    law: ControllerSpec
    requires: tuple[str, ...]
    success: Rate
    tolerant: Rate
    loss: PairedRates  #: Success of the recommended law less its own on the same scenes.
    best: bool  #: Not distinguishable from the law that succeeds most often.
    call_us: float  #: Median time of a call [µs].


class Advice(NamedTuple):
    """The laws, the recommended one first, then by success, and what that rests on."""

    laws: tuple[Judged, ...]
    families: tuple[str, ...]  #: Of the scenes.
    widened: tuple[str, ...]  #: In what they differ from the situation.
    unlike: tuple[str, ...]  #: In what it is unlike anything in the study.


def distance(name: str, asked: Any, there: Any) -> int:
    """0 of two values that are alike, 1 of those that are near, 2 of others.

    Near is one joint more or less, half of the types of constraints in common, or a number within the factor.
    """
    if name == "constraints":
        shared, every = len({*asked} & {*there}), len({*asked} | {*there})
        return 0 if shared == every else 1 if 2 * shared >= every else 2
    if name == "joints":
        return min(abs(int(asked) - int(there)), 2)
    if isinstance(asked, bool | str) or min(asked, there) <= 0.0:
        return 0 if asked == there else 2
    ratio = max(asked, there) / min(asked, there)
    return int(ratio > ALIKE) + int(ratio > NEAR)


def similar(scenes: Any, situation: Situation) -> tuple[Any, tuple[str, ...], tuple[str, ...]]:
    """Of a study's scenes those like one, each in the condition most like it; ``widened``, ``unlike`` of an advice."""
    steps, reasons = {}, []
    for name, asked in situation.said.items():
        far = {value: distance(name, asked, value) for value in scenes[name].unique()}
        if name == "constraints":
            reasons += [f"no scene has {kind}" for kind in asked if not any(kind in kinds for kinds in far)]
        elif isinstance(asked, bool | str) and asked not in far:
            reasons.append(f"no scene has {name.replace('_', ' ')}: {asked}")
        elif not isinstance(asked, bool | str) and not min(far) <= asked <= max(far):
            reasons.append(f"{name.replace('_', ' ')} {asked:.3g}: {min(far):.3g} to {max(far):.3g} in all scenes")
        # in what no scene is like it they are not told from each other
        step = {value: 1 + STEPS.index((name, d)) if d > min(far.values()) else 0 for value, d in far.items()}
        steps[name] = scenes[name].map(step)
    levels = scenes.assign(**steps, level=np.max([np.zeros(len(scenes), int), *steps.values()], axis=0))
    levels = levels.sort_values("level", kind="stable").drop_duplicates(SCENE)
    taken = levels[levels["level"] <= levels["level"].iloc[min(ENOUGH, len(levels)) - 1]]
    if (like := int((levels["level"] <= FAR).sum())) < ENOUGH:
        reasons.append(f"{like} scenes are like it, fewer than {ENOUGH}")
    reached = [STEPS[step - 1] for step in sorted({step for name in steps for step in taken[name]} - {0})]
    widened = tuple(f"{('similar', 'any')[reach - 1]} {name.replace('_', ' ')}" for name, reach in reached)
    return taken[[*SCENE, CONDITION]], widened, tuple(reasons)


def advise(
    study: Study, situation: Situation, may_use: Collection[str] | None = None, margin: float = MARGIN
) -> Advice:
    """The law for a situation, of those that require (:attr:`.Controller.uses`) nothing that is not in ``may_use``.

    Laws are ordered by success in similar scenes, to which those of the whole study add as much as :data:`ENOUGH`
    scenes. Of laws that are not distinguishable from the first, and no more than ``margin`` standard errors of the
    difference behind it, the one is recommended that requires least: no model, no L_fφ, the shortest call. Intervals of
    differences hold for all pairs of laws at once. Raises ConfigurationError if no law may be used.
    """
    requires = {name: law.make().uses for name, law in study.laws.items()}
    names = [name for name in requires if may_use is None or {*requires[name]} <= {*may_use}]
    if not names:
        raise ConfigurationError(f"no law of the study uses no more than {', '.join(sorted(may_use or ()))}")
    scenes, widened, reasons = similar(study.scenes, situation)
    runs, overall = study.runs.merge(scenes), study.runs.groupby("controller")["success"].mean()
    good, tolerant, calls = (runs.pivot(index=SCENE, columns="controller", values=c.name) for c in _RESULTS)
    score = (good.sum() + ENOUGH * overall) / (len(good) + ENOUGH)
    names.sort(key=lambda name: -score[name])
    confidence, first = simultaneous(0.95, math.comb(len(names), 2)), names[0]

    def loss(law: str, against: str) -> PairedRates:
        return mcnemar(good[against], good[law], confidence)

    behind = {name: loss(name, first) for name in names}
    best = {name: not distinguishable(pair.low, pair.high, pair.n) for name, pair in behind.items()}
    error = {n: math.sqrt(len(good)) * (good[first] * 1.0 - good[n]).std(ddof=0) / (len(good) + ENOUGH) for n in names}
    near = [name for name in names if best[name] and score[first] - score[name] <= margin * error[name]]
    call = {name: float(calls[name].median()) for name in names}
    chosen = min(near, key=lambda name: ("model" in requires[name], "L_fφ" in requires[name], call[name]))
    laws = tuple(
        Judged(study.laws[n], requires[n], rate(good[n]), rate(tolerant[n]), loss(n, chosen), best[n], call[n])
        for n in sorted(names, key=lambda name: name != chosen)
    )
    return Advice(laws, tuple(dict.fromkeys(scenes["family"])), widened, reasons)
