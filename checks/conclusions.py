"""``python -m checks.conclusions FOLDER``: repeats the statistics of a report's conclusions.

It uses only the runs, with pandas, SciPy and statsmodels and without this package: McNemar's test
with continuity correction, the sign test, Bonferroni's correction. All outcomes must agree, and the
stated power of 80 % for reversals must be confirmed in simulated scenes. The command prints both.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import binomtest, chi2
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests

FEWEST = 6
RATES = ("success", "violation")
MEDIANS = {"utilization": 1, "acceleration_variation": -1}
"""Measures that are tested; for medians, +1 if more is better, −1 if less is."""


class Told(NamedTuple):
    """Outcome of a test of two laws, and the number of scenes.

    ``way`` is 1 if the first law is better, −1 if the second is, 0 if the difference is not
    significant.
    """

    way: int
    scenes: int
    differ: int


def verdicts(runs: pd.DataFrame, measure: str) -> dict[tuple[str, str], Told]:
    """Test all pairs of laws in the runs of one condition."""
    left = runs["violated"].fillna("") != ""
    good = (runs["status"] == "converged") & ~left
    if measure in RATES:
        values = (good if measure == "success" else ~left).astype(float)
    else:
        values = (MEDIANS[measure] * runs[measure]).where(good & np.isfinite(runs[measure]))
    wide = runs.assign(x=values).pivot_table(
        index=["family", "scene"], columns="controller", values="x", dropna=False
    )
    lines = []
    for a, b in combinations(sorted(wide.columns), 2):
        both = wide[[a, b]].dropna()
        more = int((both[a] > both[b]).sum())
        fewer = int((both[a] < both[b]).sum())
        if more == fewer:
            p = 1.0
        elif measure in RATES:
            p = mcnemar([[0, more], [fewer, 0]], exact=False, correction=True).pvalue
        else:
            p = binomtest(more, more + fewer).pvalue
        lines.append((a, b, np.sign(more - fewer), len(both), more + fewer, p))
    found = pd.DataFrame(lines, columns=["a", "b", "way", "scenes", "differ", "p"])
    tested = found["scenes"] >= FEWEST
    found.loc[~tested, "way"] = 0
    if tested.any():
        sure = multipletests(found.loc[tested, "p"], method="bonferroni")[1] <= 0.05
        found.loc[tested, "way"] *= sure
    each = {
        (one.a, one.b): Told(int(one.way), int(one.scenes), int(one.differ))
        for one in found.itertuples()
    }
    return each | {(b, a): one._replace(way=-one.way) for (a, b), one in each.items()}


def going(runs: pd.DataFrame, first: str, other: str) -> pd.DataFrame:
    """Select laws with completed runs in both conditions, and families with both conditions."""
    runs = runs[(runs["controller"] != "tracking") & runs["condition"].isin([first, other])]
    came = (
        runs[~runs["status"].isin(["failed", "aborted"])]
        .groupby("controller", observed=True)["condition"]
        .nunique()
    )
    there = runs.groupby("family", observed=True)["condition"].nunique()
    return runs[
        runs["controller"].isin(came[came == 2].index)
        & runs["family"].isin(there[there == 2].index)
    ]


def power(scenes: int, differing: float, difference: float, pairs: int) -> float:
    """Power to find a difference of two rates, corrected for this number of pairs; simulated."""
    share = max(differing, difference)
    chances = [(share + difference) / 2, (share - difference) / 2, 1.0 - share]
    wins, losses, _ = np.random.default_rng(0).multinomial(scenes, chances, 50_000).T
    statistic = np.maximum(wins - losses - 1, 0) ** 2 / np.maximum(wins + losses, 1)
    return float(np.mean(chi2.sf(statistic, 1) * pairs <= 0.05))


def differing(runs: pd.DataFrame, claims: Mapping[str, Any], first: str = "nominal") -> list[str]:
    """Return deviations of the runs from the claims, one sentence each."""
    wrong = []
    runs = runs.astype(dict.fromkeys(("family", "condition", "controller", "status"), str))
    powers = {(one["condition"], one["measure"]): one for one in claims.get("power", [])}
    for condition in dict.fromkeys(one["condition"] for one in claims["conclusions"]):
        both = going(runs, first, condition)
        for measure in (*RATES, *MEDIANS):
            before, after = (
                verdicts(both[both["condition"] == name], measure) for name in (first, condition)
            )
            claimed = {
                (one["better"], one["worse"]): one["outcome"]
                for one in claims["conclusions"]
                if (one["condition"], one["measure"]) == (condition, measure)
            }
            for pair, outcome in claimed.items():
                said = {"holds": 1, "reversed": -1}.get(outcome, 0)
                if (before[pair].way, after[pair].way) != (1, said):
                    wrong.append(
                        f"{condition}, {measure}: {' before '.join(pair)} is said to be {outcome}"
                    )
            missing = {pair for pair, one in before.items() if one.way == 1} - set(claimed)
            wrong += [
                f"{condition}, {measure}: {' before '.join(pair)} is not said"
                for pair in sorted(missing)
            ]
            one = powers.get((condition, measure), {})
            if claimed and one.get("detectable") is not None:
                scenes = int(np.median([after[pair].scenes for pair in claimed]))
                share = np.median(
                    [
                        after[pair].differ / after[pair].scenes
                        for pair in claimed
                        if after[pair].scenes
                    ]
                )
                pairs = sum(told.scenes >= FEWEST for told in after.values()) // 2
                found = power(scenes, float(share), one["detectable"], pairs)
                text = (
                    f"a reversal by {100 * one['detectable']:.0f} points is found with "
                    f"{100 * found:.0f} % power"
                )
                print(
                    f"{condition}, {measure}: {len(claimed)} conclusions on {scenes} scenes; {text}"
                )
                wrong += [f"{condition}, {measure}: {text}"] if abs(found - 0.8) > 0.01 else []
    return wrong


def main(arguments: Sequence[str]) -> int:
    """Print deviations; return 1 if there are any."""
    folder = Path(arguments[0])
    claims = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    wrong = differing(pd.read_parquet(folder / "runs"), claims)
    print("\n".join([*wrong, f"{len(claims['conclusions'])} conclusions, {len(wrong)} differ"]))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
