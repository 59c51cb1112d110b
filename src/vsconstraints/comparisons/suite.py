"""Suite: scenarios, controllers, number of trials and seed of a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import chdir
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, VsconstraintsError, described, format_value
from ..plugins.classes import beside
from ..scenarios import Scenario
from ..scenarios.moments import problems_at_goals
from ..scenarios.reading import NOTHING, Table, from_table
from ..scenarios.toml import read_toml
from ..simulation import Setup
from .experiment import Entries, Experiment, entries_of, require_names
from .runs.files import plain
from .runs.spec import BASELINE, RunSpec

__all__ = ["BASELINE", "DEFAULT", "Suite"]

DEFAULT = Path(__file__).parent / "default.toml"

MAX_VARIANTS = 10_000  # maximum number of variants that one entry of a suite may define
MAX_RUNS = 100_000  # maximum number of runs of a comparison: all scores are kept in memory


@dataclass(frozen=True)
class Suite(Experiment):
    """Experiment that runs every scenario with every controller for a number of trials.

    The first trial starts as the scenario defines; the others have random starts.
    """

    name: str
    title: str
    scenarios: tuple[Scenario, ...]
    controllers: Entries
    trials: int = 1
    seed: int = 0

    whole_numbers = settings = ("trials", "seed")

    @classmethod
    def load(cls, path: Path | str | None = None) -> Suite:
        """Load the suite of a TOML file; without a path, the default suite.

        The default suite contains the paper's scenarios and two real arms.

        An entry of ``scenarios`` is a shipped scenario's name, a path, or a table: ``scenario``
        (name or path), ``name`` and ``title`` of the variant, ``set`` (dotted keys and values, ``{
        "task.Kp0" = 5.0, duration = 4.0 }``; a table replaces the scenario's), and ``each`` (dotted
        keys and lists of values: one variant for every combination). Raises ConfigurationError or
        InvalidInput for an unknown key, and if a part cannot be built or started.
        """
        source = Path(path or DEFAULT)
        if (source / "results.csv").is_file():
            again = f"vsconstraints report {source} writes its report again"
            raise ConfigurationError(f"{source} is a folder of results, not a suite: {again}")

        def suite(
            scenarios: Sequence[Any],
            controllers: Table,
            title: str = "",
            trials: int = 1,
            seed: int = 0,
        ) -> Suite:
            where = source.name
            folder = source.parent
            named = (
                _scenarios_of(entry, f"{where}.scenarios[{i}]", folder)
                for i, entry in enumerate(scenarios)
            )
            made = tuple(scenario for entry in named for scenario in entry)
            laws = entries_of(controllers, f"{where}.controllers", folder)
            return cls(source.stem, title or source.stem, made, laws, trials, seed)

        return from_table(suite, read_toml(source), source.name).checked()

    def select(
        self,
        scenarios: Sequence[str] = (),
        controllers: Sequence[str] = (),
        seed: int | None = None,
        settings: Iterable[str] = (),
    ) -> Suite:
        """Return the suite that a command line selects.

        Scenarios and controllers are selected by name or path; if none is given, all are kept. KEY
        of ``settings``, ``KEY=VALUE``, is ``scenario.…`` (every scenario), a scenario's name and a
        key in it, a controller's name and an option, ``trials`` or ``seed``.
        """
        suite = self if seed is None else replace(self, seed=seed)
        suite = suite._selected("scenarios", Scenario.load, scenarios, controllers)
        if (suite.scenarios, suite.controllers) != (self.scenarios, self.controllers):
            # the title speaks of all of them
            suite = replace(suite, title=f"{suite.title}: a selection")
        return suite.with_settings(settings).checked()

    def _with(self, key: str, value: Any) -> Suite:
        target, rest = self._target(
            key, ["scenario", *(scenario.name for scenario in self.scenarios)]
        )
        if target in {entry.name for entry in self.controllers}:
            return super()._with(key, value)
        scenarios = (
            scenario.with_override(rest, value, Path())
            if target in (scenario.name, "scenario")
            else scenario
            for scenario in self.scenarios
        )
        return replace(self, scenarios=tuple(scenarios))

    def checked(self) -> Suite:
        """Return the suite; raises the error found if a part cannot be built or started."""
        if not self.scenarios or not self.controllers:
            missing = "scenario" if self.controllers else "controller"
            raise ConfigurationError(
                f"suite {self.name} has no {missing}: there is nothing to compare"
            )
        if self.trials < 1 or self.seed < 0 or self.trials % 1 or self.seed % 1:
            raise ConfigurationError(
                "trials must be an integer of 1 or more, and seed of 0 or more, not "
                f"{self.trials} and {self.seed}"
            )
        counts = {
            "scenarios": len(self.scenarios),
            "controllers": len(self.controllers),
            "trials": self.trials,
        }
        if prod(counts.values()) > MAX_RUNS:
            what = " × ".join(f"{count} {of}" for of, count in counts.items())
            are = f"{what} are {prod(counts.values()):.3g} runs; a comparison may have {MAX_RUNS}"
            raise ConfigurationError(f"suite {self.name}: {are}")
        require_names("scenario", [scenario.name for scenario in self.scenarios])
        self.require_controllers()
        self.remarks()
        if self.trials > 1:
            for scenario in self.scenarios:
                require_variety(scenario, self.trials, self.seed)
        return self

    def remarks(self) -> list[str]:
        """Return warnings about starts, and about custom constraints that raise.

        Raises an error that names the cause if a scenario cannot be started.
        """
        return [
            f"{scenario.name}: {remark}"
            for scenario in self.scenarios
            for remark in _remarks_at_start(scenario)[1]
        ]

    def warnings(self) -> dict[str, list[str]]:
        """Return the warnings about each scenario before its runs, by its name.

        In addition to the start (:meth:`remarks`), goals are checked: they may be out of reach,
        forbidden, or not visible. Scenarios without a warning are left out.
        """
        found = {}
        for scenario in self.scenarios:
            at_goals: list[str] = []
            try:
                setup, warnings = _remarks_at_start(scenario)
            except Exception as error:  # custom parts may raise anything; their runs report it too
                found[scenario.name] = [f"no run would start: {described(error)}"]
                continue
            try:
                # custom parts may change the working directory
                with chdir("."), beside(scenario.folder):
                    at_goals = problems_at_goals(setup)
                    # the checks of goals repeat these warnings, with the distance
                    warnings = [text for text in warnings if text not in setup.forbidden]
            except Exception as error:
                warnings = [*warnings, f"goals cannot be checked: {described(error)}"]
            known = {text.partition(": ")[2] for text in at_goals} & set(warnings)
            warnings += [text for text in at_goals if text.partition(": ")[2] not in known]
            if warnings:
                found[scenario.name] = list(dict.fromkeys(warnings))
        return found

    def runs(self) -> list[RunSpec]:
        """Return all runs, in the order of the results."""
        every = product(self.scenarios, self.controllers, range(self.trials))
        return [
            RunSpec(scenario, entry, trial=trial, seed=self.seed)
            for scenario, entry, trial in every
        ]

    def resolved(self) -> dict[str, Any]:
        """Return everything that determines the results, as plain data."""
        return {
            "suite": self.name,
            "title": self.title,
            "trials": self.trials,
            "seed": self.seed,
            "controllers": {entry.name: entry.table for entry in self.controllers},
            "scenarios": {
                each.name: {
                    "folder": "" if each.shipped else str(each.folder.resolve()),
                    "tables": plain(each.tables),
                }
                for each in self.scenarios
            },
        }


def _remarks_at_start(scenario: Scenario) -> tuple[Setup, list[str]]:
    """Return the setup and warnings about its start; raises an error if it cannot be started."""
    with chdir("."):  # custom parts may change the working directory
        setup = scenario.setup()
    try:
        with beside(scenario.folder):
            return setup, setup.check_start()
    except VsconstraintsError as error:
        cause = error.__cause__
        ours = isinstance(error, ConfigurationError) and isinstance(
            cause, (type(None), VsconstraintsError)
        )
        if ours or not scenario.own_parts:
            raise ConfigurationError(f"{scenario.name}: {error}") from error
        return setup, [f"its runs will fail: {error}"]


def _scenarios_of(value: object, where: str, folder: Path) -> list[Scenario]:
    """Return the scenarios of a suite's entry, see :meth:`Suite.load`.

    Raises ConfigurationError that names ``where``.
    """
    if isinstance(value, str):
        return [Scenario.load(value, folder)]
    if not isinstance(value, dict):
        kinds = "a name, a path, or a table with the key 'scenario'"
        raise ConfigurationError(f"{where} must be {kinds}, not {format_value(value)}")
    return from_table(_variants, value, where, {"where": where, "folder": folder})


def _variants(
    where: str,
    folder: Path,
    scenario: str,
    name: str,
    title: str = "",
    set: Mapping[str, Any] = NOTHING,
    each: Mapping[str, Any] = NOTHING,
) -> list[Scenario]:
    base = Scenario.load(scenario, folder)
    for key, candidates in each.items():
        if not isinstance(candidates, list) or not candidates:
            raise ConfigurationError(
                f"{where}.each: {key} must be a list of values, not {format_value(candidates)}"
            )
    if (count := prod(map(len, each.values()))) > MAX_VARIANTS:
        raise ConfigurationError(
            f"{where}.each makes {count:.3g} variants; an entry may make {MAX_VARIANTS}"
        )
    scenarios = []
    for values in product(*each.values()):
        texts = [str(value) for value in values]
        variant = replace(base, name="-".join([name, *texts]))
        changes = {
            "title": ", ".join([title or name, *texts]),
            **set,
            **dict(zip(each, values, strict=True)),
        }
        for key, changed in changes.items():
            variant = variant.with_override(key, changed, folder)
        scenarios.append(variant)
    return scenarios


def require_variety(scenario: Scenario, trials: int, seed: int) -> None:
    """Raise ConfigurationError if all trials would be the same run."""
    with chdir("."):  # custom parts may change the working directory
        first = scenario.setup(0, seed)
        second = scenario.setup(1, seed)
    drawn = first.disturbances.random or (first.images is not None and first.images.random)
    if not drawn and (first.q0 == second.q0).all():
        same = (
            f"{trials} trials of {scenario.name} would be identical, since nothing in it is random"
        )
        keys = "start_deviation, or pixel_noise, lost_frames or acceleration_noise in disturbances"
        example = f"--set {scenario.name}.start_deviation=0.01"
        raise ConfigurationError(f"{same}. Set {keys}, for example with {example}; or trials = 1")
