"""What changed between two comparisons besides their results: code, settings, packages, machine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

PARTS = {
    "version": "code",
    "git_commit": "code",
    "code": "code",
    "configuration": "settings",
    "packages": "packages",
    "machine": "machine",
}
"""Entries of a manifest that results depend on, and what they are part of; the others say how a command went."""

NAMED = ("scenarios", "controllers", "families")
"""Tables of a configuration that hold a table for each name."""


@dataclass(frozen=True)
class Change:
    """Something that is another in B than in A.

    Attributes
    ----------
    part
        ``code``, ``settings``, ``packages`` or ``machine``.
    what
        Its key, with dots.
    names
        The scenarios, families or controllers that it is a key of, alike in all of them; none if it is of no such.
    before, after
        In A and in B; None where it is not there.
    """

    part: str
    what: str
    names: tuple[str, ...]
    before: Any
    after: Any


def changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Change]:
    """What two manifests say differently; the same change of several scenarios or controllers is one."""
    found: dict[tuple[str, str, str], Change] = {}
    for key, part in PARTS.items():
        for path, before, after in _different(a.get(key), b.get(key), ()):
            names: tuple[str, ...] = ()
            if key == "configuration" and path and path[0] in NAMED and len(path) > 1:
                names, path = (path[1],), (path[0], *(step for step in path[2:] if step != "tables"))
            what = ".".join(path) or key
            same = part, what, repr((before, after) if len(path) != 1 or not names else (before is None, after is None))
            names = (*found[same].names, *names) if same in found else names
            found[same] = Change(part, what, names, before, after)
    return list(found.values())


def _different(a: Any, b: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Paths to what is different, as deep as both have the same tables."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys((*a, *b)):
            yield from _different(a.get(key), b.get(key), (*path, str(key)))
    elif _tables(a) and _tables(b) and len(a) == len(b):
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from _different(one, other, (*path, str(i)))
    elif a != b:
        yield path, a, b


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(entry, dict) for entry in value)
