"""Application of the command line: the commands that all parts register."""

from __future__ import annotations

import inspect
from typing import Annotated

import typer

from .. import __version__
from ..plugins.registry import Command, Group, Part, in_order, load, parts_with_packages, registered
from . import options
from .terminal import console

_HELP = "Compare controllers that keep visual servoing inside its limits."
app = typer.Typer(help=_HELP, no_args_is_help=True, pretty_exceptions_enable=False)


def commands() -> dict[str, Command]:
    """Return all commands by name, in the order in which ``--help`` shows them."""
    found: dict[str, Command] = registered("commands")
    return in_order(found, {name: command.before for name, command in found.items()})


def _declare(name: str, command: Command, part: Part, to: typer.Typer, panel: str | None) -> None:
    """Add a command of a part to the application or to a group."""
    function = load(command.function)
    text = inspect.getdoc(function) or ""
    example = f"Example: vsconstraints {name} {command.example}"
    declare = to.command(
        name.rpartition(" ")[2],
        help=options.literal(f"{example}\n\n{text}"),
        short_help=text.partition("\n")[0],
        rich_help_panel=panel,
    )
    declare(options.described(name, function, part.options))


def _declare_all() -> None:
    """Add the commands and groups of all parts."""
    found = commands()
    owner = {name: part for _, part in parts_with_packages() for name in part.commands}
    about: dict[str, Group] = registered("groups")
    groups = dict[str, typer.Typer]()
    for name, command in found.items():
        group = name.rpartition(" ")[0]
        if not group:
            _declare(name, command, owner[name], app, command.panel)
            continue
        if group not in groups:
            text, example = about[group]
            example = f"Example: vsconstraints {group} {example}"
            groups[group] = typer.Typer(no_args_is_help=True, help=f"{example}\n\n{text}")
            app.add_typer(groups[group], name=group, short_help=text, rich_help_panel=command.panel)
        _declare(name, command, owner[name], groups[group], None)


def _version(value: bool) -> None:
    if value:
        console.print(f"vsconstraints {__version__}")
        raise typer.Exit


_Version = Annotated[
    bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
]


@app.callback(help=_HELP)
def _options(version: _Version = False) -> None: ...


_declare_all()
