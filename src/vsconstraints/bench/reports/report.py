"""Report of evidence: tables, figures and findings combined by a template; findings as data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path
from typing import Any

from ...comparisons.metrics import NEGLIGIBLE, TOLERANCES, TOLERANT, definitions
from ...comparisons.runs.files import write_json
from ...comparisons.runs.folder import MANIFEST, make_folder
from ...errors import ConfigurationError, StorageError
from ...reports import groups
from ...reports.page import render, write_pages
from ...reports.plots import PNG, Formats
from ...scenarios.reading import from_table
from ..evidence import CallTimes, Evidence
from ..statistics import costs, profile, ranks
from ..statistics.judged import UNSUCCESSFUL
from . import across, failures, robustness, tables
from . import ranking as rank
from .dataset import Dataset
from .figures import BUDGETS, CRITICAL_DIFFERENCE, LEVELS, PROFILES, TOLERANCE, Diagram, Panel
from .findings import Finding, always_failing, findings, reversals, tuning_gain
from .ranking import Ranking, condition_text, finite, ranking, scenes_text

CLAIMS = "claims.json"
SITUATIONS = "Success in every situation"  #: Details that the page shows as a heat map.
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
#: Metrics of the profiles, all positive, with their names; and the metric of ranks.
PROFILED = {"acceleration_variation": "variation", "settling_time_s": "settling time"}
RANKED_BY = "acceleration_variation"
#: Kinds of findings on several conditions, each on a separate line.
ACROSS = ("turned", "tuned", "nowhere")
#: Kinds of findings not in the line of a condition: those across conditions and in tables.
HIDDEN = (*ACROSS, "across", "holds", "tolerant", "violations")
#: Called with the number of finished parts of a report and their total.
OnWritten = Callable[[int, int], None]


def write_evidence_report(
    folder: Path | Sequence[Path],
    *,
    out: Path | None = None,
    figures: bool = True,
    tuning: Path | None = None,
    formats: Formats = PNG,
    trust: bool = False,
    on_written: OnWritten = lambda done, total: None,
    on_remark: Callable[[str], None] = lambda remark: None,
) -> Path:
    """Write report.md, details.md, report.html, figures and claims.json from a campaign.

    Several folders are read as one campaign, see :meth:`.Evidence.load`. The report is written to
    ``out``, by default the folder of the campaign. Return the path of report.md. Without
    ``figures`` existing figures are kept, and the report shows none. The report shows the first of
    the ``formats``. ``tuning`` is the folder of the tuned settings, by default ``tuning`` in the
    campaign's folder. Laws and constraints that the campaign names as ``module:Class`` are imported
    only with ``trust``. ``on_written`` is called with the number of finished parts and their total,
    ``on_remark`` with warnings. Raises ConfigurationError if a folder has no evidence, if it was
    changed after it was stored, if the runs of an existing report are missing, or if ``out`` holds
    other results. Raises StorageError if the report cannot be written.
    """
    evidence = Evidence.load(folder, trust)
    for remark in evidence.remarks:
        on_remark(remark)
    count = evidence.manifest.get("runs")
    if count and not len(evidence.runs):
        raise ConfigurationError(
            f"{evidence.folder} has none of the {count} runs that its report was made from: runs, "
            "rows and scenes are missing. The report is left unchanged"
        )
    if out is not None:
        if (out / MANIFEST).exists():
            raise ConfigurationError(f"{out} holds results: give another folder with --out")
        make_folder(out, "the report")
    if tuning is None and (evidence.folder / "tuning").is_dir():
        tuning = evidence.folder / "tuning"
    return write_report_of(Dataset(evidence, tuning, figures, formats, out), on_written)


def write_report_of(dataset: Dataset, on_written: OnWritten = lambda done, total: None) -> Path:
    """Write the report of loaded evidence."""
    context = dict[str, Any]()
    parts = (_claims, _quality, _singles)
    report = dataset.folder / "report.md"
    for done, part in enumerate(parts):
        on_written(done, len(parts))
        if done == 0 or context["rankings"]:
            context |= part(dataset)
    on_written(len(parts), len(parts))
    rankings: list[Ranking] = context["rankings"]
    data = {
        "sentences": list(map(asdict, context["claims"])),
        "table": list(map(finite, context["headline"])),
        "conclusions": [each.as_data() for each in robustness.conclusions(dataset)],
        "power": [finite(each._asdict()) for each in robustness.powers(dataset)],
        "answers": list(map(finite, context["answers"])),
        "situations": list(map(finite, failures.situation_data(dataset))),
    }
    known = definitions()
    defined = {name: known[name] for name in DEFINED if name in known}
    call_times = dataset.configuration.get("call_times")
    if call_times:
        defined["call_time"] = from_table(CallTimes, call_times, "call_times").sentence
    context |= {
        "strict": NEGLIGIBLE,
        "tolerant": TOLERANT,
        "definitions": defined,
        "tables": tables,
        "failures": failures,
        "across": across,
        "robustness": robustness,
        "tolerances": TOLERANCES,
        "unsuccessful": UNSUCCESSFUL,
        "groups": groups,
        "rank": rank,
        "situations_title": SITUATIONS,
        "drawn": scenes_text(int(dataset.evidence.scenes["found"].sum()), len(dataset.families)),
    }
    try:
        interactive = {SITUATIONS: failures.heat_map(dataset)} if rankings else {}
        script = Path(__file__).with_name("heat-map.js").read_text(encoding="utf-8")
        text = render(Path(__file__).with_name("evidence.md"), dataset=dataset, **context)
        write_pages(report, text, interactive, script if interactive else "")
        write_json(dataset.folder / CLAIMS, data)
    except OSError as error:
        raise StorageError(f"the report cannot be written to {dataset.folder}: {error}") from error
    return report


def claims_of(dataset: Dataset) -> list[Finding]:
    """Return the findings of the first screen in order; none if only the baseline was run."""
    claims = list[Finding]()
    for on_condition in findings(dataset).values():
        claims += on_condition
    if not claims:
        return []
    claims += reversals(dataset)
    claims += robustness.robustness_findings(dataset)
    claims += across.across_findings(dataset)
    gain = tuning_gain(dataset)
    if gain is not None:
        claims.append(gain)
    claims += always_failing(dataset)
    return claims


def _claims(dataset: Dataset) -> dict[str, Any]:
    claims = claims_of(dataset)
    rankings = [ranking(dataset, condition) for condition in dataset.conditions]
    rankings = [each for each in rankings if each.scenes]
    texts = []
    depths = []
    for each in rankings:
        condition = each.condition
        sentences = []
        for claim in claims:
            if claim.condition == condition and claim.about not in HIDDEN:
                sentences.append(claim.text)
        texts.append(" ".join(sentences))
        depths.append((condition_text(condition), dataset.paired(condition, "tolerance")))
    texts += [claim.text for claim in claims if claim.about in ACROSS]
    laws: list[str] = []
    if rankings:
        laws = list(dict.fromkeys((*rankings[0].laws, *dataset.laws)))
    return {
        "claims": claims,
        "headline": [tables.headline_numbers(dataset, rankings, law) for law in laws],
        "rankings": rankings,
        "answers": [tables.answer_numbers(dataset, each) for each in rankings],
        "findings": texts,
        "tolerance": dataset.picture(TOLERANCE, depths, dataset.laws),
        "levels": list(filter(None, _levels(dataset))),
    }


def _levels(dataset: Dataset) -> Iterator[str]:
    """Yield the figure of each family whose conditions are a factorial."""
    for family, factorial in dataset.factorials.items():
        rankings = {}
        for name in factorial.conditions.values():
            rankings[name] = ranking(dataset, name, families=[family])
        scenes = {each.scenes for each in rankings.values()}
        count = str(min(scenes))
        if len(scenes) > 1:
            count += f" to {max(scenes)}"
        figure = replace(
            LEVELS,
            name=f"levels--{family}",
            title=f"{family}: {LEVELS.title}",
            caption=f"{family}, {count} scenes. {LEVELS.caption}",
        )
        yield dataset.picture(figure, factorial, rankings, dataset.laws)


def _quality(dataset: Dataset) -> dict[str, Any]:
    """Return the figures of all conditions: profiles and critical differences."""
    panels: dict[str, list[Panel]] = {metric: [] for metric in PROFILED}
    diagrams: list[Diagram] = []
    conditions = dataset.conditions if len(dataset.laws) > 1 else ()
    for metric, condition in product(PROFILED, conditions):
        cost = costs(dataset.among(condition), metric).table
        laws = tuple(law for law in dataset.laws if law in cost.columns)
        values = cost[list(laws)].to_numpy(float)
        if not len(values):
            continue
        title = f"{PROFILED[metric]}, {condition}"
        panels[metric].append((title, laws, profile(values)))
        if metric == RANKED_BY:
            diagrams.append((condition_text(condition), laws, ranks(values)))
    figures = [
        dataset.picture(PROFILES, list(panels.values()), dataset.laws),
        dataset.picture(CRITICAL_DIFFERENCE, diagrams, dataset.laws),
    ]
    return {"figures": [figure for figure in figures if figure]}


def _singles(dataset: Dataset) -> dict[str, Any]:
    """Return the figures of single scenes and of the tuning."""
    shown: dict[str, Any] = {
        "scene_figures": failures.scene_figures(dataset),
        "evaluations": None,
        "budgets_figure": "",
    }
    evaluations = tables.evaluations_of(dataset)
    if evaluations is not None and len(evaluations):
        laws = list(dict.fromkeys(evaluations["law"].astype(str)))
        shown["evaluations"] = evaluations
        shown["budgets_figure"] = dataset.picture(BUDGETS, evaluations, laws)
    return shown
