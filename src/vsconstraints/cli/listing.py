"""``vsconstraints list``: everything that can be named in files and on the command line."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from rich.table import Table

from ..arms.drivers import DRIVERS, driver_class
from ..comparisons.metrics import METRICS, Metric
from ..constraints.curves import SHAPES
from ..controllers import CONTROLLERS, DEMANDS, RESOLVERS
from ..controllers.demand import USES as REQUIRED_BY_DEMANDS
from ..controllers.resolver import USES as REQUIRED_BY_RESOLVERS
from ..errors import ConfigurationError, unknown_name
from ..qp import make_solver, solver_names
from ..robots.catalogue import READY_MADE
from ..scenarios import CONSTRAINTS, Scenario, shipped_scenarios
from ..scenarios.families import Family, families
from ..vision.features import FEATURES
from .terminal import console


class Entry(NamedTuple):
    """A name, what it means in a line or two, and what else is shown of it alone."""

    name: str
    text: str
    details: tuple[str, ...] = ()


def _first_line(thing: object) -> str:
    """The first line of a docstring, without the marks of references and code."""
    line = (inspect.getdoc(thing) or "").partition("\n")[0]
    return re.sub(r"(?::\w+:`\.?|`)([^`]*)`", r"\1", line.replace("``", "`"))


def _part(name: str, part: Callable[..., object], required: Iterable[str]) -> Entry:
    """A law, a demand or a resolver, with its options and the information it requires."""
    options = [str(p.replace(annotation=p.empty)) for p in inspect.signature(part).parameters.values()]
    details = (("options", ", ".join(options)), ("requires", ", ".join(required)))
    return Entry(name, _first_line(part), tuple(f"{what}: {text}" for what, text in details if text))


def _solver(name: str) -> Entry:
    try:
        make_solver(name)
    except ConfigurationError as error:
        return Entry(name, str(error))
    return Entry(name, "installed")


def _metric(metric: Metric) -> Entry:
    """A column of results.csv, with the first sentence of its definition, and the others."""
    first, *others = re.split(r"(?<=\.) (?=[A-Z])", metric.definition or metric.header, maxsplit=1)
    return Entry(metric.column, first, tuple(others))


def _described(things: Iterable[tuple[str, object]]) -> Iterator[Entry]:
    return (Entry(name, _first_line(thing)) for name, thing in things)


#: What makes the entries of each kind.
KINDS: dict[str, Callable[[], Iterable[Entry]]] = {
    "scenarios": lambda: (
        Entry(name, scenario.title, (" ".join(scenario.description.split()),))
        for name in shipped_scenarios()
        for scenario in (Scenario.load(name),)
    ),
    "families": lambda: (Entry(name, Family.load(name).title) for name in families()),
    "laws": lambda: (_part(name, law, law().uses) for name, law in CONTROLLERS.items()),
    "demands": lambda: (_part(part.name, part, (REQUIRED_BY_DEMANDS[use] for use in part.uses)) for part in DEMANDS),
    "resolvers": lambda: (
        _part(part.name, part, (REQUIRED_BY_RESOLVERS[use] for use in part.uses)) for part in RESOLVERS
    ),
    "solvers": lambda: map(_solver, solver_names()),
    "robots": lambda: _described(READY_MADE.items()),
    "arms": lambda: _described((f"{scheme}://", driver_class(scheme)) for scheme in DRIVERS),
    "constraints": lambda: _described(CONSTRAINTS.items()),
    "features": lambda: _described(FEATURES.items()),
    "shapes": lambda: _described(SHAPES.items()),
    "metrics": lambda: (_metric(metric) for metric in METRICS if metric.value is not None),
}

ALSO_CALLED = {"controllers": "laws"}


def print_listing(words: Sequence[str]) -> None:
    """Print the names of all kinds, or what the kinds and names in ``words`` are.

    Raises
    ------
    ConfigurationError
        for a word that is neither a kind nor a name; it has the closest one.
    """
    if not words:
        _print_table((kind, ", ".join(entry.name for entry in entries())) for kind, entries in KINDS.items())
        console.print("\nDetails: vsconstraints list KIND, for example list laws; or vsconstraints list NAME")
    for word in words:
        kind = ALSO_CALLED.get(word, word)
        if kind in KINDS:
            _print_table((entry.name, entry.text) for entry in KINDS[kind]())
            continue
        everything = [(kind, entry) for kind, entries in KINDS.items() for entry in entries()]
        named = [(kind, entry) for kind, entry in everything if entry.name == word]
        if not named:
            raise unknown_name("kind or name", word, [*KINDS, *(entry.name for _, entry in everything)])
        for kind, entry in named:
            lines = "\n".join(filter(None, (entry.text, *entry.details)))
            _print_table([(f"{entry.name} ({kind})", lines)])


def _print_table(rows: Iterable[tuple[str, str]]) -> None:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for row in rows:
        table.add_row(*row)
    console.print(table)
