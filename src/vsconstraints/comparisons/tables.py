"""Tables results.csv and constraints.csv: written line by line, read with typed values."""

from __future__ import annotations

import csv
import io
import math
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ..errors import ConfigurationError, format_value
from ..plugins.regular_files import require_regular
from ..simulation.trajectory import Outcome
from .metrics import METRICS, REQUIRED_COLUMNS, ROW_METRICS, RUN
from .runs.files import replaced

csv.field_size_limit(sys.maxsize)  # labels of many rows together can be long

_KINDS = {
    **{metric.column: metric.kind for metric in (*METRICS, *ROW_METRICS)},
    **dict.fromkeys(RUN[:-1], "text"),
}
_EMPTY: dict[str, Any] = {"text": "", "flag": None}  # for all others NaN


def cell(value: object) -> str:
    """Format a value as text; empty for a number that is not finite.

    One NaN therefore leaves only one cell empty.
    """
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (float, np.floating)):
        return f"{value:.9g}" if math.isfinite(value) else ""
    # a text may contain characters that UTF-8 cannot encode
    return str(value).encode("utf-8", "backslashreplace").decode()


def _text(columns: Sequence[str], lines: Iterable[dict[str, Any]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(
        [cell(line[name]) for name in columns] for line in lines
    )
    return text.getvalue()


def write_table(path: Path, columns: Sequence[str], lines: Iterable[dict[str, Any]]) -> None:
    """Write a whole table; the file is replaced atomically, never left half written."""
    with replaced(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        file.write(_text(columns, [dict(zip(columns, columns, strict=True)), *lines]))


def append_lines(
    path: Path, columns: Sequence[str], lines: Iterable[dict[str, Any]], new: bool = False
) -> None:
    """Append lines to a table, which is created if it is ``new`` or does not exist.

    If the lines do not fit on the disk, none is appended, and OSError is raised.
    """
    if new or not path.exists():
        write_table(path, columns, lines)
        return
    text = _text(columns, lines).encode()
    size = path.stat().st_size
    try:
        with path.open("ab") as file:
            file.write(text)
    except OSError:
        os.truncate(path, size)
        raise


def read_table(path: Path, columns: Iterable[str] = ()) -> list[dict[str, Any]]:
    """Return the lines of a table: text, flags and floats, NaN where empty.

    A missing column is read as empty: a text as "", a flag as None. Raises ConfigurationError, with
    file and line, if a required one is missing (:data:`.metrics.REQUIRED_COLUMNS`).
    """
    lines = []
    try:
        require_regular(path)
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file, strict=True)
            header: list[str] = next(reader, [])
            missing = [name for name in columns if name not in header]
            unusable = [name for name in missing if name in REQUIRED_COLUMNS]
            unusable += [name for name in columns if header.count(name) > 1]
            if unusable:
                why = "or more than one; another version may have written it"
                raise ValueError(f"it has no column {format_value(unusable[0])}, {why}")
            empty: dict[str, Any] = {name: _EMPTY.get(_kind(name), math.nan) for name in missing}
            for cells in reader:
                where = f"line {reader.line_num}"
                if len(cells) != len(header):
                    raise ValueError(f"{where} has {len(cells)} cells, not {len(header)}")
                line: dict[str, Any] = {
                    name: _parsed(name, text, where)
                    for name, text in zip(header, cells, strict=True)
                }
                lines.append(line | empty)
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    return lines


def _kind(column: str) -> str:
    return _KINDS.get(column, "number")


def _parsed(name: str, text: str, where: str) -> str | bool | float:
    kind = _kind(name)
    if name == "status" and text not in get_args(Outcome):
        raise ValueError(
            f"{where}: status must be one of {', '.join(get_args(Outcome))}, not "
            f"{format_value(text)}"
        )
    if kind == "text":
        return text
    if kind == "flag":
        if text not in ("true", "false"):
            raise ValueError(f"{where}: {name} must be true or false, not {format_value(text)}")
        return text == "true"
    try:
        value = float(text) if text else math.nan
    except ValueError:
        value = math.inf
    if math.isinf(value) or (name == "trial" and not (value >= 0.0 and value.is_integer())):
        raise ValueError(f"{where}: {name} must be a number, not {format_value(text)}")
    return value
