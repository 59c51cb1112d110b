"""Scenario family: a scenario file with distributions in place of numbers, and conditions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from time import perf_counter
from typing import Any

from ...errors import ConfigurationError, VsconstraintsError, format_value, unknown_name
from ...plugins.classes import beside
from ...scenarios.reading import Table, require_table
from ...scenarios.scenario import (
    Described,
    Scenario,
    extended_tables,
    require_data,
    scenario_file,
    shipped_scenarios,
)
from ...scenarios.toml import file_named, read_toml
from ...simulation import Setup, until_settled
from .attempts import (
    Reason,
    Rejected,
    check_baseline,
    check_ends,
    check_first_image,
    least_time,
    placed,
    share_to_hold,
    violated_by_tracking,
)
from .drawing import Streams, drawn, merged, parsed, require_no_placement
from .drawn import Drawn, Summary, reasons

SHIPPED = Path(__file__).parent  #: folder of the families that come with the package
#: The condition that every family has, and the one whose limits bound what any law can do.
NOMINAL = "nominal"
LIMITED = "limited"

#: scenes for tuning, and scenes for evaluation only
HALVES = ("training", "held-out")
#: Keys of a family's file that scenarios lack, or that hold for all scenes of the family.
OWN_KEYS = ("title", "description", "extends", "conditions", "attempts", "testset", "frozen")

TOGETHER = "conditions"  #: key of a condition that lists others, whose draws it combines
ATTEMPTS = 200  #: default of the largest number of attempts at a scene
#: Number of refusals with the same message after which a scene is given up, because further
#: attempts would fail, too.
REFUSALS = 10


@cache
def families() -> tuple[str, ...]:
    """Return the names of the families that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def _scene_file(name: str, base: Path) -> Path:
    """Return the path of a family or a scenario by its name, or by a path relative to ``base``."""
    if name in families():
        return SHIPPED / f"{name}.toml"
    if not name.endswith(".toml") and name not in shipped_scenarios():
        known = (*shipped_scenarios(), *families(), "a path ending in .toml")
        raise unknown_name("scenario or family", name, known)
    return scenario_file(name, base)


