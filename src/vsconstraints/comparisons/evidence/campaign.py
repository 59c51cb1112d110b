"""A campaign: which families' scenes are run with which controllers, in which conditions, and how
many.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError, shown, unknown_name
from ...plugins.provenance import digest
from ...scenarios import Scenario
from ...scenarios.families import HALVES, SHIPPED, Family
from ...scenarios.reading import Table, demand_known, demand_table, from_table
from ...scenarios.toml import read_toml
from ..experiment import Entries, Experiment, demand_names, entries_of
from ..runs.files import plain
from ..runs.machine import code_identity, used_versions
from .own_files import contents, files_of_laws, own_folders

#: Nested tables as JSON has them; the same wherever the same campaign is run.
Identity = dict[str, Any]

MAX_SHOWN = 3  # differences that a message shows
MAX_SCENES = 10_000_000  # of a family in a campaign

IN_WORDS = {
    "code": "the package's source",
    "version": "the package's version",
    "compiled": "whether runs are compiled",
}

#: Files of the campaigns that come with the package, by name; ``comparisons/evidence.toml`` is a
#: link to the first.
SHIPPED_CAMPAIGNS = {
    name: Path(__file__).parent / f"{name}.toml" for name in ("evidence", "real-world")
}


def of_controllers(entries: Entries) -> Identity:
    """Laws and their options, what the files of own ones hold, and which solvers they use."""
    identity = {}
    for entry in entries:
        files = {f"file {path.name}": digest(path) for path in entry.files}
        packages = {
            f"package {name}": version for name, version in used_versions(entry.options).items()
        }
        identity[entry.name] = plain({**entry.table, **files, **packages})
    return identity


def of_family(family: Family) -> Identity:
    """What a family says, what the files that it names hold, and which packages its conditions
    use.
    """
    files = Scenario(family.name, family.tables, family.folder).files
    return {
        "tables": plain(family.tables),
        "files": {path.name: digest(path) for path in files},
        "packages": used_versions(family.tables),
    }


def different(
    a: Any, b: Any, path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Paths to what differs, None where it is missing, as deep as both have the same tables, or
    lists of as many.
    """
    lists = isinstance(a, list) and isinstance(b, list) and len(a) == len(b) > 0
    if lists and all(isinstance(entry, Mapping) for entry in (*a, *b)):
        a, b = (dict(enumerate(side)) for side in (a, b))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        for key in dict.fromkeys((*a, *b)):
            if key in a and key in b:
                yield from different(a[key], b[key], (*path, str(key)))
            else:
                yield (*path, str(key)), a.get(key), b.get(key)
    elif a != b:
        yield path, a, b


def differences(there: Any, here: Any) -> Iterator[str]:
    """Sentences that name what differs, with both values."""
    for path, old, new in different(there, here):
        name = ".".join(path)
        if old is None or new is None:
            yield f"{name} is only {'there' if new is None else 'here'}"
        else:
            said = f"{name} is {shown(old)} there and {shown(new)} here"
            yield f"{IN_WORDS[name]} differs" if name in IN_WORDS else said


def in_words(texts: Sequence[str]) -> str:
    """The first of many differences, and how many there are."""
    more = len(texts) - MAX_SHOWN
    return "; ".join(texts[:MAX_SHOWN]) + (f"; and {more} more" if more > 0 else "")


