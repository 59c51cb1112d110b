"""The report of evidence: tables, figures and findings put together by a template, and the findings as data."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

from ...comparisons.evidence import CallTimes, Evidence
from ...comparisons.metrics import DEFINITIONS, NEGLIGIBLE, TOLERANT
from ...comparisons.runs.files import replaced
from ...comparisons.statistics import costs, profile, ranks
from ...errors import ConfigurationError, StorageError
from ...rows.readable import counted
from ...scenarios.reading import from_table
from ..numbers import DASH, number, of_length
from ..page import facts_table, render, write_pages
from ..plots import PNG, Formats
from . import failures, tables
from .across import across_findings, across_table
from .best import best_table
from .dataset import Dataset
from .failures import TRACKS, scene_figures, worst_figures
from .figures import BUDGETS, CRITICAL_DIFFERENCE, LEVELS, PROFILES, TOLERANCE, Diagram, Panel
from .findings import Finding, always_failing, findings, reversals, tuning_gain
from .ranking import Ranking, condition_text, finite, ranking, scenes_text
from .robustness import conclusion_tables, conclusions, power_table, powers, robustness_findings
from .situations import heat_map, situation_data, situation_table

CLAIMS = "claims.json"

SITUATIONS = "Success in every situation"  #: The details that are a heat map in the page.

#: Metrics whose definitions the report repeats.
DEFINED = (
    "status",
    "violated",
    "within_band",
    "settling_time_s",
    "utilization",
    "acceleration_variation",
    "share_to_hold",
)
#: Metrics of the profiles, all positive, and their names; ranks are by the first.
PROFILED = {"acceleration_variation": "variation", "settling_time_s": "settling time"}
ACROSS = ("turned", "tuned", "nowhere")  #: Kinds of findings on several conditions, each a line of its own.
#: Kinds of findings not in the line of a condition: those across conditions, and those that a table shows.
HIDDEN = (*ACROSS, "across", "holds", "tolerant", "violations")
OnWritten = Callable[[int, int], None]  #: Called with how many parts of a report are there, and how many there will be.


class Claims(NamedTuple):
    """What the first screen claims: the findings in their order, and the headline table's numbers, unrounded."""

    findings: tuple[Finding, ...] = ()
    table: tuple[dict[str, Any], ...] = ()


def write_evidence_report(
    folder: Path,
    *,
    figures: bool = True,
    tuning: Path | None = None,
    formats: Formats = PNG,
    trust: bool = False,
    on_written: OnWritten = lambda done, total: None,
    on_remark: Callable[[str], None] = lambda remark: None,
) -> Path:
    """Write report.md, details.md, both as report.html, figures and claims.json from a campaign; returns report.md.

    Without ``figures`` those that are there stay as they are, and the report shows none; ``formats`` are those of the
    files, of which the report shows the first. ``tuning`` is the folder of the tuning that tuned settings come from,
    ``tuning`` in the campaign's folder if not given. Only with ``trust`` are laws and constraints imported that the
    campaign names as ``module:Class``, to make single runs again that figures show. Called are ``on_written`` with how
    many parts are there and how many there will be, ``on_remark`` with warnings on what is stored.

    Raises ConfigurationError if there is no evidence in the folder, it is not what was stored, or the runs are gone
    that its report was made from, and StorageError if the report cannot be written.
    """
    evidence = Evidence.load(folder, trust)
    for remark in evidence.remarks:
        on_remark(remark)
    if not len(evidence.runs) and (count := evidence.manifest.get("runs")):
        raise ConfigurationError(
            f"{folder} has none of the {count} runs that its report was made from: runs, rows and scenes are missing. "
            "The report is left as it is"
        )
    own = folder / "tuning"
    tuning = tuning if tuning is not None else own if own.is_dir() else None
    return write_report_of(Dataset(evidence, tuning, figures, formats), on_written)


def write_report_of(dataset: Dataset, on_written: OnWritten = lambda done, total: None) -> Path:
    """Write the report of evidence that has been read."""
    parts, context = (_claims, _quality, _failures, _tuning), dict[str, Any]()
    for done, part in enumerate(parts):
        on_written(done, len(parts))
        if done == 0 or context["rankings"]:
            context |= part(dataset)
    on_written(len(parts), len(parts))
    report, claims = dataset.folder / "report.md", context["claims"]
    data = {
        "sentences": [asdict(one) for one in claims.findings],
        "table": [finite(line) for line in claims.table],
        "conclusions": [one.as_data() for one in conclusions(dataset)],
        "power": [one.as_data() for one in powers(dataset)],
        "answers": [finite(tables.answer_numbers(dataset, one)) for one in context["rankings"]],
        "situations": [finite(one) for one in situation_data(dataset)],
    }
    context |= {
        "of_length": of_length,
        "strict": NEGLIGIBLE,
        "tolerant": TOLERANT,
        "definitions": {**{name: DEFINITIONS[name] for name in DEFINED if name in DEFINITIONS}, **_call_times(dataset)},
        "tables": tables,
        "failures": failures,
        "condition_text": condition_text,
        "situations_title": SITUATIONS,
        "situation_table": situation_table(dataset),
        "drawn": scenes_text(int(dataset.evidence.scenes["found"].sum()), len(dataset.families)),
        "counted": counted,
        "machine": _machine(dataset),
    }
    try:
        interactive = {SITUATIONS: heat_map(dataset)} if context["rankings"] else {}
        write_pages(report, render("evidence.md", dataset=dataset, **context), interactive)
        with replaced(dataset.folder / CLAIMS) as file:
            file.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise StorageError(f"the report cannot be written to {dataset.folder}: {error}") from error
    return report


