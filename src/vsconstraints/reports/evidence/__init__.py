"""The report of evidence: which controller, when, and how sure, from thousands of drawn scenes.

It needs pandas, which ``pip install 'vsconstraints[evidence]'`` brings.
"""

from .dataset import replay, replayed
from .report import write_evidence_report

__all__ = ["replay", "replayed", "write_evidence_report"]
