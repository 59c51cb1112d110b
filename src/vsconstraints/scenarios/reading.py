"""From a table of a file to what is made of it: the signature of what is made declares keys, types and defaults.

A parameter is a key of the same name; its annotation says what the key's value must be, and its default makes the key
optional. What a table stands in for (a pose, a motion, another dataclass) is made from that table in the same way.
"""

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

import msgspec
import numpy as np

from ..errors import ConfigurationError, shown, unknown_name
from ..robots.geometry import Pose, Vector3
from ..vision.motion import Motion

Table = dict[str, Any]
"""A table of a file, by its keys."""

Given = Mapping[str, Any]
"""Arguments that are known besides those of a table: the robot, the camera, the folder of files."""

NOTHING: Given = types.MappingProxyType({})
UNIONS = (Union, types.UnionType)

Made = TypeVar("Made")


def made(make: Callable[..., Made], table: object, where: str, given: Given = NOTHING) -> Made:
    """What ``make`` makes with the values of a table, each checked against its parameter's annotation.

    Parameters
    ----------
    make
        A class or function; its parameters are the table's keys.
    table
        What the file says; its values may be NumPy's, too.
    where
        File and table, for messages.
    given
        Arguments that files do not give.

    Raises
    ------
    ConfigurationError
        for keys that are unknown (it names those there are) or missing, and for values that do not fit.
    """
    keys, values = parameters(make), demand_table(table, where)
    known = [name for name in keys if name not in given]
    arguments = {name: value for name, value in values.items() if name not in known}
    if not takes_any(make):
        demand_known(values, known, where)
    for name, parameter in keys.items():
        if name in given:
            arguments[name] = given[name]
        elif name in values:
            arguments[name] = checked(values[name], parameter.annotation, where, name, given)
        elif parameter.default is inspect.Parameter.empty:
            raise ConfigurationError(f"{where}: the key {name!r} is missing")
    return make(**arguments)


def split(table: object, where: str, *makes: Callable[..., Any], given: Iterable[str] = ()) -> list[Table]:
    """One table as several, one for each of what is made of it; a key that none of them has is refused."""
    values = demand_table(table, where)
    known = [[name for name in parameters(make) if name not in given] for make in makes]
    demand_known(values, [name for names in known for name in names], where)
    return [{name: values[name] for name in names if name in values} for names in known]


