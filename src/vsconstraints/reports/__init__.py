"""Reports: tables and figures made from a stored comparison."""

from typing import Any


def __getattr__(name: str) -> Any:
    """Import ``write_report`` on first access.

    Commands such as ``--help`` need only the figure formats, so they do not load the report.
    """
    if name != "write_report":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from .report import write_report

    return write_report
