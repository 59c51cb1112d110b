"""Features in scenario files: the keys of a feature are the arguments of its class."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, VsconstraintsError, described, format_value
from ..plugins.classes import imported_class
from ..vision.features import FEATURES, Feature, Stack
from .reading import Table, checked, chosen, from_table, require_table

#: Keys of a task's table that name a feature, or several of them.
ONE = "feature"
SEVERAL = "features"

#: Keys of shipped features; another feature replaces them.
OF_FEATURE = (ONE, SEVERAL, "interaction_matrix", "markers", "marker")

Make = Callable[..., Feature]


def without_replaced_feature(under: Table, over: Table) -> Table:
    """Return a task's table without the feature, if ``over`` states another one."""
    stated = {key: over[key] for key in (ONE, SEVERAL) if key in over}
    if all(under.get(key) == value for key, value in stated.items()):
        return under
    return {key: value for key, value in under.items() if key not in OF_FEATURE}


def feature_named(table: Table, where: str, folder: Path) -> Make:
    """Remove the name of a feature from a table, and return its class; a stack for several.

    ``module:Class`` is beside the scenario, in ``folder``. Raises ConfigurationError if the name is
    unknown, or if one feature and several are given.
    """
    if SEVERAL in table:
        if ONE in table:
            raise ConfigurationError(f"{where}: give {ONE} or {SEVERAL}, not both")
        return Stack
    name = table.get(ONE)
    if isinstance(name, str) and ":" in name:
        del table[ONE]
        return imported_class(name, Feature, folder)
    make: Make = chosen(table, ONE, FEATURES, where, others=["module:Class"])
    return make


def make_feature(make: Make, table: Table, where: str, folder: Path) -> Feature:
    """Return the feature of a class that a table without its name describes.

    Raises ConfigurationError for unknown keys and unusable values.
    """
    if make is Stack:
        several = checked(table[SEVERAL], list[Any], where, SEVERAL)
        return Stack(
            [_of_stack(entry, f"{where}.{SEVERAL}[{i}]", folder) for i, entry in enumerate(several)]
        )
    try:
        return from_table(make, table, where)
    except VsconstraintsError:
        raise
    except (Exception, SystemExit) as error:  # a custom feature may raise anything
        name = getattr(make, "__name__", make)
        raise ConfigurationError(
            f"{where}: the feature {name} cannot be made with {format_value(table)}: "
            f"{described(error)}"
        ) from error


def _of_stack(entry: object, where: str, folder: Path) -> Feature:
    """Return a feature of a stack: a name, or a table with a name and further keys."""
    table = {ONE: entry} if isinstance(entry, str) else require_table(entry, where)
    return make_feature(feature_named(table, where, folder), table, where, folder)
