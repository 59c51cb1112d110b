"""What ``options.toml`` says of the parameters of commands, and the names that a shell
completes.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from glob import glob
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer

OPTIONS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)

Names = list[str] | None

#: What help calls a value of these types, unless the option has a ``metavar``: short, so that
#: descriptions have room.
METAVARS: dict[str, str] = {"path": "PATH", "str": "NAME", "int": "N", "float": "X", "bool": ""}


def described(name: str, command: Callable[..., None]) -> Callable[..., None]:
    """The function of a command, its parameters annotated with what :data:`OPTIONS` says of
    them.
    """
    known = OPTIONS["shared"] | OPTIONS.get(name, {})
    for parameter, kind in get_type_hints(command).items():
        if parameter not in ("context", "return"):
            table = dict(known[parameter])
            is_argument = table.pop("argument", False)
            declare = typer.Argument if is_argument else typer.Option
            table["help"] = literal(table["help"])
            if not is_argument:  # an argument is called by its name
                table.setdefault("metavar", METAVARS[value_type(kind).__name__.lower()])
            if names := table.pop("names", None):
                table["autocompletion"] = run_names if names == "runs" else completed(*names)
            command.__annotations__[parameter] = Annotated[
                kind, declare(*table.pop("flags", "").split(), **table)
            ]
    return command


def value_type(kind: Any) -> type:
    """Return the type of one value of an option: ``str`` for ``list[str] | None``."""
    parts = [part for part in get_args(kind) if part is not type(None)]
    return value_type(parts[0]) if parts else kind


def literal(text: str) -> str:
    """Return the markup that help shows as this text: [s] is no tag, and FOLDER:FAMILY:SCENE holds
    no emoji.
    """
    from rich.markup import escape

    return re.sub(r":(\w+)(?=:)", r":[none]\1[/none]", escape(text))


def completed(source: str, ending: str = "", files: str = "") -> Callable[[str], list[str]]:
    """What completes a word: the names in ``module:attribute`` of this package, with an ending, and
    files with theirs.

    The module is imported only when the user presses Tab. The attribute is a collection, a function
    that returns one, or a Literal.
    """
    module, _, attribute = source.partition(":")

    def complete(incomplete: str) -> list[str]:
        names = getattr(import_module(f"vsconstraints.{module}"), attribute)
        names = get_args(names) or (names() if callable(names) else names)
        found = [f"{name}{ending}" for name in names if f"{name}{ending}".startswith(incomplete)]
        return found + sorted(glob(f"{incomplete}*{files}") if files else ())

    return complete


def run_names(incomplete: str) -> list[str]:
    """What completes ``SCENARIO:CONTROLLER``, or the file of a stored run.

    A scenario that is the only one to begin like the word comes with its laws: a shell ends a word
    that is complete.
    """
    scenario, colon, controller = incomplete.partition(":")
    scenarios = (
        [scenario] if colon else completed("scenarios:shipped_scenarios", files=".toml")(incomplete)
    )
    files = sorted(glob(f"{incomplete}*.npz"))
    if len(scenarios) == 1 and not files:
        return [
            f"{scenarios[0]}:{name}" for name in completed("controllers:CONTROLLERS")(controller)
        ]
    return [*(f"{name}:" for name in scenarios), *files]
