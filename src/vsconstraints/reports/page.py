"""A report as Markdown and as a page for a browser or a phone; details are folded, or in a second file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from ..comparisons.runs.files import replaced
from .markdown import PAGE, bold, bullets, code, page_widths, plain

if TYPE_CHECKING:
    from markdown_it.token import Token

TEMPLATES = Path(__file__).parent / "templates"

PHONE = 358
"""A table that is no wider stays one on a phone, which is 390 px wide with its margins [px]."""

BESIDE = re.compile(r"(?!/|[\w.+-]+:).+")
"""Where figures are: beside the page. An address of anything else in a network would tell who reads it."""

ANCHOR = re.compile(r'<a id="[\w.%-]+">')
"""A place that links lead to."""

OPENING = re.compile(r"<details><summary>([^<>\n]*)</summary>")
"""The line that begins details, which end with the line ``</details>``; with anchors the only HTML in a report."""

DETAILS = re.compile(rf"^{OPENING.pattern}\n\n(.*?)\n\n</details>\n*", re.MULTILINE | re.DOTALL)

MIN_SECTIONS = 4
"""From so many sections on a page has a list of them."""


def render(template: str, **context: Any) -> str:
    """The text of a Markdown template; nothing is escaped: values from elsewhere must be ``plain`` or ``code``."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"bold": bold, "bullets": bullets, "code": code, "plain": plain}
    text = environment.get_template(template).render(context)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def write_pages(report: Path, text: str) -> None:
    """Write a report's Markdown and the page made from it; each whole or not at all.

    Parameters
    ----------
    report
        Where the Markdown goes; the page is :func:`page_of` it. Details, which the page folds, have a file of their
        own, ``details.md``.
    text
        The report.

    Raises
    ------
    OSError
        if they cannot be written.
    """
    short, details = split_details(text)
    for path, content in ((report, short), (details_of(report), details), (page_of(report), html_page(text))):
        if content:
            with replaced(path) as part:
                part.write_text(content, encoding="utf-8")


def split_details(text: str) -> tuple[str, str]:
    """A report without its details, and its details with their headings; the latter empty where there are none."""
    title = text.partition("\n")[0]
    details = "\n".join(f"## {found[1]}\n\n{found[2]}\n" for found in DETAILS.finditer(text))
    short = DETAILS.sub(lambda found: f"[{found[1]}](details.md#{_slug(found[1])})\n\n", text)
    return short, f"{title}: details\n\n{details.replace('](#', '](report.md#')}" if details else ""


def details_of(report: Path) -> Path:
    """Where the details of a report are."""
    return report.with_name("details.md")


def page_of(report: Path) -> Path:
    """Where the page of a report is."""
    return report.with_suffix(".html")


def where(report: Path) -> str:
    """Where both are, for a terminal."""
    return f"Report: {report}; as a page: {page_of(report)}"


def html_page(text: str) -> str:
    """A report in Markdown as one HTML file, without scripts and without anything from a network.

    Links stay as they are: figures, tables and replays are found beside the page. Whatever looks like HTML in the text
    is shown as it stands, but for anchors and details. Cells have the heading of their column as ``data-label``: where
    a window is too narrow for a table, its lines are shown as lists of headings and values.
    """
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"xhtmlOut": False}).enable("table")
    tokens = parser.parse(text)
    _disarm(tokens)
    headings = _named_headings(tokens)
    _label_tables(tokens)
    _link_images(tokens)
    first = next((heading.place for heading in headings if heading.tag == "h2"), len(tokens))
    before, after = (parser.renderer.render(part, parser.options, {}) for part in (tokens[:first], tokens[first:]))
    sections = sum(heading.tag == "h2" for heading in headings)
    page = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True).get_template("page.html")
    return page.render(
        title=next((heading.text for heading in headings), "Report"),
        style=(TEMPLATES / "page.css").read_text(encoding="utf-8"),
        before=before,
        contents=[one for one in headings if one.tag in ("h2", "h3")] if sections >= MIN_SECTIONS else [],
        after=after,
    )


