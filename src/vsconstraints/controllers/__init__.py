"""Controllers: interchangeable functions of rows and a task, importable one by one.

Parts of the package register further laws. Their classes, :data:`CONTROLLERS`
and :data:`VELOCITY_LAWS` are imported at the first use of any of them.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from contextlib import chdir
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError, VsconstraintsError, described, format_value, unknown_name
from ..plugins.classes import beside, folder_of_neighbours, imported_class
from ..plugins.earlier_names import EarlierNames
from ..plugins.registry import with_laws_of_parts
from ..rows.factors import FACTORS, RowFactors
from .barriers import Barrier
from .base import Controller, Wrapper, innermost
from .delay import DelayCompensated
from .demand import Demand
from .demands import DEMANDS, BoundaryLayer, Firas, ImplicitSwitch, RampRepulsion, Switch
from .law import Law
from .laws import NAMED, HierarchicalQP, Pair, PotentialField, SlidingMode, Tracking
from .observer import Observed
from .ranges import Choices, Range, ranges_of
from .resolver import Additive, Priority, Resolver
from .resolvers import (
    RESOLVERS,
    Filter,
    Hierarchy,
    Projection,
    Saturation,
    SaturationExact,
    Scaling,
)
from .velocity_controller import VelocityController

__all__ = [
    "CONTROLLERS",
    "DEMANDS",
    "NAMED",
    "RESOLVERS",
    "VELOCITY_LAWS",
    "Additive",
    "Barrier",
    "BoundaryLayer",
    "Choices",
    "Controller",
    "DelayCompensated",
    "Demand",
    "Filter",
    "Firas",
    "HierarchicalQP",
    "Hierarchy",
    "ImplicitSwitch",
    "Law",
    "Observed",
    "Pair",
    "PotentialField",
    "PredictiveControl",
    "Priority",
    "Projection",
    "RampRepulsion",
    "Range",
    "ResolvedRate",
    "ResolvedRateAvoidance",
    "Resolver",
    "RobustPredictive",
    "RowFactors",
    "Saturation",
    "SaturationExact",
    "Scaling",
    "SlidingMode",
    "Switch",
    "Tracking",
    "VelocityController",
    "VelocityDamper",
    "VelocityHierarchicalQP",
    "VelocityQP",
    "controller_class",
    "law_ranges",
    "make_controller",
]

if TYPE_CHECKING:
    from ..prediction import PredictiveControl, RobustPredictive
    from ..velocity import (
        ResolvedRate,
        ResolvedRateAvoidance,
        VelocityDamper,
        VelocityHierarchicalQP,
        VelocityQP,
    )

    #: Controllers by their name in files and on the command line.
    CONTROLLERS: dict[str, type[Controller]]
    #: Those that command joint speeds.
    VELOCITY_LAWS: tuple[type[VelocityController], ...]
    #: The values of :data:`CONTROLLERS`.
    LAWS: tuple[type[Controller], ...]

#: Laws of the core.
CORE_LAWS: tuple[type[Controller], ...] = (
    SlidingMode,
    PotentialField,
    HierarchicalQP,
    Tracking,
    *NAMED,
    Pair,
)

#: Laws that were part of the package, by their former name: the file and class in the repository.
FORMER_LAWS: dict[str, str] = {
    "goal-governor": "controllers/goal_governor.py:GoalGovernor",
    "barrier-governor": "controllers/goal_governor.py:BarrierGovernor",
    "mppi": "controllers/mppi.py:PathIntegralControl",
}
#: Wrappers of laws, the innermost first, and the options that add them, valid for every law.
WRAPPERS: dict[Callable[..., Wrapper], tuple[str, ...]] = {
    Observed: ("observer", "dead_time"),
    DelayCompensated: ("command_delay",),
}


@cache
def registered_laws() -> dict[str, type[Controller]]:
    """Return all laws by name: those of the core, then those of parts.

    Raises ConfigurationError if a part registers a law with the name of another one.
    """
    return with_laws_of_parts(__name__, {law.name: law for law in CORE_LAWS})


def _exported(name: str) -> Any:
    """Return an object that depends on the laws of parts, or a module that moved."""
    if name == "CONTROLLERS":
        return registered_laws()
    if name == "LAWS":
        return tuple(registered_laws().values())
    if name == "VELOCITY_LAWS":
        laws = registered_laws().values()
        return tuple(law for law in laws if issubclass(law, VelocityController))
    if name in __all__:
        return {law.__name__: law for law in registered_laws().values()}[name]
    if EarlierNames.today(f"{__name__}.{name}"):
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


if not TYPE_CHECKING:  # type checkers know all names that exist, and no others
    __getattr__ = _exported


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def controller_class(name: str, folder: Path | None = None) -> type[Controller]:
    """Return the controller of a registered name, or a custom one.

    Custom controllers are named as ``"my_laws:Cautious"`` or as a file,
    ``"controllers/cautious.py:Cautious"``, which are first searched for in ``folder``, see
    :func:`.imported_class`. Raises ConfigurationError if the name is unknown.
    """
    if ":" in name:
        return imported_class(name, Controller, folder)
    laws = registered_laws()
    if name not in laws:
        raise unknown_controller(name, [*laws, "module:Class", "FILE.py:Class"])
    return laws[name]


def unknown_controller(name: str, candidates: Collection[str]) -> ConfigurationError:
    """Return the error for a name that is none of the candidates."""
    if name in FORMER_LAWS:
        return ConfigurationError(
            f"{name!r} is no longer part of the package: it is {FORMER_LAWS[name]}, in the "
            f"repository's folder controllers (docs/controllers.md)"
        )
    return unknown_name("controller", name, candidates)


def make_controller(
    name: str, options: Mapping[str, Any] | None = None, folder: Path | None = None
) -> Controller:
    """Create the controller of a name, see :func:`controller_class`, with these options.

    ``K`` and ``switching_gain`` are :class:`.RowFactors`, ``observer`` and ``dead_time`` belong to
    :class:`.Observed`, and ``command_delay`` to :class:`.DelayCompensated`. Every law takes these
    options, unless it has an option of the same name. Raises ConfigurationError, with the
    candidates, if the name or an option is unknown.
    """
    law = controller_class(name, folder)
    options = dict(options or {})
    parameters = inspect.signature(law).parameters
    factors = {key: options.pop(key) for key in FACTORS if key in options and key not in parameters}
    around = [
        (
            wrapper,
            {key: options.pop(key) for key in keys if key in options and key not in parameters},
        )
        for wrapper, keys in WRAPPERS.items()
    ]
    if any("dead_time" in given and "observer" not in given for _, given in around):
        raise ConfigurationError(
            f"dead_time of {name} is that of an observer: give its time constant [s], too"
        )
    if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        for key in options:
            if key not in parameters:
                known = dict.fromkeys(
                    (*parameters, *FACTORS, *chain.from_iterable(WRAPPERS.values()))
                )
                raise unknown_name(f"option of {name}", key, known)
    try:
        # a custom law may change directory, and import modules beside it
        with chdir("."), beside(folder, folder_of_neighbours(name, folder)):
            made = law(**options)
            if factors:
                made.factors = RowFactors(**{**made.factors.options(), **factors})
            for wrapper, given in around:
                made = wrapper(made, **given) if given else made
            return made
    except VsconstraintsError:
        raise
    except (Exception, SystemExit) as error:  # a custom law may fail in any way
        raise ConfigurationError(
            f"controller {name!r} cannot be made with {format_value(options)}: {described(error)}"
        ) from error


def law_ranges(
    name: str, options: Mapping[str, Any] | None = None, folder: Path | None = None
) -> dict[str, Range | Choices]:
    """Return the search ranges of a law's options; empty if it declares none.

    They are those of the law's class and, for a :class:`Law`, of its demand and its resolver.
    Options that are given are fixed, and have no range; ``law_ranges("law", {"demand": "barrier",
    "resolver": "filter"})`` returns those of a pair. The parameters are those of
    :func:`make_controller`. Raises ConfigurationError also if a declaration is no range, or if the
    range does not contain the default of the option.
    """
    return ranges_of(innermost(make_controller(name, options, folder)), name, options or {})
