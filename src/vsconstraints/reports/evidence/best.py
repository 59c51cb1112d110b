"""Laws beside the best motions that are known of scenes of the test set: what can be reached, how soon, how near."""

from __future__ import annotations

import math
from statistics import median
from typing import Any

from ...comparisons.evidence import parquet
from ...comparisons.statistics import rate
from ...scenarios.families.family import NOMINAL
from ...scenarios.families.frozen import V1, TestSet
from ..markdown import Table
from .dataset import SCENE, Dataset
from .ranking import Share

TABLE = V1.with_name(f"{V1.name}-best.parquet")  #: what is known of scenes of test set v1: `python -m checks.best`


def known_motions(dataset: Dataset) -> Any:
    """The lines of :data:`TABLE` on scenes of a campaign, a DataFrame; None if it has none, or other scenes."""
    import pandas as pd

    testset = TestSet.load()
    half = dataset.configuration.get("half")
    frozen = {family.name: family.tables["frozen"].get(half) for family in testset.families}
    run = dataset.configuration["families"].items()
    same = {name for name, own in run if own.get("tables", {}).get("frozen", {}).get(half) == frozen.get(name, "")}
    if not same or parquet.facts_of(TABLE).get("sha256") != testset.sha256:
        return None
    known = pd.read_parquet(TABLE)
    known = known[(known["half"] == half) & known["family"].isin(same)]
    return known if len(known) else None


def regrets(runs: Any, known: Any) -> dict[str, dict[str, Any]]:
    """Of each law its success among the scenes that can be reached, and medians over its successes.

    ``time`` is that of settling over the best known one, ``space`` its utilization less that of the best law there.
    """
    reachable = known[known["outcome"] == "reachable"].astype({"family": str})
    lines = runs.merge(reachable[[*SCENE, "best_time_s", "law_space"]], on=SCENE)
    found = {}
    for law, own in lines.groupby("controller"):
        good = own[own["success"]]
        ratios = good["settling_time_s"] / good["best_time_s"], good["utilization"] - good["law_space"]
        time, space = (median(each.dropna().tolist() or [math.nan]) for each in ratios)
        found[str(law)] = {"success": rate(own["success"].to_numpy(bool)), "time": time, "space": space}
    return found


def best_table(dataset: Dataset) -> Table:
    """One line for each law, without disturbances; empty for scenes of which no best motions are known."""
    runs = dataset.among(NOMINAL)
    known = known_motions(dataset) if len(runs) else None
    if known is None:
        return Table([], [])
    lines = [
        [law, Share.of(own["success"]).cell, f"{own['time']:.2f}", f"{100.0 * own['space']:+.1f}".replace("-", "−")]
        for law, own in sorted(regrets(runs, known).items(), key=lambda each: dataset.laws.index(each[0]))
    ]
    return Table(["law", "success [%]", "settling time, × best known", "utilization, beside the best law's [%]"], lines)
