"""Tables as Parquet files, with facts about them in their footers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError
from ..extras import demand
from ..runs.files import replaced
from .columns import Column

demand("evidence")

import pyarrow as pa  # noqa: E402 - what is missing is told with what installs it
import pyarrow.parquet as pq  # noqa: E402

FACTS = b"vsconstraints"
"""Under which a file's footer holds facts, as JSON."""

_TYPES = {"text": pa.string(), "flag": pa.bool_(), "whole": pa.int64(), "number": pa.float64()}
"""Numbers keep all their digits: halves would save a third of the space, and no two folders could be held together."""


def schema(columns: Sequence[Column]) -> Any:
    """The schema of a table with these columns."""
    return pa.schema([(column.name, _TYPES[column.kind]) for column in columns])


def table(columns: Sequence[Column], lines: Sequence[Mapping[str, Any]]) -> Any:
    """A table of lines; a number that does not exist, or is not finite, is missing, as in results.csv."""
    arrays = [
        pa.array([_cell(line[column.name], column.kind) for line in lines], _TYPES[column.kind]) for column in columns
    ]
    return pa.Table.from_arrays(arrays, schema=schema(columns))


def _cell(value: Any, kind: str) -> Any:
    if kind == "number":
        number = float(value)
        return number if math.isfinite(number) else None
    if kind == "text":
        # a text may hold what no encoding has
        return str(value).encode("utf-8", "backslashreplace").decode()
    return int(value) if kind == "whole" else bool(value)


def joined(tables: Sequence[Any]) -> Any:
    """One table of the lines of all."""
    return pa.concat_tables(tables)


def write(path: Path, lines: Any, facts: Mapping[str, Any]) -> None:
    """Write a table whole or not at all; raises OSError."""
    text = json.dumps(facts, ensure_ascii=False, default=str).encode("utf-8", "backslashreplace")
    with replaced(path) as part:
        pq.write_table(lines.replace_schema_metadata({FACTS: text}), part, compression="zstd")


def is_whole(path: Path) -> bool:
    """Whether a file ends as Parquet files do: what was cut off does not."""
    try:
        pq.read_schema(path)
    except (OSError, ValueError):  # pyarrow's errors are of these classes
        return False
    return True


def facts_of(path: Path) -> dict[str, Any]:
    """The facts in a file's footer; raises ConfigurationError that names the file if it holds none."""
    try:
        facts = json.loads((pq.read_schema(path).metadata or {})[FACTS])
    except (OSError, ValueError, KeyError) as error:
        raise ConfigurationError(f"{path} cannot be read: {error or type(error).__name__}") from error
    if not isinstance(facts, dict):
        raise ConfigurationError(f"{path} cannot be read: its facts are no table")
    return facts


def read(paths: Iterable[Path], columns: Sequence[Column], names: Sequence[str] | None = None) -> Any:
    """One table of the lines of all files.

    Parameters
    ----------
    paths
        The files.
    columns
        What they hold.
    names
        The columns that are wanted; all if None.

    Raises
    ------
    ConfigurationError
        if one of them cannot be read, or holds other columns.
    """
    columns = [column for column in columns if names is None or column.name in names]
    wanted = schema(columns)
    found = [wanted.empty_table()]
    for path in paths:
        try:
            # a file by itself: nothing is taken from the names of its folders
            with pq.ParquetFile(path) as file:
                lines = file.read(wanted.names).replace_schema_metadata()
            for column in columns:
                if column.added and column.name not in lines.column_names:
                    lines = lines.append_column(column.name, pa.nulls(len(lines), _TYPES[column.kind]))
            missing = [name for name in wanted.names if name not in lines.column_names]
            if missing:
                raise ValueError(f"it has no column {missing[0]!r}; another version wrote it, which can report on it")
            found.append(lines.select(wanted.names).cast(wanted))
        except (OSError, ValueError, KeyError) as error:
            raise ConfigurationError(f"{path} cannot be read: {error}") from error
    return pa.concat_tables(found)
