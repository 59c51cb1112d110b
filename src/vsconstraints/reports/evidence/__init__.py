"""The report of evidence: which law, when, and how sure, from thousands of drawn scenes.

It needs pandas, which ``pip install 'vsconstraints[evidence]'`` brings.
"""

from .replay import replay
from .report import write_evidence_report

__all__ = ["replay", "write_evidence_report"]
