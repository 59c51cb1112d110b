"""Results beyond the families that were run, and compared with the best known motions."""

from __future__ import annotations

import math
from statistics import median
from typing import Any, NamedTuple

from ...reports.markdown import bold
from ...rows import Array
from ..evidence import parquet
from ..families.family import NOMINAL
from ..families.frozen import V1, TestSet
from ..statistics import across_families, left_out_ranks, rate, simultaneous
from .dataset import SCENE, Dataset
from .findings import Finding, text_of
from .ranking import Share, condition_text, ranking

#: Best known motions of the scenes of test set v1, from `python -m checks.best`.
TABLE = V1.with_name(f"{V1.name}-best.parquet")
FEWEST = 4  #: Least number of families for an estimate of the spread between families.


class Beyond(NamedTuple):
    """Expected success of laws in a condition in a further, similar family, best law first.

    ``behind`` are the laws that succeed less often than the first one. ``ranks`` (families, laws)
    are the ranks with one family left out.
    """

    condition: str
    laws: tuple[str, ...]
    shares: dict[str, Share]
    behind: frozenset[str]
    ranks: Array

    def cell(self, law: str) -> str:
        """Format the success of a law in a family like these.

        The first law is bold if all others are behind. If several laws are not behind, they are
        marked with ≈.
        """
        text = self.shares[law].cell
        if law in self.behind or len(self.laws) < 2:
            return text
        return bold(text) if len(self.behind) == len(self.laws) - 1 else f"≈ {text}"

    def rank(self, law: str) -> str:
        """Format the range of ranks of a law over the families left out."""
        own = self.ranks[:, self.laws.index(law)]
        low = int(own.min())
        high = int(own.max())
        return f"{low}" if low == high else f"{low}–{high}"

    @property
    def stays(self) -> int:
        """Number of families whose omission leaves the first law the most successful."""
        return int((self.ranks[:, 0] == 1).sum())


def beyond(dataset: Dataset) -> list[Beyond]:
    """Return the results of each condition with at least :data:`FEWEST` families."""
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
        # Comparison with the best law: Hsu's multiple comparisons, corrected for all others.
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
    """Return findings on the most successful law of each condition in a similar family.

    They state whether the result depends on one of the families.
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
    """Return the lines of :data:`TABLE` on scenes of a campaign, as a DataFrame.

    Return None if the campaign has none of these scenes.
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
    """Return each law's success in reachable scenes, and medians of its time and space.

    ``time`` is relative to the best known motion. ``space`` is the utilization less the greatest
    utilization of the laws in the table that succeed.
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
    """Return :func:`regrets` of a campaign without disturbances.

    The result is empty for scenes without known best motions.
    """
    runs = dataset.among(NOMINAL)
    known = known_motions(dataset) if len(runs) else None
    found = {} if known is None else regrets(runs, known)
    return {
        law: found[law] | {"success": Share.of(found[law]["success"])}
        for law in dataset.laws
        if law in found
    }
