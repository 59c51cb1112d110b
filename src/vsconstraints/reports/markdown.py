"""Markdown that is also readable as plain text: aligned tables, escaped cells."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

PAGE = 1012
"""Width at which GitHub shows a page [px]: a wider table scrolls sideways."""

LETTER, COLUMN = 9, 27
"""Width of a letter, and of what stands around a column, on such a page at most [px]."""


def tables(header: Sequence[str], lines: Sequence[Sequence[str]], text_columns: int = 1) -> str:
    """A table like :func:`table`; if it is wider than a page, several that each begin with its first column."""
    widths = page_widths(header, lines, text_columns)
    parts = _parts(widths, len(widths))
    # as many columns in each, where no more tables come of it
    even = _parts(widths, -(-(len(widths) - 1) // max(len(parts), 1)))
    return "\n\n".join(
        table(
            [header[k] for k in part],
            [[line[k] for k in part] for line in lines],
            sum(k < text_columns for k in part),
        )
        for part in (even if len(even) == len(parts) else parts)
    )


def cells_of(line: str) -> list[str]:
    """Cells of a line of a table, in which bars that end none have a backslash, even inside code."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip()[1:-1])]


def _parts(widths: Sequence[int], most: int) -> list[list[int]]:
    """Numbers of the columns of each table: the first one, and at most so many others, in order."""
    parts = [[0]]
    for i in range(1, len(widths)):
        if len(parts[-1]) > 1 and (len(parts[-1]) > most or sum(widths[k] for k in (*parts[-1], i)) > PAGE):
            parts.append([0])
        parts[-1].append(i)
    return parts


def page_widths(header: Sequence[str], lines: Sequence[Sequence[str]], text_columns: int = 1) -> list[int]:
    """How wide each column is on a page at least [px], where texts are broken at spaces and behind hyphens."""
    columns = zip(header, *lines, strict=True)
    return [
        COLUMN + LETTER * max(_longest(head), *(_longest(text, i < text_columns) for text in body), 0)
        for i, (head, *body) in enumerate(columns)
    ]


def table(header: Sequence[str], lines: Sequence[Sequence[str]], text_columns: int = 1) -> str:
    """A table with its columns aligned; the first ``text_columns`` to the left, the others to the right."""
    cells = [[_cell(text) for text in line] for line in (header, *lines)]
    widths = [max(3, *(_width(line[i]) for line in cells)) for i in range(len(header))]
    left = [i < text_columns for i in range(len(header))]
    rule = [":" + "-" * (w - 1) if to_left else "-" * (w - 1) + ":" for w, to_left in zip(widths, left, strict=True)]
    rows = [[_pad(text, w, to_left) for text, w, to_left in zip(line, widths, left, strict=True)] for line in cells]
    return "\n".join("| " + " | ".join(line) + " |" for line in (rows[0], rule, *rows[1:]))


def bold(text: str) -> str:
    """Strong emphasis."""
    return f"**{text}**"


def code(text: str) -> str:
    """A name set as code, whatever it contains, on one line."""
    text = " ".join(text.split())
    fence = "`" * (max((len(run) for run in re.findall("`+", text)), default=0) + 1)
    space = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{space}{text}{space}{fence}"


def plain(text: str) -> str:
    """Text from elsewhere, such as an error message, on one line and without effect as Markdown or HTML."""
    flat = " ".join(text.split())
    escaped = re.sub(r"([\\`*\[\]|~]|\b_|_\b|^#)", r"\\\1", flat)
    return escaped.replace("<", "&lt;").replace(">", "&gt;")


def bullets(lines: Sequence[str]) -> str:
    """A list."""
    return "\n".join(f"- {line}" for line in lines)


def enumeration(names: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else ""


def _cell(text: str) -> str:
    # a bar ends a cell even inside code
    return re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split()))


def _longest(text: str, broken: bool = True) -> int:
    """Letters of the longest part of a cell that stays in one line."""
    shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)  # of a link only its text
    shown = re.sub(r"[*`\\]", "", shown)
    return max(_width(part) for part in (re.split(r"\s+|(?<=\w-)(?=[^\W\d])", shown) if broken else [shown]))


def _pad(text: str, width: int, to_left: bool) -> str:
    space = " " * (width - _width(text))
    return text + space if to_left else space + text


def _width(text: str) -> int:
    """Columns that a text takes in a fixed-width font."""
    return sum(0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)