@dataclass(frozen=True)
class Campaign(Experiment):
    """So many scenes of each family, drawn with a seed, each run in every condition with every
    controller.

    ``question`` is what it is to answer, for reports. Without ``conditions`` each family is run in
    all that it has; ``scenes_in`` limits the number of scenes in some; ``call_times`` are
    :class:`.CallTimes` as data.
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
        """The campaign of a TOML file, or one that comes with the package by its name: ``evidence``
        without one.
        """
        source = SHIPPED_CAMPAIGNS.get(str(path or "evidence"), Path(path or ""))
        folder = source.parent if path else Path()
        file: _File = from_table(_File, read_toml(source), source.name)
        controllers = entries_of(file.controllers, f"{source.name}.controllers", folder)
        if file.tuned:
            tables = read_toml(folder / file.tuned)
            name = Path(file.tuned).name
            demand_known(tables, ["controllers"], name)
            tuned = demand_table(tables.get("controllers", {}), f"{name}.controllers")
            controllers += entries_of(tuned, f"{name}.controllers", folder)
        families = tuple(Family.load(name, folder) for name in file.families)
        name = source.stem
        title = file.title or source.stem
        conditions = tuple(file.conditions)
        sizes = file.scenes, file.half, file.seed, file.scenes_in
        return cls(name, title, file.question, families, controllers, conditions, *sizes).checked()

    def select(
        self,
        families: Sequence[str] = (),
        controllers: Sequence[str] = (),
        scenes: int | None = None,
        settings: Iterable[str] = (),
    ) -> Campaign:
        """The campaign a command line asks for, with families and controllers of these names, or
        paths, if any.

        KEY of ``settings``, ``KEY=VALUE``, is one of :attr:`settings`, or a controller's name and
        an option.
        """
        campaign = self if scenes is None else replace(self, scenes=scenes)
        return (
            campaign._selected("families", Family.load, families, controllers)
            .with_settings(settings)
            .checked()
        )

    def _with(self, key: str, value: Any) -> Campaign:
        table, _, condition = key.partition(".")
        if key == "half":
            return replace(self, half=str(value))
        if key == "conditions":
            return replace(
                self, conditions=tuple(map(str, value if isinstance(value, list) else [value]))
            )
        in_some = table == "scenes_in" and condition
        return (
            replace(self, scenes_in={**self.scenes_in, condition: value})
            if in_some
            else super()._with(key, value)
        )

    def checked(self) -> Campaign:
        """The campaign with the unconstrained baseline in it; raises what is wrong if something
        cannot be used.
        """
        if not self.families:
            raise ConfigurationError(
                f"campaign {self.name}: it names no family, so there is no scene to be drawn"
            )
        if not 1 <= self.scenes <= MAX_SCENES:
            raise ConfigurationError(f"scenes must be from 1 to {MAX_SCENES}, not {self.scenes}")
        if self.seed < 0:
            raise ConfigurationError(f"seed must be 0 or more, not {self.seed}")
        if self.half not in HALVES:
            raise unknown_name("half", self.half, HALVES)
        demand_names("family", [family.name for family in self.families])
        self.demand_controllers()
        known = list(
            dict.fromkeys(condition for family in self.families for condition in family.conditions)
        )
        demand_names("condition", known)
        for name in (*self.conditions, *self.scenes_in):
            if name not in known:
                raise unknown_name("condition", name, known)
        for name, most in self.scenes_in.items():
            if isinstance(most, bool) or not isinstance(most, int) or most < 0:
                raise ConfigurationError(
                    f"scenes_in.{name} must be an integer, 0 or more, not {shown(most)}"
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
        """The conditions in which a family's scene of that number is run, in the family's order."""
        wanted = self.conditions or family.conditions
        most = self.scenes_in
        return tuple(
            name
            for name in family.conditions
            if name in wanted and number < most.get(name, self.scenes)
        )

    def identity(self, family: Family) -> Identity:
        """All that the results of one family's scenes depend on."""
        return {
            **code_identity(),
            "seed": self.seed,
            "half": self.half,
            "conditions": list(self.conditions_of(family)),
            **({"scenes_in": dict(self.scenes_in)} if self.scenes_in else {}),
            "controllers": of_controllers(self.controllers),
            "family": of_family(family),
        }

    def identities(self) -> dict[str, Identity]:
        """All that results depend on, by family."""
        return {family.name: self.identity(family) for family in self.families}

    def on_each_machine(self) -> Callable[[], Identity]:
        """What says, wherever it is called, what results depend on there: identities and contents
        of own files.

        The files are those that laws of one's own load and read on this machine when they are made.
        """
        folders = own_folders(self.controllers, self.families)
        return partial(_on_this_machine, self, tuple(files_of_laws(self.controllers, folders)))

    def resolved(self) -> dict[str, Any]:
        """Everything that determines the results but for code and files, as data."""
        families = {}
        shipped = SHIPPED.resolve()
        for family in self.families:
            # within that of the shipped families as seen from it, since that differs from machine
            # to machine
            folder = family.folder.resolve()
            at = (
                folder.relative_to(shipped).as_posix()
                if folder.is_relative_to(shipped)
                else str(folder)
            )
            conditions = list(self.conditions_of(family))
            families[family.name] = {
                "folder": at,
                "conditions": conditions,
                "tables": plain(family.tables),
            }
        return {
            "campaign": self.name,
            **{
                name: getattr(self, name)
                for name in ("title", "question", "scenes", "half", "seed")
            },
            "conditions": list(self.conditions),
            "scenes_in": dict(self.scenes_in),
            "controllers": {entry.name: entry.table for entry in self.controllers},
            "families": families,
            **({"call_times": dict(self.call_times)} if self.call_times else {}),
        }


def _on_this_machine(campaign: Campaign, own_files: Sequence[str]) -> Identity:
    files = contents(own_files, own_folders(campaign.controllers, campaign.families))
    return {**campaign.identities(), "own files": files}


@dataclass(frozen=True)
class _File:
    """Keys of a campaign's file."""

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
