"""Report on the paper's claims: verdicts, figures and studies, rendered by a template."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from ..comparisons.runs.machine import git_commit, machine, package_versions
from ..comparisons.tables import write_table
from ..reports.markdown import Table
from ..reports.page import render, where, write_pages
from ..reports.plots import PNG, Formats
from .figures import FIGURES
from .studies import STUDIES, data_file, figure_file
from .verdicts import VERDICTS, Finding, all_claims

COLUMNS = ("claim", "where", "sentence", "rule", "verdict", "measured")

#: Topics of the claims by number.
TOPICS = {
    1: "First example: sliding along the border of the image",
    2: "Fast motion and the switching gain",
    3: "A trap",
    4: "Corners",
    5: "The case study",
    6: "The experiments, simulated",
    7: "Against potential fields",
    8: "A limit case of potential fields",
    9: "What the law needs to know",
    10: "Gain, speed, sampling and rank",
    11: "Moving obstacles and targets",
    12: "Computation time",
}

SEARCHED = ("q0", "target", "task.goals", "duration")
#: Keys of scenarios whose values were searched for, because the paper does not print them; the
#: other scenarios of the first example share its values.
NOT_PRINTED = {
    "example-2d-fov": ("camera", *SEARCHED),
    "case-study-6r": ("camera", *SEARCHED),
    "experiment-1-pbvs": SEARCHED,
    "experiment-2-ibvs": SEARCHED,
}

#: Template variables that do not depend on the reproduction.
TOLD: dict[str, Any] = {
    "table": Table,
    "topics": TOPICS,
    "verdicts": VERDICTS,
    "shipped": STUDIES,
    "figure_file": figure_file,
    "data_file": data_file,
    "not_printed": NOT_PRINTED,
}


@dataclass(frozen=True)
class Reproduction:
    """Result of checking all claims."""

    report: Path  #: Path of the report.
    findings: Mapping[str, Finding]  #: By the claims' keys, in the report's order.
    #: Reasons why something could not be run or drawn, by name.
    problems: Mapping[str, str] = field(default_factory=dict)
    wall_time: float = 0.0  #: Wall time [s].
    formats: Formats = PNG  #: Formats of the figures.

    @property
    def folder(self) -> Path:
        """Folder of the report, with figures and tables below it."""
        return self.report.parent

    @property
    def counts(self) -> dict[str, int]:
        """Number of claims with each verdict."""
        verdicts = Counter(finding.verdict for finding in self.findings.values())
        return {verdict: verdicts[verdict] for verdict in VERDICTS}

    def summary(self) -> str:
        """Return one line for the command line."""
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        return (
            f"{len(self.findings)} claims: {counts}. {self.wall_time:.0f} s. {where(self.report)}"
        )


def write_report(
    result: Reproduction,
    missing: Mapping[int, str],
    studies: Mapping[str, Any],
    command: Sequence[str],
) -> None:
    """Write report.md, its equivalent report.html, and claims.csv; each completely or not at all.

    ``missing`` holds by figure the reason why it could not be drawn. ``studies`` holds results by
    name, or the reason why there are none.
    """
    findings = [(claim, result.findings[claim.key]) for claim in all_claims()]
    facts = {**machine(), **package_versions(), "git commit": git_commit()}
    by_number = groupby(findings, key=lambda pair: pair[0].number)
    headings_lowered = differences().replace("\n## ", "\n### ")
    text = render(
        Path(__file__).with_name("reproduction.md"),
        **TOLD,
        result=result,
        missing=missing,
        studies=studies,
        command=" ".join(command),
        figures=FIGURES,
        facts={name: str(value) for name, value in facts.items() if value},
        differences=headings_lowered.replace("# Differences", "## Differences", 1),
        findings=findings,
        numbered={number: list(group) for number, group in by_number},
    )
    write_pages(result.report, text)
    lines = [
        {
            "claim": claim.key,
            "where": claim.where,
            "sentence": claim.sentence,
            "rule": claim.rule,
            "verdict": found.verdict,
            "measured": found.text,
        }
        for claim, found in findings
    ]
    write_table(result.folder / "claims.csv", COLUMNS, lines)


def differences() -> str:
    """Differences between this project and the paper, as Markdown; also in the documentation."""
    return Path(__file__).with_name("differences.md").read_text(encoding="utf-8")
