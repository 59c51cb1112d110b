"""The controllers that a file lists, as a command line chooses and changes them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..controllers import CONTROLLERS, controller_class
from ..errors import ConfigurationError, shown, unknown_name
from ..scenarios.reading import Table, checked, demand_table
from ..scenarios.toml import parse_toml
from .runs.spec import BASELINE, ControllerSpec

MAX_NAME_BYTES = 100
"""Bytes that the name of a scenario or controller may have; files are named after both."""

Entries = tuple[ControllerSpec, ...]
"""Controllers in the order of the results."""


def entries_of(tables: Table, where: str, folder: Path) -> Entries:
    """The controllers of a file's tables; raises ConfigurationError for an unknown law."""
    entries = []
    for name, table in tables.items():
        options = demand_table(table, f"{where}.{name}")
        law = checked(options.pop("type", name), str, f"{where}.{name}", "type")
        controller_class(law, folder)
        entries.append(ControllerSpec(name, law, options, folder))
    return tuple(entries)


def resolved_entries(entries: Entries) -> dict[str, Any]:
    """Laws and options by name, as data."""
    return {entry.name: {"type": entry.law, **entry.options} for entry in entries}


def checked_entries(entries: Entries) -> None:
    """Raise ConfigurationError or InvalidInput unless all of them can be made, and files can be named after them."""
    demand_names("controller", [entry.name for entry in entries])
    for entry in entries:
        entry.make()


def chosen_entries(entries: Entries, names: Sequence[str]) -> Entries:
    """Those of these names, of the file's, registered ones or ``module:Class``; all of the file's if none is given."""
    by_name = {entry.name: entry for entry in entries}
    for name in names:
        if name not in by_name and name not in CONTROLLERS and ":" not in name:
            known = unknown_name("controller", name, {*by_name, *CONTROLLERS})
            raise ConfigurationError(
                f"{known}; a suite can name others, as comparisons/laws.toml does, and module:Class is one of your own"
            )
    chosen = tuple(by_name.get(name) or ControllerSpec.called(name, folder=Path()) for name in unique(names))
    demand_names("controller", [entry.name for entry in chosen])
    return chosen or entries


def with_option(entries: Entries, name: str, option: str, value: object) -> Entries:
    """The same with another value for an option of one of them."""
    return tuple(
        replace(entry, options={**entry.options, option: value}) if entry.name == name else entry for entry in entries
    )


def with_baseline(entries: Entries) -> Entries:
    """The same with the unconstrained baseline first; raises ConfigurationError if its name is another law's."""
    baseline = next((entry for entry in entries if entry.name == BASELINE), ControllerSpec(BASELINE))
    if baseline.law != BASELINE:
        raise ConfigurationError(f"the name {BASELINE!r} is that of the baseline; give the controller another one")
    return (baseline, *(entry for entry in entries if entry is not baseline))


def demand_names(what: str, names: Sequence[str]) -> None:
    """Raise ConfigurationError unless files can be named after these names, and each is there once."""
    for name in names:
        if not re.fullmatch(r"\w[\w .+=,-]*(?<! )", name) or "--" in name:
            raise ConfigurationError(
                f"{what} name {shown(name)} is used in file names: letters, digits, ' ', '.', '_', '+', '=', "
                "',' and single '-'"
            )
        if len(name.encode()) > MAX_NAME_BYTES:
            raise ConfigurationError(
                f"{what} name {shown(name)} is used in file names and longer than {MAX_NAME_BYTES} bytes"
            )
        if names.count(name) > 1:
            raise ConfigurationError(f"{what} {name!r} appears more than once; give each its own name")


def demand_stored_names(what: str, names: Iterable[str], where: str) -> None:
    """The same of names in a folder of results: figures are named after them."""
    for name in names:
        try:
            demand_names(what, [name])
        except ConfigurationError as error:
            raise ConfigurationError(f"{where}: {error}") from error


def parsed_setting(setting: str) -> tuple[str, Any, str]:
    """Key, value and the value's text of ``KEY=VALUE``; the value as in TOML, or plain text."""
    key, equals, text = setting.partition("=")
    if not equals:
        raise ConfigurationError(f"--set takes KEY=VALUE, not {setting!r}")
    return key.strip(), _value(text.strip()), text


def whole(key: str, value: object, text: str) -> int:
    """The value of a setting that is a whole number; raises ConfigurationError otherwise."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise ConfigurationError(f"{key} must be an integer, not {shown(text)}")
    return value


def target_of(key: str, names: Iterable[str], others: Iterable[str]) -> tuple[str, str]:
    """The one of ``names`` that a dotted key begins with, and the rest; messages also list ``others`` as candidates."""
    names = set(names)
    # names may contain dots: the longest one that the key begins with is meant
    begins = [name for name in names if f"{key}.".startswith(f"{name}.")]
    if not begins:
        raise unknown_name("setting", key.partition(".")[0], {*names, *others})
    target = max(begins, key=len)
    rest = key[len(target) + 1 :]
    if not rest:
        raise ConfigurationError(f"--set {target} needs a key in it: {target}.KEY=VALUE")
    return target, rest


def unique(names: Iterable[str]) -> list[str]:
    """Each name once, in order."""
    return list(dict.fromkeys(names))


def _value(text: str) -> Any:
    try:
        return parse_toml(f"value = {text}", "--set")["value"]
    except ConfigurationError as error:
        if isinstance(error.__cause__, tomllib.TOMLDecodeError):
            return text
        raise
