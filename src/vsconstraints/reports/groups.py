"""Descriptions of controllers for reports, and the groups of controllers that share a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..comparisons.runs.spec import BASELINE, ControllerSpec
from ..controllers import registered_laws
from ..scenarios.toml import toml_text
from .markdown import evenly_split, plain
from .numbers import number

MAX_LAWS = 8  #: Most controllers that a figure shows beside the unconstrained baseline.
#: What reports call runs in which Python runs law, rows or task, or all of it without a compiler.
UNCOMPILED = "uncompiled"


class Group(NamedTuple):
    """Laws that are shown together, after the unconstrained baseline if that was run.

    ``suffix`` ends the names of figures.
    """

    controllers: tuple[str, ...]
    suffix: str = ""


def required_information(name: str, entry: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return the information that a controller requires beyond rows and task.

    Return None for a custom controller: its code defines its requirements.
    """
    kind = str(entry.get("type", name))
    if kind not in registered_laws():
        return None
    return ControllerSpec.from_table(name, entry).make().uses


def controller_cells(
    name: str, entry: Mapping[str, Any], declared: Sequence[str] | None = None
) -> list[str]:
    """Return type, options and required information of a controller of a manifest, for a table.

    ``declared`` are the data that a stack declared as used.
    """
    options = []
    for key, value in entry.items():
        if key == "type":
            continue
        if isinstance(value, float):
            value = number(value)
        elif isinstance(value, Mapping):
            value = toml_text(value)
        options.append(f"{key} = {value}")
    kind = plain(entry.get("type", name))
    shown_options = plain(", ".join(options)) or "defaults"
    required = required_information(name, entry)
    information = information_text(declared if required is None else required)
    return [kind, shown_options, information]


def information_text(required: Sequence[str] | None) -> str:
    """Return the required information of a controller, for a cell."""
    if required is None:
        return "see its code"
    return plain(", ".join(required)) or "none"


def implementation_text(were_compiled: Sequence[bool], external: bool) -> str:
    """Return how a controller runs: compiled, uncompiled, or external (in its own process).

    ``were_compiled`` says of each of its runs whether it was compiled; there is at least one.
    """
    if external:
        return "external"
    share = sum(were_compiled) / len(were_compiled)
    if share == 0.0:
        return UNCOMPILED
    if share == 1.0:
        return "compiled"
    return f"compiled in {100.0 * share:.0f} %, else {UNCOMPILED}"


def grouped(entries: Mapping[str, Mapping[str, Any]]) -> tuple[Group, ...]:
    """Split the controllers of a suite into groups, in their order.

    Groups are as few and as even in size as :data:`MAX_LAWS` allows.
    """
    laws = [name for name in entries if name != BASELINE]
    baseline = [BASELINE] if BASELINE in entries else []
    groups = []
    parts = evenly_split(laws, MAX_LAWS)
    for k, part in enumerate(parts, start=1):
        suffix = f"--{k}" if len(parts) > 1 else ""
        groups.append(Group((*baseline, *part), suffix))
    return tuple(groups)
