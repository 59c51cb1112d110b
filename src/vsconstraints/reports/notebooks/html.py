"""Small tables and pictures as HTML, which notebooks show."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from typing import Any

PICTURE_DPI = 75
"""Of small pictures: they are as wide as a notebook's column, and take some 50 kB."""


def table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table of texts."""
    head = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in line)}</tr>" for line in lines)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def paragraph(text: str) -> str:
    """A text by itself."""
    return f"<p>{escape(text)}</p>"


def picture(figure: Any, alternative: str) -> str:
    """A figure of matplotlib in the text, with what stands for it where it cannot be seen."""
    file = BytesIO()
    figure.savefig(file, format="png", dpi=PICTURE_DPI)
    data = base64.b64encode(file.getvalue()).decode()
    return f'<img alt="{escape(alternative)}" src="data:image/png;base64,{data}">'


def page_within(page: str, height: int = 640) -> str:
    """A whole page of its own within another one."""
    return f'<iframe srcdoc="{escape(page)}" style="width:100%;height:{height}px;border:0"></iframe>'
