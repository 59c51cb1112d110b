"""Formats of figures; a command reads them before it loads NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..errors import unknown_name

Formats = tuple[str, ...]  #: Suffixes of a figure's files; pages show the first.
PNG: Formats = ("png",)
#: Vector formats, with the metadata that removes the date from files: the same figure gives the
#: same bytes.
VECTOR: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
FORMATS = (*PNG, *VECTOR)


def formats_of(names: Sequence[str]) -> Formats:
    """Return these formats with one that pages show first.

    Pages show no PDF: if no other format is given, PNG is added. Raises ConfigurationError for a
    name that is not in :data:`FORMATS`.
    """
    for name in names:
        if name not in FORMATS:
            raise unknown_name("format", name, FORMATS)
    shown = [name for name in dict.fromkeys(names) if name != "pdf"]
    if not shown:
        shown = [*PNG]
    return (*shown, "pdf") if "pdf" in names else tuple(shown)
