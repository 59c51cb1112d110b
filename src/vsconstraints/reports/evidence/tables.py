"""The tables of the report of evidence: selection, success, quality, cost, failures, tuning and scenes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ...comparisons.evidence.parquet import UNREADABLE
from ...comparisons.metrics import TOLERANCES, TOLERANT
from ...comparisons.statistics import rate
from ...comparisons.statistics.judged import UNSUCCESSFUL
from ...errors import ConfigurationError, one_line
from ...rows.readable import counted
from ..groups import controller_cells, information_text
from ..markdown import Table, bold, enumeration, plain
from ..numbers import DASH, median, number, of_length
from .dataset import Dataset
from .ranking import Ranking, Share, best_by, condition_text, gap, names_text, pairwise_verdicts, percentage, ranking

if TYPE_CHECKING:
    import pandas as pd

#: Columns of the headline table, and reasons in a cell.
MAX_COLUMNS, MAX_REASONS = 7, 3
#: What distinguishes controllers that succeed equally often, and the metric that measures it.
AIMS = {
    "lowest command variation": "acceleration_variation",
    "shortest settling time": "settling_time_s",
    "highest utilization": "utilization",
}
LOSSES = ("second", "median", "worst")  #: Of the other controllers: those whose loss is reported.


def headline_numbers(dataset: Dataset, rankings: Sequence[Ranking], law: str) -> dict[str, Any]:
    """The unrounded numbers of the headline table's line of a controller."""
    runs = dataset.of_law(law)
    clean = runs[(runs["condition"] == dataset.conditions[0]) & runs["success"]]
    return {
        "law": law,
        **{one.condition: one.shares[law].value for one in rankings if law in one.laws},
        "variation": median(clean["acceleration_variation"].astype(float).tolist()),
        "call": median(runs["step_time_median_us"].astype(float).tolist()),
    }