def _disarm(tokens: Sequence[Token]) -> None:
    """Make text of everything that would be HTML, but for anchors and details, and of pictures from elsewhere."""
    opened: Token | None = None
    for token in tokens:
        if token.type == "html_block":
            line, kind = token.content.strip(), token.type
            token.type = "code_block"
            if opened is None and token.level == 0 and OPENING.fullmatch(line):
                opened = token
            elif opened is not None and token.level == 0 and line == "</details>":
                opened.type = token.type = kind
                opened = None
        children = token.children or []
        for k, child in enumerate(children):
            if child.type == "html_inline":
                opens = ANCHOR.fullmatch(child.content) and [one.content for one in children[k + 1 : k + 2]] == ["</a>"]
                closes = child.content == "</a>" and k > 0 and children[k - 1].type == "html_inline"
                if not opens and not closes:
                    child.type = "text"
            elif child.type == "image" and not BESIDE.fullmatch(str(child.attrs["src"])):
                child.type, child.content = "text", f"![{child.content}]({child.attrs['src']})"


@dataclass(frozen=True)
class Heading:
    """A heading of a page: where its token is, ``h1`` to ``h6``, its text without emphasis, and its ``id``."""

    place: int
    tag: str
    text: str
    name: str


def _named_headings(tokens: Sequence[Token]) -> list[Heading]:
    """Give headings the names by which GitHub knows them, where no place has that name."""
    taken = {place for token in tokens for place in re.findall(r'<a id="([\w.%-]+)">', token.content)}
    headings = []
    for k, token in enumerate(tokens):
        if token.type == "heading_open":
            text = _plain(tokens[k + 1])
            slug = _slug(text)
            name = next(one for n in range(len(tokens)) if (one := f"{slug}-{n}" if n else slug) not in taken)
            taken.add(name)
            token.attrSet("id", name)
            headings.append(Heading(k, token.tag, text, name))
    return headings


def _slug(heading: str) -> str:
    """The name by which GitHub knows a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def _label_tables(tokens: Sequence[Token]) -> None:
    """Say in every cell what its column is; of every table whether it fits a phone, and a screen without breaks."""
    for first, last in _tables(tokens):
        rows: list[list[int]] = []
        for k in range(first, last):
            if tokens[k].type == "tr_open":
                rows.append([])
            elif tokens[k].type in ("th_open", "td_open"):
                rows[-1].append(k)
        header, *lines = rows
        for line in lines:
            for above, k in zip(header, line, strict=True):
                if label := _plain(tokens[above + 1]):
                    tokens[k].attrSet("data-label", label)
        left = sum("left" in str(tokens[k].attrGet("style")) for k in header)
        texts = [[tokens[k + 1].content for k in row] for row in rows]
        narrow = sum(page_widths(texts[0], texts[1:], left)) <= PHONE
        whole = sum(page_widths(texts[0], texts[1:], 0)) <= PAGE
        tokens[first].attrSet("class", ("narrow" if narrow else "wide") + (" whole" if whole else ""))


def _tables(tokens: Sequence[Token]) -> Iterator[tuple[int, int]]:
    begin = 0
    for k, token in enumerate(tokens):
        if token.type == "table_open":
            begin = k
        elif token.type == "table_close":
            yield begin, k


def _link_images(tokens: Sequence[Token]) -> None:
    """Make each figure a link to its file: whoever wants to see more of it on a phone opens it alone."""
    from markdown_it.token import Token

    for token in tokens:
        children = token.children or []
        if any(child.type == "image" for child in children) and not any(
            child.type == "link_open" for child in children
        ):
            token.children = []
            for child in children:
                if child.type == "image":
                    opened = Token("link_open", "a", 1, attrs={"href": child.attrs["src"]})
                    token.children += [opened, child, Token("link_close", "a", -1)]
                else:
                    token.children.append(child)


def _plain(inline: Token) -> str:
    """What a line says, without emphasis, links and places."""
    said = (child.content if child.type in ("text", "code_inline") else " " for child in inline.children or [])
    return " ".join("".join(said).split())
