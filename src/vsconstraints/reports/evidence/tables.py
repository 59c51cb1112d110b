"""The tables of the report of evidence: selection, success, quality, cost, tuning and scenes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from math import ceil, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...comparisons.evidence.parquet import UNREADABLE
from ...comparisons.metrics import TOLERANCES, TOLERANT
from ...comparisons.statistics import rate
from ...errors import ConfigurationError, one_line
from ...rows.readable import counted
from ..groups import information_text
from ..markdown import Table, bold, enumeration, plain
from ..numbers import DASH, median, number, of_length
from .dataset import Dataset
from .formatting import Share, condition_text, names_text, percentage
from .ranking import PairVerdict, Ranking, best_by, pairwise_verdicts, ranking

if TYPE_CHECKING:
    import pandas as pd

MAX_COLUMNS = 7
"""Of the headline table."""

MAX_FAMILIES = 6
"""A table shows no more families than this."""

MAX_REASONS = 3

AIMS: tuple[tuple[str, str], ...] = (
    ("lowest command variation", "acceleration_variation"),
    ("shortest settling time", "settling_time_s"),
    ("highest utilization", "utilization"),
)
"""What distinguishes controllers that succeed equally often, and the metric that measures it."""

FAILED_STATUSES = (("slow",), ("trapped",), ("unfinished",), ("failed", "aborted"))
"""How runs end that do not converge; those of a column together."""

EVALUATIONS, HYPERVOLUMES = "evaluations.parquet", "hypervolumes.parquet"


def headline_numbers(dataset: Dataset, rankings: Sequence[Ranking], law: str) -> dict[str, Any]:
    """The unrounded numbers of the headline table's line of a controller."""
    runs = dataset.runs[dataset.runs["controller"] == law]
    clean = runs[(runs["condition"] == dataset.conditions[0]) & runs["success"]]
    return {
        "law": law,
        **{one.condition: one.shares[law].value for one in rankings if law in one.laws},
        "variation": median(clean["acceleration_variation"].astype(float).tolist()),
        "call": median(runs["step_time_median_us"].astype(float).tolist()),
    }


def headline_table(dataset: Dataset, rankings: Sequence[Ranking], numbers: Sequence[dict[str, Any]]) -> str:
    """One line per controller, the best in the first condition on top, in at most :data:`MAX_COLUMNS` columns."""
    laws = [str(line["law"]) for line in numbers]
    conditions = rankings[: MAX_COLUMNS - 2]
    room = MAX_COLUMNS - 2 - len(conditions)
    columns = {"law": laws}
    if room >= 1:
        columns["required information"] = [information_text(dataset.required[law]) for law in laws]
    for one in conditions:
        columns[f"{condition_text(one.condition, inside=True)} [%]"] = success_cells(one, laws)
    if room >= 2:
        columns["variation [rad/s³]"] = [number(line["variation"]) for line in numbers]
    columns["call [µs]"] = [number(line["call"]) for line in numbers]
    lines = [list(line) for line in zip(*columns.values(), strict=True)]
    return Table(list(columns), lines, 2 if room >= 1 else 1)


def success_cells(ranked: Ranking, laws: Sequence[str]) -> list[str]:
    """How often each succeeds: bold if significantly the best, ≈ if not significantly worse than the best."""
    marked = ranked.front if ranked.shares and ranked.shares[ranked.leader].value else ()
    return [_marked(ranked, marked, law, ranked.shares[law].cell) if law in ranked.laws else DASH for law in laws]


def _marked(ranked: Ranking, front: Sequence[str], law: str, text: str) -> str:
    if len(ranked.laws) < 2 or law not in front:
        return text
    return bold(text) if len(front) == 1 else f"≈ {text}"


def _violation_cell(dataset: Dataset, kept: Ranking, law: str) -> str:
    working = kept.among(dataset.working(kept.condition))
    return _marked(working, working.front, law, kept.shares[law].complement.cell)


