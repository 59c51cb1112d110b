"""Study: runs of laws with the situation of each run, stored as one table to check and read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from .. import __version__
from ..comparisons.runs.spec import BASELINE, ControllerSpec
from ..controllers import FORMER_LAWS
from ..errors import ConfigurationError, VsconstraintsError, format_value
from ..plugins.provenance import Files
from ..scenarios import Scenario
from ..scenarios.reading import Table, checked
from ..simulation.programs import declared_in
from .evidence import Evidence, parquet
from .evidence.parquet import KEYS, Column, Kind
from .statistics import OUTCOMES

SHIPPED = Path(__file__).with_name("study.parquet")  #: The study that comes with the package.
FORMAT = 2  #: Format of a study's table; other versions have other numbers.


@dataclass(frozen=True)
class Situation:
    """Properties of a scene in a condition that matter to laws; None matches anything."""

    joints: int | None = None
    feature: str | None = None
    fixed_camera: bool | None = None  #: Fixed in space, not carried by the robot.
    constraints: tuple[str, ...] | None = None  #: Sorted types of the constraints.
    sampling_time: float | None = None  #: T_s [s].
    delay: float | None = None  #: Age of an image when it becomes usable [s].
    noise: float | None = None  #: Standard deviation of a pixel coordinate [px].
    unknown_motion: bool | None = None  #: Unknown motion of the target or of an obstacle.
    #: True if calibration, depths, gradients or actuation deviate from the model.
    wrong_model: bool | None = None
    limits: bool | None = None  #: True if accelerations are limited.
    mass: bool | None = None  #: True if the dynamics of the arm are simulated.
    images: bool | None = None  #: True if the controller uses rendered images.

    @classmethod
    def of(cls, scenario: Scenario) -> Situation:
        """Return the situation of a scenario; raises the errors of :meth:`.Scenario.setup`."""
        setup = scenario.setup()
        disturbances = setup.disturbances
        images = setup.images
        types = {str(table["type"]) for table in scenario.tables.get("constraints", ())}
        if images is None:
            image_period = disturbances.image_period or setup.Ts
            delay = disturbances.delay * image_period
        else:
            delay = images.latency_s
        errors = (
            disturbances.intrinsics,
            disturbances.distortion,
            disturbances.mount,
            disturbances.target,
            disturbances.depth_factor != 1.0,
            disturbances.gradient_error,
            disturbances.time_constant,
            disturbances.acceleration_noise,
            *disturbances.acceleration,
        )
        return cls(
            joints=setup.scene.robot.n,
            feature=setup.task.feature.name,
            fixed_camera=setup.scene.camera.fixed is not None,
            constraints=tuple(sorted(types)),
            sampling_time=setup.Ts,
            delay=delay + disturbances.command_delay,
            noise=disturbances.pixel_noise,
            unknown_motion=setup.constraints.has_unknown_motion(setup.scene),
            wrong_model=any(errors),
            limits=setup.limits.any,
            mass=setup.dynamics is not None,
            images=images is not None,
        )

    @property
    def specified(self) -> dict[str, Any]:
        """Specified properties by name."""
        return {name: value for name, value in vars(self).items() if value is not None}


SCENE = ["family", "scene"]  #: Key of a scene; its conditions are not independent of each other.
CONDITION = "condition"
_KINDS: Mapping[str, Kind] = {"int": "whole", "float": "number", "bool": "flag"}
_SITUATION_KINDS: Mapping[str, Kind] = {
    # the type of a property is written as "int | None"
    each.name: _KINDS.get(str(each.type).partition(" ")[0], "text")
    for each in fields(Situation)
}
# an empty text would say that a scene has no constraints
_SITUATION = [
    Column(name, kind, required=kind == "text") for name, kind in _SITUATION_KINDS.items()
]
#: Result of a run, which does not depend on the machine; see ``results.csv``.
_NUMBERS = "violation_fraction", "settling_time_s", "utilization", "acceleration_variation"
OUTCOME = (
    Column("status", "text", category=True, required=True),
    Column("violated", "text", required=True),
    *(Column(name, "number", required=name == "violation_fraction") for name in _NUMBERS),
)
_SUCCESS = (
    Column("success", "flag", required=True),
    Column("tolerant_success", "flag", required=True),
    Column("call_us", "number"),
)
#: Columns that are empty for runs that failed immediately or never settled. Cells of all other
#: columns are never empty, except those of a column that an earlier version did not write.
_MAY_BE_EMPTY = (*_NUMBERS, "call_us")
#: Columns of a study's table, which has one line for each run of a law: keys, situation, result.
COLUMNS = (*KEYS, *_SITUATION, *_SUCCESS, *OUTCOME)


@dataclass(frozen=True)
class Study:
    """Runs of laws, a DataFrame with :data:`COLUMNS`, and the laws' settings by controller name.

    ``requires`` holds the required information of each law beyond rows and task. Of a stack, it is
    all that it declared in its runs; of another custom law, whose code is not imported, it is None.
    ``frozen`` holds, for each family of a test set and by half, the seed and the hash of its
    scenes. ``files`` are hashes of the files that custom laws have loaded or read, see
    :mod:`.own_files`.
    """

    runs: Any
    laws: Mapping[str, ControllerSpec]
    requires: Mapping[str, Sequence[str] | None] = field(default_factory=dict)
    frozen: Mapping[str, Table] = field(default_factory=dict)
    files: Files = field(default_factory=dict)

    @property
    def missing_results(self) -> tuple[str, ...]:
        """Columns of results without any value, for example since an earlier version wrote none."""
        names = [column.name for column in (*_SUCCESS, *OUTCOME)]
        return tuple(name for name in names if self.runs[name].isna().all())

    @classmethod
    def load(
        cls,
        path: Path | Sequence[Path] = SHIPPED,
        trust: bool = False,
        on_scene: Callable[[int, int], Any] = max,
        custom_laws: bool = False,
    ) -> Study:
        """Load a stored table, or build the study from folders of ``vsconstraints evidence``.

        Several folders are read as one campaign. Their scenes are set up again. Laws that do not
        come with the package are left out unless ``custom_laws``; their code is never imported.
        Raises ConfigurationError that names the problem if the data cannot be read, belongs to
        another version, or contains no run of a law.
        """
        if not isinstance(path, Path):
            path = path[0] if len(path) == 1 else tuple(path)
        if not isinstance(path, Path) or path.is_dir():
            study = _of_evidence(Evidence.load(path, trust), on_scene)
        else:
            study = _of_table(path, parquet.facts_of(path))
        if not custom_laws:
            laws = {name: law for name, law in study.laws.items() if ":" not in law.law}
            runs = study.runs[study.runs["controller"].isin(laws)]
            study = replace(study, laws=laws, runs=runs)
        study.require_valid(path)
        return study

    def require_valid(self, source: object) -> None:
        """Raise ConfigurationError unless each law can be made and has one run in each scene.

        ``source`` is the file or folder of the study.
        """
        for name, law in self.laws.items():
            try:
                if ":" not in law.law and law.law not in FORMER_LAWS:
                    law.make()
            except VsconstraintsError as error:
                raise ConfigurationError(
                    f"{source}: the law {name} is from another version: {error}"
                ) from error
        names = sorted(self.laws)
        if not len(self.runs):
            raise ConfigurationError(f"{source} is not a study of the package's laws: it is empty")
        laws_of_scene = self.runs.groupby([*SCENE, CONDITION])["controller"]
        has_all_laws = laws_of_scene.agg(lambda laws: sorted(laws) == names)
        if not has_all_laws.all():
            raise ConfigurationError(
                f"{source} is not a study of the package's laws: not every law has one run in each "
                "scene"
            )
        for name in names:
            if name not in self.requires:
                raise ConfigurationError(
                    f"{source}: requires has no entry for the law {format_value(name)}"
                )

    def keep(self, path: Path) -> None:
        """Write the table for :meth:`load`; raises OSError."""
        laws = {name: law.table for name, law in self.laws.items()}
        facts: dict[str, Any] = {
            "study": FORMAT,
            "version": __version__,
            "controllers": laws,
            "requires": dict(self.requires),
            "frozen": dict(self.frozen),
        }
        if self.files:
            facts["files"] = dict(self.files)
        lines = parquet.table(COLUMNS, self.runs.to_dict("records"))
        parquet.write(path, lines, facts)

    @cached_property
    def scenes(self) -> Any:
        """DataFrame with one line per scene and condition: its keys and its situation."""
        key = [*SCENE, CONDITION]
        scenes = self.runs.drop_duplicates(key)[[*key, *vars(Situation())]]
        constraints = []
        for text in scenes["constraints"]:
            constraints.append(tuple(filter(None, text.split("; "))))
        return scenes.assign(constraints=constraints)


def _laws(entries: Mapping[str, Any]) -> dict[str, ControllerSpec]:
    """Read the laws by name, without the unconstrained baseline."""
    return {
        name: ControllerSpec.from_table(name, entry)
        for name, entry in entries.items()
        if name != BASELINE
    }


def _of_table(path: Path, facts: Mapping[str, Any]) -> Study:
    """Read a stored table with the facts in its footer; raises ConfigurationError if invalid."""
    where = str(path)
    if facts.get("study") != FORMAT:
        raise _unreadable(path, f"its format is {facts.get('study')}, not {FORMAT}")
    for name in ("controllers", "requires", "frozen"):
        if not isinstance(facts.get(name), dict):
            raise _unreadable(path, f"it has no {name}")
    requires = checked(facts["requires"], dict[str, Sequence[str] | None], where, "requires")
    frozen = checked(facts["frozen"], dict[str, Table], where, "frozen")
    files = checked(facts.get("files", {}), dict[str, str], where, "files")
    runs = parquet.read([path], COLUMNS).to_pandas()
    laws = _laws(facts["controllers"])
    for column in COLUMNS:
        empty = int(runs[column.name].isna().sum())
        missing = not column.required and empty == len(runs)
        if empty and not missing and column.name not in _MAY_BE_EMPTY:
            raise ConfigurationError(
                f"{path}: {empty} cells of column {column.name} are empty; write the table again "
                "with --keep"
            )
    return Study(runs, laws, requires, frozen, files)


def _unreadable(path: Path, why: str) -> ConfigurationError:
    return ConfigurationError(
        f"{path} is not a study that this version can read: {why}; write one with --keep from a "
        "folder of evidence"
    )


def _of_evidence(evidence: Evidence, on_scene: Callable[[int, int], Any]) -> Study:
    version = evidence.manifest.get("version")
    if version != __version__:
        raise ConfigurationError(
            f"{evidence.folder} is of version {version}, and scenes of {__version__} may differ: "
            "write it with --keep of that version"
        )
    configuration = evidence.manifest["configuration"]
    laws = _laws(configuration["controllers"])
    frozen = {}
    for name, family in configuration["families"].items():
        if "frozen" in family["tables"]:
            frozen[name] = family["tables"]["frozen"][configuration["half"]]
    runs = evidence.runs[evidence.runs["controller"].isin(laws)]
    runs = runs.assign(
        success=OUTCOMES["success"].flag(runs),
        tolerant_success=OUTCOMES["tolerant success"].flag(runs),
        call_us=[float(f"{each:.2g}") for each in runs["step_time_median_us"]],
    )
    requires = {}
    for name, law in laws.items():
        if ":" in law.law:
            reasons = runs.loc[runs["controller"] == name, "reason"]
            requires[name] = declared_in(reasons.dropna())
        else:
            requires[name] = law.make().uses
    lines = []
    scenes = runs.groupby(SCENE, observed=True)
    for done, ((family, number), scene_runs) in enumerate(scenes):
        on_scene(done, len(scenes))
        scene = evidence.drawn(family, number)
        for condition, each in scene_runs.groupby(CONDITION, observed=True):
            properties = Situation.of(scene.scenario(condition)).specified
            properties["constraints"] = "; ".join(properties["constraints"])
            for line in each.to_dict("records"):
                lines.append({**line, **properties})
    table = parquet.table(COLUMNS, lines).to_pandas()
    return Study(table, laws, requires, frozen, evidence.own_files)
