"""Reading a TOML table key by key, so that every key is known, typed, and named when it is wrong."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigurationError, shown, unknown_name
from ..rows import Array

REQUIRED: Any = object()
"""Default of a key that must be given."""

OPTIONAL = ("disturbances", "tolerances", "motion", "mount", "fixed")
"""Tables that need not be in a file, and are made when a key in them is overridden."""

DEEPEST = 30
"""Levels of tables and lists in each other that a file may have."""


class Section:
    """One table of a file; each key is taken once, and :meth:`finish` refuses what is left.

    Parameters
    ----------
    table
        What TOML gave.
    where
        File and table, for messages.
    """

    def __init__(self, table: object, where: str) -> None:
        if not isinstance(table, Mapping):
            raise ConfigurationError(f"{where} must be a table, not {shown(table)}")
        self._table, self._where = dict(table), where
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        return key in self._table

    def take(self, key: str, kind: type | tuple[type, ...], default: Any = REQUIRED) -> Any:
        """The value of a key, of one of these types; ``default`` if it is absent."""
        self._known.append(key)
        if key not in self._table:
            if default is REQUIRED:
                raise ConfigurationError(f"{self._where}: the key {key!r} is missing")
            return default
        value = self._table.pop(key)
        kinds = kind if isinstance(kind, tuple) else (kind,)
        if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
            names = " or ".join(_NAMES.get(k, k.__name__) for k in kinds)
            raise ConfigurationError(f"{self._where}: {key} must be {names}, not {shown(value)}")
        return value

    def peek(self, key: str) -> Any:
        """The value of a key as it stands there, not taken; None if it is absent."""
        return self._table.get(key)

    def number(self, key: str, default: Any = REQUIRED) -> Any:
        """A finite number, as float; the default as it is."""
        value = self.take(key, (int, float), default)
        if value is default:
            return value
        try:
            number = float(value)
        except OverflowError:
            number = np.inf
        if not np.isfinite(number):
            raise ConfigurationError(f"{self._where}: {key} must be finite, and less than 1e308")
        return number

    def array(self, key: str, default: Any = REQUIRED, shape: tuple[int | None, ...] = (None,)) -> Any:
        """A finite float array; None in ``shape`` stands for any length."""
        value = self.take(key, list, default)
        if value is default:
            return value
        try:
            array: Array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise ConfigurationError(f"{self._where}: {key} must be numbers, not {shown(value)}") from error
        fits = array.ndim == len(shape) and all(
            wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
        )
        if not fits:
            wanted = " × ".join("any" if length is None else str(length) for length in shape)
            raise ConfigurationError(f"{self._where}: {key} must be {wanted} numbers; it has the shape {array.shape}")
        if not np.isfinite(array).all():
            raise ConfigurationError(f"{self._where}: {key} must be finite")
        return array

    def strings(self, key: str, default: Any = REQUIRED) -> Any:
        """A list of strings; the default as it is."""
        value = self.take(key, list, default)
        if value is not default and not all(isinstance(one, str) for one in value):
            raise ConfigurationError(f"{self._where}: {key} must be strings, not {shown(value)}")
        return value

    def section(self, key: str, default: Any = REQUIRED) -> Section:
        """A table inside this one."""
        return Section(self.take(key, dict, default), f"{self._where}.{key}")

    def sections(self, key: str) -> list[Section]:
        """A list of tables inside this one; empty if absent."""
        tables = self.take(key, list, [])
        return [Section(table, f"{self._where}.{key}[{i}]") for i, table in enumerate(tables)]

    def choice(self, key: str, candidates: Iterable[str], default: Any = REQUIRED) -> str:
        """A name out of some candidates."""
        value = self.take(key, str, default)
        names = list(candidates)
        if value not in names:
            raise unknown_name(f"{key} in {self._where}", value, names)
        return str(value)

    def numbers(self) -> dict[str, float]:
        """All keys not taken yet, each of which must have a finite number."""
        return {key: self.number(key) for key in self.names}

    def rest(self) -> dict[str, Any]:
        """All keys not taken yet, for something that checks them itself."""
        left, self._table = self._table, {}
        return left

    def finish(self) -> None:
        """Raise ConfigurationError if a key was not taken; it names the keys there are."""
        if self._table:
            raise unknown_name(f"key in {self._where}", next(iter(self._table)), self._known)

    @property
    def names(self) -> list[str]:
        """All keys not taken yet."""
        return list(self._table)

    @property
    def where(self) -> str:
        """File and table, for messages."""
        return self._where


_NAMES = {
    int: "an integer",
    float: "a number",
    str: "a string",
    list: "a list",
    dict: "a table",
    bool: "true or false",
}


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file; raises ConfigurationError that names the file if it cannot be read."""
    try:
        str(path.absolute()).encode()  # results name it, in UTF-8
        # a byte order mark is what some editors begin files with
        text = path.read_bytes().decode("utf-8-sig")
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"cannot read {os.fspath(path)}: {error}") from error
    return parse_toml(text, os.fspath(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The tables of a TOML text; raises ConfigurationError that names ``where``.

    What TOML leaves to its readers is refused, too: integers of more than 64 bits, and more than :data:`DEEPEST`
    levels.
    """
    too_deep = f"{where}: tables and lists lie in each other more than {DEEPEST} levels deep"
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError(f"{where} is not TOML: {error}") from error
    except RecursionError as error:
        raise ConfigurationError(too_deep) from error
    except ValueError as error:  # digits without end
        raise ConfigurationError(f"{where}: {error}") from error
    level: list[Any] = [tables]
    for _ in range(DEEPEST + 1):
        level = [inner for one in level for inner in (one.values() if isinstance(one, dict) else one)]
        for value in level:
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise ConfigurationError(f"{where}: integers have at most 64 bits, not {value.bit_length()}")
        level = [value for value in level if isinstance(value, (dict, list))]
    if level:
        raise ConfigurationError(too_deep)
    return tables


def override(table: dict[str, Any], key: str, value: object, where: str) -> None:
    """Set a dotted key such as ``task.Kp0`` or ``constraints.0.K`` in nested tables, in place.

    A table on the way must exist, or be one of :data:`OPTIONAL`; whether the last key is known is decided by whoever
    reads the table.
    """
    at: Any = table
    *way, last = key.split(".")
    for name in way:
        at = _child(at, name, where)
    if isinstance(at, list):
        _child(at, last, where)
        at[int(last)] = value
    elif isinstance(at, dict):
        at[last] = value
    else:
        raise ConfigurationError(f"{where}: {key!r} does not lead to a table")


def _child(at: Any, name: str, where: str) -> Any:
    if isinstance(at, list):
        if not (name.isascii() and name.isdecimal()) or int(name) >= len(at):
            raise unknown_name(f"entry of a list in {where}", name, [str(i) for i in range(len(at))])
        return at[int(name)]
    if not isinstance(at, dict) or (name not in at and name not in OPTIONAL):
        raise unknown_name(f"table in {where}", name, at if isinstance(at, dict) else [])
    return at.setdefault(name, {})