@dataclass(frozen=True)
class Family(Described):
    """A scenario family: the content of its file, merged over the scenario that it extends."""

    @classmethod
    def load(cls, name_or_path: str | Path, base: Path | None = None) -> Family:
        """Load a shipped family by name, ``"six-axis"``, or a TOML file by its path.

        The path is relative to ``base``. With ``extends = "…"``, the name or path of a scenario or
        of a family, a file states only the differences from it and the distributions. Raises
        ConfigurationError if no family has that name, if the file cannot be read, or if a
        distribution is not valid.
        """
        path = file_named("family", str(name_or_path), SHIPPED, families(), base)
        tables = read_toml(path)
        if "extends" in tables:
            extended = tables.pop("extends")
            if not isinstance(extended, str):
                raise ConfigurationError(
                    f"{path}: extends must be the name or the path of a scenario or a family"
                )
            under = extended_tables(_scene_file(extended, path.parent), _scene_file)
            tables = merged(under, tables, str(path))
        family = cls(path.stem, tables, path.parent)
        # evaluate all cached properties now, so that mistakes are reported here
        _ = family._parsed
        _ = family._overrides
        _ = family._parts
        _ = family.attempts
        return family

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions, the nominal one first."""
        others = [name for name in self.tables.get("conditions", {}) if name != NOMINAL]
        return (NOMINAL, *others)

    def has_key(self, key: str, condition: str) -> bool:
        """True if the tables of a condition, or those of all conditions, have a key."""
        conditions = self.tables.get("conditions", {})
        parts = [conditions[part] for part in self._parts.get(condition, ())]
        return any(key in tables for tables in (self.tables, *parts))

    @property
    def attempts(self) -> int:
        """Largest number of attempts at a scene."""
        most = self.tables.get("attempts", ATTEMPTS)
        if isinstance(most, bool) or not isinstance(most, int) or most < 1:
            raise ConfigurationError(
                f"{self.name}: attempts must be a positive integer, not {format_value(most)}"
            )
        return most

    @cached_property
    def _parsed(self) -> Table:
        common = {key: value for key, value in self.tables.items() if key not in OWN_KEYS}
        return {
            **parsed(common, self.name),
            "title": self.title,
            "description": self.description,
        }

    @cached_property
    def _overrides(self) -> dict[str, Any]:
        where = f"{self.name}.conditions"
        overrides = {}
        conditions = require_table(self.tables.get("conditions", {}), where)
        for name, changes in conditions.items():
            table = dict(require_table(changes, f"{where}.{name}"))
            table.pop(TOGETHER, None)
            overrides[name] = parsed(table, f"{where}.{name}")
            require_no_placement(overrides[name], f"{where}.{name}")
        return overrides

    @cached_property
    def _parts(self) -> dict[str, tuple[str, ...]]:
        """Conditions whose tables each condition combines, in the order of merging; itself last."""
        conditions = self.tables.get("conditions", {})
        single = [name for name, changes in conditions.items() if TOGETHER not in changes]
        parts = {}
        for name, changes in conditions.items():
            where = f"{self.name}.conditions.{name}.{TOGETHER}"
            others = changes.get(TOGETHER, [])
            if not isinstance(others, list):
                raise ConfigurationError(
                    f"{where} must be a list of conditions, not {format_value(others)}"
                )
            for other in others:
                if other not in single:
                    raise unknown_name(f"condition in {where}", str(other), single)
            parts[name] = (*others, name)
        return parts

    def scene(self, number: int, half: str = "held-out", seed: int = 0) -> Drawn:
        """Return a scene by number: the first result of :meth:`set_up`.

        It depends on its own draws only, not on other scenes.
        """
        return self.set_up(number, half, seed)[0]

    def set_up(
        self, number: int, half: str = "held-out", seed: int = 0
    ) -> tuple[Drawn, Mapping[str, Setup]]:
        """Return a scene by its number, from 0, and its setups by condition.

        The setups are those of :meth:`Drawn.setup`. The halves ``"training"`` and ``"held-out"``
        share no scenes. The scene is not ``found`` if the family's number of attempts was rejected,
        or if the build is refused repeatedly with the same message. Raises ConfigurationError if
        the half is unknown, or if number or seed is negative.
        """
        if half not in HALVES:
            raise unknown_name("half", half, HALVES)
        if number < 0 or seed < 0:
            raise ConfigurationError(
                f"a scene's number and seed must be zero or more, not {number} and {seed}"
            )
        if not self.trusted:
            require_data(f"family {self.name}", self.tables, self.folder)
        scene = Drawn(self.name, number, half, seed, self.folder, trusted=self.trusted)
        return self._filled(scene)

    def _filled(self, scene: Drawn) -> tuple[Drawn, dict[str, Setup]]:
        """Complete a scene that has only number, half and seed, and return its setups."""
        # in a test set, no two families draw the same numbers
        key = f"{self.tables['testset']}/{self.name} " if "testset" in self.tables else ""
        rejected: Counter[str] = Counter()
        refusals: Counter[str] = Counter()
        refusal = ""
        with beside(self.folder if self.trusted else None):
            for attempt in range(self.attempts):
                streams = Streams(scene.seed, scene.half, scene.number, attempt, key)
                try:
                    known, setups = self._attempt(streams)
                except Rejected as error:
                    rejected[error.reason.value] += 1
                    refusal = str(error)
                    refusals[refusal] += error.reason is Reason.BUILD_REFUSED
                    if refusals[refusal] >= REFUSALS:
                        break
                else:
                    return replace(scene, rejected=dict(rejected), refusal=refusal, **known), setups
        return replace(scene, rejected=dict(rejected), refusal=refusal), {}

    def _attempt(self, streams: Streams) -> tuple[dict[str, Any], dict[str, Setup]]:
        """Return the fields of a scene and its setups; raise Rejected if a check fails."""
        values: dict[str, Any] = {}
        where = f"{self.name}-{streams.number}"
        noise = streams.entropy("noise", bits=32)
        bare = drawn(self._parsed, streams, "", values)
        overrides = {
            name: drawn(changes, streams, f"conditions.{name}", values)
            for name, changes in self._overrides.items()
        }
        try:
            common, ends = placed(bare, where, self.folder)
            tables = {}
            for name in self.conditions:
                table = common
                for part in self._parts.get(name, ()):
                    table = merged(table, overrides.get(part, {}), where)
                tables[name] = table
            scenario = Scenario(where, tables[NOMINAL], self.folder, self.trusted)
            nominal = scenario.setup(seed=noise)
            check_ends(nominal, ends)
            check_first_image(nominal)
            challenged = violated_by_tracking(nominal)
            if "testset" in self.tables:
                check_baseline(nominal)
            # checks that take long and seldom fail come last
            setups = {NOMINAL: nominal}
            for name, table in tables.items():
                if name != NOMINAL:
                    scenario = Scenario(where, table, self.folder, self.trusted)
                    setups[name] = scenario.setup(seed=noise)
            for name, setup in setups.items():
                if name != NOMINAL:
                    check_first_image(setup)
        except VsconstraintsError as error:
            raise Rejected(Reason.BUILD_REFUSED, str(error)) from error
        limited = setups.get(LIMITED, nominal)
        values.setdefault("q0", common["q0"])
        known = {
            "tables": tables,
            "values": values,
            "challenged": challenged,
            "share_to_hold": share_to_hold(limited),
            "least_time": least_time(limited, ends),
            "duration": (until_settled(limited).samples_at_most - 1) * limited.Ts,
            "noise": noise,
        }
        return known, setups

    def require_scenes(self, half: str = "held-out", seed: int = 0, scenes: int = 3) -> None:
        """Raise ConfigurationError with counts if none of the first scenes is found.

        It is called before thousands of scenes are drawn.
        """
        rejected: Counter[str] = Counter()
        for number in range(scenes):
            tried = self.scene(number, half, seed)
            if tried.found:
                return
            rejected.update(tried.rejected)
        raise ConfigurationError(
            f"family {self.name}: all of {rejected.total()} attempts at its first {scenes} scenes "
            f"were rejected: {reasons(rejected)}; the last one: {tried.refusal}"
        )


def summarised(
    family: Family,
    scenes: int,
    half: str = "held-out",
    seed: int = 0,
    on_drawn: Callable[[], None] = lambda: None,
) -> Summary:
    """Draw the first scenes of a family and return their statistics.

    Raises ConfigurationError with counts if the first few scenes are all rejected.
    """
    family.require_scenes(half, seed)
    began = perf_counter()
    drawn_scenes = []
    for number in range(scenes):
        drawn_scenes.append(family.scene(number, half, seed))
        on_drawn()
    return Summary(tuple(drawn_scenes), perf_counter() - began)
