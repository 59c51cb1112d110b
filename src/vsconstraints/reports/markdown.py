"""Markdown that is also readable as plain text: tables, and escaped text from elsewhere."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

from rich.cells import cell_len

Value = TypeVar("Value")

#: A table with more columns is split into several, each with the first column repeated.
MAX_COLUMNS = 9


class Table(str):
    """Table as Markdown text, empty if it has no lines.

    The first ``text_columns`` columns are aligned left, the others right.
    """

    #: Texts of its cells in Markdown.
    header: Sequence[str]
    lines: Sequence[Sequence[str]]

    def __new__(
        cls, header: Sequence[str], lines: Iterable[Sequence[str]], text_columns: int = 1
    ) -> Table:
        """Return the table of these cells in Markdown.

        Raises ValueError if a line has another number of cells than the header.
        """
        lines = [list(line) for line in lines]
        columns = []
        for j, column in enumerate(zip(header, *lines, strict=True)):
            columns.append(_aligned(column, left=j < text_columns))
        blocks = []
        if lines:
            first, *others = columns
            for part in evenly_split(others, MAX_COLUMNS - 1):
                rows = [" | ".join(row) for row in zip(first, *part, strict=True)]
                blocks.append("\n".join(f"| {row} |" for row in rows))
        table = super().__new__(cls, "\n\n".join(blocks))
        table.header = header
        table.lines = lines
        return table


def evenly_split(values: Sequence[Value], most: int) -> list[Sequence[Value]]:
    """Split values into as few parts of at most ``most`` as possible, even in size; one if none."""
    size = len(values)
    count = max(1, math.ceil(size / most))
    ends = [size * k // count for k in range(count + 1)]
    return [values[begin:end] for begin, end in pairwise(ends)]


def _aligned(column: Sequence[str], left: bool) -> list[str]:
    """Return the cells of a column with equal widths, and the rule below its header."""
    cells = []
    for text in column:
        # A bar ends a cell even inside code.
        cells.append(re.sub(r"(?<!\\)\|", r"\\|", _on_one_line(text)))
    width = max(3, *map(cell_len, cells))
    padded = []
    for text in cells:
        space = " " * (width - cell_len(text))
        padded.append(text + space if left else space + text)
    dashes = "-" * (width - 1)
    rule = f":{dashes}" if left else f"{dashes}:"
    return [padded[0], rule, *padded[1:]]


def _on_one_line(text: str) -> str:
    return " ".join(text.split())


def bold(text: str) -> str:
    """Return text with strong emphasis."""
    return f"**{text}**"


def code(text: str) -> str:
    """Return text set as code on one line, with a fence longer than any in the text."""
    text = _on_one_line(text)
    fence = "`"
    while fence in text:
        fence += "`"
    space = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{space}{text}{space}{fence}"


def plain(text: object) -> str:
    """Return text from elsewhere, such as an error message, on one line.

    Characters with an effect in Markdown or HTML are escaped.
    """
    line = _on_one_line(str(text))
    escaped = re.sub(r"([\\`*\[\]|~]|\b_|_\b|^#)", r"\\\1", line)
    return escaped.replace("<", "&lt;").replace(">", "&gt;")


def bullets(lines: Iterable[str]) -> str:
    """Return a bulleted list."""
    return "\n".join(f"- {line}" for line in lines)


def enumeration(names: Sequence[str]) -> str:
    """Return names as ``a``, ``a and b`` or ``a, b and c``."""
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"


def first_names(names: Iterable[str], most: int) -> list[str]:
    """Return the distinct names, or the first of them and the number of the others.

    The list has at most ``most`` entries.
    """
    names = list(dict.fromkeys(names))
    if len(names) <= most:
        return names
    left_out = len(names) - most + 1
    return [*names[: most - 1], f"{left_out} more"]
