"""The page of a report: it says what the Markdown says, runs nothing, and fits a screen as it fits
a phone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import html5lib
import pytest
from checks import drawing
from hypothesis import given, settings
from hypothesis import strategies as st

from browser import NAMES, browser, program
from documents import ROOT
from test_reports import made, result
from vsconstraints.comparisons import Suite, compare
from vsconstraints.reports import write_report
from vsconstraints.reports.page import html_page, page_of, write_pages

KEPT = sorted((ROOT / "reports").glob("*/report.md"))
ARMED = (
    '<script>stolen = 1</script>', '<img src="x" onerror="stolen = '
                                   '1">', "<b>", "</main>", "</a>", '<a id="x">',
    '<a id="x" onclick="stolen = '
    '1"></a>', "[here](javascript:stolen=1)", "![there](javascript:stolen=1)", "&lt;i&gt;",
    "<!-- ", "<style>", "\n<details>\n",
    "\n</details>\n\n", "\n<details><summary>x</summary>\n\n", "> <details><summary>y</summary>\n",
    "| a |\n|---|\n| <script> |\n", "\n\n<div>\n\n", "`<u>`", "\n## <h1>\n", '" onload="', "\n",
)  # fmt: skip
"""What a text from elsewhere could bring."""

HARMLESS = {
    "html", "head", "meta", "link", "title", "style", "body", "main", "nav", "h1", "h2", "h3", "h4", "h5", "h6", "p",
    "ul", "ol", "li", "a", "img", "strong", "em", "code", "pre", "table", "thead", "tbody", "tr", "th", "td", "br",
    "hr", "blockquote", "details", "summary", "span",
}  # fmt: skip


def parsed(page: str) -> Any:
    """The page as another library reads it, without a single error of the HTML standard."""
    parser = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False)
    return parser.parse(page)


def said(element: Element) -> str:
    return " ".join("".join(element.itertext()).split())


def markdown_cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def without_marks(text: str) -> str:
    """What a reader sees of a cell, whose names never contain stars, backslashes or backticks."""
    text = re.sub(r'<a id="[^"]*"></a>', "", text)
    text = re.sub(r"\[((?:[^\]\\]|\\.)*)\]\([^)]*\)", r"\1", text)
    return " ".join(unescape(re.sub(r"[*`\\]", "", text)).split())


@pytest.mark.parametrize("report", KEPT, ids=lambda path: path.parent.name)
def test_every_table_is_in_the_page_with_the_same_cells(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    blocks = re.findall(r"(?:^\|.*\n?)+", text, flags=re.MULTILINE)
    tables = list(parsed(html_page(text)).iter("table"))
    assert len(tables) == len(blocks) > 5
    for table, block in zip(tables, blocks, strict=True):
        header, _, *lines = map(markdown_cells, block.splitlines())
        rows = [list(row) for row in table.iter("tr")]
        assert [[said(cell) for cell in row] for row in rows] == [
            [without_marks(cell) for cell in line] for line in (header, *lines)
        ]
        for row, line in zip(rows[1:], lines, strict=True):
            assert [cell.get("data-label", "") for cell in row] == [
                without_marks(cell) for cell in header
            ]
            bold = [re.fullmatch(r"\*\*[^*]+\*\*", cell) is not None for cell in line]
            assert [
                said(cell) != "" and [said(one) for one in cell.iter("strong")] == [said(cell)]
                for cell in row
            ] == bold


@pytest.mark.parametrize(
    ("cell", "whole"),
    [
        ("(98.13)", ["(98.13)"]),
        ("−0.0123", ["−0.0123"]),
        ("1.23e−5", ["1.23e−5"]),
        ("96.1 [95.2–97.3]", ["[95.2–97.3]"]),
        ("<0.001 / 1.2 [0.4–3]", ["[0.4–3]"]),
        ("2.3 (−0.1 to 5.7)", ["(−0.1 to 5.7)"]),
        ("12 of 12 (75–100 %)", ["(75–100 %)"]),
        ("late-36", []),
        ("ur5-fov", []),
    ],
)
def test_no_line_ends_inside_a_number(cell: str, whole: list[str]) -> None:
    page = parsed(html_page(f"# Title\n\n| a | b |\n|---|---|\n| x | {cell} |\n"))
    spans = [said(one) for one in page.iter("span") if one.get("class") == "whole"]
    assert spans == whole


@pytest.mark.parametrize("report", KEPT, ids=lambda path: path.parent.name)
def test_whatever_a_page_links_to_is_there(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    page = parsed(html_page(text))
    names = [element.get("id") for element in page.iter() if element.get("id")]
    assert len(names) == len(set(names))
    assert said(next(page.iter("title"))) == text.splitlines()[0].removeprefix("# ")
    addresses = [
        element.get("href") or element.get("src") or ""
        for tag in ("a", "img")
        for element in page.iter(tag)
    ]
    for address in filter(None, addresses):
        if address.startswith("#"):
            assert unquote(address[1:]) in names
        elif not address.startswith("https://"):
            assert (report.parent / unquote(address).partition("#")[0]).is_file(), address
    shown = [image.get("src") for image in page.iter("img")]
    assert shown == re.findall(r"!\[[^\]]*\]\(([^)]*)\)", text)
    # each is opened alone by a click on it
    assert [link.get("href") for link in page.iter("a") if list(link.iter("img"))] == shown


def elements(page: str) -> Iterator[tuple[str, dict[str, str]]]:
    for element in parsed(page).iter():
        if isinstance(element.tag, str):
            yield element.tag, dict(element.items())


@settings(max_examples=40)
@given(st.lists(st.sampled_from(ARMED) | st.text(max_size=5), max_size=8))
def test_nothing_from_elsewhere_runs(pieces: list[str]) -> None:
    parser = html5lib.HTMLParser(namespaceHTMLElements=False)
    page = parser.parse(html_page("# A report\n\n" + "".join(pieces)))
    for element in page.iter():
        if not isinstance(element.tag, str):
            continue
        assert element.tag in HARMLESS, element.tag
        assert not [name for name, _ in element.items() if name.startswith("on")]
        assert (
            not (element.get("href") or element.get("src") or "").lower().startswith("javascript:")
        )
    # what would end the page early, or a part of it, does not
    assert [child.tag for child in next(page.iter("body"))] == ["main"]


def test_a_scenario_called_like_a_script_is_shown_as_it_is_called(tmp_path: Path) -> None:
    name = "<script>stolen = 1</script>"
    lines = [result("sliding-mode", reason="<img src=x onerror=stolen>", status="failed")]
    report = write_report(made(tmp_path, lines, tables={"title": name}), figures=False)
    page = page_of(report).read_text(encoding="utf-8")
    found = list(elements(page))
    assert "script" not in {tag for tag, _ in found}
    assert not [attributes for tag, attributes in found if tag == "img" or "onerror" in attributes]
    assert "&lt;script&gt;stolen = 1&lt;/script&gt;" in page
    assert "&lt;img src=x onerror=stolen&gt;" in page


def test_a_page_that_does_not_fit_leaves_the_one_before(tmp_path: Path) -> None:
    write_pages(tmp_path / "report.md", "# One\n")
    before = page_of(tmp_path / "report.md").read_bytes()
    (tmp_path / "report.html.part").symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"):
        write_pages(tmp_path / "report.md", "# Two\n")
    assert page_of(tmp_path / "report.md").read_bytes() == before


def test_the_time_that_a_report_takes_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = made(tmp_path / "made", [result("sliding-mode", "one"), result("sliding-mode", "two")])
    write_report(folder, figures=False)
    assert drawing.main([str(folder)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines if line[0] != " "] == [
        "reading", "figures of scenarios", "figures of the whole", "report.html",
    ]  # fmt: skip
    assert drawing.main([]) == 2


WIDER = """
[...document.querySelectorAll('body *')].filter(e => {
  const box = e.getBoundingClientRect();
  return box.right > innerWidth + 0.5 || box.left < -0.5 || e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0;
}).map(e => e.outerHTML.slice(0, 200))
"""
"""What a reader would have to scroll sideways for, or what is cut."""

CARDS = """
[...document.querySelectorAll('table.wide td:not(:first-child):not(:empty)')]
  .map(e => [getComputedStyle(e, '::before').content, e.dataset.label || ''])
