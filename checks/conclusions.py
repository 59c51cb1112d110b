"""Which conclusions hold, counted again: ``python -m checks.conclusions FOLDER`` reads a report's claims and runs.

From the runs alone, with pandas, SciPy and statsmodels and nothing of this package: McNemar's test as a binomial one,
Wilcoxon's signed ranks with Pratt's zeros, Holm's correction. Of rates every verdict has to be the same; of medians,
whose intervals count too, whatever is told has to be significant and in that direction.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest, wilcoxon
from statsmodels.stats.multitest import multipletests

FEWEST = 6
RATES, MEDIANS = ("success", "violation"), {"utilization": 1, "acceleration_variation": -1}
"""What is counted; of medians, whether more is better."""

Directions = dict[tuple[str, str], int]
"""Of two laws 1 where the first is better, −1 where the second is, 0 where no test tells."""


def directions(runs: pd.DataFrame, measure: str) -> Directions:
    """What tests say of every two laws in the runs of one condition."""
    left = runs["violated"].fillna("") != ""
    good = (runs["status"] == "converged") & ~left
    if measure in RATES:
        values = (good if measure == "success" else ~left).astype(float)
    else:
        values = (MEDIANS[measure] * runs[measure]).where(good & np.isfinite(runs[measure]))
    wide = runs.assign(x=values).pivot_table(index=["family", "scene"], columns="controller", values="x", dropna=False)
    wide = wide.reindex(sorted(wide.columns), axis=1)
    pairs, p, way = list(combinations(wide.columns, 2)), [], []
    for a, b in pairs:
        both = wide[[a, b]].dropna()
        one, other = both[a].to_numpy(), both[b].to_numpy()
        more, fewer = int((one > other).sum()), int((one < other).sum())
        way.append(int(np.sign(more - fewer)))
        if len(both) < FEWEST or not more + fewer:
            p.append(np.nan if len(both) < FEWEST else 1.0)
        elif measure in RATES:
            p.append(binomtest(more, more + fewer).pvalue)
        else:
            apart = one - other if measure == "utilization" else np.log(other / one)
            p.append(wilcoxon(apart, zero_method="pratt").pvalue)
    tested = ~np.isnan(p)
    told = np.zeros(len(pairs), dtype=int)
    if tested.any():
        told[tested] = multipletests(np.array(p)[tested], method="holm")[0]
    found = {pair: int(sign * yes) for pair, sign, yes in zip(pairs, way, told, strict=True)}
    return found | {(b, a): -sign for (a, b), sign in found.items()}


def going(runs: pd.DataFrame, first: str, other: str) -> pd.DataFrame:
    """Runs of laws that came to anything in both conditions, and of families that both have."""
    runs = runs[(runs["controller"] != "tracking") & runs["condition"].isin([first, other])]
    came = runs[~runs["status"].isin(["failed", "aborted"])].groupby("controller", observed=True)["condition"].nunique()
    there = runs.groupby("family", observed=True)["condition"].nunique()
    return runs[runs["controller"].isin(came[came == 2].index) & runs["family"].isin(there[there == 2].index)]


def differing(runs: pd.DataFrame, conclusions: Sequence[dict[str, Any]], first: str = "nominal") -> list[str]:
    """What runs do not say as the claims do, one sentence each."""
    wrong = []
    runs = runs.astype(dict.fromkeys(("family", "condition", "controller", "status"), str))
    for condition in dict.fromkeys(one["condition"] for one in conclusions):
        both = going(runs, first, condition)
        for measure in (*RATES, *MEDIANS):
            before, after = (directions(both[both["condition"] == name], measure) for name in (first, condition))
            claimed = {
                (one["better"], one["worse"]): one["outcome"]
                for one in conclusions
                if (one["condition"], one["measure"]) == (condition, measure)
            }
            for pair, outcome in claimed.items():
                said = {"holds": 1, "reversed": -1}.get(outcome, 0)
                sure = measure in RATES or said != 0
                if before[pair] != 1 or (sure and after[pair] != said):
                    wrong.append(f"{condition}, {measure}: {' before '.join(pair)} is said to be {outcome}")
            if measure in RATES:
                missing = {pair for pair, way in before.items() if way == 1} - set(claimed)
                wrong += [f"{condition}, {measure}: {' before '.join(pair)} is not said" for pair in sorted(missing)]
    return wrong


def main(arguments: Sequence[str]) -> int:
    """Print what differs; 1 if anything does."""
    folder = Path(arguments[0])
    conclusions = json.loads((folder / "claims.json").read_text(encoding="utf-8"))["conclusions"]
    wrong = differing(pd.read_parquet(folder / "runs"), conclusions)
    print("\n".join([*wrong, f"{len(conclusions)} conclusions, {len(wrong)} differ"]))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
