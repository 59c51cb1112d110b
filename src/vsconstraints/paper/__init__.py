"""The whole paper, claim by claim: what it says, what is measured here, and our counterparts of its figures."""

from .parts import check, chosen_claims, chosen_figures, redraw
from .report import Reproduction
from .runner import reproduce
from .verdicts import CLAIMS, Claim, Finding, Verdict, all_claims

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
