"""Reports: tables and figures made from a stored comparison."""

from .report import write_report

__all__ = ["write_report"]