def claims_of(dataset: Dataset) -> Claims:
    """The findings and the headline table's numbers; nothing if only tracking alone was run."""
    by_condition = findings(dataset)
    if not by_condition:
        return Claims()
    gain = tuning_gain(dataset)
    every = [finding for own in by_condition.values() for finding in own]
    every += [*reversals(dataset), *robustness_findings(dataset), *across_findings(dataset)]
    every += [*([gain] if gain else []), *always_failing(dataset)]
    rankings = _rankings(dataset)
    laws = dict.fromkeys((*rankings[0].laws, *dataset.laws))
    return Claims(tuple(every), tuple(tables.headline_numbers(dataset, rankings, law) for law in laws))


def _rankings(dataset: Dataset) -> list[Ranking]:
    return [one for condition in dataset.conditions if (one := ranking(dataset, condition)).scenes]


def _claims(dataset: Dataset) -> dict[str, Any]:
    claims, rankings = claims_of(dataset), _rankings(dataset)
    by_condition = [
        " ".join(one.text for one in claims.findings if one.condition == ranked.condition and one.about not in HIDDEN)
        for ranked in rankings
    ]
    depths = [(condition_text(one.condition), dataset.paired(one.condition, "tolerance")) for one in rankings]
    return {
        "claims": claims,
        "tolerance": dataset.picture(TOLERANCE, depths, dataset.laws),
        "levels": _levels(dataset),
        "rankings": rankings,
        "findings": [*by_condition, *(one.text for one in claims.findings if one.about in ACROSS)],
        "across": across_table(dataset),
        "best": best_table(dataset),
        "across_sentences": [one.text for one in claims.findings if one.about == "across"],
        "power": power_table(dataset),
        "conclusions": conclusion_tables(dataset),
    }


def _levels(dataset: Dataset) -> list[str]:
    """The figure of each family whose conditions are a factorial."""
    texts = []
    for family, factorial in dataset.factorials.items():
        rankings = {name: ranking(dataset, name, families=[family]) for name in factorial.conditions.values()}
        scenes = sorted({one.scenes for one in rankings.values()})
        caption = f"{family}, {' to '.join(map(str, (scenes[0], scenes[-1])[-len(scenes) :]))} scenes. {LEVELS.caption}"
        figure = replace(LEVELS, name=f"levels--{family}", title=f"{family}: {LEVELS.title}", caption=caption)
        texts.append(dataset.picture(figure, factorial, rankings, dataset.laws))
    return [text for text in texts if text]


def _quality(dataset: Dataset) -> dict[str, Any]:
    """Figures of all conditions, and one table for each."""
    panels: list[list[Panel]] = []
    diagrams: list[Diagram] = []
    for metric, words in PROFILED.items():
        panels.append([])
        for condition in dataset.conditions if len(dataset.laws) > 1 else ():
            cost = costs(dataset.among(condition), metric).table
            cost = cost[[law for law in dataset.laws if law in cost.columns]]
            if len(cost):
                values, laws = cost.to_numpy(float), tuple(cost.columns)
                panels[-1].append((f"{words}, {condition}", laws, profile(values)))
                if len(panels) == 1:
                    diagrams.append((condition_text(condition), laws, ranks(values)))
    shown = (PROFILES, panels), (CRITICAL_DIFFERENCE, diagrams)
    return {
        "figures": [text for figure, data in shown if (text := dataset.picture(figure, data, dataset.laws))],
        "quality": [table for condition in dataset.conditions if (table := tables.quality_table(dataset, condition))],
    }


def _failures(dataset: Dataset) -> dict[str, Any]:
    return {"worst": worst_figures(dataset), "scene_figures": scene_figures(dataset), "reading": TRACKS.reading}


def _tuning(dataset: Dataset) -> dict[str, Any]:
    evaluations = tables.evaluations_of(dataset)
    if evaluations is None:
        return {"evaluations": "", "budgets_figure": ""}
    laws = list(dict.fromkeys(evaluations["law"].astype(str)))
    return {
        "evaluations": tables.evaluations_table(evaluations),
        "budgets_figure": dataset.picture(BUDGETS, evaluations, laws),
    }


def _call_times(dataset: Dataset) -> dict[str, str]:
    """What is to be known of when commands arrive, if they are late."""
    stored = dataset.configuration.get("call_times")
    return {"call_time": from_table(CallTimes, stored, "call_times").sentence} if stored else {}


def _machine(dataset: Dataset) -> str:
    manifest, configuration = dataset.manifest, dataset.configuration
    wall, runs = manifest.get("wall_time_s"), len(dataset.evidence.runs)
    per_second = manifest.get("runs_per_s") or (runs / wall if wall else None)
    facts = {
        "half, seed": f"{configuration.get('half', DASH)}, {configuration.get('seed', DASH)}",
        "wall time [s]": None if wall is None else number(float(wall)),
        "runs": runs,
        "runs per second": None if per_second is None else number(float(per_second)),
    }
    return facts_table(manifest, **facts)
