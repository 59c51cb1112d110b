"""Experiment: scenes × conditions × laws × trials, described by a file or the command line."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Self

from ..controllers import controller_class, registered_laws, unknown_controller
from ..errors import ConfigurationError, format_value, unknown_name
from ..scenarios.reading import Table
from ..scenarios.toml import parse_toml
from .runs.spec import AS_THE_SCENE, BASELINE, ControllerSpec

#: Maximum length of a scenario or controller name [bytes]; both appear in file names.
MAX_NAME_BYTES = 100
Entries = tuple[ControllerSpec, ...]  #: Controllers in the order of the results.


class Experiment:
    """Base of a suite of scenarios and a campaign of drawn scenes, both frozen dataclasses."""

    controllers: Entries
    #: Attributes that ``KEY=VALUE`` sets to whole numbers, and all keys that are not names of
    #: scenarios or controllers.
    whole_numbers: ClassVar[tuple[str, ...]]
    settings: ClassVar[tuple[str, ...]]

    def changed(self, **attributes: Any) -> Self:
        """Return a copy with other values of some attributes."""
        return replace(self, **attributes)  # type: ignore[type-var]

    def _selected(
        self,
        what: str,
        load: Callable[[str], Any],
        names: Sequence[str],
        controllers: Sequence[str],
    ) -> Self:
        """Return a copy with only the scenes and controllers of these names or paths.

        If no name is given, all are kept.
        """
        own = {each.name: each for each in getattr(self, what)}
        chosen = tuple(own.get(name) or load(name) for name in dict.fromkeys(names or own))
        return self.changed(
            **{what: chosen, "controllers": chosen_entries(self.controllers, controllers)}
        )

    def with_stacks(self, commands: Iterable[str]) -> Self:
        """Return a copy with the stacks of these command lines as further controllers.

        Raises ConfigurationError if a command is empty or a name is used twice.
        """
        stacks = tuple(map(ControllerSpec.of_stack, commands))
        if not stacks:
            return self
        changed = self.changed(controllers=(*self.controllers, *stacks))
        changed.require_controllers()
        return changed

    def with_settings(self, settings: Iterable[str]) -> Self:
        """Return a copy with the settings ``KEY=VALUE`` applied, VALUE as in TOML.

        KEY is an attribute, or a dotted key that begins with the name of a controller or of another
        part. Raises ConfigurationError for an invalid setting.
        """
        experiment = self
        for setting in settings:
            key, equals, text = (part.strip() for part in setting.partition("="))
            if not equals:
                raise ConfigurationError(f"--set must be KEY=VALUE, not {setting!r}")
            try:
                value = parse_toml(f"value = {text}", "--set")["value"]
            except ConfigurationError as error:
                if not isinstance(error.__cause__, tomllib.TOMLDecodeError):
                    raise
                value = text
            if key not in self.whole_numbers:
                experiment = experiment._with(key, value)
            elif isinstance(value, int) and not isinstance(value, bool):
                experiment = experiment.changed(**{key: value})
            else:
                raise ConfigurationError(f"{key} must be an integer, not {format_value(text)}")
        return experiment

    def _with(self, key: str, value: Any) -> Self:
        name, option = self._target(key)
        entries = (
            entry.changed(option, value) if entry.name == name else entry
            for entry in self.controllers
        )
        return self.changed(controllers=tuple(entries))

    def _target(self, key: str, others: Iterable[str] = ()) -> tuple[str, str]:
        """Split a dotted key into the part that it names and the rest.

        The part is a controller or one of ``others``. Raises ConfigurationError for an unknown
        part.
        """
        names = {*others, *(entry.name for entry in self.controllers)}
        begun = [name for name in names if f"{key}.".startswith(f"{name}.")]
        if not begun:
            raise unknown_name("setting", key.partition(".")[0], {*names, *self.settings})
        # names may contain dots: the longest name that the key begins with is used
        target = max(begun, key=len)
        rest = key[len(target) + 1 :]
        if not rest:
            raise ConfigurationError(f"--set {target} needs a key: {target}.KEY=VALUE")
        return target, rest

    def with_baseline(self) -> Self:
        """Return a copy with the unconstrained baseline as first controller.

        Raises ConfigurationError if another law has the name of the baseline.
        """
        baseline = next(
            (entry for entry in self.controllers if entry.name == BASELINE),
            ControllerSpec(BASELINE),
        )
        if baseline.law != BASELINE or baseline.run != AS_THE_SCENE:
            raise ConfigurationError(
                f"the name {BASELINE!r} is reserved for the baseline: give the controller "
                "another one"
            )
        others = (entry for entry in self.controllers if entry is not baseline)
        return self.changed(controllers=(baseline, *others))

    def require_controllers(self) -> None:
        """Raise unless all controllers can be built and their names are valid in file names.

        The error is ConfigurationError or InvalidInput.
        """
        require_names("controller", [entry.name for entry in self.controllers])
        for entry in self.controllers:
            entry.make()


def entries_of(tables: Table, where: str, folder: Path) -> Entries:
    """Read the controllers of a file's tables; raises ConfigurationError for an unknown law."""
    entries = []
    for name, table in tables.items():
        entries.append(ControllerSpec.from_table(name, table, where, folder))
        controller_class(entries[-1].law, folder)
    return tuple(entries)


def chosen_entries(entries: Entries, names: Sequence[str]) -> Entries:
    """Select controllers by name; without names, return all controllers of the file.

    A name is that of a controller of the file, of a registered law, ``module:Class`` or
    ``FILE.py:Class``. Raises ConfigurationError for an unknown name.
    """
    by_name = {entry.name: entry for entry in entries}
    for name in names:
        if name not in by_name and name not in registered_laws() and ":" not in name:
            others = (
                "a suite can name others, as comparisons/laws.toml does, and module:Class or "
                "FILE.py:Class names a custom one"
            )
            raise ConfigurationError(
                f"{unknown_controller(name, {*by_name, *registered_laws()})}; {others}"
            )
    chosen = tuple(
        by_name.get(name) or ControllerSpec.called(name, folder=Path())
        for name in dict.fromkeys(names)
    )
    require_names("controller", [entry.name for entry in chosen])
    return chosen or entries


def require_names(what: str, names: Iterable[str], where: str = "") -> None:
    """Raise ConfigurationError unless all names are distinct and valid in file names."""
    for name, count in Counter(iter(names)).items():
        named = f"{where}{what} name {format_value(name)} is used in file names"
        if not re.fullmatch(r"\w[\w .+=,-]*(?<! )", name) or "--" in name:
            raise ConfigurationError(
                f"{named}: letters, digits, ' ', '.', '_', '+', '=', ',' and single '-'"
            )
        if len(name.encode()) > MAX_NAME_BYTES:
            raise ConfigurationError(f"{named} and longer than {MAX_NAME_BYTES} bytes")
        if count > 1:
            raise ConfigurationError(
                f"{where}{what} {name!r} appears more than once; give each its own name"
            )
