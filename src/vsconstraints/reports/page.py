"""Reports as Markdown and as an HTML page; details are folded, or in a second file."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markdown_it import MarkdownIt
from markdown_it.common.utils import escapeHtml
from markdown_it.token import Token
from markupsafe import Markup

from ..comparisons.runs.files import replaced
from ..rows.readable import counted
from .markdown import Table, bold, bullets, code, enumeration, first_names, plain
from .numbers import DASH, median, number, of_length, over_trials, percent, percentage

TEMPLATES = Path(__file__).parent / "templates"
#: Addresses of figures: only files beside the page. A network address would reveal the reader.
BESIDE = re.compile(r"(?!/|[\w.+-]+:).+")
#: Target of links; with details the only HTML in a report.
ANCHOR = re.compile(r'<a id="([\w.%-]+)"></a>')
ESCAPED_ANCHOR = re.compile(escapeHtml(ANCHOR.pattern))
SECTION = ("heading_open", "h2")  #: Type and tag of the token that begins a section.
NUMBER = r"[<≈±]?[−-]?\d[\d.]*(?:e[−-]?\d+)?"
#: Text that is not broken at the end of a line: intervals, ranges and plain numbers.
WHOLE = re.compile(
    rf"\([−\d][−\d.– to%]*\)|[(\[]?{NUMBER}(?:–{NUMBER})+[)\]]?|^[(\[]?{NUMBER}[)\]]?$"
)
DETAILS = re.compile(
    r"^<details><summary>([^<>\n]*)</summary>\n\n(.*?)\n\n</details>\n*", re.MULTILINE | re.DOTALL
)
MIN_SECTIONS = 4  #: Least number of sections for which a page lists its sections.


def render(template: Path, **context: Any) -> str:
    """Render a Markdown template, which may include those beside it and those of this package.

    Nothing is escaped: values from elsewhere must be passed through ``plain`` or ``code``.
    """
    environment = Environment(
        loader=FileSystemLoader([template.parent, TEMPLATES]),
        extensions=["jinja2.ext.do"],
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for text_filter in (bold, bullets, code, enumeration, number, percentage, plain):
        environment.filters[text_filter.__name__] = text_filter
    environment.filters["table"] = _table
    for function in (counted, first_names, median, of_length, over_trials, percent):
        environment.globals[function.__name__] = function
    environment.globals["dash"] = DASH
    text = environment.get_template(template.name).render(context)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _table(text: str, text_columns: int = 1) -> str:
    """Return lines of cells separated by ¦ as a table, empty if only the header is given."""
    rows = []
    for line in text.splitlines():
        if line.strip():
            rows.append([cell.strip() for cell in line.split("¦")])
    header, *lines = rows
    return f"{Table(header, lines, text_columns)}\n" if lines else ""


def render_html(template: Path, **context: Any) -> str:
    """Render an HTML template; values are escaped."""
    environment = Environment(
        loader=FileSystemLoader(template.parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    inline = parser(html=False).renderInline  # escapes HTML
    environment.filters |= {"percentage": percentage, "markdown": lambda text: Markup(inline(text))}
    return environment.get_template(template.name).render(context)


def write_pages(
    report: Path,
    text: str,
    interactive: Mapping[str, str] = MappingProxyType({}),
    script: str = "",
) -> None:
    """Write a report without its details, the details to :func:`details_of` it, and its page.

    ``interactive`` maps summaries of details to HTML. On the page this HTML replaces the details
    of that summary and is not folded; ``script`` is the script that it needs. Raises OSError.
    """

    def link(found: re.Match[str]) -> str:
        return f"[{found[1]}](details.md#{_slug(found[1])})\n\n"

    contents = {
        report: DETAILS.sub(link, text),
        page_of(report): html_page(text, interactive, script),
    }
    details = []
    for summary, content in DETAILS.findall(text):
        details.append(f"## {summary}\n\n{content}\n")
    if details:
        title = text.partition("\n")[0]
        sections = "\n".join(details).replace("](#", "](report.md#")
        contents[details_of(report)] = f"{title}: details\n\n{sections}"
    for path, content in contents.items():
        with replaced(path) as part:
            part.write_text(content, encoding="utf-8")


def details_of(report: Path) -> Path:
    """Return the path of the details of a report."""
    return report.with_name("details.md")


def page_of(report: Path) -> Path:
    """Return the path of the page of a report."""
    return report.with_suffix(".html")


def where(report: Path) -> str:
    """Return the paths of a report and of its page as a line for a terminal."""
    return f"Report: {report}; as a page: {page_of(report)}"


def parser(html: bool = True) -> MarkdownIt:
    """Return a parser for reports."""
    return MarkdownIt("commonmark", {"html": html, "xhtmlOut": False}).enable("table")


def html_page(
    text: str, interactive: Mapping[str, str] = MappingProxyType({}), script: str = ""
) -> str:
    """Return a report in Markdown as one HTML file that needs no network.

    The only script is that of the ``interactive`` parts, which are HTML and not escaped; see
    :func:`write_pages`. Anything else that looks like HTML is shown literally, except anchors and
    details. Figures, tables and replays are files beside the page. In a window that is too narrow
    for a table, its lines are shown as lists of headings and values.
    """
    markdown = parser(html=False)
    markdown.add_render_rule("image", _image)
    markdown.add_render_rule("text", _text)
    tokens: list[Token] = []
    summary = ""
    for k, part in enumerate(DETAILS.split(text)):  # text, summary, details, text, …
        if k % 3 == 0:
            tokens += markdown.parse(part)
        elif k % 3 == 1:
            summary = part
        elif summary in interactive:
            tokens.append(_html_block(interactive[summary]))
        else:
            tokens.append(_html_block(f"<details><summary>{summary}</summary>\n"))
            tokens += markdown.parse(part)
            tokens.append(_html_block("</details>\n"))
    headings = _labelled(tokens, set(ANCHOR.findall(text)))
    # The list of contents stands before the first section.
    first = 0
    while first < len(tokens) and (tokens[first].type, tokens[first].tag) != SECTION:
        first += 1

    def html(part: Sequence[Token]) -> str:
        rendered = markdown.renderer.render(part, markdown.options, {})
        return ESCAPED_ANCHOR.sub(r'<a id="\1"></a>', rendered)

    contents = [heading for heading in headings if heading["tag"] in ("h2", "h3")]
    if sum(heading["tag"] == "h2" for heading in contents) < MIN_SECTIONS:
        contents = []
    return render_html(
        TEMPLATES / "page.html",
        title=headings[0]["text"] if headings else "Report",
        style=(TEMPLATES / "page.css").read_text(encoding="utf-8"),
        before=html(tokens[:first]),
        contents=contents,
        after=html(tokens[first:]),
        script=script,
        digest=b64encode(sha256(script.encode()).digest()).decode(),
    )


def _html_block(content: str) -> Token:
    return Token("html_block", "", 0, content=content)


def _image(renderer: Any, tokens: Sequence[Token], k: int, options: Any, env: Any) -> str:
    """Return a figure as a link to its file, so that it can be enlarged on a phone.

    Pictures from other places are shown as text.
    """
    token = tokens[k]
    source = str(token.attrs["src"])
    if not BESIDE.fullmatch(source):
        return escapeHtml(f"![{token.content}]({source})")
    picture = renderer.image(tokens, k, options, env)
    return f'<a href="{escapeHtml(source)}">{picture}</a>'


def _text(renderer: Any, tokens: Sequence[Token], k: int, options: Any, env: Any) -> str:
    """Return escaped text in which numbers are not broken across lines."""
    escaped = escapeHtml(tokens[k].content)
    return WHOLE.sub(r'<span class="whole">\g<0></span>', escaped)


def _slug(heading: str) -> str:
    text = re.sub(r"[^\w\- ]", "", heading.lower())
    return text.replace(" ", "-")


def _labelled(tokens: Sequence[Token], taken: set[str]) -> list[dict[str, str]]:
    """Label headings and tables of a page; return tag, text and name of each heading.

    Each heading gets the ``id`` by which GitHub knows it, with a number appended if that is taken.
    Each cell gets the heading of its column, and each table a class for wide or narrow tables.
    """
    headings: list[dict[str, str]] = []
    header: list[str] = []
    for k, token in enumerate(tokens):
        if token.type == "heading_open":
            text = _plain(tokens[k + 1])
            slug = _slug(text)
            name = slug
            repetition = 0
            while name in taken:
                repetition += 1
                name = f"{slug}-{repetition}"
            taken.add(name)
            token.attrSet("id", name)
            headings.append({"tag": token.tag, "text": text, "name": name})
        elif token.type == "table_open":
            table = token
            header = []
        elif token.type == "th_open":
            header.append(_plain(tokens[k + 1]))
        elif token.type == "thead_close":
            table.attrSet("class", "wide" if len(header) > 2 else "narrow")
        elif token.type == "tr_open":
            column = iter(header)
        elif token.type == "td_open" and (label := next(column)):
            token.attrSet("data-label", label)
    return headings


def _plain(inline: Token) -> str:
    """Return the text of a line without emphasis, links and anchors."""
    text = ""
    for child in inline.children or []:
        has_text = child.type in ("text", "code_inline")
        text += child.content if has_text else " "
    without_anchors = ANCHOR.sub("", text)
    return " ".join(without_anchors.split())
