"""Claims of the paper: its sentences, measurements of each, and counterparts of its figures."""

from .report import Reproduction as Reproduction
from .runner import check as check
from .runner import chosen_claims as chosen_claims
from .runner import chosen_figures as chosen_figures
from .runner import redraw as redraw
from .runner import reproduce as reproduce
from .verdicts import CLAIMS as CLAIMS
from .verdicts import Claim as Claim
from .verdicts import Finding as Finding
from .verdicts import Verdict as Verdict
from .verdicts import all_claims as all_claims
