"""A report's tables for LaTeX: read from its Markdown, so that both say the same."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..comparisons.runs.files import replaced
from ..errors import StorageError
from .markdown import cells_of
from .page import details_of

FOLDER = "tables"
"""Beside the report."""

SPECIAL = {
    **{char: f"\\{char}" for char in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "\\": r"\textbackslash{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "–": "--",
    "†": r"\dag{}",
    "‡": r"\ddag{}",
    "…": r"\dots{}",
    "✓": r"\checkmark{}",
}
"""What means something else in LaTeX, or is written otherwise."""

MATHEMATICS = {
    "−": "-",
    "±": r"\pm",
    "×": r"\times",
    "·": r"\cdot",
    "°": r"^\circ",
    "≤": r"\le",
    "≥": r"\ge",
    "≈": r"\approx",
    "≠": r"\ne",
    "∞": r"\infty",
    "∈": r"\in",
    "→": r"\to",
    "‖": r"\|",
    "√": r"\surd",
    "²": "^2",
    "³": "^3",
    "⁺": "^+",
    "ₛ": "_s",
    "α": r"\alpha",
    "β": r"\beta",
    "γ": r"\gamma",
    "Δ": r"\Delta",
    "δ": r"\delta",
    "ε": r"\varepsilon",
    "η": r"\eta",
    "κ": r"\kappa",
    "λ": r"\lambda",
    "µ": r"\mu",
    "μ": r"\mu",
    "π": r"\pi",
    "ρ": r"\rho",
    "Σ": r"\Sigma",
    "σ": r"\sigma",
    "τ": r"\tau",
    "φ": r"\phi",
    "ψ": r"\psi",
    "ω": r"\omega",
}
ACCENTS = {"\u0307": r"\.", "\u0308": r"\""}
"""Derivatives: combining characters behind their letter."""

INLINE = re.compile(
    r"""(?P<fence>`+)(?P<code>.+?)(?P=fence)
      | \*\*(?P<bold>.+?)\*\*
      | \*(?P<emphasis>.+?)\*
      | \[(?P<link>[^\]]*)\]\([^)]*\)
      | <(?P<tag>[^>]*)>
      | \\(?P<escaped>[^\w\s]|_)
      | &(?P<entity>lt|gt|amp);
      | (?P<letter>\w)(?P<accent>[\u0307\u0308])
      | (?P<char>.)""",
    re.VERBOSE | re.DOTALL,
)
ENTITIES = {"lt": "<", "gt": ">", "amp": "&"}


def write_tables(report: Path) -> Path:
    r"""Write each table of a report and of its details to a file of its own; return their folder, ``tables``.

    Files are named by the heading above their table and its number there. Each is a ``tabular`` for
    ``\usepackage{booktabs}``, to be put into a ``table`` with a caption. Those of an earlier report are removed.

    Raises
    ------
    StorageError
        if they cannot be written.
    """
    folder = report.parent / FOLDER
    try:
        folder.mkdir(exist_ok=True)
        for old in folder.glob("*.tex"):
            old.unlink()
        parts = [part.read_text(encoding="utf-8") for part in (report, details_of(report)) if part.is_file()]
        for name, text in latex_tables("\n".join(parts)):
            with replaced(folder / f"{name}.tex") as part:
                part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(f"the tables cannot be written to {folder}: {error}") from error
    return folder


def latex_tables(markdown: str) -> Iterator[tuple[str, str]]:
    """Names and texts of the tables of a text in Markdown, in their order."""
    heading, block, count = "table", list[str](), Counter[str]()
    for line in [*markdown.splitlines(), ""]:
        if line.startswith("|"):
            block.append(line)
            continue
        if len(block) > 1:
            name = re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") or "table"
            count[name] += 1
            yield f"{name}-{count[name]}", _table(block)
        block = []
        if line.startswith("#"):
            heading = line.lstrip("#").strip()


def latex(text: str) -> str:
    """A text in Markdown as LaTeX: emphasis stays, of a link its text, and nothing of it is a command."""
    return "".join(map(_piece, INLINE.finditer(text)))


def _piece(found: re.Match[str]) -> str:
    part = found.groupdict()
    for name, command in (("bold", "textbf"), ("emphasis", "emph")):
        if part[name] is not None:
            return f"\\{command}{{{latex(part[name])}}}"
    if part["code"] is not None:
        return f"\\texttt{{{_escaped(part['code'].strip())}}}"
    if part["accent"] is not None:
        return f"{ACCENTS[part['accent']]}{{{_escaped(part['letter'])}}}"
    if part["link"] is not None:
        return latex(part["link"])
    if part["tag"] is not None:
        return ""
    return _escaped(part["escaped"] or ENTITIES.get(part["entity"] or "") or part["char"] or "")


def _escaped(text: str) -> str:
    return "".join(
        f"\\ensuremath{{{MATHEMATICS[char]}}}" if char in MATHEMATICS else SPECIAL.get(char, char) for char in text
    )


def _table(block: Sequence[str]) -> str:
    header, rule, *lines = ([cell.replace(r"\|", "|") for cell in cells_of(line)] for line in block)
    columns = "".join("r" if mark.endswith(":") and not mark.startswith(":") else "l" for mark in rule)
    body = [" & ".join(map(latex, line)) + r" \\" for line in lines]
    parts = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", " & ".join(map(latex, header)) + r" \\", r"\midrule"]
    return "\n".join([*parts, *body, r"\bottomrule", r"\end{tabular}"]) + "\n"
