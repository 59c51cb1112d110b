"""Command ``vsconstraints list``: all names that files and the command line can use."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import starmap

from rich.table import Table

from ..comparisons.metrics import Metric, run_metrics
from ..constraints.curves import SHAPES
from ..controllers import DEMANDS, RESOLVERS, registered_laws
from ..controllers.demand import USES as USED_BY_DEMANDS
from ..controllers.resolver import USES as USED_BY_RESOLVERS
from ..errors import ConfigurationError, unknown_name
from ..plugins.registry import Listing, in_order, load, registered
from ..qp import make_solver, solver_names
from ..robots.catalogue import READY_MADE
from ..scenarios import CONSTRAINTS, Scenario, shipped_scenarios
from ..vision.features import FEATURES
from .terminal import console

#: A name, its description in a line or two, and details shown when only this name is listed.
Entry = tuple[str, ...]


def described_entry(name: str, thing: object) -> Entry:
    """Return a name with the first line of a docstring, without markup of references and code."""
    docstring = inspect.getdoc(thing) or ""
    line = docstring.partition("\n")[0].replace("``", "`")
    return name, re.sub(r"(?::\w+:`\.?|`)([^`]*)`", r"\1", line)


def part_entry(name: str, part: Callable[..., object], required: Iterable[str]) -> Entry:
    """Return the entry of a law, a demand or a resolver: options and required information."""
    options = []
    for parameter in inspect.signature(part).parameters.values():
        without_type = parameter.replace(annotation=parameter.empty)
        options.append(str(without_type))
    details = []
    for what, texts in (("options", options), ("requires", [*required])):
        if texts:
            details.append(f"{what}: {', '.join(texts)}")
    return (*described_entry(name, part), *details)


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
    text = metric.definition or metric.header
    sentences = re.split(r"(?<=\.) (?=[A-Z])", text, maxsplit=1)
    return metric.column, *sentences


def scenarios() -> Iterator[Entry]:
    """Return the shipped scenarios with title and description."""
    for name in shipped_scenarios():
        yield _scenario(Scenario.load(name))


def laws() -> Iterator[Entry]:
    """Return the registered laws."""
    for name, law in registered_laws().items():
        yield part_entry(name, law, law().uses)


def demands() -> Iterator[Entry]:
    """Return the demands of which laws are made."""
    for part in DEMANDS:
        required = [USED_BY_DEMANDS[name] for name in part.uses]
        yield part_entry(part.name, part, required)


def resolvers() -> Iterator[Entry]:
    """Return the resolvers of which laws are made."""
    for part in RESOLVERS:
        required = [USED_BY_RESOLVERS[name] for name in part.uses]
        yield part_entry(part.name, part, required)


def solvers() -> Iterator[Entry]:
    """Return the QP solvers, and whether each is installed."""
    return map(_solver, solver_names())


def robots() -> Iterator[Entry]:
    """Return the robots that scenarios can name."""
    return starmap(described_entry, READY_MADE.items())


def constraints() -> Iterator[Entry]:
    """Return the types of constraints."""
    return starmap(described_entry, CONSTRAINTS.items())


def features() -> Iterator[Entry]:
    """Return the features of visual tasks."""
    return starmap(described_entry, FEATURES.items())


def shapes() -> Iterator[Entry]:
    """Return the shapes of curves in the image."""
    return starmap(described_entry, SHAPES.items())


def metrics() -> Iterator[Entry]:
    """Return the columns of results.csv that are scores."""
    return (_metric(metric) for metric in run_metrics() if metric.value is not None)


def kinds() -> dict[str, Callable[[], Iterable[Entry]]]:
    """Return functions that return the entries of each kind."""
    found: dict[str, Listing] = registered("listings")
    before = {name: listing.before for name, listing in found.items()}
    ordered = in_order(found, before)
    return {name: load(listing.function) for name, listing in ordered.items()}


def print_listing(words: Sequence[str]) -> None:
    """Print the names of all kinds, or the descriptions of ``words``.

    Raises ConfigurationError for an unknown word.
    """
    known = kinds()
    if not words:
        rows = []
        for kind, entries in known.items():
            names = [name for name, *_ in entries()]
            rows.append((kind, ", ".join(names)))
        _print_table(rows)
        console.print("\nDetails: vsconstraints list KIND, for example list laws, or list NAME")
    for word in words:
        kind = "laws" if word == "controllers" else word
        if kind in known:
            _print_table((name, text) for name, text, *_ in known[kind]())
            continue
        _print_named(word, known)


def _print_named(word: str, known: Mapping[str, Callable[[], Iterable[Entry]]]) -> None:
    """Print the entries of all kinds with this name; raises ConfigurationError without any."""
    names = [*known]
    is_found = False
    for kind, entries in known.items():
        for name, *texts in entries():
            names.append(name)
            if name == word:
                is_found = True
                details = [text for text in texts if text]
                _print_table([(f"{name} ({kind})", "\n".join(details))])
    if not is_found:
        raise unknown_name("kind or name", word, names)


def _print_table(rows: Iterable[tuple[str, str]]) -> None:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for row in rows:
        table.add_row(*row)
    console.print(table, soft_wrap=False)
