"""The columns of the three tables: the keys of a run, then those of results.csv and constraints.csv."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..metrics import CONSTRAINT_COLUMNS, METRICS, RESULT_COLUMNS, ROW_METRICS, RUN, TIMING_COLUMNS

Kind = Literal["text", "flag", "whole", "number"]


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name
        Its name.
    kind
        What a cell holds.
    category
        Whether it has few values, which come again and again.
    added
        Whether files may lack it that were written before it was there; its values are missing then.
    """

    name: str
    kind: Kind
    category: bool = False
    added: bool = False


KEYS = (
    Column("family", "text", category=True),
    Column("condition", "text", category=True),
    Column("half", "text", category=True),
    Column("scene", "whole"),
    Column("controller", "text", category=True),
)
"""Which run it is."""

_KINDS: dict[str, Kind] = {"text": "text", "flag": "flag", "number": "number", "time": "number"}
_OF_RUNS = {metric.column: _KINDS[metric.kind] for metric in METRICS if metric.value is not None}
_OF_ROWS = {metric.column: _KINDS[metric.kind] for metric in ROW_METRICS if metric.value is not None}
_CATEGORIES = ("status", "constraint", "kind", "unit")

RUNS = (
    *KEYS,
    *(Column(name, _OF_RUNS[name], name in _CATEGORIES) for name in RESULT_COLUMNS if name not in RUN),
)
"""One line for each run."""

ROWS = (
    *KEYS,
    *(Column(name, _OF_ROWS[name], name in _CATEGORIES) for name in CONSTRAINT_COLUMNS if name not in RUN),
)
"""One line for each row of a run that was challenged, acted, or was left."""

SCENES = (
    Column("family", "text", category=True),
    Column("half", "text", category=True),
    Column("scene", "whole"),
    Column("found", "flag"),
    Column("attempts", "whole"),
    Column("rejected", "text"),
    Column("challenged", "text"),
    Column("share_to_hold", "number"),
    Column("values", "text"),
    Column("least_time_s", "number", added=True),
    Column("duration_s", "number", added=True),
)
"""One line for each scene: ``rejected`` and ``values`` as JSON."""

TABLES = {"runs": RUNS, "rows": ROWS, "scenes": SCENES}
"""By the folders of their shards."""

TIMING = TIMING_COLUMNS
"""What differs from one machine, and one time, to the next; everything else is the same wherever it is run."""

__all__ = ["KEYS", "ROWS", "RUNS", "SCENES", "TABLES", "TIMING", "Column"]
