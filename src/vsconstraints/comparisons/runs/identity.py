"""Identity of results: everything that they depend on, and how two identities differ.

A run of a comparison, a campaign, a tuning, and the runs of the paper have one. Stored results are
continued or combined only if their identities are equal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from ...errors import format_value
from ...plugins.provenance import digest
from ...plugins.registry import packages_with_metrics
from .files import plain
from .machine import code_identity, used_versions

#: Everything that results depend on, as nested JSON tables; the same on every machine.
Identity = dict[str, Any]

MAX_SHOWN = 3  # maximum number of differences in a message

IN_WORDS = {
    "code": "the package's source",
    "version": "the package's version",
    "compiled": "whether runs are compiled",
}


class Law(Protocol):
    """Properties of a :class:`.ControllerSpec` that identities need."""

    @property
    def name(self) -> str:
        """Name in results."""

    @property
    def options(self) -> Mapping[str, Any]:
        """Options of the law."""

    @property
    def table(self) -> dict[str, Any]:
        """Law, options and timing."""

    @property
    def files(self) -> tuple[Path, ...]:
        """Files in which a custom law is defined."""


def identity(controllers: Iterable[Law], *, with_files: bool = True, **others: Any) -> Identity:
    """Return everything that runs depend on: code, packages, controllers, and ``others``.

    ``others`` are settings, and scenes by :func:`scene_identity`. Unless ``with_files``, hashes of
    files of custom laws and packages with metrics are left out, for runs that are stored as
    records: these hold hashes of all files, and are scored again whenever they are read.
    """
    laws = {entry.name: _law_identity(entry, with_files) for entry in controllers}
    found = {**code_identity(), **others, "controllers": laws}
    # records are scored anew; without them, scores of other packages' metrics are results
    packages = {} if not with_files else packages_with_metrics()
    if packages:
        found["metrics"] = packages
    return found


def scene_identity(tables: Mapping[str, Any], files: Iterable[Path] = ()) -> Identity:
    """Return the identity of a scenario or a family.

    It holds the tables, hashes of files that they name, and the versions of optional packages that
    they use.
    """
    return {
        "tables": plain(tables),
        "files": _hashes(files),
        "packages": used_versions(tables),
    }


def _hashes(files: Iterable[Path]) -> dict[str, str]:
    """Return the hashes of files by their names, which are the same on every machine.

    Files of one name in several folders have one entry: their different hashes, in the given order.
    """
    found: dict[str, dict[str, None]] = {}
    for path in files:
        found.setdefault(path.name, {})[digest(path)] = None
    return {name: " ".join(contents) for name, contents in found.items()}


def _law_identity(entry: Law, with_files: bool) -> Identity:
    """Return the options of a law, hashes of its custom files and versions of its solvers."""
    files = entry.files if with_files else ()
    packages = used_versions(entry.options)
    law: Identity = plain(
        {
            **entry.table,
            **{f"file {name}": content for name, content in _hashes(files).items()},
            **{f"package {name}": version for name, version in packages.items()},
        }
    )
    return law


def different(
    a: Any, b: Any, path: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Yield the path to each difference with both values, None where a value is missing.

    Tables are compared recursively, as are nonempty lists of tables with equal length.
    """
    if _is_list_of_tables(a) and _is_list_of_tables(b) and len(a) == len(b):
        a = dict(enumerate(a))
        b = dict(enumerate(b))
    if not (isinstance(a, Mapping) and isinstance(b, Mapping)):
        if a != b:
            yield path, a, b
        return
    for key in dict.fromkeys((*a, *b)):
        inside = (*path, str(key))
        if key in a and key in b:
            yield from different(a[key], b[key], inside)
        else:
            yield inside, a.get(key), b.get(key)


def _is_list_of_tables(value: Any) -> bool:
    """True for a nonempty list of tables."""
    if not isinstance(value, list) or not value:
        return False
    return all(isinstance(entry, Mapping) for entry in value)


def differences(
    first: Any, second: Any, in_first: str = "there", in_second: str = "here"
) -> Iterator[str]:
    """Yield a sentence for each difference, with both values and words for where they are."""
    for path, old, new in different(first, second):
        name = ".".join(path)
        if old is None or new is None:
            yield f"{name} is only {in_first if new is None else in_second}"
        else:
            said = f"{name} is {format_value(old)} {in_first} and {format_value(new)} {in_second}"
            yield f"{IN_WORDS[name]} differs" if name in IN_WORDS else said


def in_words(texts: Sequence[str]) -> str:
    """Join the first differences and the number of the remaining ones."""
    more = len(texts) - MAX_SHOWN
    return "; ".join(texts[:MAX_SHOWN]) + (f"; and {more} more" if more > 0 else "")
