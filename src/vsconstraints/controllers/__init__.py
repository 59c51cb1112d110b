"""Controllers: functions of rows and a task, interchangeable and importable one by one."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextlib import chdir
from itertools import chain
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, VsconstraintsError, described, shown, unknown_name
from ..plugins.classes import beside, imported_class
from ..rows.factors import FACTORS, RowFactors
from .barriers import Barrier
from .base import Controller, Wrapper, innermost
from .delay import DelayCompensated
from .demand import Demand
from .demands import DEMANDS, BoundaryLayer, Firas, ImplicitSwitch, RampRepulsion, Switch
from .goal_governor import BarrierGovernor, GoalGovernor
from .law import Law
from .laws import NAMED, HierarchicalQP, Pair, PotentialField, SlidingMode, Tracking
from .observer import Observed
from .path_integral import PathIntegralControl
from .predictive import PredictiveControl
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
from .robust_predictive import RobustPredictive

__all__ = [
    "CONTROLLERS", "DEMANDS", "NAMED", "RESOLVERS", "Additive", "Barrier", "BarrierGovernor", "BoundaryLayer",
    "Choices", "Controller", "DelayCompensated", "Demand", "Filter", "Firas", "GoalGovernor", "HierarchicalQP",
    "Hierarchy", "ImplicitSwitch", "Law", "Observed", "Pair", "PathIntegralControl", "PotentialField",
    "PredictiveControl", "Priority", "Projection", "RampRepulsion", "Range", "Resolver", "RobustPredictive",
    "RowFactors", "Saturation", "SaturationExact", "Scaling", "SlidingMode", "Switch", "Tracking", "controller_class",
    "law_ranges", "make_controller",
]  # fmt: skip

LAWS: tuple[type[Controller], ...] = (
    SlidingMode, PotentialField, HierarchicalQP, Tracking, *NAMED, Pair, PredictiveControl,
    RobustPredictive, GoalGovernor, BarrierGovernor, PathIntegralControl,
)  # fmt: skip

#: Controllers by the name files and the command line use.
CONTROLLERS: dict[str, type[Controller]] = {law.name: law for law in LAWS}
#: What laws can be put behind, the innermost first, and the options that do so: those of every law.
WRAPPERS: dict[Callable[..., Wrapper], tuple[str, ...]] = {
    Observed: ("observer", "dead_time"),
    DelayCompensated: ("command_delay",),
}


def controller_class(name: str, folder: Path | None = None) -> type[Controller]:
    """The controller of a registered name, or of ``"my_laws:Cautious"``, a module that may also be
    in ``folder``.
    """
    if ":" in name:
        return imported_class(name, Controller, folder)
    if name not in CONTROLLERS:
        raise unknown_name("controller", name, [*CONTROLLERS, "module:Class"])
    return CONTROLLERS[name]


def make_controller(
    name: str, options: Mapping[str, Any] | None = None, folder: Path | None = None
) -> Controller:
    """The controller of that name, see :func:`controller_class`, with these keyword arguments.

    ``K`` and ``switching_gain`` are :class:`.RowFactors`, ``observer`` and ``dead_time`` those of
    :class:`.Observed`, ``command_delay`` that of :class:`.DelayCompensated`: options of every law
    that has none of that name. ConfigurationError names the candidates if name or option is
    unknown.
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
        with chdir("."), beside(folder):  # an own law may change the working directory
            made = law(**options)
            if factors:
                made.factors = RowFactors(**{**made.factors.options(), **factors})
            for wrapper, given in around:
                made = wrapper(made, **given) if given else made
            return made
    except VsconstraintsError:
        raise
    except (Exception, SystemExit) as error:  # an own law may fail in any way
        raise ConfigurationError(
            f"controller {name!r} cannot be made with {shown(options)}: {described(error)}"
        ) from error


def law_ranges(
    name: str, options: Mapping[str, Any] | None = None, folder: Path | None = None
) -> dict[str, Range | Choices]:
    """From where to where the options of a law are worth searching; empty if it declares nothing.

    They are those of the law's class and, of a :class:`Law`, of its demand and its resolver. What
    is given stays as it is, and is not among them; ``law_ranges("law", {"demand": "barrier",
    "resolver": "filter"})`` are those of a pair. Parameters are those of :func:`make_controller`.
    ConfigurationError also if the class declares what is no range, or one that does not hold the
    option's default.
    """
    return ranges_of(innermost(make_controller(name, options, folder)), name, options or {})
