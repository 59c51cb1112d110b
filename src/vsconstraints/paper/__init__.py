"""Claims of the paper: its sentences, measurements of each, and counterparts of its figures."""

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
    from .claims import CLAIMS, all_claims
    from .report import Reproduction
    from .runner import check, chosen_claims, chosen_figures, redraw, reproduce
    from .verdicts import Claim, Finding, Verdict

__all__ = [
    "CLAIMS",
    "Claim",
    "Finding",
    "Reproduction",
    "Verdict",
    "all_claims",
    "check",
    "chosen_claims",
    "chosen_figures",
    "redraw",
    "reproduce",
]
__getattr__, __dir__ = exported(
    __name__,
    {
        "Reproduction": "report",
        "check": "runner",
        "chosen_claims": "runner",
        "chosen_figures": "runner",
        "redraw": "runner",
        "reproduce": "runner",
        "CLAIMS": "claims",
        "Claim": "verdicts",
        "Finding": "verdicts",
        "Verdict": "verdicts",
        "all_claims": "claims",
    },
)
