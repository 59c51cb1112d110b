"""The paper claim by claim: its sentences, what is measured of each here, and counterparts of its figures."""

from .report import Reproduction
from .runner import check, chosen_claims, chosen_figures, redraw, reproduce
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