"""


@pytest.mark.skipif(
    program() is None, reason=f"no browser: none of {', '.join(NAMES)} is installed"
)
def test_nothing_is_cut_or_scrolls_sideways(tmp_path: Path) -> None:
    folder = tmp_path / "small"
    compare(
        Suite.load().select(
            ["example-2d-fov"], ["sliding-mode"], settings=["scenario.duration=0.5"]
        ),
        folder,
        workers=1,
    )
    addresses = [page_of(write_report(folder)).as_uri()]
    for report in (one for one in KEPT if one.parent.name in ("default", "evidence", "paper")):
        page = page_of(tmp_path / report.parent.name)
        page.write_text(html_page(report.read_text(encoding="utf-8")), encoding="utf-8")
        addresses.append(page.as_uri())
    with browser(tmp_path / "browser") as page:
        for address in addresses:
            for width in (390, 1012):
                page.ask(
                    "Emulation.setDeviceMetricsOverride",
                    width=width,
                    height=800,
                    deviceScaleFactor=1,
                    mobile=False,
                )
                page.open(f"{address}?{width}")
                page.wait(f"document.readyState === 'complete' && location.search === '?{width}'")
                assert page.value("document.documentElement.scrollWidth") <= width, address
                assert page.value(WIDER) == [], (address, width)
                cards = page.value(CARDS)
                assert cards or address == addresses[0]
                for content, label in cards:
                    assert content == (f'"{label}"' if width < 880 else "none")
            if address == addresses[0]:
                page.wait(
                    "[...document.images].every(image => image.complete && image.naturalWidth > 0)"
                )
                assert page.value("document.images.length") == 3
                assert page.complaints == []
        assert all(url.startswith(("file:", "data:", "about:")) for url in page.requests), (
            page.requests
        )
