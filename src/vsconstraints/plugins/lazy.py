"""Objects that are imported or built at their first use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from typing import Any, TypeVar, overload

Value = TypeVar("Value")


def exported(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package that exports objects of its modules.

    ``modules`` maps each exported name to its module, relative to the package. A command such as
    ``vsconstraints --help`` imports packages without what they export.
    """

    def get(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f".{modules[name]}", package), name)

    return get


class LazySequence(Sequence[Value]):
    """Sequence whose values are built at the first use; raises what ``build`` raises."""

    def __init__(self, build: Callable[[], Iterable[Value]]) -> None:
        self._build = build

    @cached_property
    def _values(self) -> tuple[Value, ...]:
        return tuple(self._build())

    @overload
    def __getitem__(self, index: int) -> Value: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Value, ...]: ...

    def __getitem__(self, index: int | slice) -> Value | tuple[Value, ...]:
        return self._values[index]

    def __len__(self) -> int:
        return len(self._values)


class LazyMapping(Mapping[str, Value]):
    """Mapping whose values are built at the first use; raises what ``build`` raises."""

    def __init__(self, build: Callable[[], Mapping[str, Value]]) -> None:
        self._build = build

    @cached_property
    def _values(self) -> Mapping[str, Value]:
        return self._build()

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)
