"""Tables taken from the code, so that each has one source.

``{registry} vsconstraints.robots:READY_MADE`` lists what has a name, with its text, its question,
or the first line of its docstring. ``{options} vsconstraints.controllers:SlidingMode`` lists the
options of a class, with their defaults and descriptions. ``{commands}`` lists the commands of the
command line.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import Any

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from vsconstraints.cli import app
from vsconstraints.controllers import CONTROLLERS, Law


def imported(name: str) -> Any:
    """Import the object ``module:name``."""
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)


def table(
    headings: Iterable[str], lines: Iterable[Iterable[nodes.Node]], widths: list[int]
) -> nodes.table:
    """Build a table of nodes."""
    group = nodes.tgroup("", *(nodes.colspec(colwidth=width) for width in widths), cols=len(widths))
    group += nodes.thead("", _row(nodes.paragraph("", heading) for heading in headings))
    group += nodes.tbody("", *(_row(line) for line in lines))
    return nodes.table("", group)


def _row(cells: Iterable[nodes.Node]) -> nodes.row:
    return nodes.row("", *(nodes.entry("", cell) for cell in cells))


def _code(text: str) -> nodes.paragraph:
    return nodes.paragraph("", "", nodes.literal(text, text))


def prose(text: str) -> nodes.paragraph:
    """Build a paragraph in which double backticks mean code, and roles are left out."""
    paragraph = nodes.paragraph()
    text = re.sub(
        r":\w+:`~?([^`]*)`",
        lambda role: f"``{role[1].rpartition('.')[2]}``",
        " ".join(text.split()),
    )
    for i, part in enumerate(re.split(r"``", text)):
        paragraph += nodes.literal(part, part) if i % 2 else nodes.Text(part)
    return paragraph


class Registry(SphinxDirective):
    """Directive that lists a dictionary of names, or the one that a function returns."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write one line for each name."""
        lines = []
        registry = imported(self.arguments[0])
        if callable(registry):
            registry = registry()
        for name, thing in registry.items():
            text = (
                thing
                if isinstance(thing, str)
                else getattr(thing, "question", None) or _first_line(thing)
            )
            lines.append([_code(str(name)), prose(text)])
        return [table(("name", "what"), lines, [25, 75])]


def _first_line(thing: object) -> str:
    return (inspect.getdoc(thing) or "").partition("\n")[0]


class Options(SphinxDirective):
    """Directive that lists the options of a class."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Write one line for each option."""
        made = imported(self.arguments[0])
        described = {**meanings(made), **parameters(inspect.getdoc(made) or "")}
        lines = []
        for name, option in inspect.signature(made).parameters.items():
            default = "none" if option.default is None else repr(option.default).strip("'")
            lines.append([_code(name), _code(default), prose(described[name])])
        return [table(("option", "default", "what"), lines, [20, 15, 65])]


class Commands(SphinxDirective):
    """Directive that lists the commands of the command line, with arguments and options."""

    def run(self) -> list[nodes.Node]:
        """Write one table for each command."""
        found: list[nodes.Node] = []
        for name, command in typer.main.get_command(app).commands.items():
            section = nodes.section("", ids=[nodes.make_id(f"command-{name}")], names=[])
            section += nodes.title("", "", nodes.literal("", f"vsconstraints {name}"))
            example, _, text = (command.help or "").strip().partition("\n\n")
            section += _code(example.removeprefix("Example: "))
            section += nodes.paragraph("", text)
            lines = [
                [_code(self._shown(given)), prose(getattr(given, "help", "") or "")]
                for given in command.params
            ]
            if lines:
                section += table(("argument or option", "what"), lines, [35, 65])
            found.append(section)
        return found

    @staticmethod
    def _shown(given: Any) -> str:
        if given.param_type_name == "argument":
            return str(given.name).upper()
        return ", ".join(given.opts)


def parameters(doc: str) -> dict[str, str]:
    """Return the descriptions in the section Parameters of a numpy docstring."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", doc, flags=re.S | re.M)
    found = re.findall(r"^(\w.*)\n((?:[ \t]+.*\n?|\n)+)", section[1] if section else "", flags=re.M)
    return {name.strip(): text for names, text in found for name in names.split(",")}


def meanings(made: Any) -> dict[str, str]:
    """Return the meanings of options, from the metadata of their fields.

    The options are those of a dataclass, or of the demand and the resolver of a law.
    """
    law = made() if made in CONTROLLERS.values() else None
    parts = [law.demand, law.resolver] if isinstance(law, Law) else [made]
    found = {field.name: field for part in parts if is_dataclass(part) for field in fields(part)}
    return {
        name: f"{field.metadata['meaning']}."
        for name, field in found.items()
        if "meaning" in field.metadata
    }


def setup(sphinx: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    sphinx.add_directive("registry", Registry)
    sphinx.add_directive("options", Options)
    sphinx.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
