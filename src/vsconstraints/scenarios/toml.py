"""TOML files: reading, checks that TOML does not require, and overrides of single keys."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, unknown_name
from ..plugins.regular_files import read_regular

#: Tables that state the place of a camera; one of them is allowed.
PLACES = ("mount", "fixed", "camera_in_tip", "tip_in_camera", "camera_in_base", "base_in_camera")
#: Tables that may be missing from a file; they are created when a key in them is overridden.
OPTIONAL = (
    "disturbances",
    "tolerances",
    "motion",
    "distortion",
    "plant",
    "sensor",
    "payload",
    "friction",
    *PLACES,
)

BY_TYPE = ("sensor",)  #: tables that may be abbreviated to their ``type``
MAX_DEPTH = 30  #: largest nesting depth of tables and lists in a file


def read_toml(path: Path) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises ConfigurationError, which names the file, if it cannot be read.
    """
    try:
        str(path.absolute()).encode()  # results store the path in UTF-8
        # some editors begin files with a byte order mark
        text = read_regular(path).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot read {os.fspath(path)}: {error}") from error
    return parse_toml(text, os.fspath(path))


def file_named(
    what: str, name: str, shipped: Path, names: Sequence[str], base: Path | None
) -> Path:
    """Return the path of a shipped file by name, or a path relative to ``base``.

    ``names`` are the files in the folder ``shipped``. Raises ConfigurationError, which names
    ``what`` and the known names, if the name is unknown.
    """
    if name.endswith(".toml"):
        return (base or Path()) / name
    if name not in names:
        raise unknown_name(what, name, [*names, "a path ending in .toml"])
    return shipped / f"{name}.toml"


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises ConfigurationError, which names ``where``, if the text is not TOML, an integer is too
    large or the nesting is too deep.
    """
    too_deep = f"{where}: tables and lists lie in each other more than {MAX_DEPTH} levels deep"
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(f"{where} is not TOML: {error}") from error
    except RecursionError as error:
        raise ConfigurationError(too_deep) from error
    except ValueError as error:  # an integer with too many digits
        raise ConfigurationError(f"{where}: {error}") from error
    level: list[Any] = [tables]
    for _ in range(MAX_DEPTH + 1):
        level = [
            value
            for outer in level
            for value in (outer.values() if isinstance(outer, dict) else outer)
        ]
        for value in level:
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise ConfigurationError(
                    f"{where}: integers have at most 64 bits, not {value.bit_length()}"
                )
        level = [value for value in level if isinstance(value, (dict, list))]
    if level:
        raise ConfigurationError(too_deep)
    return tables


def toml_items(table: Mapping[str, Any]) -> list[str]:
    """Return each key of a table with its value, as TOML text."""
    return [
        f"{key if re.fullmatch('[A-Za-z_][A-Za-z0-9_]*', key) else toml_text(key)} = "
        f"{toml_text(table[key])}"
        for key in table
    ]


def toml_text(value: Any) -> str:
    """Return a value as TOML text on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_items(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_text, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def override(table: dict[str, Any], key: str, value: object, where: str) -> None:
    """Set a dotted key such as ``task.Kp0`` or ``constraints.0.K`` in nested tables, in place.

    The tables on the path must exist or belong to :data:`OPTIONAL`. A type that stands for a table
    is expanded to that table. The last key is checked by the code that reads the table.
    """
    parent: Any = table
    *way, last = key.split(".")
    for name in way:
        parent = _child(parent, name, where)
    if isinstance(parent, list):
        _child(parent, last, where)
        parent[int(last)] = value
    elif isinstance(parent, dict):
        parent[last] = value
    else:
        raise ConfigurationError(f"{where}: {key!r} does not lead to a table")


def merged(under: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Return ``over`` merged into ``under``: nested tables are merged, other values replaced."""
    result = dict(under)
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = merged(result[key], value) if both else value
    return result


def _child(parent: Any, name: str, where: str) -> Any:
    """Return the entry of a list or table; raise ConfigurationError, with candidates, if unknown.

    A missing optional table is added. A table given as a text is one of that type.
    """
    if isinstance(parent, list):
        numbers = [str(i) for i in range(len(parent))]
        is_number = name.isascii() and name.isdecimal()
        if not is_number or int(name) >= len(parent):
            raise unknown_name(f"entry of a list in {where}", name, numbers)
        return parent[int(name)]
    tables = parent if isinstance(parent, dict) else {}
    is_known = name in tables or name in OPTIONAL
    if not isinstance(parent, dict) or not is_known:
        raise unknown_name(f"table in {where}", name, tables)
    if name in BY_TYPE and isinstance(parent.get(name), str):
        parent[name] = {"type": parent[name]}
    return parent.setdefault(name, {})
