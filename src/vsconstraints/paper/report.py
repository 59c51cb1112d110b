"""The text of the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import groupby
from pathlib import Path, PurePath
from typing import Any

from ..comparisons.runs.machine import git_commit, machine, package_versions
from ..comparisons.tables import write_table
from ..reports.markdown import bold, bullets, code, plain, table
from ..reports.page import where, write_pages
from ..reports.plots import PNG, Formats
from .figures import FIGURES
from .reconstructed import reconstructed
from .studies import STUDIES, data_file, figure_file
from .verdicts import VERDICTS, Claim, Finding, all_claims

Found = Sequence[tuple[Claim, Finding]]

COLUMNS = ("claim", "where", "sentence", "rule", "verdict", "measured")

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
"""What the claims of each number are about."""

OPENING = """\
Muñoz-Benavent et al., *Robust fulfillment of constraints in robot visual servoing*, Control Engineering Practice
71 (2018), [doi 10.1016/j.conengprac.2017.10.017](https://doi.org/10.1016/j.conengprac.2017.10.017): what it says,
sentence by sentence, what the same law does here, and our counterparts of its figures. Every verdict follows from
the measured numbers by a rule that is [printed below](#rules); none is set by hand."""

SAMPLING = """\
**φ ≤ 0 and σ ≤ 0.** A constraint is σ ≤ 0; the law acts on φ = σ + K σ̇ and switches where φ reaches zero. A
sampled law finds φ above zero before it acts: eq. (43) bounds what one switching step of the constraint action
takes back, T_s u⁺. On a step on which the row is inactive the tracking acceleration moves φ as well, by
T_s (L_fφ + L_gφ q̈), which can be larger. So wherever the paper prints φ ≤ 0, "holds partly" means: the constraint
σ ≤ 0 holds in every sample, and φ is above zero by no more than sampling explains. Where φ stays at or above zero for
many samples, and for more of them with a shorter period, it is not sampling: u⁺ is below (12)."""


@dataclass(frozen=True)
class Reproduction:
    """What came of it.

    Attributes
    ----------
    report
        Where the report is.
    findings
        By the claims' keys, in the report's order.
    problems
        What could not be run or drawn, by name, with the reason.
    wall_time
        [s].
    formats
        Of the figures.
    """

    report: Path
    findings: Mapping[str, Finding]
    problems: Mapping[str, str] = field(default_factory=dict)
    wall_time: float = 0.0
    formats: Formats = PNG

    @property
    def folder(self) -> Path:
        """Of the report, with figures and tables below it."""
        return self.report.parent

    @property
    def counts(self) -> dict[str, int]:
        """How many claims have each verdict."""
        verdicts = [finding.verdict for finding in self.findings.values()]
        return {verdict: verdicts.count(verdict) for verdict in VERDICTS}

    def summary(self) -> str:
        """One line for the command line."""
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        return f"{len(self.findings)} claims: {counts}. {self.wall_time:.0f} s. {where(self.report)}"


def write_report(
    result: Reproduction, drawn: Mapping[int, str], studies: Mapping[str, Any], command: Sequence[str]
) -> None:
    """Write report.md, the same as report.html, and claims.csv; each whole or not at all.

    Parameters
    ----------
    result
        The findings.
    drawn
        Of each figure why it is not there; an empty text if it is.
    studies
        Results by name, or texts why there are none.
    command
        What the user typed.
    """
    folder, found = result.folder, [(claim, result.findings[claim.key]) for claim in all_claims()]
    parts = [
        "# The paper, claim by claim",
        OPENING,
        _summary(result, found),
        SAMPLING,
        *_claims(result, found),
        '<a id="rules"></a>\n\n## Rules\n\nA claim holds if:',
        table(["claim", "rule"], [[claim.key, plain(claim.rule)] for claim, _ in found], text_columns=2),
        *_figures(result, drawn),
        *_studies(result, studies),
        reconstructed(),
        differences().replace("\n## ", "\n### ").replace("# Differences", "## Differences", 1),
        *_problems(result),
        "## Machine and versions",
        _machine(result, command),
    ]
    write_pages(result.report, "\n\n".join(text.strip() for text in parts if text) + "\n")
    lines = [
        (claim.key, claim.where, claim.sentence, claim.rule, finding.verdict, finding.text) for claim, finding in found
    ]
    write_table(folder / "claims.csv", COLUMNS, [dict(zip(COLUMNS, line, strict=True)) for line in lines])


def differences() -> str:
    """Where this project differs from the paper, as Markdown: the one text there is of it."""
    return files(__package__).joinpath("differences.md").read_text(encoding="utf-8")


def _by_number(found: Found) -> Iterator[tuple[int, Found]]:
    for number, group in groupby(found, key=lambda pair: pair[0].number):
        yield number, list(group)


def _summary(result: Reproduction, found: Found) -> str:
    lines = []
    for number, group in _by_number(found):
        counts = Counter(finding.verdict for _, finding in group)
        lines.append([f"[{number}. {TOPICS[number]}](#claim-{number})", *(str(counts[v] or "") for v in VERDICTS)])
    total = [bold(str(count)) if count else "" for count in result.counts.values()]
    return table(["claims", *VERDICTS], [*lines, [bold("all"), *total]])


def _claims(result: Reproduction, found: Found) -> Iterator[str]:
    yield "## Claims"
    for number, group in _by_number(found):
        yield f'<a id="claim-{number}"></a>\n\n### {number}. {TOPICS[number]}'
        lines = [
            [
                f'<a id="{claim.key}"></a>{claim.key}',
                _where(result, claim),
                plain(claim.sentence),
                plain(finding.text),
                finding.verdict if finding.verdict == "holds" else bold(finding.verdict),
            ]
            for claim, finding in group
        ]
        yield table(["", "where", "the paper says", "measured here", "verdict"], lines, text_columns=5)


def _where(result: Reproduction, claim: Claim) -> str:
    figure = f"figures/{PurePath(claim.figure).stem}.{result.formats[0]}"
    return f"[{claim.where}]({figure})" if claim.figure and (result.folder / figure).exists() else claim.where


def _figures(result: Reproduction, drawn: Mapping[int, str]) -> Iterator[str]:
    yield "## Figures"
    yield (
        "Our counterparts, with the paper's numbers. Figs. 1 and 13 show frames and a laboratory, and have none. In "
        "Figs. 4 to 8 v points upwards, as in the paper; in the others downwards, as in an image. What is forbidden is "
        "shaded."
    )
    for number, figure in FIGURES.items():
        why = drawn[number]
        image = (
            f"![{figure.title}](figures/{figure.file_in(result.formats)})" if not why else f"Not drawn: {plain(why)}"
        )
        yield f"### {figure.title}\n\n{image}\n\n{plain(figure.caption)}"


def _studies(result: Reproduction, studies: Mapping[str, Any]) -> Iterator[str]:
    folder = result.folder
    if studies:
        yield "## Studies"
        yield "Sweeps that go beyond the paper's single runs."
    for name, answer in studies.items():
        if isinstance(answer, str):
            yield f"{code(name)}: not measured, {plain(answer)}"
            continue
        study, image = STUDIES[name], figure_file(folder, name, result.formats)
        yield f"### {study.title}"
        yield study.question
        yield bullets([plain(sentence) for sentence in answer.sentences])
        if image.exists():
            yield f"![{study.title}]({image.relative_to(folder)})\n\n{plain(study.figure_caption)}"
        if answer.failures:
            yield bullets([f"failed: {plain(failure)}" for failure in answer.failures])
        if data_file(folder, name).exists():
            yield f"Data: [studies/{name}.csv](studies/{name}.csv)"


def _problems(result: Reproduction) -> Iterator[str]:
    if result.problems:
        yield "## What could not be run or drawn"
        yield bullets([f"{plain(name)}: {plain(why)}" for name, why in result.problems.items()])


def _machine(result: Reproduction, command: Sequence[str]) -> str:
    facts = {**machine(), **package_versions(), "git commit": git_commit()}
    lines = [[name, plain(str(value))] for name, value in facts.items() if value]
    lines += [["command", code(" ".join(command))]] if command else []
    lines.append(["wall time [s]", f"{result.wall_time:.0f}"])
    return table(["what", "value"], lines, text_columns=2)
