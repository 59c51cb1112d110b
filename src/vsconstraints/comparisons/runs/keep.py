"""Whose trajectories are kept: the ways to say it, and which runs each means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeVar, cast, get_args

from ...errors import unknown_name

Keep = Literal["none", "failed", "worst", "first", "all"]
"""Runs whose trajectories are kept: none; those that failed or were aborted; of each kind of run the one with the
deepest violation, of equal ones the first; those that come first; all."""

Line = TypeVar("Line", bound=Mapping[str, Any])


class Kinds(NamedTuple):
    """Columns of a table of runs: what makes runs of one kind, what is counted, and within what it is counted."""

    kind: tuple[str, ...]
    counted: str
    within: str


def demand_keep(keep: str) -> Keep:
    """The way to keep of this name; raises ConfigurationError if there is none."""
    if keep not in get_args(Keep):
        raise unknown_name("--keep", keep, get_args(Keep))
    return cast("Keep", keep)


def kept_lines(lines: Sequence[Line], keep: Keep, kinds: Kinds) -> list[Line]:
    """Lines of the runs whose trajectories are kept, in their order.

    Parameters
    ----------
    lines
        One for each run, with ``status``, ``violation_depth`` and the columns of ``kinds``.
    keep
        Which.
    kinds
        What the runs are of.
    """
    if keep == "failed":
        return [line for line in lines if line["status"] in ("failed", "aborted")]
    if keep == "worst":
        deepest: dict[tuple[Any, ...], Line] = {}
        for line in lines:
            kind = tuple(line[name] for name in kinds.kind)
            if line["violation_depth"] > (deepest[kind]["violation_depth"] if kind in deepest else 0.0):
                deepest[kind] = line
        chosen = set(map(id, deepest.values()))
        return [line for line in lines if id(line) in chosen]
    if keep == "first":
        first: dict[Any, Any] = {}
        for line in lines:
            within, counted = line[kinds.within], line[kinds.counted]
            first[within] = min(first.get(within, counted), counted)
        return [line for line in lines if line[kinds.counted] == first[line[kinds.within]]]
    return list(lines) if keep == "all" else []