def selection_table(dataset: Dataset) -> str:
    """For each condition the best by success and violations and, among the most successful, by further aims."""
    header = ["condition", "most successful", f"at {of_length(TOLERANT)}", "fewest violations"]
    lines = []
    for condition in dataset.conditions:
        ranked = ranking(dataset, condition)
        if not ranked.scenes:
            continue
        cells = []
        for one in (ranked, ranking(dataset, condition, "tolerant success")):
            cells.append("none" if one.shares[one.leader].value == 0.0 else _front_cell(one))
        cells.append(_front_cell(ranking(dataset, condition, "kept").among(dataset.working(condition))))
        for _, metric in AIMS:
            never = ranked.shares[ranked.leader].value == 0.0
            best = None if never else best_by(dataset, condition, ranked.front, metric)
            cells.append(DASH if best is None else _names_cell(best.laws))
        lines.append([condition_text(condition), *cells])
    header += [aim for aim, _ in AIMS]
    return Table(header, lines, len(header)) if lines else ""


def _front_cell(ranked: Ranking) -> str:
    everybody = len(ranked.laws) > 1 and len(ranked.front) == len(ranked.laws)
    return "no significant difference" if everybody else _names_cell(ranked.front)


def _names_cell(laws: Sequence[str]) -> str:
    return bold(laws[0]) if len(laws) == 1 else names_text(laws)


def success_table(dataset: Dataset, condition: str) -> str:
    """Success and violations in all families together, and how other runs ended."""
    ranked, tolerant, kept = (ranking(dataset, condition, name) for name in ("success", "tolerant success", "kept"))
    runs = dataset.among(condition)
    lines = []
    for law in ranked.laws:
        statuses = runs[runs["controller"] == law]["status"]
        endings = [str(int(statuses.isin(ending).sum())) for ending in FAILED_STATUSES]
        cells = *success_cells(ranked, [law]), *success_cells(tolerant, [law]), _violation_cell(dataset, kept, law)
        lines.append([law, *cells, *endings])
    return Table(["law", "success", f"at {of_length(TOLERANT)}", "violated", *map(" or ".join, FAILED_STATUSES)], lines)


def tolerance_table(dataset: Dataset, condition: str) -> str:
    """How often each controller succeeds at each tolerance, and violates by the tolerant standard."""
    least, kept = dataset.paired(condition, "tolerance"), ranking(dataset, condition, "tolerant kept")
    lines = []
    for law in ranking(dataset, condition).laws:
        shares = [percentage(float((least[law].astype(float) <= each).mean()), 1) for each in TOLERANCES]
        lines.append([law, *shares, _violation_cell(dataset, kept, law)])
    return Table(["law", *(f"{100.0 * each:g} %" for each in TOLERANCES), f"violated at {of_length(TOLERANT)}"], lines)


def family_tables(dataset: Dataset, condition: str) -> str:
    """Success and violations in each family; several tables where there are many families."""
    families = dataset.families_of(condition)
    if len(families) < 2:
        return ""
    parts = []
    for what, column in (("Success", "success"), ("Violated", "kept")):
        for names in np.array_split(np.array(families), ceil(len(families) / MAX_FAMILIES)):
            each = [ranking(dataset, condition, column, [name]) for name in names.tolist()]
            lines = []
            for law in dataset.laws:
                cells = [DASH] * len(each)
                for k, one in enumerate(each):
                    if law in one.laws and column == "success":
                        cells[k] = success_cells(one, [law])[0]
                    elif law in one.laws:
                        cells[k] = _violation_cell(dataset, one, law)
                lines.append([law, *cells])
            parts.append(f"{what} in each family, in per cent:\n\n{Table(['law', *names.tolist()], lines)}")
    return "\n\n".join(parts)


