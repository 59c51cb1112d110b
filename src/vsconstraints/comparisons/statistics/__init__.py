"""How sure is it? Rates, paired differences, profiles and ranks over many scenes.

Pure functions of arrays, one entry per scene, and of tables of runs. What they rest on is in the
guide.
"""

from .judged import OUTCOMES, SCENE, distinguishable, judged_metrics, simultaneous, verdict
from .ranking import Profile, Ranks, across_families, left_out_ranks, profile, ranks
from .rates import (
    PairedRates,
    Rate,
    detectable,
    difference_interval,
    mcnemar,
    median,
    paired,
    rate,
    rate_of,
    rate_text,
    with_interval,
)
from .tables import compare_laws, costs, medians, rates

__all__ = [
    "OUTCOMES",
    "SCENE",
    "PairedRates",
    "Profile",
    "Ranks",
    "Rate",
    "across_families",
    "compare_laws",
    "costs",
    "detectable",
    "difference_interval",
    "distinguishable",
    "judged_metrics",
    "left_out_ranks",
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
