"""Calibration files as plain tables: YAML, JSON and OpenCV's XML (``cv::FileStorage``).

Files are not trusted. Of YAML only tables, lists and texts are read, whatever the tags state. XML
with a document type is refused, so that it cannot define entities. The size and the nesting depth
of files are bounded. Messages name file and position; they do not show content that may be private
if the file is no calibration.
"""

from __future__ import annotations

import codecs
import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..errors import ConfigurationError, format_value
from ..rows import Array

#: Largest size of a file [bytes] and largest nesting depth; calibrations are far below.
MAX_BYTES = 250_000
MAX_DEPTH = 10
MAX_SHOWN = 30  #: Largest number of characters of a value in a message.
EMPTY = ("", "~", "null")  #: Texts that mean that a value is missing.
Calibrated = Mapping[str, Any]  #: Table of a file: texts, lists and tables by key.
#: Byte order marks with their encodings, longer ones first.
BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def read_table(path: str | Path) -> Calibrated:
    """Return the table in a calibration file.

    Raises ConfigurationError, which names the file, if it cannot be read, is too large, is nested
    too deep, is encoded in neither UTF-8 nor UTF-16, or is no table.
    """
    where = os.fspath(path)
    table = table_of(read_text(path, "calibration"), where, "calibration")
    if not isinstance(table, Mapping):
        raise ConfigurationError(f"{where} is not a calibration: it must be a table")
    return table


def read_text(path: str | Path, what: str) -> str:
    """Return the text of a file of bounded size.

    Raises ConfigurationError, which names the file, if it cannot be read.
    """
    try:
        return _text(Path(path))
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot read the {what} {os.fspath(path)}: {error}") from None


def table_of(text: str, where: str, what: str) -> object:
    """Return the table, list or text of a file in YAML, JSON or OpenCV's XML.

    Raises ConfigurationError if it cannot be read.
    """
    try:
        return _of_xml(text) if text.lstrip().startswith("<") else _of_yaml(text)
    except ValueError as error:
        raise ConfigurationError(f"cannot read the {what} {where}: {error}") from None


def _text(path: Path) -> str:
    """Return the text of a file without its byte order mark."""
    if path.exists() and not path.is_file():
        raise ValueError("it is not a file")
    with path.open("rb") as file:
        data = file.read(MAX_BYTES + 1)
    if len(data) > MAX_BYTES:
        raise ValueError(f"it is larger than {MAX_BYTES} bytes")
    encoding = "utf-8"
    for mark, stands_for in BYTE_ORDER_MARKS:
        if data.startswith(mark):
            encoding = stands_for
            data = data.removeprefix(mark)
            break
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"line {line} is in another encoding than UTF-8: save the file as UTF-8, or write its "
            f"comments in ASCII"
        ) from None


def _of_yaml(text: str) -> object:
    """Return the content of the first nonempty document in a YAML file.

    OpenCV 3 and 4 begin files with ``%YAML:1.0``, which other readers refuse.
    """
    import yaml  # imported only if there is such a file

    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    text = re.sub(r"(?m)^%YAML.*$", "", text)
    try:
        _require_plain(yaml, yaml.parse(text, Loader=loader))
        # the output of "topic echo" ends with "---", which begins an empty document
        return next((document for document in yaml.load_all(text, Loader=loader) if document), None)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ValueError(f"{place}it is not valid YAML") from None


def _require_plain(yaml: Any, events: Iterator[Any]) -> None:
    """Raise ValueError for deep nesting, duplicate keys and aliases.

    With aliases, a small file can expand to a huge one.
    """
    depth = 0
    nodes = 0
    keys = set[str]()
    for event in events:
        place = f"line {event.start_mark.line + 1}"
        if isinstance(event, yaml.DocumentStartEvent):
            nodes = 0
            keys = set()
        elif isinstance(event, yaml.AliasEvent):
            raise ValueError(f"{place} has an alias (*), which no calibration needs")
        elif isinstance(event, yaml.NodeEvent) and depth == 1:
            nodes += 1  # keys and values alternate
            if nodes % 2 and isinstance(event, yaml.ScalarEvent):
                if event.value in keys:
                    raise ValueError(f"{place} repeats a key")
                keys.add(event.value)
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(
            event, yaml.CollectionEndEvent
        )
        if depth > MAX_DEPTH:
            raise ValueError(f"{place} is nested deeper than {MAX_DEPTH} levels")


