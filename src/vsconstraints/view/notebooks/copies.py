"""Copies of laws that are defined in a session: for other processes, and for this one."""

from __future__ import annotations

import hashlib
import os
import pickle
import pickletools
import re
from collections.abc import Collection
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

from ...controllers import Controller
from ...plugins.classes import IN_SESSION

#: File name of a cell of this session.
_CELL = re.compile(rf".*ipykernel_{os.getpid()}\W\d+\.py|<ipython-input-\d+-[0-9a-f]+>")
_UNORDERED = ("FROZENSET", "ADDITEMS")
_ENDING_GROUPS = (
    "TUPLE",
    "LIST",
    "DICT",
    "APPENDS",
    "SETITEMS",
    "POP_MARK",
    "OBJ",
    "INST",
    *_UNORDERED,
)
_ATOM = "atom "

Shared = type | FunctionType | BuiltinFunctionType | ModuleType


def packed(law: Controller) -> tuple[bytes, str]:
    """Return bytes from which any process makes the law, or empty bytes and the reason.

    The bytes are not unpickled here: that would replace the global variables of a class defined in
    this session with their current values for the rest of the session.
    """
    by_value = find_spec("cloudpickle") is not None
    try:
        pickler: Any = import_module("cloudpickle") if by_value else pickle
        data = bytes(pickler.dumps(law))
        copied(law)
    except (Exception, SystemExit) as error:  # a custom law may hold any object
        return b"", f"it cannot be sent to another one ({type(error).__name__}: {error})"
    if not by_value and IN_SESSION.encode() in data:
        return (
            b"",
            "it is defined in this session; pip install 'vsconstraints[notebooks]' to send it to "
            "others",
        )
    return data, ""


def copied(law: Controller) -> Controller:
    """Return a copy for this process that shares classes, functions and modules with the law."""
    shared: list[Shared] = []

    def number(value: object) -> int | None:
        if not isinstance(value, Shared):
            return None
        shared.append(value)
        return len(shared) - 1

    data = BytesIO()
    pickler = _pickler()(data)
    pickler.persistent_id = number
    pickler.dump(law)
    data.seek(0)
    unpickler: Any = pickle.Unpickler(data)
    unpickler.persistent_load = shared.__getitem__
    copy: Controller = unpickler.load()
    return copy


def stable_digest(data: bytes) -> str:
    """Return a hash of a packed law that is the same in every session.

    It omits everything that differs between sessions: numbers of classes, names of cells, and the
    order of sets. The law was packed in this session.
    """
    numbers = _class_numbers()
    groups: list[list[str]] = [[]]
    known: list[str] = []
    for operation, argument, _ in pickletools.genops(data):
        name = operation.name
        if name in ("PROTO", "FRAME"):
            continue
        if name == "MEMOIZE":
            last = groups[-1][-1] if groups[-1] else ""
            known.append(last if last.startswith(_ATOM) else f"object {len(known)}")
        elif name == "MARK":
            groups.append([])
        elif name in _ENDING_GROUPS:
            items = groups.pop()
            if name in _UNORDERED and all(item.startswith(_ATOM) for item in items):
                items.sort()
            groups[-1].append(f"{name} {_hash(items)}")
        elif name.endswith("GET") and isinstance(argument, int):
            groups[-1].append(known[argument])
        elif isinstance(argument, str) and (argument in numbers or _CELL.fullmatch(argument)):
            groups[-1].append(f"{_ATOM}of the session")
        else:
            groups[-1].append(f"{_ATOM if operation.stack_before == [] else ''}{name} {argument!r}")
    return _hash(groups[0])[:16]


def _class_numbers() -> Collection[str]:
    """Return the numbers that cloudpickle has given to classes of this session."""
    try:
        cloudpickle: Any = import_module("cloudpickle.cloudpickle")
    except ImportError:
        return ()
    # without this private table, numbers count, and a law is run again in every session
    return frozenset(getattr(cloudpickle, "_DYNAMIC_CLASS_TRACKER_BY_ID", ()))


def _hash(texts: list[str]) -> str:
    digest = hashlib.sha256()
    for text in texts:
        data = text.encode("utf-8", "surrogatepass")
        digest.update(b"%d:" % len(data))
        digest.update(data)
    return digest.hexdigest()


def _pickler() -> Any:
    try:
        return import_module("cloudpickle").Pickler
    except ImportError:
        return pickle.Pickler
