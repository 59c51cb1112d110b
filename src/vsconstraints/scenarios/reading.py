"""Construct objects from tables of files by the signatures of classes and functions.

Each parameter is a key of the same name. Its annotation states the type of the value, and its
default makes the key optional. A nested object (a pose, a motion, another dataclass) is constructed
from a nested table in the same way.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec
import numpy as np

from ..errors import ConfigurationError, format_value, unknown_name
from ..robots.geometry import Pose, Vector3
from ..vision.motion import Motion

Table = dict[str, Any]  #: A table of a file, by its keys.

#: Arguments that do not come from the table: the robot, the camera, the folder of files.
Context = Mapping[str, Any]

NOTHING: Context = types.MappingProxyType({})
UNIONS = (Union, types.UnionType)

Made = TypeVar("Made")


def from_table(
    make: Callable[..., Made], table: object, where: str, context: Context = NOTHING
) -> Made:
    """Call a class or function with the values of a table, each checked against its annotation.

    ``where`` names the file and the table in messages. ``context`` holds arguments that files do
    not contain. Raises ConfigurationError for unknown keys (with the known ones), for missing keys,
    and for values of the wrong type.
    """
    keys = parameters(make)
    values = require_table(table, where)
    known = [name for name in keys if name not in context]
    arguments = {name: value for name, value in values.items() if name not in known}
    if not takes_any(make):
        require_known(values, known, where)
    for name, parameter in keys.items():
        if name in context:
            arguments[name] = context[name]
        elif name in values:
            arguments[name] = checked(values[name], parameter.annotation, where, name, context)
        elif parameter.default is inspect.Parameter.empty:
            raise ConfigurationError(f"{where}: the key {name!r} is missing")
    return make(**arguments)


def split(
    table: object, where: str, *makes: Callable[..., Any], without: Iterable[str] = ()
) -> list[Table]:
    """Split one table into several, one for each callable in ``makes``.

    Raises ConfigurationError for a key that no callable takes.
    """
    values = require_table(table, where)
    known: list[str] = []
    tables = []
    for make in makes:
        names = [name for name in parameters(make) if name not in without]
        known += names
        tables.append({name: values[name] for name in names if name in values})
    require_known(values, known, where)
    return tables


def parameters(make: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of a class or function by name.

    Annotations are evaluated where possible.
    """
    return _signature(make)[0]


def takes_any(make: Callable[..., Any]) -> bool:
    """True if a class or function accepts keywords that its signature does not name."""
    return _signature(make)[1]


@lru_cache(maxsize=512)
def _signature(make: Callable[..., Any]) -> tuple[Mapping[str, inspect.Parameter], bool]:
    """Return the parameters of a callable, and True if it accepts any keyword.

    The result is cached, because inspecting a signature takes longer than calling it.
    """
    try:
        signature = inspect.signature(make, eval_str=True)
    except NameError:  # a custom annotation may name a type that is imported for type checkers only
        signature = inspect.signature(make)
    named = {}
    accepts_any = False
    for name, parameter in signature.parameters.items():
        if parameter.kind is parameter.VAR_KEYWORD:
            accepts_any = True
        elif parameter.kind is not parameter.VAR_POSITIONAL:
            is_evaluated = not isinstance(parameter.annotation, str)
            named[name] = parameter if is_evaluated else parameter.replace(annotation=Any)
    return types.MappingProxyType(named), accepts_any


def require_table(value: object, where: str) -> Table:
    """Return a copy of a table; raise ConfigurationError if the value is not a table."""
    if not isinstance(value, Mapping):
        raise ConfigurationError(f"{where} must be a table, not {format_value(value)}")
    return dict(value)


def require_known(table: Table, known: Iterable[str], where: str) -> None:
    """Raise ConfigurationError unless every key of a table is known; it names the known keys."""
    names = list(known)
    for key in table:
        if key not in names:
            raise unknown_name(f"key in {where}", key, names)


def chosen(
    table: Table, key: str, candidates: Mapping[str, Any], where: str, others: Sequence[str] = ()
) -> Any:
    """Remove a key from a table and return the candidate that its value names."""
    if key not in table:
        names = ", ".join((*candidates, *others))
        raise ConfigurationError(f"{where}: the key {key!r} is missing; it is one of {names}")
    name = checked(table.pop(key), str, where, key)
    if name not in candidates:
        raise unknown_name(f"{key} in {where}", name, [*candidates, *others])
    return candidates[name]


