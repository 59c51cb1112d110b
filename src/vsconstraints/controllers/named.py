"""Laws by name: a demand and a resolver, named one by one or together."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Any, ClassVar, Literal, TypeVar

from ..errors import unknown_name
from .demands import (
    DEMANDS,
    Barrier,
    BoundaryLayer,
    Demand,
    ImplicitSuperTwisting,
    ImplicitSwitch,
    ImplicitSwitchWithDrift,
    SuperTwisting,
)
from .law import Law
from .resolvers import RESOLVERS, Filter, Hierarchy, Priority, Resolver

Part = TypeVar("Part", Demand, Resolver)


class Pair(Law):
    """Any demand with any resolver, by their names: the paper's, unless others are named.

    Parameters
    ----------
    demand
        Name of one of :data:`vsconstraints.controllers.DEMANDS`.
    resolver
        Name of one of :data:`vsconstraints.controllers.RESOLVERS`.
    options
        Parameters of the demand and options of the resolver.
    """

    def __init__(self, *, demand: str = "switch", resolver: str = "priority", **options: Any) -> None:
        parts = of_name("demand", demand, DEMANDS), of_name("resolver", resolver, RESOLVERS)
        super().__init__(*made(self.name, parts, options))


class Named(Law):
    """A demand and a resolver under a name of their own; :func:`named` makes one."""

    parts: ClassVar[tuple[type[Demand], type[Resolver]]]
    defaults: ClassVar[Mapping[str, Any]]

    def __init__(self, **options: Any) -> None:
        super().__init__(*made(self.name, self.parts, {**self.defaults, **options}))

    def __reduce__(self) -> tuple[Any, ...]:
        return _without_state, (self.name,), self.__getstate__()


def named(name: str, demand: type[Demand], resolver: type[Resolver], line: str, **defaults: Any) -> type[Named]:
    """A law of that name: a class whose constructor takes the options of both parts.

    Parameters
    ----------
    name
        For files and the command line.
    demand, resolver
        What it consists of.
    line
        What it is, in one line.
    defaults
        Options that differ from those of the parts.
    """
    options = [
        inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=defaults.get(key, default))
        for key, default in options_of(demand, resolver).items()
    ]
    body = {
        "__doc__": line,
        "__signature__": inspect.Signature(options),
        "name": name,
        "parts": (demand, resolver),
        "defaults": defaults,
    }
    return type(name, (Named,), body)


def of_name(what: Literal["demand", "resolver"], name: object, classes: Iterable[type[Part]]) -> type[Part]:
    """The class of that name; names the candidates if there is none."""
    found = {part.name: part for part in classes}
    if not (isinstance(name, str) and name in found):
        raise unknown_name(what, name, found)
    return found[name]


def options_of(demand: type[Demand], resolver: type[Resolver]) -> dict[str, Any]:
    """The options of a demand and a resolver, with their defaults."""
    return {field.name: field.default for part in (demand, resolver) for field in fields(part)}


def made(law: str, parts: tuple[type[Demand], type[Resolver]], options: Mapping[str, Any]) -> tuple[Demand, Resolver]:
    """A demand and a resolver, each made with those options that are its own; names the candidates if one is none's."""
    demand, resolver = parts
    known = options_of(demand, resolver)
    for key in options:
        if key not in known:
            raise unknown_name(f"option of {law}", key, known)
    own = {field.name for field in fields(demand)}
    return (
        demand(**{key: value for key, value in options.items() if key in own}),
        resolver(**{key: value for key, value in options.items() if key not in own}),
    )


def _without_state(name: str) -> Named:
    law = next(law for law in NAMED if law.name == name)
    return law.__new__(law)


NAMED: tuple[type[Named], ...] = (
    named(
        "implicit-switch",
        ImplicitSwitch,
        Hierarchy,
        "The paper's switch without its chattering: solved for the end of the period, with strict priorities.",
        periods=5.0,
    ),
    named(
        "implicit-switch-with-drift",
        ImplicitSwitchWithDrift,
        Hierarchy,
        "The implicit switch, less the drift that was seen a sample ago.",
        periods=5.0,
    ),
    named(
        "boundary-layer",
        BoundaryLayer,
        Priority,
        "Sliding mode with a boundary layer, laid inside (the potential field with priority).",
    ),
    named(
        "super-twisting",
        SuperTwisting,
        Priority,
        "Sliding mode of second order, which learns the drift.",
    ),
    named(
        "implicit-super-twisting",
        ImplicitSuperTwisting,
        Hierarchy,
        "Sliding mode of second order by the proper implicit Euler method, with strict priorities.",
    ),
    named(
        "cbf-filter",
        Barrier,
        Filter,
        "The safety filter of control barrier functions: the command nearest to tracking that meets the barrier.",
    ),
)
"""Laws that have a name of their own, beside those that are classes."""
