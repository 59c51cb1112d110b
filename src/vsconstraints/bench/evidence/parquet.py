"""Tables of runs, constraint rows and scenes: columns and Parquet files.

The footer of each file holds facts about the batch.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...comparisons.metrics import (
    REQUIRED_COLUMNS,
    RUN,
    constraint_columns,
    result_columns,
    row_metrics,
    run_metrics,
)
from ...comparisons.runs.files import replaced
from ...comparisons.tables import is_empty, missing_columns
from ...errors import ConfigurationError, encodable, one_line
from ...plugins.extras import demand
from ...plugins.regular_files import require_regular

demand("evidence")

import pyarrow as pa  # noqa: E402 - a missing package is reported with what installs it
import pyarrow.parquet as pq  # noqa: E402

joined = pa.concat_tables  #: Concatenates tables.
FACTS = b"vsconstraints"  # key of the facts in the footer of a file, as JSON
# maximum uncompressed size of a line [bytes]: a reason has 2000 characters, rows some thousand
EXPANDED = 100_000

#: Exceptions that pyarrow raises for a damaged file.
UNREADABLE = (OSError, ValueError, KeyError, pa.ArrowException)

Kind = Literal["text", "flag", "whole", "number"]
_TYPES = {
    "text": pa.string(),
    "flag": pa.bool_(),
    "whole": pa.int64(),
    "number": pa.float64(),
}
_CONVERTERS: dict[Kind, Callable[[Any], Any]] = {"flag": bool, "whole": int, "number": float}


class Column(NamedTuple):
    """Column of a table: name and kind of value.

    A ``category`` has few different values. A table without a ``required`` column cannot be read.
    """

    name: str
    kind: Kind
    category: bool = False
    required: bool = False


#: Columns that identify a run.
KEYS = (
    Column("family", "text", category=True, required=True),
    Column("condition", "text", category=True, required=True),
    Column("half", "text", category=True, required=True),
    Column("scene", "whole", required=True),
    Column("controller", "text", category=True, required=True),
)
#: Further columns of texts with few different values.
CATEGORIES = ("status", "constraint", "kind", "unit")


def _columns(names: Iterable[str], metrics: Iterable[Any]) -> tuple[Column, ...]:
    """Return the keys of runs, followed by the named columns that are not keys."""
    kinds: dict[str, Kind] = {}
    for metric in metrics:
        if metric.value is not None:
            kinds[metric.column] = "number" if metric.is_number else metric.kind
    columns = list(KEYS)
    for name in names:
        if name not in RUN:
            is_required = name in REQUIRED_COLUMNS
            columns.append(Column(name, kinds[name], name in CATEGORIES, is_required))
    return tuple(columns)


#: Columns of the table with one line for each scene; ``rejected`` and ``values`` are JSON.
SCENES = (
    *(column for column in KEYS if column.name in ("family", "half", "scene")),
    Column("found", "flag", required=True),
    Column("attempts", "whole"),
    Column("rejected", "text"),
    Column("challenged", "text"),
    Column("share_to_hold", "number"),
    Column("values", "text", required=True),
    Column("least_time_s", "number"),
    Column("duration_s", "number"),
)


def tables() -> dict[str, tuple[Column, ...]]:
    """Return the columns of each table, by the folder of its batches.

    ``runs`` has one line for each run: keys, then the columns of results.csv. ``rows`` has one line
    for each challenged, active or violated row of a run: keys, then the columns of constraints.csv.
    ``scenes`` has one line for each scene. Raises ConfigurationError if a metric of another package
    cannot be used.
    """
    return {
        "runs": _columns(result_columns(), run_metrics()),
        "rows": _columns(constraint_columns(), row_metrics()),
        "scenes": SCENES,
    }


def schema(columns: Sequence[Column]) -> Any:
    """Return the Arrow schema of a table with these columns."""
    fields = [(column.name, _TYPES[column.kind]) for column in columns]
    return pa.schema(fields)


def table(columns: Sequence[Column], lines: Sequence[Mapping[str, Any]]) -> Any:
    """Return an Arrow table of lines.

    Cells that are empty in results.csv are null; a text is never null, but may be empty.
    """
    arrays = []
    for column in columns:
        cells = [_cell(column.kind, line[column.name]) for line in lines]
        arrays.append(pa.array(cells, _TYPES[column.kind]))
    return pa.Table.from_arrays(arrays, schema=schema(columns))


def _cell(kind: Kind, value: Any) -> Any:
    """Return a value as a cell of a kind; None if it is missing, which pandas may give as NaN."""
    if kind == "text":
        return encodable(str(value))
    return None if is_empty(value) else _CONVERTERS[kind](value)


def write(path: Path, lines: Any, facts: Mapping[str, Any]) -> None:
    """Write a table completely or not at all. Raises OSError."""
    text = json.dumps(facts, ensure_ascii=False, default=str)
    footer = {FACTS: encodable(text).encode()}
    lines = lines.replace_schema_metadata(footer)
    with replaced(path) as part:
        pq.write_table(lines, part, compression="zstd", write_page_checksum=True)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        require_regular(path)
        yield
    except (*UNREADABLE, RecursionError) as error:
        raise ConfigurationError(
            f"{path} cannot be read: {one_line(str(error)) or type(error).__name__}"
        ) from error


def facts_of(path: Path) -> dict[str, Any]:
    """Return the facts in the footer of a file.

    Raises ConfigurationError that names the file if it holds none.
    """
    with _reading(path):
        metadata = pq.read_schema(path).metadata or {}
        facts = json.loads(metadata[FACTS])
        if not isinstance(facts, dict):
            raise ValueError("its metadata is not a table")
    return facts


def column_names(path: Path) -> list[str]:
    """Return the names of all columns of a file; raises ConfigurationError if it is unreadable."""
    with _reading(path):
        return list(pq.read_schema(path).names)


def line_count(path: Path) -> int:
    """Return the number of lines that the footer of a file states.

    Raises ConfigurationError if the file cannot be read.
    """
    with _reading(path):
        return int(pq.read_metadata(path).num_rows)


def read(
    paths: Iterable[Path], columns: Sequence[Column], names: Sequence[str] | None = None
) -> Any:
    """Read the lines of all files into one table, with the named columns or all.

    A missing column is read as empty: a text as "", all others as null. Raises ConfigurationError
    if a file cannot be read, has no required column, or lacks a column beside an unknown one.
    """
    selected = columns
    if names is not None:
        selected = [column for column in columns if column.name in names]
    wanted = schema(selected)
    known = [column.name for column in columns]
    required = [column.name for column in columns if column.required]
    parts = [wanted.empty_table()]
    for path in paths:
        # read single files: pyarrow would derive partition columns from the names of folders
        with _reading(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
            _require_small(file.metadata)
            lines = file.read(wanted.names).replace_schema_metadata()
            lines.validate(full=True)
            missing = missing_columns(file.schema_arrow.names, wanted.names, known, required)
            for column in selected:
                if column.name in missing:
                    empty_cell = "" if column.kind == "text" else None
                    cells = [empty_cell] * len(lines)
                    empty = pa.array(cells, _TYPES[column.kind])
                    lines = lines.append_column(column.name, empty)
            parts.append(lines.select(wanted.names).cast(wanted))
    return pa.concat_tables(parts)


def _require_small(metadata: Any) -> None:
    """Raise ValueError if the tables of a file expand to more than their lines may take."""
    size = 0
    for i in range(metadata.num_row_groups):
        size += metadata.row_group(i).total_byte_size
    most = EXPANDED * (1 + metadata.num_rows)
    if size > most:
        raise ValueError(f"it expands to {size} bytes, and its lines may take {most}")
