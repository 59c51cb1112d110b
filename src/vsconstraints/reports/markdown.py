"""Markdown that is also readable as plain text: aligned tables, escaped cells."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence


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
    """A name set as code, whatever it contains."""
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


def _pad(text: str, width: int, to_left: bool) -> str:
    space = " " * (width - _width(text))
    return text + space if to_left else space + text


def _width(text: str) -> int:
    """Columns that a text takes in a fixed-width font."""
    return sum(0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)