def quality_table(dataset: Dataset, condition: str) -> str:
    """Each controller against the most successful one, on the scenes in which both succeed."""
    ranked = ranking(dataset, condition)
    if len(ranked.laws) < 2 or ranked.shares[ranked.leader].value == 0.0:
        return ""
    runs = dataset.among(condition)
    verdicts = [
        pairwise_verdicts(runs, metric, ratio=metric == "acceleration_variation")
        for metric in ("acceleration_variation", "settling_time_s", "utilization")
    ]
    lines = []
    for law in ranked.laws[1:]:
        variation, settling, space = (pairs[law, ranked.leader] for pairs in verdicts)
        lines.append([law, str(variation.scenes), _difference(variation), _difference(settling),
                      _difference(space, 100.0)])  # fmt: skip
    first = f"{condition_text(condition)}, against {ranked.leader}"
    return Table([first, "scenes", "variation, ×", "settling, + s", "utilization, + %"], lines)


def _difference(pair: PairVerdict, factor: float = 1.0) -> str:
    """A median with its interval; ≈ in front where it is not significant."""
    if not pair.scenes:
        return DASH
    middle, low, high = (factor * value for value in (pair.difference, pair.low, pair.high))
    tie = "" if pair.verdict in ("better", "worse") else "≈ "
    if not (isfinite(low) and isfinite(high)) or low == high:
        return f"{tie}{number(middle)}"
    return f"{tie}{number(middle)} ({number(low)}{' to ' if low < 0.0 else '–'}{number(high)})"


def information_table(dataset: Dataset) -> str:
    """Type, options, required information, implementation and call time of each controller."""
    entries = dataset.configuration["controllers"]
    lines = []
    for law in dataset.laws:
        entry = entries.get(law, {})
        options = [(key, number(value) if isinstance(value, float) else value) for key, value in entry.items()]
        text = plain(", ".join(f"{key} = {value}" for key, value in options if key != "type"))
        kind = str(entry.get("type", law))
        own = dataset.runs[dataset.runs["controller"] == law]
        cells = [DASH if kind == law else plain(kind), text or "defaults", information_text(dataset.required[law])]
        call = median([float(value) for value in own["step_time_median_us"]])
        lines.append([law, *cells, _implementation(own["compiled"].astype(bool)), number(call)])
    return Table(["law", "type", "options", "required information", "implementation", "call [µs]"], lines, 5)


def _implementation(compiled: pd.Series) -> str:
    if not len(compiled):
        return DASH
    share = float(compiled.mean())
    return "compiled" if share == 1.0 else "NumPy" if share == 0.0 else f"compiled in {100.0 * share:.0f} %, else NumPy"


def tuning_table(dataset: Dataset) -> str:
    """Default against tuned settings on the campaign's scenes."""
    lines = []
    for condition in dataset.conditions:
        ranked = ranking(dataset, condition)
        for law, name in dataset.tuned.items():
            if {law, name} <= set(ranked.laws):
                pair = ranked.pair(name, law)
                cells = ranked.shares[law].cell, ranked.shares[name].cell
                difference = pair.difference.cell if pair.distinguishable else f"≈ {pair.difference.cell}"
                lines.append([condition_text(condition), law, *cells, difference])
    return Table(["condition", "law", "default", "tuned", "difference"], lines, 2) if lines else ""


def evaluations_of(dataset: Dataset) -> pd.DataFrame | None:
    """The evaluations of the tuning; None if there is none to show.

    Raises
    ------
    ConfigurationError
        if they cannot be read.
    """
    if dataset.tuning is None or not (dataset.tuning / EVALUATIONS).is_file():
        return None
    return _read(dataset.tuning / EVALUATIONS, {"law", "chosen", "options", "feasible"})


