"""Markdown that is also readable as plain text: tables, and escaped text from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise

from rich.cells import cell_len

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
        """Return the table of these cells in Markdown."""
        lines = [list(line) for line in lines]
        count = max(1, -(-(len(header) - 1) // (MAX_COLUMNS - 1)))
        cuts = [1 + (len(header) - 1) * k // count for k in range(count + 1)]
        parts = [[0, *range(*ends)] for ends in pairwise(cuts)]
        blocks = [
            _aligned(
                [[line[k] for k in part] for line in (header, *lines)],
                sum(k < text_columns for k in part),
            )
            for part in parts
            if lines
        ]
        table = super().__new__(cls, "\n\n".join(blocks))
        table.header = header
        table.lines = lines
        return table


def _aligned(lines: Sequence[Sequence[str]], left: int) -> str:
    # A bar ends a cell even inside code.
    cells = [
        [re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split())) for text in line] for line in lines
    ]
    widths = [max(3, *map(cell_len, column)) for column in zip(*cells, strict=True)]
    rule = [":" + "-" * (w - 1) if k < left else "-" * (w - 1) + ":" for k, w in enumerate(widths)]

    def padded(k: int, text: str) -> str:
        space = " " * (widths[k] - cell_len(text))
        return text + space if k < left else space + text

    rows = [[padded(k, text) for k, text in enumerate(line)] for line in cells]
    return "\n".join("| " + " | ".join(line) + " |" for line in (rows[0], rule, *rows[1:]))


def bold(text: str) -> str:
    """Return text with strong emphasis."""
    return f"**{text}**"


def code(text: str) -> str:
    """Return text set as code on one line, with a fence longer than any in the text."""
    text = " ".join(text.split())
    fence = "`" * (max((len(run) for run in re.findall("`+", text)), default=0) + 1)
    space = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{space}{text}{space}{fence}"


def plain(text: object) -> str:
    """Return text from elsewhere, such as an error message, on one line.

    Characters with an effect in Markdown or HTML are escaped.
    """
    escaped = re.sub(r"([\\`*\[\]|~]|\b_|_\b|^#)", r"\\\1", " ".join(str(text).split()))
    return escaped.replace("<", "&lt;").replace(">", "&gt;")


def bullets(lines: Iterable[str]) -> str:
    """Return a bulleted list."""
    return "\n".join(f"- {line}" for line in lines)


def enumeration(names: Sequence[str]) -> str:
    """Return names as ``a``, ``a and b`` or ``a, b and c``."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def first_names(names: Iterable[str], most: int) -> list[str]:
    """Return the distinct names, or the first of them and the number of the others.

    The list has at most ``most`` entries.
    """
    names = list(dict.fromkeys(names))
    return names if len(names) <= most else [*names[: most - 1], f"{len(names) - most + 1} more"]
