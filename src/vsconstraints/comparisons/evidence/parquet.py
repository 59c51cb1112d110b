"""Tables of runs, of their rows and of scenes: their columns, and Parquet files with facts in their
footers.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...errors import ConfigurationError, one_line
from ...plugins.extras import demand
from ...plugins.regular_files import demand_regular
from ..metrics import (
    CONSTRAINT_COLUMNS,
    LATER_COLUMNS,
    METRICS,
    RESULT_COLUMNS,
    ROW_METRICS,
    RUN,
    TIMING_COLUMNS,
)
from ..runs.files import replaced

demand("evidence")

import pyarrow as pa  # noqa: E402 - a missing package is reported with what installs it
import pyarrow.parquet as pq  # noqa: E402

joined = pa.concat_tables  #: One table of the lines of several.
FACTS = b"vsconstraints"  # under which a file's footer holds facts, as JSON
# bytes that a line may take when it is read: a reason has 2000 characters, rows some thousand
EXPANDED = 100_000

#: Exceptions of pyarrow for a damaged file.
UNREADABLE = (OSError, ValueError, KeyError, pa.ArrowException)

Kind = Literal["text", "flag", "whole", "number"]
_TYPES = {"text": pa.string(), "flag": pa.bool_(), "whole": pa.int64(), "number": pa.float64()}
_CELLS: dict[Kind, Callable[[Any], Any]] = {
    # it may hold what no encoding has
    "text": lambda value: str(value).encode("utf-8", "backslashreplace").decode(),
    "flag": bool,
    "whole": int,
    "number": lambda value: float(value) if math.isfinite(value) else None,
}


class Column(NamedTuple):
    """A column of a table: its name, what a cell holds, and whether it has few values, which come
    again and again.
    """

    name: str
    kind: Kind
    category: bool = False


#: What identifies a run.
KEYS = (
    *(Column(name, "text", category=True) for name in ("family", "condition", "half")),
    Column("scene", "whole"),
    Column("controller", "text", category=True),
)


def _columns(names: Iterable[str], metrics: Iterable[Any]) -> tuple[Column, ...]:
    """The keys of runs, then those columns of a comparison's tables that are not its own keys."""
    kinds: dict[str, Kind] = {
        each.column: "number" if each.kind == "time" else each.kind
        for each in metrics
        if each.value is not None
    }
    categories = ("status", "constraint", "kind", "unit")
    return (
        *KEYS,
        *(Column(name, kinds[name], name in categories) for name in names if name not in RUN),
    )


#: One line for each run: its keys, then the columns of results.csv.
RUNS = _columns(RESULT_COLUMNS, METRICS)
#: One line for each row of a run that was challenged, active or violated: keys, then the columns of
#: constraints.csv.
ROWS = _columns(CONSTRAINT_COLUMNS, ROW_METRICS)
#: One line for each scene: ``rejected`` and ``values`` as JSON.
SCENES = (
    *(column for column in KEYS if column.name in ("family", "half", "scene")),
    *(
        Column("found", "flag"),
        Column("attempts", "whole"),
        Column("rejected", "text"),
        Column("challenged", "text"),
    ),
    *(Column("share_to_hold", "number"), Column("values", "text")),
    *(Column("least_time_s", "number"), Column("duration_s", "number")),
)
TABLES = {"runs": RUNS, "rows": ROWS, "scenes": SCENES}  #: By the folders of their shards.
TIMING = TIMING_COLUMNS  #: All other columns are the same wherever and whenever a scene is run.


def schema(columns: Sequence[Column]) -> Any:
    """The schema of a table with these columns."""
    return pa.schema([(column.name, _TYPES[column.kind]) for column in columns])


def table(columns: Sequence[Column], lines: Sequence[Mapping[str, Any]]) -> Any:
    """A table of lines; a number that does not exist, or is not finite, is missing, as in
    results.csv.
    """
    arrays = [
        pa.array([_CELLS[kind](line[name]) for line in lines], _TYPES[kind])
        for name, kind, _ in columns
    ]
    return pa.Table.from_arrays(arrays, schema=schema(columns))


def write(path: Path, lines: Any, facts: Mapping[str, Any]) -> None:
    """Write a table whole or not at all; raises OSError."""
    text = json.dumps(facts, ensure_ascii=False, default=str).encode("utf-8", "backslashreplace")
    with replaced(path) as part:
        pq.write_table(
            lines.replace_schema_metadata({FACTS: text}),
            part,
            compression="zstd",
            write_page_checksum=True,
        )


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        demand_regular(path)
        yield
    except (*UNREADABLE, RecursionError) as error:
        raise ConfigurationError(
            f"{path} cannot be read: {one_line(str(error)) or type(error).__name__}"
        ) from error


def facts_of(path: Path) -> dict[str, Any]:
    """The facts in a file's footer; raises ConfigurationError that names the file if it holds
    none.
    """
    with _reading(path):
        facts = json.loads((pq.read_schema(path).metadata or {})[FACTS])
        if not isinstance(facts, dict):
            raise ValueError("its facts are no table")
    return facts


def line_count(path: Path) -> int:
    """How many lines a file claims to have; raises ConfigurationError if it cannot be read."""
    with _reading(path):
        return int(pq.read_metadata(path).num_rows)


def read(
    paths: Iterable[Path], columns: Sequence[Column], names: Sequence[str] | None = None
) -> Any:
    """Return one table of the lines of all files, of the named columns or all.

    Columns that earlier versions did not write are empty. Raises ConfigurationError if a file
    cannot be read.
    """
    wanted = schema([column for column in columns if names is None or column.name in names])
    tables = [wanted.empty_table()]
    for path in paths:
        # a file by itself: nothing is taken from the names of its folders
        with _reading(path), pq.ParquetFile(path, page_checksum_verification=True) as file:
            groups = (file.metadata.row_group(i) for i in range(file.metadata.num_row_groups))
            size = sum(group.total_byte_size for group in groups)
            most = EXPANDED * (1 + file.metadata.num_rows)
            if size > most:
                raise ValueError(f"it expands to {size} bytes, and its lines may take {most}")
            lines = file.read(wanted.names).replace_schema_metadata()
            lines.validate(full=True)
            for name in LATER_COLUMNS:
                if name in wanted.names and name not in lines.column_names:
                    lines = lines.append_column(name, pa.nulls(len(lines), pa.float64()))
            if missing := [name for name in wanted.names if name not in lines.column_names]:
                raise ValueError(
                    f"it has no column {missing[0]!r}; another version wrote it, which can report "
                    f"on it"
                )
            tables.append(lines.select(wanted.names).cast(wanted))
    return pa.concat_tables(tables)
