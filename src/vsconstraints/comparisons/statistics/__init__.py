"""How sure is it? Rates, paired differences, profiles and ranks over many scenes.

Pure functions of arrays, one entry per scene, and of tables of runs. What they rest on is in the guide.
"""

from .judged import LAW, OUTCOMES, SCENE, Verdict, distinguishable, judged_metrics, simultaneous, verdict
from .ranking import Profile, Ranks, profile, ranks
from .rates import (
    Median,
    Paired,
    PairedRates,
    Rate,
    detectable,
    difference_interval,
    mcnemar,
    median,
    paired,
    rate,
    rate_of,
)
from .tables import compare_laws, costs, medians, rates
from .text import rate_text, with_interval

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
    "paired",
    "profile",
    "ranks",
    "rate",
    "rate_of",
    "rate_text",
    "rates",
    "simultaneous",
    "verdict",
    "with_interval",
]
