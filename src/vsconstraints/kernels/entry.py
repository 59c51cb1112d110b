"""Calls of compiled functions at the least cost."""

from __future__ import annotations

from typing import Any


def entry(function: Any) -> Any:
    """The compiled function without the search for the one that fits its arguments: for arrays that are known to."""
    return function.overloads[function.signatures[0]].entry_point
