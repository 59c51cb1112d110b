"""The report: verdicts, figures and studies, written by a template."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import groupby
from pathlib import Path, PurePath
from typing import Any

from ..comparisons.runs.machine import git_commit, machine, package_versions
from ..comparisons.tables import write_table
from ..errors import VsconstraintsError
from ..reports.markdown import Table, bold, code, plain
from ..reports.page import render, where, write_pages
from ..reports.plots import PNG, Formats
from ..scenarios import Scenario
from .figures import FIGURES
from .studies import STUDIES, data_file, figure_file
from .verdicts import VERDICTS, Claim, Finding, all_claims

Findings = Sequence[tuple[Claim, Finding]]

COLUMNS = ("claim", "where", "sentence", "rule", "verdict", "measured")

DATA: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("report.toml").read_text(encoding="utf-8"))

#: What the claims of each number are about.
TOPICS: dict[int, str] = {int(number): topic for number, topic in DATA["topics"].items()}


@dataclass(frozen=True)
class Reproduction:
    """The result of checking every claim."""

    report: Path  #: Path of the report.
    findings: Mapping[str, Finding]  #: By the claims' keys, in the report's order.
    #: What could not be run or drawn, by name, with the reason.
    problems: Mapping[str, str] = field(default_factory=dict)
    wall_time: float = 0.0  #: [s].
    formats: Formats = PNG  #: Of the figures.

    @property
    def folder(self) -> Path:
        """Of the report, with figures and tables below it."""
        return self.report.parent

    @property
    def counts(self) -> dict[str, int]:
        """How many claims have each verdict."""
        verdicts = Counter(finding.verdict for finding in self.findings.values())
        return {verdict: verdicts[verdict] for verdict in VERDICTS}

    def summary(self) -> str:
        """One line for the command line."""
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        return f"{len(self.findings)} claims: {counts}. {self.wall_time:.0f} s. {where(self.report)}"


def write_report(
    result: Reproduction, missing: Mapping[int, str], studies: Mapping[str, Any], command: Sequence[str]
) -> None:
    """Write report.md, the same as report.html, and claims.csv; each whole or not at all.

    Parameters
    ----------
    result
        The findings.
    missing
        By figure the reason why it could not be drawn; an empty text if it was.
    studies
        Results by name, or the reason why there are none.
    command
        What the user typed.
    """
    findings = [(claim, result.findings[claim.key]) for claim in all_claims()]
    numbered = {number: list(group) for number, group in groupby(findings, key=lambda pair: pair[0].number)}
    text = render(
        "reproduction.md",
        topics=TOPICS,
        summary=summary_table(result, numbered),
        claims={number: claims_table(result, group) for number, group in numbered.items()},
        rules=Table(["claim", "rule"], [[claim.key, plain(claim.rule)] for claim, _ in findings], text_columns=2),
        figures=FIGURES,
        missing=missing,
        formats=result.formats,
        folder=result.folder,
        studies=studies,
        shipped=STUDIES,
        figure_file=figure_file,
        data_file=data_file,
        reconstructed=reconstructed(),
        differences=differences().replace("\n## ", "\n### ").replace("# Differences", "## Differences", 1),
        problems=result.problems,
        machine=machine_table(result, command),
    )
    write_pages(result.report, text)
    lines = [
        (claim.key, claim.where, claim.sentence, claim.rule, finding.verdict, finding.text)
        for claim, finding in findings
    ]
    write_table(result.folder / "claims.csv", COLUMNS, [dict(zip(COLUMNS, line, strict=True)) for line in lines])


def differences() -> str:
    """Where this project differs from the paper, as Markdown; the documentation shows the same text."""
    return files(__package__).joinpath("differences.md").read_text(encoding="utf-8")


def summary_table(result: Reproduction, numbered: Mapping[int, Findings]) -> str:
    """How many claims of each number have each verdict."""
    lines = []
    for number, group in numbered.items():
        counts = Counter(finding.verdict for _, finding in group)
        lines.append([f"[{number}. {TOPICS[number]}](#claim-{number})", *(str(counts[v] or "") for v in VERDICTS)])
    total = [bold(str(count)) if count else "" for count in result.counts.values()]
    return Table(["claims", *VERDICTS], [*lines, [bold("all"), *total]])


def claims_table(result: Reproduction, findings: Findings) -> str:
    """The claims of one number with their verdicts; sections of the paper link to our counterparts of their figures."""
    lines = []
    for claim, finding in findings:
        figure = f"figures/{PurePath(claim.figure).stem}.{result.formats[0]}"
        shown = claim.figure and (result.folder / figure).exists()
        lines.append(
            [
                f'<a id="{claim.key}"></a>{claim.key}',
                f"[{claim.where}]({figure})" if shown else claim.where,
                plain(claim.sentence),
                plain(finding.text),
                finding.verdict if finding.verdict == "holds" else bold(finding.verdict),
            ]
        )
    return Table(["", "where", "the paper says", "measured here", "verdict"], lines, text_columns=5)


def machine_table(result: Reproduction, command: Sequence[str]) -> str:
    """Machine, versions, command and wall time."""
    facts = {**machine(), **package_versions(), "git commit": git_commit()}
    lines = [[name, plain(str(value))] for name, value in facts.items() if value]
    lines += [["command", code(" ".join(command))]] if command else []
    lines.append(["wall time [s]", f"{result.wall_time:.0f}"])
    return Table(["what", "value"], lines, text_columns=2)


def reconstructed() -> str:
    """A table of the values that the paper does not print, taken from the scenarios that use them."""
    lines = []
    for name, keys in DATA["not-printed"].items():
        try:
            tables = Scenario.load(name).tables
        except VsconstraintsError as error:
            lines.append([name, "", plain(str(error).split(". ")[0])])
            continue
        for key in keys:
            value: Any = tables
            for part in key.split("."):
                value = value.get(part) if isinstance(value, dict) else None
            lines += [[name, key, code(toml_value(value))]] if value is not None else []
    return Table(["scenario", "key", "value"], lines, text_columns=3)


def toml_value(value: Any) -> str:
    """A value as a TOML file spells it, on one line, with six significant digits."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(part)}" for key, part in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return f"{value:.6g}" if isinstance(value, float) else f'"{value}"' if isinstance(value, str) else str(value)
