"""Campaign: families, conditions, controllers and the number of scenes of an experiment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from ...comparisons.experiment import Entries, Experiment, entries_of, require_names
from ...comparisons.runs.files import plain
from ...comparisons.runs.identity import Identity, identity, scene_identity
from ...errors import ConfigurationError, format_value, unknown_name
from ...scenarios import Scenario
from ...scenarios.reading import Table, from_table, require_known, require_table
from ...scenarios.toml import read_toml
from ..families import HALVES, SHIPPED, Family
from .own_files import current_hashes, files_of_laws, own_folders

MAX_SCENES = 10_000_000  # maximum number of scenes of a family in a campaign

#: Files of the campaigns shipped with the package, by name. ``comparisons/evidence.toml`` is a link
#: to the first.
SHIPPED_CAMPAIGNS = {
    name: Path(__file__).parent / f"{name}.toml" for name in ("evidence", "real-world")
}


def family_identity(family: Family) -> Identity:
    """Return the identity of a family: its tables, files and packages."""
    scenario = Scenario(family.name, family.tables, family.folder)
    return scene_identity(family.tables, scenario.files)


@dataclass(frozen=True)
class Campaign(Experiment):
    """Scenes of each family, drawn with a seed and run in every condition with every controller.

    ``question`` states the purpose of the campaign in reports. Without ``conditions``, each family
    is run in all its conditions. ``scenes_in`` limits the number of scenes by condition.
    ``call_times`` holds :class:`.CallTimes` as data.
    """

    name: str
    title: str
    question: str
    families: tuple[Family, ...]
    controllers: Entries
    conditions: tuple[str, ...] = ()
    scenes: int = 1000
    half: str = "held-out"
    seed: int = 0
    scenes_in: Mapping[str, int] = field(default_factory=dict)
    call_times: Mapping[str, Any] = field(default_factory=dict)

    whole_numbers = ("scenes", "seed")
    settings = (*whole_numbers, "half", "conditions", "scenes_in.CONDITION")

    @classmethod
    def load(cls, path: Path | str | None = None) -> Campaign:
        """Load a campaign from a TOML file, or a shipped one by its name.

        The default is the shipped campaign ``evidence``.
        """
        source = SHIPPED_CAMPAIGNS.get(str(path or "evidence"), Path(path or ""))
        folder = source.parent if path else Path()
        file: _File = from_table(_File, read_toml(source), source.name)
        controllers = entries_of(file.controllers, f"{source.name}.controllers", folder)
        if file.tuned:
            tables = read_toml(folder / file.tuned)
            name = Path(file.tuned).name
            require_known(tables, ["controllers"], name)
            tuned = require_table(tables.get("controllers", {}), f"{name}.controllers")
            controllers += entries_of(tuned, f"{name}.controllers", folder)
        campaign = cls(
            source.stem,
            title=file.title or source.stem,
            question=file.question,
            families=tuple(Family.load(name, folder) for name in file.families),
            controllers=controllers,
            conditions=tuple(file.conditions),
            scenes=file.scenes,
            half=file.half,
            seed=file.seed,
            scenes_in=file.scenes_in,
        )
        return campaign.checked()

    def select(
        self,
        families: Sequence[str] = (),
        controllers: Sequence[str] = (),
        scenes: int | None = None,
        settings: Iterable[str] = (),
    ) -> Campaign:
        """Return the campaign with the selections and settings of a command line.

        ``families`` and ``controllers`` are names or paths; empty selects all. The KEY of each of
        ``settings``, ``KEY=VALUE``, is one of :attr:`settings`, or the name of a controller and an
        option.
        """
        campaign = self if scenes is None else replace(self, scenes=scenes)
        campaign = campaign._selected("families", Family.load, families, controllers)
        return campaign.with_settings(settings).checked()

    def _with(self, key: str, value: Any) -> Campaign:
        table, _, condition = key.partition(".")
        if key == "half":
            return replace(self, half=str(value))
        if key == "conditions":
            names = value if isinstance(value, list) else [value]
            return replace(self, conditions=tuple(map(str, names)))
        if table == "scenes_in" and condition:
            return replace(self, scenes_in={**self.scenes_in, condition: value})
        return super()._with(key, value)

    def checked(self) -> Campaign:
        """Return the campaign with the unconstrained baseline included.

        Raises ConfigurationError if a setting is invalid.
        """
        if not self.families:
            raise ConfigurationError(
                f"campaign {self.name} names no family, so no scenes can be drawn: give families"
            )
        if not 1 <= self.scenes <= MAX_SCENES:
            raise ConfigurationError(f"scenes must be from 1 to {MAX_SCENES}, not {self.scenes}")
        if self.seed < 0:
            raise ConfigurationError(f"seed must be 0 or more, not {self.seed}")
        if self.half not in HALVES:
            raise unknown_name("half", self.half, HALVES)
        require_names("family", [family.name for family in self.families])
        self.require_controllers()
        every: dict[str, None] = {}
        for family in self.families:
            every |= dict.fromkeys(family.conditions)
        known = list(every)
        require_names("condition", known)
        for name in (*self.conditions, *self.scenes_in):
            if name not in known:
                raise unknown_name("condition", name, known)
        for name, most in self.scenes_in.items():
            if isinstance(most, bool) or not isinstance(most, int) or most < 0:
                raise ConfigurationError(
                    f"scenes_in.{name} must be an integer, 0 or more, not {format_value(most)}"
                )
        for family in self.families:
            if not self.conditions_of(family):
                none = ", ".join(self.conditions)
                its = ", ".join(family.conditions)
                raise ConfigurationError(
                    f"family {family.name} has none of the conditions {none}; it has {its}"
                )
        for entry, family in product(self.controllers, self.families):
            heavy = [name for name in self.conditions_of(family) if family.has_key("plant", name)]
            if entry.run.call_time and heavy:
                masses = (
                    f"family {family.name} has masses in {', '.join(heavy)}: choose other "
                    f"conditions"
                )
                why = f"call_time delays commands of arms without mass, and {masses}"
                raise ConfigurationError(f"controllers.{entry.name}.run: {why}")
        return self.with_baseline()

    def conditions_of(self, family: Family, number: int = 0) -> tuple[str, ...]:
        """Return the conditions of a scene of a family, in the order of the family."""
        wanted = self.conditions or family.conditions
        conditions = []
        for name in family.conditions:
            if name in wanted and number < self.scenes_in.get(name, self.scenes):
                conditions.append(name)
        return tuple(conditions)

    def identity(self, family: Family) -> Identity:
        """Return everything that the results of a family depend on."""
        limits: dict[str, Any] = {}
        if self.scenes_in:
            limits["scenes_in"] = dict(self.scenes_in)
        return identity(
            self.controllers,
            seed=self.seed,
            half=self.half,
            conditions=list(self.conditions_of(family)),
            **limits,
            family=family_identity(family),
        )

    def identities(self) -> dict[str, Identity]:
        """Return everything that results depend on, by family."""
        return {family.name: self.identity(family) for family in self.families}

    def on_each_machine(self) -> Callable[[], Identity]:
        """Return a function that determines everything that results depend on, on any machine.

        It returns the identities of the families and hashes of custom files. These are the files
        that custom laws load and read on this machine when they are created.
        """
        folders = own_folders(self.controllers, self.families)
        names = tuple(files_of_laws(self.controllers, folders))
        return partial(_on_this_machine, self, names)

    def resolved(self) -> dict[str, Any]:
        """Return everything that determines the results, except code and files, as data."""
        families = {}
        shipped = SHIPPED.resolve()
        for family in self.families:
            folder = family.folder.resolve()
            stored_folder = str(folder)
            if folder.is_relative_to(shipped):
                # the folder of the shipped families differs from machine to machine
                stored_folder = folder.relative_to(shipped).as_posix()
            families[family.name] = {
                "folder": stored_folder,
                "conditions": list(self.conditions_of(family)),
                "tables": plain(family.tables),
            }
        configuration = {
            "campaign": self.name,
            "title": self.title,
            "question": self.question,
            "scenes": self.scenes,
            "half": self.half,
            "seed": self.seed,
            "conditions": list(self.conditions),
            "scenes_in": dict(self.scenes_in),
            "controllers": {entry.name: entry.table for entry in self.controllers},
            "families": families,
        }
        if self.call_times:
            configuration["call_times"] = dict(self.call_times)
        return configuration


def _on_this_machine(campaign: Campaign, own_files: Sequence[str]) -> Identity:
    files = current_hashes(own_files, own_folders(campaign.controllers, campaign.families))
    return {**campaign.identities(), "own files": files}


@dataclass(frozen=True)
class _File:
    """Keys of a campaign's TOML file."""

    families: Sequence[str]
    controllers: Table
    title: str = ""
    question: str = ""
    conditions: Sequence[str] = ()
    scenes: int = 1000
    half: str = "held-out"
    seed: int = 0
    scenes_in: Table = field(default_factory=dict)
    tuned: str = ""
