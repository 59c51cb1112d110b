"""Reports: tables and figures made from a stored comparison.

Commands such as ``--help`` need only the figure formats: ``write_report`` is imported at its first
use.
"""

from ..plugins.lazy import exported

__getattr__, __dir__ = exported(__name__, {"write_report": "report"})
