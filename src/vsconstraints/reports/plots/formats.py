"""Which files a figure is written to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...errors import unknown_name

Formats = tuple[str, ...]
"""Of a figure's files, by their suffixes; pages show the first."""

PNG: Formats = ("png",)

VECTOR: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Formats that stay sharp at any size, and what leaves the day out of their files: the same figure, the same bytes."""

FORMATS = (*PNG, *VECTOR)
"""All there are."""

NOT_ON_PAGES = "pdf"
"""No browser shows it within a page."""


def formats_of(names: Sequence[str]) -> Formats:
    """The formats of these names, PNG if there are none; one that pages show comes first, PNG if none of them is.

    Raises
    ------
    ConfigurationError
        for a name that is none of :data:`FORMATS`.
    """
    for name in names:
        if name not in FORMATS:
            raise unknown_name("format", name, FORMATS)
    chosen = list(dict.fromkeys(names))
    shown = [name for name in chosen if name != NOT_ON_PAGES] or list(PNG)
    return (*shown, *(name for name in chosen if name == NOT_ON_PAGES))
