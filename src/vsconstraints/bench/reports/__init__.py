"""Report of evidence: success of controllers over thousands of drawn scenes, with confidence.

It requires pandas, which ``pip install 'vsconstraints[evidence]'`` installs.
"""

from .dataset import replay
from .report import write_evidence_report

__all__ = ["replay", "write_evidence_report"]
