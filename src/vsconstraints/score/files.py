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

TIMES = ("t", "time", "time_s", "timestamp", "stamp")  #: Columns of times in seconds.
TIMES_NS = ("t_ns", "time_ns", "timestamp_ns")  #: The same in nanoseconds.
JOINT_STATE = "sensor_msgs/msg/JointState"
NANO = 1e-9


class Columns(NamedTuple):
    """Recorded samples: times t (N,) from the first one [s], and (N,) columns by name."""

    t: Array
    columns: Mapping[str, Array]


def read_columns(path: Path, clock: Clock = "header", topic: str = "") -> Columns:
    """Read a recording by the ending of its name; a folder is a bag.

    Raises ConfigurationError if it cannot be read.
    """
    reader = READERS.get(path.suffix.lower())
    if path.is_dir() or path.suffix.lower() in BAGS:
        return _bag(path, clock, topic)
    if reader is None:
        known = ", ".join((*READERS, *BAGS))
        raise ConfigurationError(
            f"{path}: a recording ends in {known}, or is the folder of a bag, not in "
            f"{format_value(path.suffix)}"
        )
    try:
        found = reader(path)
    except ConfigurationError:
        raise
    except Exception as error:  # a damaged file can raise any error
        raise ConfigurationError(f"cannot read {path}: {described(error)}") from error
    return _timed(path, found)


def _timed(path: Path, columns: dict[str, Array]) -> Columns:
    """Split the column of times from the others."""
    for names, unit in ((TIMES, 1.0), (TIMES_NS, NANO)):
        for name in names:
            if name in columns:
                t = columns.pop(name)
                if not len(t):
                    raise ConfigurationError(f"{path} has no samples")
                # differences first: nanoseconds since 1970 exceed the precision of seconds
                return Columns(unit * (t - t[0]), columns)
    raise ConfigurationError(
        f"{path} has no column of times: one of {', '.join((*TIMES, *TIMES_NS))}. Its columns are "
        f"{', '.join(columns) or 'none'}"
    )


def _csv(path: Path) -> dict[str, Array]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        lines = csv.reader(file)
        header = [name.strip() for name in next(lines, [])]
        if len(header) == 1 and ";" in header[0]:
            raise ConfigurationError(
                f"{path} has semicolons between its columns: write commas, and decimal points"
            )
        twice = sorted({name for name in header if header.count(name) > 1})
        if twice:
            raise ConfigurationError(f"{path} has two or more columns {', '.join(twice)}")
        rows = []
        for number, line in enumerate(lines, start=2):
            if not line:
                continue
            if len(line) != len(header):
                raise ConfigurationError(
                    f"{path}, line {number}: {len(line)} values for {len(header)} columns"
                )
            rows.append([_number(text, f"{path}, line {number}") for text in line])
    values: Array = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    columns: dict[str, Array] = dict(zip(header, values.T, strict=True))
    return columns


def _number(text: str, where: str) -> float:
    try:
        return float(text) if text.strip() else math.nan
    except ValueError as error:
        raise ConfigurationError(f"{where}: {format_value(text)} is no number") from error


def _parquet(path: Path) -> dict[str, Array]:
    demand("evidence", "a recording in Parquet")
    from pyarrow.parquet import read_table

    table = read_table(path)
    return {
        name: np.asarray(table.column(name).to_numpy(zero_copy_only=False), dtype=np.float64)
        for name in table.column_names
    }


def _npz(path: Path) -> dict[str, Array]:
    """Read the arrays of a stored trajectory: t (N,), q (N, n), and qd, qdd_command if present.

    Further arrays are names (n,) of the joints and measured pixels (N, M, 2).
    """
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    for name in ("t", "q"):
        if name not in arrays:
            raise ConfigurationError(f"{path} has no array {name!r}; it has {', '.join(arrays)}")
    columns: dict[str, Array] = {"t": np.asarray(arrays["t"], dtype=np.float64)}
    q = np.asarray(arrays["q"])
    for name, axes in (("q", 2), ("qd", 2), ("qdd_command", 2), ("pixels", 3)):
        if name not in arrays:
            continue
        shape = arrays[name].shape
        if len(shape) != axes or shape[0] != len(columns["t"]):
            raise ConfigurationError(
                f"{path}: {name} has the shape {shape} for {len(columns['t'])} times; its first "
                f"axis is time, and it has {axes} axes"
            )
    names = [str(name) for name in arrays.get("names", range(1, q.shape[1] + 1))]
    for array, prefix in (("q", "q"), ("qd", "qd"), ("qdd_command", "qdd")):
        for name, values in zip(names, np.asarray(arrays.get(array, q[:, :0])).T, strict=False):
            columns[f"{prefix}[{name}]"] = values.astype(np.float64)
    pixels = np.asarray(arrays.get("pixels", np.empty((len(q), 0, 2))), dtype=np.float64)
    for i in range(pixels.shape[1]):
        columns[f"u[{i + 1}]"] = pixels[:, i, 0]
        columns[f"v[{i + 1}]"] = pixels[:, i, 1]
    return columns


READERS: Mapping[str, Callable[[Path], dict[str, Array]]] = {
    ".csv": _csv,
    ".parquet": _parquet,
    ".npz": _npz,
}
BAGS = (".mcap", ".db3", ".bag")


def _bag(path: Path, clock: Clock, topic: str) -> Columns:
    """Read the joint states of a bag; a joint that a message omits is NaN in its sample."""
    demand("bags", "a recording of ROS")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    stamps = []
    samples: list[dict[str, float]] = []
    try:
        with AnyReader([path], default_typestore=store) as reader:
            chosen = _topic(path, reader.connections, topic)
            for connection, logged, raw in reader.messages(connections=chosen):
                message: Any = reader.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp
                stamps.append(
                    logged if clock == "log" else stamp.sec * 1_000_000_000 + stamp.nanosec
                )
                samples.append(dict(_joint_values(message)))
    except ConfigurationError:
        raise
    except Exception as error:  # a damaged bag can raise any error
        raise ConfigurationError(f"cannot read {path}: {described(error)}") from error
    if not stamps:
        raise ConfigurationError(f"{path} has no joint states")
    names = list(dict.fromkeys(name for sample in samples for name in sample))
    columns = {name: np.array([sample.get(name, math.nan) for sample in samples]) for name in names}
    since = np.array([stamp - stamps[0] for stamp in stamps], dtype=np.float64)
    return Columns(NANO * since, columns)


def _joint_values(message: Any) -> Iterator[tuple[str, float]]:
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
