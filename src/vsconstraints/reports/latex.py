"""Tables of a report for LaTeX, made from the same Markdown as its page."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from markdown_it.token import Token

from ..comparisons.runs.files import replaced
from ..errors import StorageError
from .page import details_of, parser

FOLDER = "tables"  #: Folder beside the report.
TEXT = (
    r"& \& % \% $ \$ # \# _ \_ { \{ } \} ~ \textasciitilde{} ^ \textasciicircum{} "
    r"\ \textbackslash{} < \textless{}"
)
TEXT += r" > \textgreater{} | \textbar{} – -- † \dag{} ‡ \ddag{} … \dots{} ✓ \checkmark{}"
MATHEMATICS = (
    r"− - ± \pm × \times · \cdot ° ^\circ ≤ \le ≥ \ge ≈ \approx ≠ \ne ∞ \infty ∈ \in "
    r"→ \to ‖ \| √ \surd ² ^2"
)
MATHEMATICS += (
    r" ³ ^3 ⁺ ^+ ₛ _s α \alpha β \beta γ \gamma Δ \Delta δ \delta ε \varepsilon "
    r"η \eta κ \kappa λ \lambda"
)
MATHEMATICS += r" µ \mu μ \mu π \pi ρ \rho Σ \Sigma σ \sigma τ \tau φ \phi ψ \psi ω \omega"
#: Characters that LaTeX reads differently or writes differently.
LATEX = dict(zip(TEXT.split()[::2], TEXT.split()[1::2], strict=True)) | {
    char: rf"\ensuremath{{{name}}}"
    for char, name in zip(MATHEMATICS.split()[::2], MATHEMATICS.split()[1::2], strict=True)
}
#: Derivatives: combining characters after their letter.
ACCENTS = {"\u0307": r"\.", "\u0308": r"\""}
MARKS = {
    "strong_open": r"\textbf{",
    "em_open": r"\emph{",
    "strong_close": "}",
    "em_close": "}",
    "softbreak": " ",
}


def write_tables(report: Path) -> Path:
    r"""Write each table of a report and of its details to a separate file in the folder ``tables``.

    Return that folder. Files are named by the heading above their table and the number of the
    table under that heading. Each is a ``tabular`` for ``\usepackage{booktabs}``, to be put into a
    ``table`` with a caption. The files of an earlier report are removed. Raises StorageError if
    they cannot be written.
    """
    folder = report.parent / FOLDER
    try:
        folder.mkdir(exist_ok=True)
        for old in folder.glob("*.tex"):
            old.unlink()
        parts = [
            part.read_text(encoding="utf-8")
            for part in (report, details_of(report))
            if part.is_file()
        ]
        for name, text in latex_tables("\n".join(parts)):
            with replaced(folder / f"{name}.tex") as part:
                part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"the tables cannot be written to {folder}: {error}") from error
    return folder


def latex_tables(markdown: str) -> Iterator[tuple[str, str]]:
    """Yield names and texts of the tables in a Markdown text, in their order."""
    name = "table"
    columns = ""
    cells = list[str]()
    count = Counter[str]()
    lines: list[str] = []
    tokens = parser().parse(markdown)
    for token, following in zip(tokens, [*tokens[1:], None], strict=True):
        if token.type == "heading_open" and following:
            name = re.sub(r"[^a-z0-9]+", "-", following.content.lower()).strip("-") or "table"
        elif token.type in ("th_open", "td_open") and following:
            columns += (
                ("r" if "right" in str(token.attrGet("style")) else "l")
                if token.type == "th_open"
                else ""
            )
            cells.append(_inline(following))
        elif token.type == "tr_close":
            lines.append(" & ".join(cells) + r" \\")
            cells = []
        elif token.type == "table_close":
            count[name] += 1
            parts = [
                rf"\begin{{tabular}}{{{columns}}}",
                r"\toprule",
                lines[0],
                r"\midrule",
                *lines[1:],
            ]
            yield (
                f"{name}-{count[name]}",
                "\n".join([*parts, r"\bottomrule", r"\end{tabular}"]) + "\n",
            )
            columns = ""
            lines = []


def latex(text: str) -> str:
    """Return a line of Markdown as LaTeX, with all special characters escaped.

    Emphasis is kept, and links are replaced by their text.
    """
    return _inline(parser().parseInline(text)[0])


def _inline(token: Token) -> str:
    parts = []
    for child in token.children or []:
        if child.type == "code_inline":
            parts.append(rf"\texttt{{{_escaped(child.content.strip())}}}")
        else:
            parts.append(
                MARKS.get(child.type) or (_escaped(child.content) if child.type == "text" else "")
            )
    return "".join(parts)


def _escaped(text: str) -> str:
    pieces = (
        (LATEX.get(char, char), accent)
        for char, accent in re.findall(r"(.)([\u0307\u0308]?)", text, re.DOTALL)
    )
    return "".join(f"{ACCENTS[accent]}{{{char}}}" if accent else char for char, accent in pieces)