def fronts_table(dataset: Dataset, evaluations: pd.DataFrame) -> str:
    """What tuning evaluated for each controller, how well, and the setting that was chosen."""
    path = (dataset.tuning or Path()) / HYPERVOLUMES
    volumes = _read(path, {"law", "hypervolume"}) if path.is_file() else None
    lines = []
    for law in dict.fromkeys(evaluations["law"].astype(str)):
        own = evaluations[evaluations["law"] == law]
        chosen = own[own["chosen"].astype(bool)]
        options = plain(str(chosen["options"].iloc[0]).strip("{}").replace('"', "")) if len(chosen) else DASH
        feasible = int(own["feasible"].astype(bool).sum())
        lines.append([law, str(len(own)), str(feasible), _volume(volumes, law), options or "default"])
    return Table(["law", "evaluations", "feasible", "hypervolume", "chosen setting"], lines)


def _read(path: Path, columns: set[str]) -> pd.DataFrame:
    import pandas as pd

    try:
        data = pd.read_parquet(path)
    except UNREADABLE as error:
        raise ConfigurationError(f"{path} cannot be read: {one_line(str(error))}") from error
    if missing := columns.difference(data.columns):
        raise ConfigurationError(f"{path} cannot be read: it has no column {min(missing)}")
    return data


def _volume(volumes: pd.DataFrame | None, law: str) -> str:
    if volumes is None:
        return DASH
    own: Any = volumes[volumes["law"] == law]["hypervolume"].astype(float)
    if own.empty:
        return DASH
    middle = number(float(own.median()))
    return middle if len(own) == 1 else f"{middle} ({number(float(own.min()))}–{number(float(own.max()))})"


def scenes_table(dataset: Dataset) -> str:
    """How many scenes of each family were drawn, what was rejected and why, and which no controller could solve."""
    every = dataset.evidence.scenes
    lines = []
    for family in dict.fromkeys(every["family"].astype(str)):
        own = every[every["family"] == family]
        rejected: Counter[str] = Counter()
        for text in own["rejected"]:
            rejected.update(json.loads(text or "{}"))
        attempts = int(own["attempts"].sum())
        known = own["share_to_hold"].astype(float).dropna()
        beyond = Share.of(rate((known > 1.0).to_numpy())).cell if len(known) else DASH
        lines.append([family, str(int(own["found"].sum())), str(attempts), _reasons(rejected, attempts), beyond])
    return Table(["family", "scenes", "attempts", "rejected, in % of the attempts", "beyond limits [%]"], lines)


def _reasons(rejected: Counter[str], attempts: int) -> str:
    if not rejected:
        return "none"
    common = rejected.most_common(MAX_REASONS)
    texts = [f"{plain(reason)} {percentage(n / attempts, 0)}" for reason, n in common]
    others = sum(rejected.values()) - sum(n for _, n in common)
    return ", ".join([*texts, *([f"others {percentage(others / attempts, 0)}"] if others else [])])


def scene_facts(dataset: Dataset) -> list[str]:
    """Scenes that were not found, rows that tracking alone violates, and scenes that nobody can finish in time."""
    every = dataset.evidence.scenes
    facts = []
    missing = every[~every["found"].astype(bool)]["family"].astype(str).value_counts()
    for family, count in missing.items():
        facts.append(f"{plain(str(family))}: {counted(int(count), 'scene')} not found, every attempt was rejected.")
    found = every[every["found"].astype(bool)]
    kinds: Counter[str] = Counter()
    for text in found["challenged"].astype(str):
        kinds.update({label.partition("[")[0] for label in text.split("; ") if label})
    if kinds:
        texts = [f"{plain(kind)} in {percentage(n / len(found), 0)} %" for kind, n in kinds.most_common()]
        facts.append(f"Rows that unconstrained tracking violates: {enumeration(texts)} of the scenes.")
    known = every[every["least_time_s"].notna()]
    if len(known):
        late = int((known["least_time_s"] > known["duration_s"]).sum())
        facts.append(
            f"No controller can arrive in time in {late} of {counted(len(known), 'scene')} with a known least time: "
            "rest to rest at the goal's joint coordinates, each joint as fast as its limits allow."
        )
    return facts
