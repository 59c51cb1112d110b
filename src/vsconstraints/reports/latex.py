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
#: Characters that LaTeX reads or writes differently in text, each followed by its replacement.
CHARACTERS = r"""
    & \& % \% $ \$ # \# _ \_ { \{ } \} ~ \textasciitilde{} ^ \textasciicircum{}
    \ \textbackslash{} < \textless{} > \textgreater{} | \textbar{}
    – -- † \dag{} ‡ \ddag{} … \dots{} ✓ \checkmark{}
"""
#: Mathematical symbols, each followed by its command.
SYMBOLS = r"""
    − - ± \pm × \times · \cdot ° ^\circ ≤ \le ≥ \ge ≈ \approx ≠ \ne ∞ \infty ∈ \in
    → \to ‖ \| √ \surd ² ^2 ³ ^3 ⁺ ^+ ₛ _s
    α \alpha β \beta γ \gamma Δ \Delta δ \delta ε \varepsilon η \eta κ \kappa λ \lambda
    µ \mu μ \mu π \pi ρ \rho Σ \Sigma σ \sigma τ \tau φ \phi ψ \psi ω \omega
"""


def _pairs(text: str) -> dict[str, str]:
    words = text.split()
    return dict(zip(words[::2], words[1::2], strict=True))


#: LaTeX code of each of these characters.
LATEX = _pairs(CHARACTERS)
for _symbol, _command in _pairs(SYMBOLS).items():
    LATEX[_symbol] = rf"\ensuremath{{{_command}}}"
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
        parts = []
        for path in (report, details_of(report)):
            if path.is_file():
                parts.append(path.read_text(encoding="utf-8"))
        for name, text in latex_tables("\n".join(parts)):
            with replaced(folder / f"{name}.tex") as file:
                file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"the tables cannot be written to {folder}: {error}") from error
    return folder


def latex_tables(markdown: str) -> Iterator[tuple[str, str]]:
    """Yield names and texts of the tables in a Markdown text, in their order."""
    heading = "table"
    count = Counter[str]()
    columns = ""
    cells: list[str] = []
    lines: list[str] = []
    tokens = parser().parse(markdown)
    for k, token in enumerate(tokens):
        if token.type == "heading_open":
            words = re.findall("[a-z0-9]+", tokens[k + 1].content.lower())
            heading = "-".join(words) or "table"
        elif token.type in ("th_open", "td_open"):
            cells.append(_inline(tokens[k + 1]))
            if token.type == "th_open":
                columns += "r" if "right" in str(token.attrGet("style")) else "l"
        elif token.type == "tr_close":
            lines.append(" & ".join(cells) + r" \\")
            cells = []
        elif token.type == "table_close":
            count[heading] += 1
            yield f"{heading}-{count[heading]}", _tabular(columns, *lines)
            columns = ""
            lines = []


def _tabular(columns: str, header: str, *lines: str) -> str:
    """Return a table with horizontal rules; ``columns`` has one letter for each alignment."""
    parts = (
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        header,
        r"\midrule",
        *lines,
        r"\bottomrule",
        r"\end{tabular}",
    )
    return "\n".join(parts) + "\n"


def latex(text: str) -> str:
    """Return a line of Markdown as LaTeX, with all special characters escaped.

    Emphasis is kept, and links are replaced by their text.
    """
    return _inline(parser().parseInline(text)[0])


def _inline(token: Token) -> str:
    text = ""
    for child in token.children or []:
        if child.type == "code_inline":
            text += rf"\texttt{{{_escaped(child.content.strip())}}}"
        elif child.type == "text":
            text += _escaped(child.content)
        else:
            text += MARKS.get(child.type, "")
    return text


def _escaped(text: str) -> str:
    escaped = ""
    for char, accent in re.findall(r"(.)([\u0307\u0308]?)", text, re.DOTALL):
        letter = LATEX.get(char, char)
        escaped += f"{ACCENTS[accent]}{{{letter}}}" if accent else letter
    return escaped