def answer_numbers(dataset: Dataset, ranked: Ranking) -> dict[str, Any]:
    """The unrounded numbers of a condition's line of the answer: the best controller and what other choices lose."""
    first, *others = ranked.laws
    call = median(dataset.of_law(first)["step_time_median_us"].astype(float).tolist())
    numbers = {"condition": ranked.condition, "law": first, "ties": ranked.front[1:], "call": call}
    numbers |= ranked.shares[first].numbers("success")
    for name, law in zip(LOSSES, (others[:1] + others[len(others) // 2 :][:1] + others[-1:]), strict=False):
        numbers |= {name: law, **ranked.differences[first, law].numbers("loss", law=name)}
    return numbers


def answer_table(dataset: Dataset, rankings: Sequence[Ranking]) -> Table:
    """Which controller, when, how sure, at what cost, and by how much another choice succeeds less often."""
    lines, losing = [], [f"{name} loses" for name in LOSSES]
    for ranked in rankings:
        numbers, law, cells = answer_numbers(dataset, ranked), ranked.leader, ["none", DASH, DASH, DASH]
        if not ranked.hopeless:
            ties = len(ranked.front) - 1
            named = f"{law} and {counted(ties, 'tie')}" if ties else bold(law)
            cells = [named, ranked.shares[law].cell, number(numbers["call"])]
            cells.append(information_text(dataset.required[law]))
        others = [str(numbers[name]) for name in LOSSES if name in numbers]
        losses = [f"{'≈ ' * (one in ranked.front)}{ranked.differences[law, one].cell}" for one in others]
        lines.append([condition_text(ranked.condition), *cells, *(losses or [DASH] * len(LOSSES))])
    return Table(["condition", "controller", "success [%]", "call [µs]", "required information", *losing], lines, 2)


def headline_table(dataset: Dataset, rankings: Sequence[Ranking], numbers: Sequence[dict[str, Any]]) -> Table:
    """One line per controller, the best in the first condition on top, in at most :data:`MAX_COLUMNS` columns."""
    laws = [str(line["law"]) for line in numbers]
    conditions = rankings[: MAX_COLUMNS - 2]
    room = MAX_COLUMNS - 2 - len(conditions)
    columns = {"law": laws}
    if room >= 1:
        columns["required information"] = [information_text(dataset.required[law]) for law in laws]
    for one in conditions:
        title = f"{condition_text(one.condition, inside=True)} [%]"
        columns[title] = [one.cell(law) for law in laws]
    if room >= 2:
        columns["variation [rad/s³]"] = [number(line["variation"]) for line in numbers]
    columns["call [µs]"] = [number(line["call"]) for line in numbers]
    return Table(list(columns), zip(*columns.values(), strict=True), 2 if room >= 1 else 1)


def selection_table(dataset: Dataset) -> Table:
    """For each condition the best by success and violations and, among the most successful, by further aims."""
    header = ["condition", "most successful", f"at {of_length(TOLERANT)}", "fewest violations", *AIMS]
    lines = []
    for condition in dataset.conditions:
        ranked = ranking(dataset, condition)
        if ranked.scenes:
            both = (ranked, ranking(dataset, condition, "tolerant success"))
            cells = ["none" if one.hopeless else _front_cell(one) for one in both]
            cells.append(_front_cell(ranking(dataset, condition, "kept").among(dataset.working(condition))))
            for metric in AIMS.values():
                best = None if ranked.hopeless else best_by(dataset, condition, ranked.front, metric)
                cells.append(_names_cell(best[0]) if best else DASH)
            lines.append([condition_text(condition), *cells])
    return Table(header, lines, len(header))


def _front_cell(ranked: Ranking) -> str:
    everybody = len(ranked.laws) > 1 and len(ranked.front) == len(ranked.laws)
    return "no significant difference" if everybody else _names_cell(ranked.front)


def _names_cell(laws: Sequence[str]) -> str:
    return bold(laws[0]) if len(laws) == 1 else names_text(laws)


def success_table(dataset: Dataset, condition: str) -> Table:
    """Success in all families together, by both standards, and how the other runs ended."""
    ranked, tolerant, kept = (ranking(dataset, condition, name) for name in ("success", "tolerant success", "kept"))
    kept, endings, lines = kept.among(dataset.working(condition)), dataset.paired(condition, "ending"), []
    for law in ranked.laws:
        others = [
            percentage(float((endings[law] == how).mean()), ranked.shares[law].digits) for how in UNSUCCESSFUL[1:]
        ]
        lines.append([law, ranked.cell(law), tolerant.cell(law), kept.cell(law, complement=True), *others])
    return Table(["law", "success", f"at {of_length(TOLERANT)}", *UNSUCCESSFUL], lines)


def tolerance_table(dataset: Dataset, condition: str) -> Table:
    """How often each controller succeeds at each tolerance, and violates by the tolerant standard."""
    least = dataset.paired(condition, "tolerance").astype(float)
    kept, lines = ranking(dataset, condition, "tolerant kept").among(dataset.working(condition)), []
    for law in ranking(dataset, condition).laws:
        shares = [percentage(float((least[law] <= each).mean()), 1) for each in TOLERANCES]
        lines.append([law, *shares, kept.cell(law, complement=True)])
    return Table(["law", *(f"{100.0 * each:g} %" for each in TOLERANCES), f"violated at {of_length(TOLERANT)}"], lines)


def quality_table(dataset: Dataset, condition: str) -> Table:
    """Each controller against the most successful one, on the scenes in which both succeed."""
    ranked, lines = ranking(dataset, condition), []
    if len(ranked.laws) < 2 or ranked.hopeless:
        return Table([], [])
    runs = dataset.among(condition)
    verdicts = [pairwise_verdicts(runs, metric, ratio="variation" in metric) for metric in AIMS.values()]
    for law in ranked.laws[1:]:
        variation, settling, space = (pairs[law, ranked.leader] for pairs in verdicts)
        lines.append([law, str(variation.scenes), gap(variation), gap(settling), gap(space, 100.0)])
    first = f"{condition_text(condition)}, against {ranked.leader}"
    return Table([first, "scenes", "variation, ×", "settling, + s", "utilization, + %"], lines)


def information_table(dataset: Dataset) -> Table:
    """Type, options, required information, implementation and call time of each controller."""
    lines = []
    for law in dataset.laws:
        own, cells = dataset.of_law(law), controller_cells(law, dataset.configuration["controllers"].get(law, {}))
        share, call = own["compiled"].astype(bool).mean(), median(own["step_time_median_us"].astype(float).tolist())
        compiled = {1.0: "compiled", 0.0: "NumPy"}.get(share, f"compiled in {100.0 * share:.0f} %, else NumPy")
        lines.append([law, *cells, compiled, number(call)])
    return Table(["law", "type", "options", "required information", "implementation", "call [µs]"], lines, 5)


def tuning_table(dataset: Dataset) -> Table:
    """Default against tuned settings on the campaign's scenes."""
    lines = []
    for condition in dataset.conditions:
        ranked = ranking(dataset, condition)
        for law, name in dataset.tuned.items():
            if {law, name} <= set(ranked.laws):
                gain = "≈ " * (not ranked.significant(name, law)) + ranked.differences[name, law].cell
                lines.append([condition_text(condition), law, *(ranked.shares[n].cell for n in (law, name)), gain])
    return Table(["condition", "law", "default", "tuned", "difference"], lines, 2)


def evaluations_of(dataset: Dataset) -> pd.DataFrame | None:
    """The evaluations of the tuning, None if there is none to show; raises ConfigurationError if unreadable."""
    import pandas as pd

    if dataset.tuning is None or not (path := dataset.tuning / "evaluations.parquet").is_file():
        return None
    try:
        data = pd.read_parquet(path)
    except UNREADABLE as error:
        raise ConfigurationError(f"{path} cannot be read: {one_line(str(error))}") from error
    if missing := {"law", "seed", "number", "options", "runs", "successes", "chosen"}.difference(data.columns):
        raise ConfigurationError(f"{path} cannot be read: it has no column {min(missing)}")
    return data


def evaluations_table(evaluations: pd.DataFrame) -> Table:
    """What tuning evaluated for each controller, and the setting that was chosen, with successes."""
    lines = []
    for law, own in evaluations.groupby("law", sort=False, observed=True):
        chosen = own.loc[own["chosen"].astype(bool).idxmax()]
        shares = [percentage(float(one["successes"] / one["runs"]), 1) for one in (own.iloc[0], chosen)]
        options = plain(str(chosen["options"]).strip("{}").replace('"', ""))
        lines.append([str(law), str(len(own)), *shares, options or "default"])
    return Table(["law", "evaluations", "default", "chosen", "chosen setting"], lines)


def scenes_table(dataset: Dataset) -> Table:
    """How many scenes of each family were drawn, what was rejected and why, and which no controller could solve."""
    lines = []
    for family, own in dataset.evidence.scenes.groupby("family", sort=False, observed=True):
        rejected: Counter[str] = Counter()
        for text in own["rejected"]:
            rejected.update(json.loads(text or "{}"))
        attempts, common = int(own["attempts"].sum()), rejected.most_common(MAX_REASONS)
        common += [("others", rejected.total() - sum(n for _, n in common))]
        reasons = ", ".join(f"{plain(reason)} {percentage(n / attempts, 0)}" for reason, n in common if n) or "none"
        known = own["share_to_hold"].astype(float).dropna()
        beyond = Share.of(rate((known > 1.0).to_numpy())).cell if len(known) else DASH
        lines.append([str(family), str(int(own["found"].sum())), str(attempts), reasons, beyond])
    return Table(["family", "scenes", "attempts", "rejected, in % of the attempts", "beyond limits [%]"], lines)


def scene_facts(dataset: Dataset) -> dict[str, Any]:
    """Scenes that were not found, rows that tracking alone violates, and scenes that nobody can finish in time."""
    every = dataset.evidence.scenes
    found = every[every["found"].astype(bool)]
    kinds: Counter[str] = Counter()
    for text in found["challenged"].astype(str):
        kinds.update(sorted({label.partition("[")[0] for label in text.split("; ") if label}))
    known = every[every["least_time_s"].notna()]
    missing = every[~every["found"].astype(bool)]["family"].astype(str).value_counts()
    return {
        "missing": {plain(family): counted(int(count), "scene") for family, count in missing.items()},
        "violated": enumeration(
            [f"{plain(kind)} in {percentage(n / len(found), 0)} %" for kind, n in kinds.most_common()]
        ),
        "late": int((known["least_time_s"] > known["duration_s"]).sum()),
        "known": counted(len(known), "scene") if len(known) else "",
    }
