"""results.csv and constraints.csv: written line by line, read back with numbers as numbers."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

_TEXT = {"suite", "scenario", "controller", "status", "reason", "violated", "constraint", "kind", "unit"}


def cell(value: object) -> str:
    """A value as text; empty where it is not a number, so that one NaN blanks one cell only."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (float, np.floating)):
        return f"{value:.9g}" if math.isfinite(value) else ""
    return str(value)


def write_table(path: Path, columns: Sequence[str], lines: Iterable[dict[str, Any]]) -> None:
    """Write a whole table; the file is replaced at once, never left half written."""
    part = path.with_name(path.name + ".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([cell(line[name]) for name in columns] for line in lines)
    os.replace(part, path)


def append_lines(path: Path, columns: Sequence[str], lines: Iterable[dict[str, Any]]) -> None:
    """Add lines to a table, which is begun if the file is not there."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(columns)
        writer.writerows([cell(line[name]) for name in columns] for line in lines)


def read_table(path: Path) -> list[dict[str, Any]]:
    """Lines of a table: text as str, ``challenged`` as bool, everything else as float, NaN where empty."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: _parse(name, text) for name, text in line.items()} for line in csv.DictReader(file)]


def _parse(name: str, text: str) -> str | bool | float:
    if name in _TEXT:
        return text
    if name == "challenged":
        return text == "true"
    return float(text) if text else math.nan
