"""Structures of arrays in memory: how they are made, laid out, and passed on by address.

A structure is a named tuple that declares the type and shape of its arrays, like those of
:mod:`.workspace`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import SimpleNamespace
from typing import Any, get_type_hints
from weakref import WeakValueDictionary

import numpy as np

from ..errors import InvalidInput, format_value
from ..formulas.limits import JointLimits
from ..rows import Array, BoolArray, IntArray
from .records import BOOL, F8, I8


@cache
def fields(kind: Any) -> dict[str, Any]:
    """Return the declared types of a structure's fields, by name."""
    return get_type_hints(kind, include_extras=True)


#: Elements of arrays, by the types that declare them. Records are declared with their own.
ELEMENTS: dict[Any, np.dtype[Any]] = {Array: F8, IntArray: I8, BoolArray: BOOL}


def element_of(declared: Any) -> np.dtype[Any]:
    """Return the type of a declared array's elements."""
    if declared.__origin__ in ELEMENTS:
        return ELEMENTS[declared.__origin__]
    record: np.dtype[Any] = declared.__metadata__[0]
    return record


def shape_of(declared: Any, lengths: Mapping[str, int] | None) -> tuple[int, ...]:
    """Return the shape of an array with declared axes such as ``"N m 3"``.

    Without any ``lengths``, each axis has the length 1, for a structure that only shows its types,
    or whose arrays are set later. Raise InvalidInput if they lack an axis.
    """
    axes = str(declared.__metadata__[-1])
    return tuple(_length_of(axis, lengths) for axis in axes.split())


def _length_of(axis: str, lengths: Mapping[str, int] | None) -> int:
    if axis.isdecimal():
        return int(axis)
    if lengths is None:
        return 1
    if axis not in lengths:
        axes = ", ".join(lengths) or "none"
        raise InvalidInput(f"the axis {axis!r} has no length; axes with one are {axes}")
    return lengths[axis]


def zeros(
    kind: Any, lengths: Mapping[str, int] | None = None, known: Mapping[str, Any] | None = None
) -> Any:
    """Return a structure of zeros, with arrays of their declared types and shapes.

    ``known`` contains fields that exist already, by name: those of the structure and those of the
    structures within it, at any depth. ``lengths`` are those of the axes in the
    declarations; see :func:`shape_of`.
    """
    values = dict(known or {})
    for name, declared in fields(kind).items():
        if name in values:
            continue
        is_array = hasattr(declared, "__metadata__")
        if is_array:
            values[name] = np.zeros(shape_of(declared, lengths), element_of(declared))
        elif declared in (int, float):
            values[name] = declared(0)
        elif declared is JointLimits:
            values[name] = _zero_limits(_length_of("limits", lengths))
        else:
            values[name] = zeros(declared, lengths, known)
    return kind(**{name: values[name] for name in kind._fields})


def _zero_limits(joints: int) -> JointLimits:
    """Return joint limits whose arrays (n,) are zero."""
    none = np.zeros(joints)
    return JointLimits(none, none, none, none, none, ranges=0, period=1.0)


#: Reference to an array, by its number of dimensions: where its numbers begin, and its shape.
ARRAY_REFERENCES = [
    np.dtype([("address", "i8"), ("shape", "i8", (dimensions,))]) for dimensions in range(5)
]


def _is_float(structure: Any, name: str) -> bool:
    """True if a number of a structure is a float, even if an integer was given for it."""
    kind: Any = type(structure)
    return fields(kind).get(name) is float or isinstance(getattr(structure, name), float)


def memory_layout(structure: Any) -> np.dtype[Any]:
    """Return the record that holds a structure: its numbers, records and references to arrays."""
    columns: list[Any] = []
    for name in structure._fields:
        part = getattr(structure, name)
        if isinstance(part, tuple):
            columns.append((name, memory_layout(part)))
        elif isinstance(part, np.ndarray):
            columns.append((name, ARRAY_REFERENCES[part.ndim]))
        else:
            columns.append((name, "f8" if _is_float(structure, name) else "i8"))
    return np.dtype(columns)


def _memory(structure: Any) -> tuple[Any, ...]:
    """Return the values of the record that holds a structure."""
    values: list[Any] = []
    for part in structure:
        if isinstance(part, tuple):
            values.append(_memory(part))
        elif isinstance(part, np.ndarray):
            if not part.flags.c_contiguous:
                raise InvalidInput("compiled functions take contiguous arrays only")
            values.append((part.ctypes.data, part.shape))
        else:
            values.append(part)
    return tuple(values)


#: Workspaces by their addresses.
_workspaces: WeakValueDictionary[int, Workspace] = WeakValueDictionary()


class Workspace:
    """Structure (a named tuple) that compiled functions take by its address.

    Its arrays are not copied. Functions that take a workspace check its kind. It lives as long as a
    user holds it.
    """

    __slots__ = ("__weakref__", "_attributes", "_record", "address", "structure")

    def __init__(self, structure: Any) -> None:
        self._record = np.array([_memory(structure)], dtype=memory_layout(structure))
        self.structure = structure
        self.address = int(self._record.ctypes.data)
        self._attributes: Any = None
        _workspaces[self.address] = self

    def in_python(self) -> Any:
        """Return the structure as functions that run in Python take it."""
        if self._attributes is None:
            self._attributes = _with_attributes(self.structure)
        return self._attributes


def require_workspace(given: object, kind: type, function: str) -> int:
    """Return the address of a workspace of the given kind of structure.

    Raise InvalidInput, which names the function, for anything else.
    """
    if isinstance(given, Workspace):
        if type(given.structure) is kind:
            return given.address
        what = type(given.structure).__name__
    else:
        what = format_value(given)
    raise InvalidInput(f"{function} takes a workspace of {kind.__name__}, not {what}")


def structure_at(address: int) -> Any:
    """Return the structure of the workspace at an address, for functions that run in Python."""
    return _workspaces[int(address)].in_python()


def _with_attributes(part: Any) -> Any:
    """Return a structure whose fields can be set, with fields of records as attributes."""
    if isinstance(part, tuple):
        attributes = {}
        for name, field in part._asdict().items():  # type: ignore[attr-defined]
            attributes[name] = _with_attributes(field)
        return SimpleNamespace(**attributes)
    is_record = isinstance(part, np.ndarray) and part.dtype.names
    return part.view(np.recarray) if is_record else part
