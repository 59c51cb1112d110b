"""The whole paper, claim by claim: what it says, what is measured here, and our counterparts of its figures."""

from .report import Reproduction
from .runner import reproduce
from .verdicts import CLAIMS, Claim, Finding, Verdict, all_claims

__all__ = ["CLAIMS", "Claim", "Finding", "Reproduction", "Verdict", "all_claims", "reproduce"]
