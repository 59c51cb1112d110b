"""Tables for LaTeX: the same cells as in Markdown, and nothing in them that LaTeX would take for a
command.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsconstraints.reports.latex import latex, latex_tables, write_tables
from vsconstraints.reports.markdown import Table, bold, code, plain

BY_HAND = r"""\begin{tabular}{lrr}
\toprule
controller & depth [\% of L] & band [rad/s\ensuremath{^3}] \\
\midrule
sliding-mode & \textbf{0.5} & -- \\
\texttt{my\_law} & (25.0) & \ensuremath{-}1 \\
\bottomrule
\end{tabular}
"""


def test_a_table_by_hand() -> None:
    lines = [["sliding-mode", bold("0.5"), "–"], [code("my_law"), "(25.0)", "−1"]]
    made = Table(["controller", "depth [% of L]", "band [rad/s³]"], lines)
    text = f"# Title\n\n## How it ended: 3 & 4\n\nWords.\n\n{made}\n"
    assert list(latex_tables(text)) == [("how-it-ended-3-4-1", BY_HAND)]


@pytest.mark.parametrize(
    ("markdown", "expected"),
    [
        ("[case](#scenario-a_b) **50 %**", r"case \textbf{50 \%}"),
        ('<a id="5.3"></a>5.3', "5.3"),
        ("T_s u⁺ *or* q̈_c", r"T\_s u\ensuremath{^+} \emph{or} \"{q}\_c"),
        (
            plain("a*b_ <c> $ \\ ~"),
            r"a*b\_ \textless{}c\textgreater{} \$ \textbackslash{} \textasciitilde{}",
        ),
        (
            code("fov[marker 2] {~^}"),
            r"\texttt{fov[marker 2] \{\textasciitilde{}\textasciicircum{}\}}",
        ),
        ("φ ≤ 0 µs", r"\ensuremath{\phi} \ensuremath{\le} 0 \ensuremath{\mu}s"),
    ],
)
def test_cells(markdown: str, expected: str) -> None:
    assert latex(markdown) == expected


MEANT = re.compile(
    r"\\ensuremath\{[^}]*\}|\\(text(bf|tt)|emph)\{|\\(textbackslash|text(ascii(tilde|circum)|less|greater|bar)|dd?ag)\{\}"
    r"|\\[&%$#_{}]|\\\"\{|\}"
)
"""What stands for a character, or was emphasis."""


@given(st.text(st.sampled_from("abq01 _$&%#{}~^\\<>|*`[]()†φ²\u0308"), max_size=25))
def test_no_text_becomes_a_command(text: str) -> None:
    """Whatever a name holds: without what is meant, nothing is left that LaTeX acts on."""
    ((_, made),) = latex_tables(Table(["x", "y"], [[plain(text), code(text or "a")]]))
    body = made.split("\\midrule\n")[1].split("\n\\bottomrule")[0]
    assert body.endswith(r" \\")
    cells = re.split(r"(?<!\\) & ", body.removesuffix(r" \\"))
    assert len(cells) == 2
    for cell in cells:
        assert not re.search(r"[\\&%$#_^~{]", MEANT.sub("", cell))
        assert len(re.findall(r"(?<!\\)\{", cell)) == len(re.findall(r"(?<!\\)\}", cell))


def test_each_table_has_a_file_and_old_ones_go(tmp_path: Path) -> None:
    one = Table(["a", "b"], [["1", "2"]])
    report = tmp_path / "report.md"
    report.write_text(f"# R\n\n{one}\n\n{one}\n\n## Größe φ\n\n{one}\n", encoding="utf-8")
    folder = write_tables(report)
    assert sorted(path.name for path in folder.iterdir()) == ["gr-e-1.tex", "r-1.tex", "r-2.tex"]
    report.write_text(f"# R\n\n{one}\n", encoding="utf-8")
    write_tables(report)
    assert [path.name for path in folder.iterdir()] == ["r-1.tex"]


def test_tables_of_a_reports_details_are_written_too(tmp_path: Path) -> None:
    table = "## {}\n\n| a | b |\n|---|---|\n| 1 | 2 |\n"
    (tmp_path / "report.md").write_text(table.format("Short"), encoding="utf-8")
    (tmp_path / "details.md").write_text(table.format("Long"), encoding="utf-8")
    assert {path.name for path in write_tables(tmp_path / "report.md").iterdir()} == {
        "short-1.tex",
        "long-1.tex",
    }
