"""Command ``vsconstraints list``: all names that files and the command line can use."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Sequence
from itertools import starmap

from rich.table import Table

from ..arms.drivers import DRIVERS, driver_class
from ..bench.families import Family, families
from ..comparisons.metrics import METRICS, Metric
from ..constraints.curves import SHAPES
from ..controllers import CONTROLLERS, DEMANDS, RESOLVERS
from ..controllers.demand import USES as USED_BY_DEMANDS
from ..controllers.resolver import USES as USED_BY_RESOLVERS
from ..errors import ConfigurationError, unknown_name
from ..qp import make_solver, solver_names
from ..robots.catalogue import READY_MADE
from ..scenarios import CONSTRAINTS, Scenario, shipped_scenarios
from ..vision.features import FEATURES
from .terminal import console

#: A name, its description in a line or two, and details shown when only this name is listed.
Entry = tuple[str, ...]


def _described(name: str, thing: object) -> Entry:
    """Return a name with the first line of a docstring, without markup of references and code."""
    line = (inspect.getdoc(thing) or "").partition("\n")[0]
    return name, re.sub(r"(?::\w+:`\.?|`)([^`]*)`", r"\1", line.replace("``", "`"))


def _part(name: str, part: Callable[..., object], required: Iterable[str]) -> Entry:
    """Return the entry of a law, a demand or a resolver: options and required information."""
    options = (
        str(p.replace(annotation=p.empty)) for p in inspect.signature(part).parameters.values()
    )
    details = (("options", ", ".join(options)), ("requires", ", ".join(required)))
    return (*_described(name, part), *(f"{what}: {text}" for what, text in details if text))


def _solver(name: str) -> Entry:
    try:
        make_solver(name)
    except ConfigurationError as error:
        return name, str(error)
    return name, "installed"


def _scenario(scenario: Scenario) -> Entry:
    return scenario.name, scenario.title, " ".join(scenario.description.split())


def _metric(metric: Metric) -> Entry:
    """Return the entry of a column of results.csv, with its definition.

    The first sentence is the description, the others are details.
    """
    return metric.column, *re.split(
        r"(?<=\.) (?=[A-Z])", metric.definition or metric.header, maxsplit=1
    )


#: Functions that return the entries of each kind.
KINDS: dict[str, Callable[[], Iterable[Entry]]] = {
    "scenarios": lambda: (_scenario(Scenario.load(name)) for name in shipped_scenarios()),
    "families": lambda: ((name, Family.load(name).title) for name in families()),
    "laws": lambda: (_part(name, law, law().uses) for name, law in CONTROLLERS.items()),
    "demands": lambda: (
        _part(part.name, part, map(USED_BY_DEMANDS.__getitem__, part.uses)) for part in DEMANDS
    ),
    "resolvers": lambda: (
        _part(part.name, part, map(USED_BY_RESOLVERS.__getitem__, part.uses)) for part in RESOLVERS
    ),
    "solvers": lambda: map(_solver, solver_names()),
    "robots": lambda: starmap(_described, READY_MADE.items()),
    "arms": lambda: (_described(f"{scheme}://", driver_class(scheme)) for scheme in DRIVERS),
    "constraints": lambda: starmap(_described, CONSTRAINTS.items()),
    "features": lambda: starmap(_described, FEATURES.items()),
    "shapes": lambda: starmap(_described, SHAPES.items()),
    "metrics": lambda: (_metric(metric) for metric in METRICS if metric.value is not None),
}


def print_listing(words: Sequence[str]) -> None:
    """Print the names of all kinds, or the descriptions of ``words``.

    Raises ConfigurationError for an unknown word.
    """
    if not words:
        _print_table(
            (kind, ", ".join(name for name, *_ in entries())) for kind, entries in KINDS.items()
        )
        console.print("\nDetails: vsconstraints list KIND, for example list laws, or list NAME")
    for word in words:
        kind = "laws" if word == "controllers" else word
        if kind in KINDS:
            _print_table((name, text) for name, text, *_ in KINDS[kind]())
            continue
        everything = [(kind, *entry) for kind, entries in KINDS.items() for entry in entries()]
        named = [entry for entry in everything if entry[1] == word]
        if not named:
            raise unknown_name(
                "kind or name", word, [*KINDS, *(name for _, name, *_ in everything)]
            )
        for kind, name, *texts in named:
            _print_table([(f"{name} ({kind})", "\n".join(filter(None, texts)))])


def _print_table(rows: Iterable[tuple[str, str]]) -> None:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for row in rows:
        table.add_row(*row)
    console.print(table, soft_wrap=False)
