"""How sure is it? Rates, paired differences, profiles and ranks over many scenes.

Pure functions of arrays, one entry per scene, and of tables of runs. What they rest on is in the guide.
"""

from .comparing import compare_laws
from .inputs import simultaneous
from .judged import LAW, OUTCOMES, SCENE, judged_metrics
from .median import Median, median
from .paired import Paired, paired
from .profiles import Profile, profile
from .ranking import Ranks, ranks
from .rates import PairedRates, Rate, detectable, difference_interval, mcnemar, rate, rate_of
from .tables import costs, medians, rates
from .text import p_text, rate_text, rounded, with_interval
from .verdicts import Verdict, distinguishable, verdict

__all__ = [
    "LAW",
    "OUTCOMES",
    "SCENE",
    "Median",
    "Paired",
    "PairedRates",
    "Profile",
    "Ranks",
    "Rate",
    "Verdict",
    "compare_laws",
    "costs",
    "detectable",
    "difference_interval",
    "distinguishable",
    "judged_metrics",
    "mcnemar",
    "median",
    "medians",
    "p_text",
    "paired",
    "profile",
    "ranks",
    "rate",
    "rate_of",
    "rate_text",
    "rates",
    "rounded",
    "simultaneous",
    "verdict",
    "with_interval",
]
