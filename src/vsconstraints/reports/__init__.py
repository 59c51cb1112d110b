"""Reports: tables and figures made from a stored comparison."""

from typing import Any


def __getattr__(name: str) -> Any:
    """``write_report`` is imported when it is asked for: ``--help`` needs the formats of figures
    alone.
    """
    if name != "write_report":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .report import write_report

    return write_report