def root_of_xml(text: str) -> ElementTree.Element:
    """Return the root of an XML file of bounded depth and without a document type.

    Raises ValueError, which names the place, if it is no such file.
    """
    if re.search(r"<!\s*(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise ValueError("it has a document type (<!DOCTYPE), which no calibration needs")
    parser: Any = ElementTree.XMLPullParser(events=("start", "end"))
    depth = 0
    try:
        parser.feed(text)
        parser.close()
        for event, _ in parser.read_events():
            depth += 1 if event == "start" else -1
            if depth > MAX_DEPTH:
                raise ValueError(f"it is nested deeper than {MAX_DEPTH} levels")
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise ValueError(f"line {line}, column {column + 1}: it is not valid XML") from None


def _of_xml(text: str) -> object:
    """Return the content of OpenCV's XML storage."""
    root = root_of_xml(text)
    if root.tag != "opencv_storage":
        raise ValueError(
            "it is XML, but its root is not OpenCV's <opencv_storage>: write its numbers into "
            "YAML as OpenCV or ROS do"
        )
    return _of_element(root)


def _of_element(element: ElementTree.Element) -> object:
    """Return the text, list or table in an XML element of OpenCV."""
    text = (element.text or "").strip()
    children = list(element)
    if not children:
        return text.strip('"')
    if all(child.tag == "_" for child in children):
        return [_of_element(child) for child in children]
    table: dict[str, Any] = {}
    for child in children:
        if child.tag in table:
            raise ValueError("it repeats a key")
        table[child.tag] = _of_element(child)
    if isinstance(table.get("data"), str):
        table["data"] = table["data"].split()
    return table


# --- values ---


def said(value: object) -> str:
    """Return a value for a message: a short text, or its kind."""
    if isinstance(value, str):
        return format_value(value) if len(value) <= MAX_SHOWN else "a long text"
    return (
        "a table"
        if isinstance(value, Mapping)
        else "a list"
        if isinstance(value, list)
        else "empty"
    )


def number_of(value: object) -> float:
    """Return the number in a text, also in YAML's spelling (``.inf``); NaN if it is no number."""
    try:
        return (
            float(re.sub(r"(?i)\.(?=inf|nan)", "", value)) if isinstance(value, str) else math.nan
        )
    except ValueError:
        return math.nan


def numbers_of(value: object, key: str, where: str) -> Array:
    """Return the numbers (rows × columns,) of a matrix or a list.

    A matrix may omit its size. Raises ConfigurationError unless all numbers are finite and their
    count fits.
    """
    is_table = isinstance(value, Mapping)
    sized = isinstance(value, Mapping) and ("rows" in value or "cols" in value)
    demanded = {"rows", "cols", "data"} if sized else {"data"}
    if isinstance(value, Mapping) and not demanded <= value.keys():
        raise ConfigurationError(f"{where}: {key} must have rows, cols and data")
    data = value["data"] if isinstance(value, Mapping) else value
    numbers = np.array([number_of(text) for text in _flat(data)])
    rows = float(len(numbers))
    columns = 1.0
    if is_table and sized:
        rows = number_of(value["rows"])  # type: ignore[index]
        columns = number_of(value["cols"])  # type: ignore[index]
    if len(numbers) != rows * columns or not np.isfinite(numbers).all():
        finite = np.isfinite(numbers).sum()
        raise ConfigurationError(
            f"{where}: {key} must have rows × cols = {rows:g} × {columns:g} finite numbers as "
            f"data; it has {finite}"
        )
    return numbers


def _flat(data: object) -> Iterator[object]:
    """Yield the entries of nested lists, without empty ones."""
    if isinstance(data, list):
        for entry in data:
            yield from _flat(entry)
    elif data not in EMPTY:
        yield data
