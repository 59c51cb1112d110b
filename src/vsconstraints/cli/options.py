"""Parameters of commands as described in TOML files, and completion of names in a shell."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from glob import glob
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer

from ..plugins.registry import load

SCENARIOS = "vsconstraints.scenarios:shipped_scenarios"
LAWS = "vsconstraints.controllers:CONTROLLERS"
SHARED = Path(__file__).with_suffix(".toml")  #: Options of the core, which parts share.

Names = list[str] | None

#: Placeholders for values of these types in help, unless the option has a ``metavar``. They are
#: short to leave room for descriptions.
METAVARS: dict[str, str] = {"path": "PATH", "str": "NAME", "int": "N", "float": "X", "bool": ""}


def known_options(name: str, file: Path | None) -> dict[str, Any]:
    """Return the options that a command may have: shared ones, its part's, and its own.

    ``file`` describes the options of the command's part.
    """
    known = dict(_read(SHARED)["shared"])
    of_part = {} if file is None else _read(file)
    return known | of_part.get("shared", {}) | of_part.get(name, {})


@cache
def _read(file: Path) -> dict[str, dict[str, Any]]:
    return tomllib.loads(file.read_text(encoding="utf-8"))


def described(name: str, command: Callable[..., None], file: Path | None) -> Callable[..., None]:
    """Annotate the parameters of a command's function with their descriptions.

    See :func:`known_options` for ``file``.
    """
    known = known_options(name, file)
    for parameter, kind in get_type_hints(command).items():
        if parameter not in ("context", "return"):
            description = _declared(known[parameter], kind)
            command.__annotations__[parameter] = Annotated[kind, description]
    return command


def _declared(description: Mapping[str, Any], kind: Any) -> Any:
    """Return the argument or option of Typer that a table describes, with values of a kind."""
    table = dict(description)
    is_argument = table.pop("argument", False)
    flags = table.pop("flags", "").split()
    names = table.pop("names", None)
    table["help"] = literal(table["help"])
    if names == "runs":
        table["autocompletion"] = run_names
    elif names:
        table["autocompletion"] = completed(*names)
    if is_argument:  # its placeholder is its name
        return typer.Argument(*flags, **table)
    type_name = value_type(kind).__name__.lower()
    table.setdefault("metavar", METAVARS[type_name])
    return typer.Option(*flags, **table)


def value_type(kind: Any) -> type:
    """Return the type of one value of an option: ``str`` for ``list[str] | None``."""
    parts = [part for part in get_args(kind) if part is not type(None)]
    return value_type(parts[0]) if parts else kind


def literal(text: str) -> str:
    """Return markup that help shows as exactly this text.

    Without it, [s] would be a tag, and FOLDER:FAMILY:SCENE would contain an emoji.
    """
    from rich.markup import escape

    return re.sub(r":(\w+)(?=:)", r":[none]\1[/none]", escape(text))


def completed(source: str, ending: str = "", files: str = "") -> Callable[[str], list[str]]:
    """Return a completer for the names in ``module:attribute``.

    Each name gets ``ending``. Files that end in ``files`` are offered too. The module is imported
    only when the user presses Tab. The attribute is a collection, a function that returns one, or a
    Literal.
    """

    def complete(incomplete: str) -> list[str]:
        named = load(source)
        names = get_args(named)
        if not names:
            names = named() if callable(named) else named
        whole = [f"{name}{ending}" for name in names]
        found = [name for name in whole if name.startswith(incomplete)]
        if files:
            found += sorted(glob(f"{incomplete}*{files}"))
        return found

    return complete


def run_names(incomplete: str) -> list[str]:
    """Complete ``SCENARIO:CONTROLLER``, or the file of a stored run.

    If only one scenario matches, it is offered with its laws: otherwise the shell would end the
    word after the scenario.
    """
    scenario, colon, controller = incomplete.partition(":")
    scenarios = [scenario]
    if not colon:
        scenarios = completed(SCENARIOS, files=".toml")(incomplete)
    files = sorted(glob(f"{incomplete}*.npz"))
    if len(scenarios) == 1 and not files:
        return [f"{scenarios[0]}:{name}" for name in completed(LAWS)(controller)]
    return [*(f"{name}:" for name in scenarios), *files]
