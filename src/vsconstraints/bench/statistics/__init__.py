"""Statistics over many scenes: rates, paired differences, performance profiles and ranks.

All are pure functions of arrays with one entry per scene, or of tables of runs. The guide explains
the methods.
"""

from ...comparisons.rates import Rate, rate_of, rate_text, with_interval
from .judged import OUTCOMES, SCENE, distinguishable, judged_metrics, simultaneous, verdict
from .ranking import Profile, Ranks, across_families, left_out_ranks, profile, ranks
from .rates import (
    PairedRates,
    detectable,
    difference_interval,
    mcnemar,
    median,
    paired,
    rate,
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
