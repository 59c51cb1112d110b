"""What results depend on, as data, and in words what differs between two of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ... import __version__
from ...compiled import available
from ...errors import shown
from ...plugins.classes import module_files
from ...plugins.provenance import digest
from ...scenarios import Scenario
from ...scenarios.families import Family
from ..entries import Entries
from ..runs.files import plain
from ..runs.machine import code_hash, package_versions, used_versions
from ..runs.spec import ControllerSpec

Identity = dict[str, Any]
"""Nested tables of plain values, as JSON has them; the same wherever the same campaign is run."""

MOST_SHOWN = 3
"""Differences that a message shows."""

IN_WORDS = {"code": "the package's source", "version": "the package's version", "compiled": "whether runs are compiled"}


def of_code() -> Identity:
    """Source, versions of Python and of the packages that all results can depend on, and whether runs are compiled."""
    return {
        "version": __version__,
        "code": code_hash()[:16],
        "compiled": available(),
        "packages": package_versions(),
    }


def of_controllers(entries: Entries) -> Identity:
    """Laws and their options, what the files of own ones hold, and which solvers they use."""
    return {entry.name: plain({"type": entry.law, **entry.options, **_parts(entry)}) for entry in entries}


def _parts(entry: ControllerSpec) -> Identity:
    files = {f"file {path.name}": digest(path) for path in module_files([entry.law], entry.folder)}
    return files | {f"package {name}": found for name, found in used_versions(entry.options).items()}


def of_family(family: Family) -> Identity:
    """What a family says, what the files that it names hold, and which packages its conditions use."""
    files = Scenario(family.name, family.tables, family.folder).files
    return {
        "tables": plain(family.tables),
        "files": {path.name: digest(path) for path in files},
        "packages": used_versions(family.tables),
    }


def differences(there: Any, here: Any, key: str = "") -> Iterator[str]:
    """Sentences that name what differs, with both values."""
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        for name in dict.fromkeys((*there, *here)):
            if name not in there or name not in here:
                yield f"{key}{name} is only {'there' if name in there else 'here'}"
            else:
                yield from differences(there[name], here[name], f"{key}{name}.")
    elif there != here:
        name = key.rstrip(".")
        values = f"{name} is {shown(there)} there and {shown(here)} here"
        yield f"{IN_WORDS[name]} differs" if name in IN_WORDS else values


def in_words(found: list[str]) -> str:
    """The first of many differences, and how many there are."""
    more = len(found) - MOST_SHOWN
    return "; ".join(found[:MOST_SHOWN]) + (f"; and {more} more" if more > 0 else "")