def parameters(make: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    """The parameters of a class or function by their names, their annotations evaluated where that is possible."""
    return _signature(make)[0]


def takes_any(make: Callable[..., Any]) -> bool:
    """Whether a class or function takes keywords that its signature does not name."""
    return _signature(make)[1]


@lru_cache(maxsize=512)
def _signature(make: Callable[..., Any]) -> tuple[Mapping[str, inspect.Parameter], bool]:
    """Both, kept: to look at a signature takes longer than to make what it is of."""
    try:
        signature = inspect.signature(make, eval_str=True)
    except NameError:  # somebody's own annotations may name what is there for type checkers only
        signature = inspect.signature(make)
    every = signature.parameters.items()
    named = {
        name: parameter.replace(annotation=Any) if isinstance(parameter.annotation, str) else parameter
        for name, parameter in every
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    }
    return types.MappingProxyType(named), any(one.kind is one.VAR_KEYWORD for _, one in every)


def demand_table(value: object, where: str) -> Table:
    """A copy of a table; raises ConfigurationError if it is none."""
    if not isinstance(value, Mapping):
        raise ConfigurationError(f"{where} must be a table, not {shown(value)}")
    return dict(value)


def demand_known(table: Table, known: Iterable[str], where: str) -> None:
    """Raise ConfigurationError that names the known keys if a table has another one."""
    names = list(known)
    for key in table:
        if key not in names:
            raise unknown_name(f"key in {where}", key, names)


def chosen(table: Table, key: str, candidates: Mapping[str, Any], where: str, others: Sequence[str] = ()) -> Any:
    """Take a key out of a table whose value names one of some candidates, and return that one."""
    if key not in table:
        raise ConfigurationError(
            f"{where}: the key {key!r} is missing; it is one of {', '.join((*candidates, *others))}"
        )
    name = checked(table.pop(key), str, where, key)
    if name not in candidates:
        raise unknown_name(f"{key} in {where}", name, [*candidates, *others])
    return candidates[name]


def checked(value: object, kind: Any, where: str, key: str, given: Given = NOTHING) -> Any:
    """The value of a key as what its annotation ``kind`` says; raises ConfigurationError that names key and value.

    What neither a file can hold nor a table describes is left to whoever takes the value.
    """
    if kind is Any:
        return value
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    try:
        said = _said(kind)
    except TypeError:  # somebody's own annotation may be anything, also what cannot be kept
        said = _said.__wrapped__(kind)
    for option in said.options:
        if option.made:
            if not option.several:
                return _part(option.part, value, f"{where}.{key}", given)
            tables = checked(value, list[Any], where, key)
            return [_part(option.part, table, f"{where}.{key}[{i}]", given) for i, table in enumerate(tables)]
        if option.words and isinstance(value, str) and value not in option.words:
            raise unknown_name(f"{key} in {where}", value, option.words)
    if said.path:
        return given["folder"] / checked(value, str, where, key)
    if said.paths:
        return [given["folder"] / one for one in checked(value, list[str], where, key)]
    if said.raw is None:
        return value
    try:
        return msgspec.convert(value if said.raw else _finite(value), said.kind)
    except FloatingPointError as error:
        raise ConfigurationError(f"{where}: {key} must be finite, and less than 1e308") from error
    except msgspec.ValidationError as error:
        raise ConfigurationError(f"{where}: {key} must be {_words(kind)}, not {shown(value)}") from error


class _Option(NamedTuple):
    """One of the types that an annotation allows.

    Attributes
    ----------
    part, several, made
        What is made of a table, or of each of several, if that is so.
    words
        The only strings; any, if there are none.
    """

    part: Any
    several: bool
    made: bool
    words: tuple[Any, ...]


class _Said(NamedTuple):
    """What an annotation says of a value.

    Attributes
    ----------
    options
        Each type that it allows.
    path, paths
        Whether it is one of a file, or several.
    kind, raw
        What files may hold, for msgspec, and whether it is checked further where it is read; None of what they cannot.
    """

    options: tuple[_Option, ...]
    path: bool
    paths: bool
    kind: Any
    raw: bool | None


@lru_cache(maxsize=512)
def _said(kind: Any) -> _Said:
    """What an annotation says: kept, since there are few, and taking one apart takes longer than to read a value."""
    every = get_args(kind) if get_origin(kind) in UNIONS else (kind,)
    allowed = [one for one in every if get_origin(one) is not np.ndarray]
    options = []
    for option in allowed:
        several = get_origin(option) is Sequence
        part = get_args(option)[0] if several else option
        words = get_args(option) if get_origin(option) is Literal else ()
        options.append(_Option(part, several, part in (Pose, Motion) or is_dataclass(part), words))
    paths = any(get_origin(one) is Sequence and Path in get_args(get_args(one)[0]) for one in allowed)
    raw = any(Any in get_args(one) for one in allowed) if all(map(_of_files, allowed)) else None
    whole = None if raw is None else Union[tuple(allowed)]  # noqa: UP007
    return _Said(tuple(options), Path in allowed, paths, whole, raw)


def _part(part: Any, table: object, where: str, given: Given) -> Any:
    return made(
        placed if part is Pose else part, table, where, {"folder": given["folder"]} if "folder" in given else NOTHING
    )


def placed(xyz: Vector3 = (0.0, 0.0, 0.0), rpy: Vector3 = (0.0, 0.0, 0.0)) -> Pose:
    """A pose; it says nothing where it changes nothing."""
    return Pose.from_xyz_rpy(xyz, rpy)


def _of_files(kind: Any) -> bool:
    """Whether a type is one of the values that files hold."""
    origin = get_origin(kind)
    if origin in (Annotated, tuple, list, dict, Sequence, Mapping):
        return all(
            _of_files(one) for one in get_args(kind) if one is not Ellipsis and not isinstance(one, msgspec.Meta)
        )
    return origin is Literal or kind in (float, int, str, bool, dict, list, Any, types.NoneType)


def _finite(value: Any) -> Any:
    """A value with Python's own numbers for NumPy's; raises FloatingPointError if one of them is not finite."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float | int) and not -1e308 <= value <= 1e308:
        raise FloatingPointError
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return {key: _finite(one) for key, one in value.items()} if isinstance(value, dict) else value


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
"""What one value, and several, of a type are called in messages."""


def _words(kind: Any, several: bool = False) -> str:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in UNIONS:
        names = [_words(one) for one in inner if one is not types.NoneType and get_origin(one) is not np.ndarray]
        return " or ".join(names)
    if origin is Annotated and inner[0] is float:
        return "positive numbers" if several else "a positive number"
    if origin is Annotated:
        count, items = inner[1].min_length, _words(get_args(inner[0])[0], several=True)
        if inner[1].max_length is None:
            return f"one or more {items}"
        return f"rows of {count} {items}" if several else f"{count} {items}"
    if origin in (dict, Mapping) and inner[1] is not Any:
        return f"a table of {_words(inner[1], several=True)}"
    if origin is tuple and Ellipsis not in inner:
        return f"{len(inner)} {_words(inner[0], several=True)}"
    if origin in (tuple, list, Sequence) and inner[0] is not Any:
        return f"{'lists' if several else 'a list'} of {_words(inner[0], several=True)}"
    return _NAMES[list if origin in (tuple, list, Sequence) else origin or kind][several]