def checked(value: object, kind: Any, where: str, key: str, context: Context = NOTHING) -> Any:
    """Return the value of a key, converted to its annotation ``kind``.

    Raises ConfigurationError, which names key and value, if the value does not fit. A type that
    neither a file nor a table can represent is not checked here but by the callable that takes the
    value.
    """
    if kind is Any:
        return value
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    for option in _options(kind):
        several = get_origin(option) is Sequence
        part = get_args(option)[0] if several else option
        if part in (Pose, Motion) or is_dataclass(part):
            make: Callable[..., Any] = placed if part is Pose else part
            inner = {"folder": context["folder"]} if "folder" in context else NOTHING
            if not several:
                return from_table(make, value, f"{where}.{key}", inner)
            tables = checked(value, list[Any], where, key)
            return [
                from_table(make, table, f"{where}.{key}[{i}]", inner)
                for i, table in enumerate(tables)
            ]
        names_choice = get_origin(option) is Literal and isinstance(value, str)
        if names_choice and value not in get_args(option):
            raise unknown_name(f"{key} in {where}", value, get_args(option))
        if option is Path:
            return context["folder"] / checked(value, str, where, key)
        if several and Path in get_args(part):
            return [context["folder"] / path for path in checked(value, list[str], where, key)]
    try:
        type_in_file, may_be_infinite = _type_in_file(kind)
    except TypeError:  # a custom annotation may be unhashable, so that it cannot be cached
        type_in_file, may_be_infinite = _type_in_file.__wrapped__(kind)
    if type_in_file is None:
        return value
    try:
        return msgspec.convert(value if may_be_infinite else _finite(value), type_in_file)
    except FloatingPointError as error:
        raise ConfigurationError(f"{where}: {key} must be finite, and less than 1e308") from error
    except msgspec.ValidationError as error:
        raise ConfigurationError(
            f"{where}: {key} must be {_words(kind)}, not {format_value(value)}"
        ) from error


def placed(xyz: Vector3 = (0.0, 0.0, 0.0), rpy: Vector3 = (0.0, 0.0, 0.0)) -> Pose:
    """Return a pose from translation [m] and roll, pitch, yaw [rad], by default the identity."""
    return Pose.from_xyz_rpy(xyz, rpy)


def _options(kind: Any) -> list[Any]:
    """Return the types of a union, or the one type; without arrays, which files do not hold."""
    options: tuple[Any, ...] = (kind,)
    if get_origin(kind) in UNIONS:
        options = get_args(kind)
    return [option for option in options if get_origin(option) is not np.ndarray]


@lru_cache(maxsize=512)
def _type_in_file(kind: Any) -> tuple[Any, bool]:
    """Return the type that msgspec checks, and True if numbers are checked later.

    The type is None if the annotation allows anything that a file cannot hold.
    """
    options = _options(kind)
    type_in_file = None
    if all(map(_can_be_in_file, options)):
        type_in_file = Union[tuple(options)]  # noqa: UP007
    checked_later = any(Any in get_args(option) for option in options)
    return type_in_file, checked_later


def _can_be_in_file(kind: Any) -> bool:
    """True if a file can hold values of a type, and of all types inside it."""
    origin = get_origin(kind)
    if origin in (Annotated, tuple, list, dict, Sequence, Mapping):
        for part in get_args(kind):
            is_type = part is not Ellipsis and not isinstance(part, msgspec.Meta)
            if is_type and not _can_be_in_file(part):
                return False
        return True
    plain = (float, int, str, bool, dict, list, Any, types.NoneType)
    return origin is Literal or kind in plain


def _finite(value: Any) -> Any:
    """Return a value with Python numbers in place of NumPy's.

    Raises FloatingPointError if a number is not finite.
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float | int) and not -1e308 <= value <= 1e308:
        raise FloatingPointError
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    return value


#: Names of types in messages, singular and plural.
_NAMES = {
    int: ("an integer", "integers"),
    float: ("an integer or a number", "numbers"),
    str: ("a string", "strings"),
    bool: ("true or false", "true or false"),
    list: ("a list", "lists"),
    dict: ("a table", "tables"),
    Mapping: ("a table", "tables"),
    Literal: ("a string", "strings"),
}


def _words(kind: Any, several: bool = False) -> str:
    """Describe a type in messages: one value of it, or ``several``."""
    origin = get_origin(kind)
    inner = get_args(kind)
    if origin in UNIONS:
        return " or ".join(
            _words(option) for option in _options(kind) if option is not types.NoneType
        )
    if origin is Annotated and inner[0] is float:
        return "positive numbers" if several else "a positive number"
    if origin is Annotated:
        count = inner[1].min_length
        items = _words(get_args(inner[0])[0], several=True)
        if inner[1].max_length is None:
            return f"one or more {items}"
        return f"rows of {count} {items}" if several else f"{count} {items}"
    if origin in (dict, Mapping) and inner[1] is not Any:
        return f"a table of {_words(inner[1], several=True)}"
    if origin is tuple and Ellipsis not in inner:
        return f"{len(inner)} {_words(inner[0], several=True)}"
    if origin in (tuple, list, Sequence) and inner[0] is not Any:
        return f"{'lists' if several else 'a list'} of {_words(inner[0], several=True)}"
    plain = list if origin in (tuple, list, Sequence) else origin or kind
    singular, plural = _NAMES[plain]
    return plural if several else singular
