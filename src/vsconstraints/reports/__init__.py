"""Reports: tables and figures made from a stored comparison."""

from typing import Any

__all__ = ["write_report"]


def __getattr__(name: str) -> Any:
    """What is exported is imported when it is asked for: ``--help`` needs the formats of figures alone."""
    if name in __all__:
        from .report import write_report

        return write_report
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
