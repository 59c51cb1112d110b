"""Tables results.csv and constraints.csv: written line by line, read with typed values."""

from __future__ import annotations

import csv
import io
import math
import os
import sys
from collections.abc import Collection, Container, Iterable, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ..errors import ConfigurationError, encodable, format_value
from ..plugins.regular_files import require_regular
from ..simulation.trajectory import Outcome
from .metrics import KINDS_OF_RUN, REQUIRED_COLUMNS, Metric, row_metrics, run_metrics
from .runs.files import replaced

csv.field_size_limit(sys.maxsize)  # labels of many rows together can be long


def _metrics() -> dict[str, Metric]:
    """Return the metrics of both tables by column, without ratios, which have none."""
    metrics = (*run_metrics(), *row_metrics())
    return {metric.column: metric for metric in metrics if metric.value is not None}


def is_empty(value: object) -> bool:
    """True for a value whose cell is empty, in CSV and Parquet: None, or a number not finite."""
    if isinstance(value, (float, np.floating)):
        return not math.isfinite(value)
    return value is None


def cell(value: object) -> str:
    """Format a value as text; empty for None, and for a number that is not finite."""
    if is_empty(value):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (float, np.floating)):
        return f"{value:.9g}"
    return encodable(str(value))


def _text(columns: Sequence[str], lines: Iterable[dict[str, Any]]) -> str:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    for line in lines:
        writer.writerow([cell(line[name]) for name in columns])
    return text.getvalue()


def write_table(path: Path, columns: Sequence[str], lines: Iterable[dict[str, Any]]) -> None:
    """Write a whole table; the file is replaced atomically, never left half written."""
    header = {name: name for name in columns}
    with replaced(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        file.write(_text(columns, [header, *lines]))


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

    A missing column is read as empty: a text as "", a flag as None. Cells of a metric that is not
    installed are numbers or, where they are none, text. Raises ConfigurationError, with file and
    line, if a required column is missing (:data:`.metrics.REQUIRED_COLUMNS`), or any column beside
    an unknown one, which may be its damaged name.
    """
    columns = tuple(columns)
    metrics = _metrics()
    # without those of metrics that are not installed
    kinds = {**KINDS_OF_RUN, **{name: metric.kind for name, metric in metrics.items()}}
    kinds["status"] = "outcome"
    lines = []
    try:
        require_regular(path)
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.reader(file, strict=True)
            header: list[str] = next(reader, [])
            missing = missing_columns(header, columns, columns, REQUIRED_COLUMNS)
            empty = {name: metrics[name].empty for name in missing}
            for cells in reader:
                where = f"line {reader.line_num}"
                if len(cells) != len(header):
                    raise ValueError(f"{where} has {len(cells)} cells, not {len(header)}")
                line: dict[str, Any] = {}
                for name, text in zip(header, cells, strict=True):
                    line[name] = _parse(name, kinds.get(name), text, where)
                lines.append(line | empty)
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error}") from error
    return lines


def missing_columns(
    header: Sequence[str],
    wanted: Iterable[str],
    known: Collection[str],
    required: Container[str],
) -> list[str]:
    """Return the wanted columns that the header of a table lacks, of CSV or Parquet.

    ``known`` are all columns that the table can have. Raises ValueError if one of the wanted
    appears more than once, if a required one is missing, or if any is missing beside an unknown
    column, which may be its damaged name.
    """
    missing = []
    for name in wanted:
        count = header.count(name)
        if count > 1 or (count == 0 and name in required):
            why = "or more than one; another version may have written it"
            raise ValueError(f"it has no column {format_value(name)}, {why}")
        if count == 0:
            missing.append(name)
    unknown = [name for name in header if name not in known]
    if missing and unknown:
        raise ValueError(
            f"it has no column {format_value(missing[0])}, but {format_value(unknown[0])}, which "
            "is a damaged name, a column of another version, or a metric that is not installed"
        )
    return missing


def _parse(name: str, kind: str | None, text: str, where: str) -> Any:
    """Return a cell as text, flag or float; text or float if its kind is None, not known.

    Raises ValueError that names its line and column.
    """
    if kind == "outcome" and text not in get_args(Outcome):
        raise ValueError(
            f"{where}: status must be one of {', '.join(get_args(Outcome))}, not "
            f"{format_value(text)}"
        )
    if kind in ("text", "outcome"):
        return text
    if kind == "flag":
        if text == "" and name not in REQUIRED_COLUMNS:
            return None
        if text not in ("true", "false"):
            raise ValueError(f"{where}: {name} must be true or false, not {format_value(text)}")
        return text == "true"
    if not text:
        return math.nan
    number = _parse_number(text)
    if kind is None:
        return text if number is None else number
    if number is None or (kind == "index" and not _is_index(number)):
        raise ValueError(f"{where}: {name} must be a number, not {format_value(text)}")
    return number


def _parse_number(text: str) -> float | None:
    """Return the number of a cell; None if it is none, or infinite, which no table holds."""
    try:
        number = float(text)
    except ValueError:
        return None
    return None if math.isinf(number) else number


def _is_index(number: float) -> bool:
    return number >= 0.0 and number.is_integer()
