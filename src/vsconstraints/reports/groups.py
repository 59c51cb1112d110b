"""Controllers that share a figure: all where there are few, otherwise those that require the same information."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..comparisons.suite import BASELINE
from ..controllers import CONTROLLERS, make_controller
from ..controllers.demand import USES
from .markdown import enumeration

MAX_LAWS = 8
"""How many controllers a figure shows beside tracking alone."""

KINDS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("plain", f"Laws without {USES['period']}, {USES['Lf']}, memory or model", ()),
    ("period", f"Laws that use {USES['period']}", (USES["period"],)),
    ("drift", f"Laws that use {USES['Lf']}", (USES["Lf"],)),
    ("memory", "Laws with memory", ("memory", USES["last_rate"])),
    ("model", "Laws with a model", ("model",)),
    ("own", "Own laws", ("own",)),
)
"""Name in files, title, and what laws use that belong there: a law belongs to the last kind of which it uses any."""


@dataclass(frozen=True)
class Group:
    """Laws that are shown together.

    Attributes
    ----------
    controllers
        Their names, behind tracking alone where that was run.
    title
        What they have in common; empty where all laws stand together.
    suffix
        Of the names of their figures; empty where all laws stand together.
    listed
        The title with the names of the laws.
    """

    controllers: tuple[str, ...]
    title: str = ""
    suffix: str = ""
    listed: str = ""

    @property
    def sentence(self) -> str:
        """The title behind a caption."""
        return f" {self.title}." if self.title else ""

    def and_also(self, other: Group) -> Group:
        """The laws of both."""
        controllers = tuple(dict.fromkeys((*self.controllers, *other.controllers)))
        title, listed = (
            f"{own}; {more[0].lower()}{more[1:]}"
            for own, more in ((self.title, other.title), (self.listed, other.listed))
        )
        return Group(controllers, title, f"{self.suffix}-{other.suffix.removeprefix('--')}", listed)


def required_information(name: str, entry: Mapping[str, Any]) -> tuple[str, ...] | None:
    """What a controller requires beside rows and task; None for an own one, whose code says it."""
    kind = str(entry.get("type", name))
    if kind not in CONTROLLERS:
        return None
    return make_controller(kind, {key: value for key, value in entry.items() if key != "type"}).uses


def grouped(entries: Mapping[str, Mapping[str, Any]]) -> tuple[Group, ...]:
    """The groups of a suite's controllers, each with at most :data:`MAX_LAWS` laws beside tracking alone.

    Where there are more laws, those of a kind stay together, several kinds where they fit.
    """
    laws = [name for name in entries if name != BASELINE]
    if len(laws) <= MAX_LAWS:
        return (Group(tuple(entries)),)
    kinds, baseline = (
        {name: _kind(required_information(name, entries[name])) for name in laws},
        set(entries) - set(laws),
    )
    groups: list[Group] = []
    for file, title, _ in KINDS:
        members = [name for name in laws if kinds[name] == file]
        parts = -(-len(members) // MAX_LAWS)
        for k in range(parts):
            own = members[k * len(members) // parts : (k + 1) * len(members) // parts]
            of, number = (f" ({k + 1} of {parts})", f"-{k + 1}") if parts > 1 else ("", "")
            new = Group((*baseline, *own), title + of, f"--{file}{number}", f"{title}{of}: {enumeration(own)}")
            both = groups[-1].and_also(new) if groups else new
            if groups and len(both.controllers) - len(baseline) <= MAX_LAWS:
                groups[-1] = both
            else:
                groups.append(new)
    return tuple(groups)


def _kind(used: Sequence[str] | None) -> str:
    used = ("own",) if used is None else used
    return [file for file, _, any_of in KINDS if not any_of or not set(any_of).isdisjoint(used)][-1]
