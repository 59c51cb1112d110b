"""Results beyond the families that were run, and compared with the best known motions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...reports.markdown import bold
from ...reports.numbers import median
from ...rows import Array
from ..evidence import parquet
from ..families.family import NOMINAL
from ..families.frozen import V1, TestSet
from ..statistics import across_families, left_out_ranks, rate, simultaneous
from .dataset import SCENE, Dataset
from .findings import Finding, text_of
from .ranking import Share, condition_text, ranking

if TYPE_CHECKING:
    import pandas as pd

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
        is_alone = len(self.behind) == len(self.laws) - 1
        return bold(text) if is_alone else f"≈ {text}"

    def rank(self, law: str) -> str:
        """Format the range of ranks of a law over the families left out."""
        ranks = self.ranks[:, self.laws.index(law)]
        best = int(ranks.min())
        worst = int(ranks.max())
        if best == worst:
            return str(best)
        return f"{best}–{worst}"

    @property
    def stays(self) -> int:
        """Number of families whose omission leaves the first law the most successful."""
        return int((self.ranks[:, 0] == 1).sum())


def beyond(dataset: Dataset) -> list[Beyond]:
    """Return the results of each condition with at least :data:`FEWEST` families."""

    def compute() -> list[Beyond]:
        results = []
        for condition in dataset.conditions:
            result = _beyond(dataset, condition)
            if result is not None:
                results.append(result)
        return results

    return dataset.once("beyond", compute)


def _beyond(dataset: Dataset, condition: str) -> Beyond | None:
    laws = ranking(dataset, condition).laws
    success = dataset.paired(condition, "success")[list(laws)].astype(bool)
    families = success.groupby(level="family", observed=True)
    if len(families) < FEWEST:
        return None
    counts = _by_family(success)
    sizes = families.size().to_numpy(float)
    estimates = across_families(counts, np.broadcast_to(sizes, counts.shape))
    shares = {}
    for law, estimate in zip(laws, estimates, strict=True):
        shares[law] = Share(estimate.share, estimate.low, estimate.high)
    return Beyond(
        condition,
        laws,
        shares,
        behind=_behind_first(success),
        ranks=left_out_ranks(families.mean()),
    )


def _behind_first(success: pd.DataFrame) -> frozenset[str]:
    """Return the laws (columns) that succeed less often than the first one in a similar family."""
    leader, *others = success.columns
    if not others:
        return frozenset()
    first = success[leader]
    only_first = _by_family(success[others].apply(lambda other: first & ~other))
    differing = _by_family(success[others].apply(lambda other: first ^ other))
    # Comparison with the best law: Hsu's multiple comparisons, corrected for all others.
    confidence = simultaneous(0.95, len(others))
    pairs = across_families(only_first, differing, confidence)
    behind = set()
    for law, pair in zip(others, pairs, strict=True):
        if pair.low > 0.5:
            behind.add(law)
    return frozenset(behind)


def _by_family(flags: pd.DataFrame) -> Array:
    """Return the number of scenes (laws, families) in which a flag is true."""
    counts = flags.groupby(level="family", observed=True).sum()
    by_law: Array = counts.T.to_numpy(float)
    return by_law


def across_findings(dataset: Dataset) -> list[Finding]:
    """Return findings on the most successful law of each condition in a similar family.

    They state whether the result depends on one of the families.
    """
    findings = []
    for result in beyond(dataset):
        leader = result.laws[0]
        share = result.shares[leader]
        begin = condition_text(result.condition)
        text = text_of("across", begin=begin, leader=leader, share=share, one=result)
        numbers: dict[str, float] = share.numbers("success", law=leader)
        numbers["families"] = len(result.ranks)
        numbers["stays"] = result.stays
        findings.append(Finding(text, "across", result.condition, (leader,), numbers))
    return findings


def known_motions(dataset: Dataset) -> Any:
    """Return the lines of :data:`TABLE` on scenes of a campaign, as a DataFrame.

    Return None if the campaign has none of these scenes.
    """
    import pandas as pd

    testset = TestSet.load()
    half = dataset.configuration.get("half")
    run_families = dataset.configuration["families"]
    # families of the campaign whose scenes are those of the test set
    same = set()
    for family in testset.families:
        tables = run_families.get(family.name, {}).get("tables", {})
        run_scenes = tables.get("frozen", {}).get(half)
        if run_scenes is not None and run_scenes == family.tables["frozen"].get(half):
            same.add(family.name)
    if not same or parquet.facts_of(TABLE).get("sha256") != testset.sha256:
        return None
    known = pd.read_parquet(TABLE)
    is_same = (known["half"] == half) & known["family"].isin(same)
    known = known[is_same]
    return known if len(known) else None


def regrets(runs: Any, known: Any) -> dict[str, dict[str, Any]]:
    """Return each law's success in reachable scenes, and medians of its time and space.

    ``time`` is relative to the best known motion. ``space`` is the utilization less the greatest
    utilization of the laws in the table that succeed.
    """
    reachable = known[known["outcome"] == "reachable"].astype({"family": str})
    best = reachable[[*SCENE, "best_time_s", "law_space"]]
    lines = runs.merge(best, on=SCENE)
    found = {}
    for law, law_runs in lines.groupby("controller"):
        successful = law_runs[law_runs["success"]]
        time = successful["settling_time_s"] / successful["best_time_s"]
        space = successful["utilization"] - successful["law_space"]
        found[str(law)] = {
            "success": rate(law_runs["success"].to_numpy(bool)),
            "time": median(time.tolist()),
            "space": median(space.tolist()),
        }
    return found


def beside_best(dataset: Dataset) -> dict[str, dict[str, Any]]:
    """Return :func:`regrets` of a campaign without disturbances.

    The result is empty for scenes without known best motions.
    """
    runs = dataset.among(NOMINAL)
    if not len(runs):
        return {}
    known = known_motions(dataset)
    if known is None:
        return {}
    found = regrets(runs, known)
    beside = {}
    for law in dataset.laws:
        if law in found:
            success = Share.of(found[law]["success"])
            beside[law] = found[law] | {"success": success}
    return beside
