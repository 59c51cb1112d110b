"""Tables of the report of evidence: selection, success, quality, cost, failures, tuning, scenes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ...errors import ConfigurationError, one_line
from ...reports.markdown import enumeration, plain
from ...reports.numbers import median, percentage
from ...rows.readable import counted
from ..evidence.parquet import UNREADABLE
from ..statistics import rate
from .dataset import Dataset
from .ranking import PairVerdicts, Ranking, Share, pairwise_verdicts

if TYPE_CHECKING:
    import pandas as pd

#: Most reasons in a cell.
MAX_REASONS = 3
#: Aims that distinguish controllers with equal success, and their metrics.
AIMS = {
    "lowest command variation": "acceleration_variation",
    "shortest settling time": "settling_time_s",
    "highest utilization": "utilization",
}
LOSSES = ("second", "median", "worst")  #: Other controllers whose loss is reported.
#: Columns of a tuning that the report needs.
EVALUATION_COLUMNS = frozenset(("law", "seed", "number", "options", "runs", "successes", "chosen"))


def middle(runs: pd.DataFrame, column: str) -> float:
    """Return the median of a column."""
    return median(runs[column].astype(float).tolist())


def headline_numbers(dataset: Dataset, rankings: Sequence[Ranking], law: str) -> dict[str, Any]:
    """Return the unrounded numbers of a controller's line of the headline table."""
    runs = dataset.of_law(law)
    in_first_condition = runs["condition"] == dataset.conditions[0]
    successful = runs[in_first_condition & runs["success"]]
    success = {}
    for ranked in rankings:
        if law in ranked.laws:
            success[ranked.condition] = ranked.shares[law].value
    return {
        "law": law,
        **success,
        "variation": middle(successful, "acceleration_variation"),
        "call": middle(runs, "step_time_median_us"),
    }


def answer_numbers(dataset: Dataset, ranked: Ranking) -> dict[str, Any]:
    """Return the unrounded numbers of a condition's line of the answer.

    They describe the best controller and the loss with other choices.
    """
    first, *others = ranked.laws
    numbers = {
        "condition": ranked.condition,
        "law": first,
        "ties": ranked.front[1:],
        "call": middle(dataset.of_law(first), "step_time_median_us"),
        **ranked.shares[first].numbers("success"),
    }
    if others:
        compared = (others[0], others[len(others) // 2], others[-1])
        for name, law in zip(LOSSES, compared, strict=True):
            loss = ranked.differences[first, law]
            numbers[name] = law
            numbers |= loss.numbers("loss", law=name)
    return numbers


def quality_verdicts(dataset: Dataset, condition: str) -> list[PairVerdicts]:
    """Compare all pairs of controllers by each of :data:`AIMS`, on scenes in which both succeed."""
    runs = dataset.among(condition)
    verdicts = []
    for metric in AIMS.values():
        is_ratio = metric == "acceleration_variation"
        verdicts.append(pairwise_verdicts(runs, metric, ratio=is_ratio))
    return verdicts


def evaluations_of(dataset: Dataset) -> pd.DataFrame | None:
    """Return the evaluations of the tuning, None without a tuning.

    Raises ConfigurationError if they cannot be read.
    """
    import pandas as pd

    if dataset.tuning is None:
        return None
    path = dataset.tuning / "evaluations.parquet"
    if not path.is_file():
        return None
    try:
        data = pd.read_parquet(path)
    except UNREADABLE as error:
        raise ConfigurationError(f"{path} cannot be read: {one_line(str(error))}") from error
    missing = EVALUATION_COLUMNS.difference(data.columns)
    if missing:
        raise ConfigurationError(f"{path} cannot be read: it has no column {min(missing)}")
    return data


def most_frequent(counts: Counter[str], most: int, least: float = 0.0) -> list[tuple[str, int]]:
    """Return the most frequent names with at least ``least`` counts, and the sum of the others."""
    frequent = []
    for name, count in counts.most_common(most):
        if count >= least:
            frequent.append((name, count))
    others = counts.total() - sum(count for _, count in frequent)
    if others:
        frequent.append(("others", others))
    return frequent


def rejected(scenes: pd.DataFrame) -> list[tuple[str, int]]:
    """Return the main reasons for rejected attempts to draw scenes, with their counts."""
    reasons = Counter[str]()
    for text in scenes["rejected"]:
        reasons.update(json.loads(text or "{}"))
    return most_frequent(reasons, MAX_REASONS)


def beyond_limits(scenes: pd.DataFrame) -> str:
    """Return the share of scenes in which limits of acceleration cannot hold a row.

    The share is evaluated where the unconstrained baseline reaches the row, see ``share_to_hold``.
    Only scenes in which it is known are counted.
    """
    known = scenes["share_to_hold"].astype(float).dropna()
    if known.empty:
        return ""
    is_beyond = (known > 1.0).to_numpy()
    return Share.of(rate(is_beyond)).cell


def scene_facts(dataset: Dataset) -> dict[str, Any]:
    """Return facts about the scenes.

    These are scenes that were not found, rows that the unconstrained baseline violates, and scenes
    that no controller can finish in time.
    """
    every = dataset.evidence.scenes
    is_found = every["found"].astype(bool)
    found = every[is_found]
    kinds = Counter[str]()
    for labels in found["challenged"].astype(str):
        kinds.update(sorted(row_kinds(labels)))
    violated = []
    for kind, count in kinds.most_common():
        violated.append(f"{plain(kind)} in {percentage(count / len(found), 0)} %")
    missing = {}
    not_found = every.loc[~is_found, "family"].astype(str)
    for family, count in not_found.value_counts().items():
        missing[plain(family)] = counted(int(count), "scene")
    known = every[every["least_time_s"].notna()]
    is_late = known["least_time_s"] > known["duration_s"]
    return {
        "missing": missing,
        "violated": enumeration(violated),
        "late": int(is_late.sum()),
        "known": counted(len(known), "scene") if len(known) else "",
    }


def row_kinds(labels: str) -> set[str]:
    """Return the kinds of rows with these labels, which are separated by semicolons."""
    return {label.partition("[")[0] for label in labels.split("; ") if label}
