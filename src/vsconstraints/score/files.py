"""Columns of recorded runs, from CSV, Parquet, npz and bags of ROS."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..errors import ConfigurationError, described, format_value
from ..plugins.extras import demand
from ..rows import Array

#: Time of a sample of a bag: that in its header, or that of its recording.
Clock = Literal["header", "log"]

JOINT_STATE = "sensor_msgs/msg/JointState"
NANO = 1e-9
#: Names of columns of times that state no unit, and are in seconds.
WITHOUT_UNIT = ("t", "time", "timestamp", "stamp")
#: Units of times [s] that a name of a column may state: ``t_ms``.
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": NANO}
#: Names of columns of times, and their unit [s].
TIMES: Mapping[str, float] = {
    **dict.fromkeys(WITHOUT_UNIT, UNITS["s"]),
    **{f"{name}_{unit}": UNITS[unit] for unit in UNITS for name in ("t", "time", "timestamp")},
}
#: Names of arrays (N, n) of joints in npz files, and of their columns.
ARRAYS = {"q": "q", "qd": "qd", "qdd_command": "qdd"}


class Table(NamedTuple):
    """Columns of a file by name: (N,) numbers, and what makes others unreadable."""

    numbers: dict[str, Array]
    #: For each other column, one sentence: its first value that is no number, or another column
    #: of the same name.
    others: Mapping[str, str] = {}


class Columns(NamedTuple):
    """Recorded samples: times t (N,) from the first one [s], and the columns of a :class:`Table`.

    ``unit_stated`` is True if the file states the unit of its times, as the column ``t_s`` does.
    """

    t: Array
    numbers: Mapping[str, Array]
    others: Mapping[str, str] = {}
    unit_stated: bool = False

    def find(self, names: Sequence[str]) -> Array | None:
        """Return the column (N,) of the first of some names that there is; None without one.

        Raises ConfigurationError if that column is not of numbers, or if two have its name.
        """
        for name in names:
            if name in self.numbers:
                return self.numbers[name]
        for name in names:
            if name in self.others:
                raise ConfigurationError(self.others[name])
        return None


def read_columns(path: Path, clock: Clock = "header", topic: str = "") -> Columns:
    """Read a recording by the ending of its name; a folder is a bag.

    Raises ConfigurationError if it cannot be read.
    """
    ending = path.suffix.lower()
    if is_bag(path):
        return _bag(path, clock, topic)
    if ending not in READERS:
        known = ", ".join((*READERS, *BAGS))
        raise ConfigurationError(
            f"{path}: a recording ends in {known}, or is the folder of a bag, not in "
            f"{format_value(path.suffix)}"
        )
    try:
        table = READERS[ending](path)
    except ConfigurationError:
        raise
    except Exception as error:  # a damaged file can raise any error
        raise ConfigurationError(f"cannot read {path}: {described(error)}") from error
    return _timed(path, table)


def _timed(path: Path, table: Table) -> Columns:
    """Split the column of times from the others. Raises ConfigurationError if there is none."""
    numbers = dict(table.numbers)
    for name, unit in TIMES.items():
        if name in numbers:
            t = numbers.pop(name)
            if not len(t):
                raise ConfigurationError(f"{path} has no samples")
            # differences first: nanoseconds since 1970 exceed the precision of seconds
            since_first = unit * (t - t[0])
            return Columns(since_first, numbers, table.others, name not in WITHOUT_UNIT)
    for name in TIMES:
        if name in table.others:
            raise ConfigurationError(table.others[name])
    raise ConfigurationError(
        f"{path} has no column of times: one of {', '.join(TIMES)}. Its columns are "
        f"{', '.join((*numbers, *table.others)) or 'none'}"
    )


def _csv(path: Path) -> Table:
    with path.open(newline="", encoding="utf-8-sig") as file:
        lines = list(csv.reader(file))
    header = [name.strip() for name in lines[0]] if lines else []
    if len(header) == 1 and ";" in header[0]:
        raise ConfigurationError(
            f"{path} has semicolons between its columns: write commas, and decimal points"
        )
    # spreadsheets end lines with separators, of the header or of every line
    named = [i for i, name in enumerate(header, start=1) if name]
    needed = max(named, default=0)
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if not line:
            continue
        too_long = any(value.strip() for value in line[len(header) :])
        if len(line) < needed or too_long:
            raise ConfigurationError(
                f"{path}, line {number}: {len(line)} values for {len(header)} columns"
            )
        rows.append((number, line))

    def read(column: int) -> Array:
        values = [_number(line[column], f"{path}, line {number}") for number, line in rows]
        return np.array(values, dtype=np.float64)

    return _table(path, header, read)


def _table(path: Path, names: Sequence[str], read: Callable[[int], Array]) -> Table:
    """Return the table of the columns that have a name.

    ``read`` returns the numbers (N,) of a column by its index, and raises ConfigurationError if
    some of its values are no numbers.
    """
    numbers = {}
    others = _repeated_names(path, names)
    for i, name in enumerate(names):
        if name and name not in others:
            try:
                numbers[name] = read(i)
            except ConfigurationError as error:
                others[name] = f"{error}, in column {name}"
    return Table(numbers, others)


def _repeated_names(path: Path, names: Sequence[str]) -> dict[str, str]:
    """Return a sentence for each name of two or more columns, of which none can be chosen."""
    found = {}
    for name in filter(None, dict.fromkeys(names)):
        numbers = [str(i) for i, other in enumerate(names, start=1) if other == name]
        if len(numbers) > 1:
            found[name] = (
                f"{path}: columns {' and '.join(numbers)} have the same name, {name}: rename all "
                "but the one that is meant"
            )
    return found


def _number(text: str, where: str) -> float:
    try:
        return float(text) if text.strip() else math.nan
    except ValueError as error:
        raise ConfigurationError(f"{where}: {format_value(text)} is no number") from error


def _parquet(path: Path) -> Table:
    demand("evidence", "a recording in Parquet")
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:  # read_table refuses columns of one name
        stored = file.read()

    def read(column: int) -> Array:
        values = stored.column(column)
        try:
            return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ConfigurationError(
                f"{path}: values of type {values.type} are no numbers"
            ) from error

    return _table(path, stored.column_names, read)


def _npz(path: Path) -> Table:
    """Read the arrays of a stored trajectory: t (N,), q (N, n), and qd, qdd_command if present.

    Times have the names of columns. Further arrays are names (n,) of the joints and measured
    pixels (N, M, 2).
    """
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    time = next((name for name in TIMES if name in arrays), None)
    if time is None or "q" not in arrays:
        missing = "'q'" if time is not None else f"of times: one of {', '.join(TIMES)}"
        raise ConfigurationError(f"{path} has no array {missing}; it has {', '.join(arrays)}")
    samples = arrays[time].size
    columns = {time: _numbers_of(path, arrays, time, 1, samples)}
    q = _numbers_of(path, arrays, "q", 2, samples)
    numbers = np.arange(1, q.shape[1] + 1)
    joints = arrays.get("names", numbers)
    for name, prefix in ARRAYS.items():
        if name not in arrays:
            continue
        values = _numbers_of(path, arrays, name, 2, samples)
        if values.shape[1] != len(joints):
            raise ConfigurationError(
                f"{path}: {name} has {values.shape[1]} columns for {len(joints)} joints"
            )
        for joint, column in zip(joints, values.T, strict=True):
            columns[f"{prefix}[{joint}]"] = column
    if "pixels" in arrays:
        pixels = _numbers_of(path, arrays, "pixels", 3, samples)
        for number, (u, v) in enumerate(pixels.transpose(1, 2, 0), start=1):
            columns[f"u[{number}]"] = u
            columns[f"v[{number}]"] = v
    return Table(columns)


def _numbers_of(path: Path, arrays: Mapping[str, Any], name: str, axes: int, samples: int) -> Array:
    """Return an array of numbers (samples, …) with this many axes.

    Raises ConfigurationError if it has another number of axes or of samples.
    """
    values = np.asarray(arrays[name], dtype=np.float64)
    if values.ndim != axes or len(values) != samples:
        raise ConfigurationError(
            f"{path}: {name} has the shape {values.shape} for {samples} times; its first axis is "
            f"time, and it has {axes} axes"
        )
    return values


READERS: Mapping[str, Callable[[Path], Table]] = {
    ".csv": _csv,
    ".parquet": _parquet,
    ".npz": _npz,
}
BAGS = (".mcap", ".db3", ".bag")


def is_bag(path: Path) -> bool:
    """Return True if a recording is a bag by the ending of its name, or as a folder."""
    return path.is_dir() or path.suffix.lower() in BAGS


def _bag(path: Path, clock: Clock, topic: str) -> Columns:
    """Read the joint states of a bag; a joint that a message omits is NaN in its sample."""
    demand("bags", "a recording of ROS")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    stamps: list[int] = []
    samples: list[dict[str, float]] = []
    try:
        with AnyReader([path], default_typestore=store) as reader:
            chosen = _topic(path, reader.connections, topic)
            for connection, logged, raw in reader.messages(connections=chosen):
                message: Any = reader.deserialize(raw, connection.msgtype)
                header = message.header.stamp
                stamp = logged if clock == "log" else header.sec * 1_000_000_000 + header.nanosec
                stamps.append(stamp)
                samples.append(dict(_joint_values(message)))
    except ConfigurationError:
        raise
    except Exception as error:  # a damaged bag can raise any error
        raise ConfigurationError(f"cannot read {path}: {described(error)}") from error
    if not stamps:
        raise ConfigurationError(f"{path} has no joint states")
    names = list(dict.fromkeys(name for sample in samples for name in sample))
    columns = {}
    for name in names:
        values = [sample.get(name, math.nan) for sample in samples]
        columns[name] = np.array(values)
    since = np.array([stamp - stamps[0] for stamp in stamps], dtype=np.float64)
    return Columns(NANO * since, columns, unit_stated=True)


def _joint_values(message: Any) -> Iterator[tuple[str, float]]:
    """Yield the names of columns with their values; none for a field without a value per joint."""
    for name, field in (("position", message.position), ("velocity", message.velocity)):
        if len(field) == len(message.name):
            for joint, value in zip(message.name, field, strict=True):
                yield f"{joint}.{name}", float(value)


def _topic(path: Path, connections: Sequence[Any], topic: str) -> list[Any]:
    """Return the connections of the one topic of joint states."""
    states = [each for each in connections if each.msgtype == JOINT_STATE]
    topics = sorted({each.topic for each in states})
    if not topics or (topic and topic not in topics):
        others = ", ".join(sorted(f"{each.topic} ({each.msgtype})" for each in connections))
        raise ConfigurationError(
            f"{path} has no {topic or 'topic'} of {JOINT_STATE}; its topics are {others or 'none'}"
        )
    if not topic and len(topics) > 1:
        raise ConfigurationError(
            f"{path} has joint states on {', '.join(topics)}: choose one with --topic"
        )
    return [each for each in states if each.topic == (topic or topics[0])]
