"""What holds beyond the families that were run, and beside the best motions that are known of
scenes.
"""

from __future__ import annotations

import math
from statistics import median
from typing import Any, NamedTuple

from ...comparisons.evidence import parquet
from ...comparisons.statistics import across_families, left_out_ranks, rate, simultaneous
from ...rows import Array
from ...scenarios.families.family import NOMINAL
from ...scenarios.families.frozen import V1, TestSet
from ..markdown import bold
from .dataset import SCENE, Dataset
from .findings import Finding, text_of
from .ranking import Share, condition_text, ranking

#: what is known of scenes of test set v1: `python -m checks.best`
TABLE = V1.with_name(f"{V1.name}-best.parquet")
FEWEST = 4  #: Families from which on a spread between families can be told.


class Beyond(NamedTuple):
    """Laws in a condition, the most successful first, in a further family like those that were run.

    ``behind`` are the laws that succeed less often than the first one; ``ranks`` (families, laws)
    leave one family out.
    """

    condition: str
    laws: tuple[str, ...]
    shares: dict[str, Share]
    behind: frozenset[str]
    ranks: Array

    def cell(self, law: str) -> str:
        """Success in a family like these; bold if only the first one is not behind, ≈ where several
        are not.
        """
        text = self.shares[law].cell
        if law in self.behind or len(self.laws) < 2:
            return text
        return bold(text) if len(self.behind) == len(self.laws) - 1 else f"≈ {text}"

    def rank(self, law: str) -> str:
        """The ranks that it has, whichever family is left out."""
        own = self.ranks[:, self.laws.index(law)]
        low = int(own.min())
        high = int(own.max())
        return f"{low}" if low == high else f"{low}–{high}"

    @property
    def stays(self) -> int:
        """With how many families left out the first law is still the most successful."""
        return int((self.ranks[:, 0] == 1).sum())


def beyond(dataset: Dataset) -> list[Beyond]:
    """Of each condition that has :data:`FEWEST` families or more."""
    each = (_beyond(dataset, condition) for condition in dataset.conditions)
    return dataset.once("beyond", lambda: [one for one in each if one is not None])


def _beyond(dataset: Dataset, condition: str) -> Beyond | None:
    laws = ranking(dataset, condition).laws
    success = dataset.paired(condition, "success").astype(bool)[list(laws)]
    groups = success.groupby(level="family", observed=True)
    if len(groups) < FEWEST:
        return None
    own = groups.sum().T.to_numpy()
    of = groups.size().to_numpy() + 0 * own
    shares = dict(zip(laws, (Share(*one[:3]) for one in across_families(own, of)), strict=True))
    behind = set()
    if len(laws) > 1:
        # with the best, whichever it is: Hsu's multiple comparisons, corrected for all others
        first = success.iloc[:, 0]
        others = success.iloc[:, 1:]
        flags = (
            others.apply(lambda other: first & ~other),
            others.apply(lambda other: first ^ other),
        )
        only, differ = (
            each.groupby(level="family", observed=True).sum().T.to_numpy(float) for each in flags
        )
        pairs = across_families(only, differ, simultaneous(0.95, len(laws) - 1))
        behind = {law for law, pair in zip(laws[1:], pairs, strict=True) if pair.low > 0.5}
    return Beyond(condition, laws, shares, frozenset(behind), left_out_ranks(groups.mean()))


def across_findings(dataset: Dataset) -> list[Finding]:
    """The most successful law of each condition in a family like these, and whether it hangs on one
    of them.
    """
    several = []
    for one in beyond(dataset):
        leader = one.laws[0]
        families = len(one.ranks)
        share = one.shares[leader]
        text = text_of(
            "across", begin=condition_text(one.condition), leader=leader, share=share, one=one
        )
        numbers = {**share.numbers("success", law=leader), "families": families, "stays": one.stays}
        several.append(Finding(text, "across", one.condition, (leader,), numbers))
    return several


def known_motions(dataset: Dataset) -> Any:
    """The lines of :data:`TABLE` on scenes of a campaign, a DataFrame; None if it has none, or
    other scenes.
    """
    import pandas as pd

    testset = TestSet.load()
    half = dataset.configuration.get("half")
    frozen = {family.name: family.tables["frozen"].get(half) for family in testset.families}
    run = dataset.configuration["families"].items()
    same = {
        name
        for name, own in run
        if own.get("tables", {}).get("frozen", {}).get(half) == frozen.get(name, "")
    }
    if not same or parquet.facts_of(TABLE).get("sha256") != testset.sha256:
        return None
    known = pd.read_parquet(TABLE)
    known = known[(known["half"] == half) & known["family"].isin(same)]
    return known if len(known) else None


def regrets(runs: Any, known: Any) -> dict[str, dict[str, Any]]:
    """Of each law its success in scenes that can be reached, and medians: time over the best one,
    space less its.
    """
    reachable = known[known["outcome"] == "reachable"].astype({"family": str})
    lines = runs.merge(reachable[[*SCENE, "best_time_s", "law_space"]], on=SCENE)
    found = {}
    for law, own in lines.groupby("controller"):
        good = own[own["success"]]
        ratios = (
            good["settling_time_s"] / good["best_time_s"],
            good["utilization"] - good["law_space"],
        )
        time, space = (median(each.dropna().tolist() or [math.nan]) for each in ratios)
        found[str(law)] = {
            "success": rate(own["success"].to_numpy(bool)),
            "time": time,
            "space": space,
        }
    return found


def beside_best(dataset: Dataset) -> dict[str, dict[str, Any]]:
    """The same of a campaign without disturbances; empty for scenes of which no best motions are
    known.
    """
    runs = dataset.among(NOMINAL)
    known = known_motions(dataset) if len(runs) else None
    found = {} if known is None else regrets(runs, known)
    return {
        law: found[law] | {"success": Share.of(found[law]["success"])}
        for law in dataset.laws
        if law in found
    }
