"""Registry of parts, by which optional folders and other packages extend the core.

A part is described by one :class:`Part`, which names functions and classes as ``module:name``. They
are imported when they are needed, so that the core runs without them. The package's own parts are
those of :data:`OWN`, found by their names: an installation whose metadata is older than its files
still has them. Another package registers its part by an entry point of the group :data:`GROUP`::

    [project.entry-points."vsconstraints.parts"]
    my-part = "my_package.part:PART"
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

from ..errors import ConfigurationError, VsconstraintsError, described, format_value
from .metric import Metric

Value = TypeVar("Value")

#: Folders that register something, in the order in which ``vsconstraints --help`` shows them.
OWN = (
    "cli",
    "view",
    "arms",
    "score",
    "paper",
    "bench",
    "prediction",
    "velocity",
    "dynamics",
    "images",
    "stacks",
)
#: Those of them that register laws. Making a law imports no other part.
WITH_LAWS = ("prediction", "velocity")
GROUP = "vsconstraints.parts"  #: Group of the entry points of other packages.


class Command(NamedTuple):
    """Command of the command line: ``function`` is called with its parsed parameters.

    Its annotations and docstring give types and help, its part's options file the rest. The command
    is shown in the ``panel`` of ``--help``, at its end or ``before`` another command.
    """

    function: str
    panel: str
    example: str
    before: str = ""


class Group(NamedTuple):
    """Group of commands, such as ``testset``, with its purpose and an example."""

    text: str
    example: str


class Listing(NamedTuple):
    """Kind of things that ``vsconstraints list`` shows.

    ``function`` returns tuples of a name, a description and further lines. The kind is listed at
    the end or ``before`` another one.
    """

    function: str
    before: str = ""


@dataclass(frozen=True)
class Part:
    """Extensions by one part; every function and class is given as ``module:name``.

    Parts of other packages have all of them but laws.
    """

    #: Commands by name; ``testset run`` is the command ``run`` of the group ``testset``.
    commands: Mapping[str, Command] = field(default_factory=dict)
    groups: Mapping[str, Group] = field(default_factory=dict)  #: Groups of commands by name.
    #: TOML file that describes the parameters of the commands, see ``cli/options.toml``.
    options: Path | None = None
    listings: Mapping[str, Listing] = field(default_factory=dict)
    #: Types of the scenario tables ``plant`` and ``sensor``: by table and by type the class whose
    #: fields are the table's keys, see :mod:`vsconstraints.simulation.settings`.
    scenario_tables: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    #: Laws by name: classes of :class:`vsconstraints.controllers.Controller`, of the parts
    #: :data:`WITH_LAWS` of this package. Laws of other packages are named as ``module:Class``, so
    #: that results depend on their files.
    laws: Mapping[str, str] = field(default_factory=dict)
    #: Controllers of special tables, by the name of their kind: ``stack`` is that of tables with a
    #: command or an adapter, which run a program in a process of its own.
    controllers: Mapping[str, str] = field(default_factory=dict)
    #: Figures of each scenario in a report: objects of
    #: :class:`vsconstraints.reports.plots.sheet.Figure`, drawn from a
    #: :class:`vsconstraints.reports.figures.view.View`.
    figures: Sequence[str] = ()
    #: Text of each scenario in a report, by what it shows: functions that take the
    #: :class:`vsconstraints.reports.results.Results` and the scenario's name, and return Markdown.
    report_sections: Mapping[str, str] = field(default_factory=dict)
    #: Metrics of runs and of their rows that a part of another package adds to results.csv,
    #: constraints.csv and reports: objects of :class:`.Metric`. Those of this package are in
    #: ``comparisons/metrics.py``.
    metrics: Sequence[str] = ()
    row_metrics: Sequence[str] = ()
    #: Kinds of results, by name; that of the core is ``a comparison``. Objects of
    #: ``vsconstraints.cli.results.ResultsKind``.
    results: Mapping[str, str] = field(default_factory=dict)


@cache
def parts_with_packages() -> tuple[tuple[str, Part], ...]:
    """Return all parts, each after the name of the package that it is from.

    Those of this package are first, then those of other packages by their names. Raises
    ConfigurationError if a part of another package cannot be imported.
    """
    found = []
    for name in OWN:
        package = f"vsconstraints.{name}"
        found.append((package, load(f"{package}.part:PART")))
    for installed in parts_of_other_packages():
        found.append((installed.package, installed.part))
    return tuple(found)


class InstalledPart(NamedTuple):
    """Part of another package, with the name and the version of the package."""

    part: Part
    package: str
    version: str


@cache
def parts_of_other_packages() -> tuple[InstalledPart, ...]:
    """Return the parts of other packages by the names of their entry points.

    Raises ConfigurationError if one cannot be imported.
    """
    found = []
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        package = "an unknown package"
        version = ""
        if entry.dist is not None:
            package = entry.dist.name
            version = entry.dist.version
        where = f"part {entry.name} of {package}, {entry.value}"
        try:
            part = entry.load()
        except (Exception, SystemExit) as error:  # code of others may fail in any way
            raise ConfigurationError(
                f"{where}, cannot be imported: {described(error)}. Repair or uninstall {package}"
            ) from error
        if not isinstance(part, Part):
            raise ConfigurationError(f"{where}, must be a Part, not {format_value(part)}")
        if part.laws:
            raise ConfigurationError(
                f"{where}, registers the laws {', '.join(part.laws)}: remove them from the part, "
                f"and name them as module:Class where they are used, so that results depend on "
                f"their files"
            )
        found.append(InstalledPart(part, package, version))
    return tuple(found)


def load(reference: str) -> Any:
    """Import the object that ``"module:name"`` names.

    Raises ConfigurationError that names it if this fails, and the package's own errors.
    """
    module, _, name = reference.partition(":")
    try:
        return getattr(import_module(module), name)
    except VsconstraintsError:
        raise
    except (Exception, SystemExit) as error:  # code of others may fail in any way
        raise ConfigurationError(
            f"{reference}, which a part names, cannot be imported: {described(error)}"
        ) from error


def registered(kind: str) -> dict[str, Any]:
    """Return what all parts register of a kind, a field of :class:`Part`, by name.

    Raises ConfigurationError, which names both packages, if two parts register the same name.
    """
    tables = [(package, getattr(part, kind)) for package, part in parts_with_packages()]
    return _joined(tables, kind.replace("_", " "))


def with_laws_of_parts(package: str, core: Mapping[str, Value]) -> dict[str, Value]:
    """Return the laws of the core, and after them those that parts of this package register.

    All are classes by name; those of the core are from ``package``. Raises as :func:`registered`.
    """
    tables = [(package, core)]
    for name in WITH_LAWS:
        owner = f"vsconstraints.{name}"
        laws = load(f"{owner}.part:PART").laws
        tables.append((owner, {law: load(reference) for law, reference in laws.items()}))
    return _joined(tables, "laws")


def scenario_types(table: str) -> dict[str, str]:
    """Return references to the classes of a scenario table, by type.

    Raises as :func:`registered`.
    """
    tables = []
    for package, part in parts_with_packages():
        tables.append((package, part.scenario_tables.get(table, {})))
    return _joined(tables, f"types of {table}")


def _joined(tables: Iterable[tuple[str, Mapping[str, Value]]], kind: str) -> dict[str, Value]:
    """Return the entries of tables that packages register; raise ConfigurationError for a clash."""
    found: dict[str, Value] = {}
    packages: dict[str, str] = {}
    for package, table in tables:
        for name, value in table.items():
            if name in found:
                raise ConfigurationError(
                    f"two parts register {name} as {kind}: those of {packages[name]} and {package}"
                )
            found[name] = value
            packages[name] = package
    return found


def with_figures_of_parts(package: str, core: Iterable[Any]) -> list[Any]:
    """Return the figures of scenarios of the core, and after them those that parts register.

    Those of the core are from ``package``. Raises as :func:`registered`, since the files of two
    figures with one name would be the same.
    """
    # a table for each figure: a part may also register one name twice
    tables = [(package, {figure.name: figure}) for figure in core]
    for owner, part in parts_with_packages():
        for figure in map(load, part.figures):
            tables.append((owner, {figure.name: figure}))
    return [*_joined(tables, "figures").values()]


def added_metrics(table: Literal["metrics", "row_metrics"]) -> list[Metric]:
    """Return the metrics that parts of other packages add to a table, a field of :class:`Part`.

    Raises ConfigurationError, which names the package, if one cannot be imported or is no metric.
    """
    found = []
    for installed in parts_of_other_packages():
        for reference in getattr(installed.part, table):
            where = f"{reference}, a metric of {installed.package},"
            try:
                metric = load(reference)
            except VsconstraintsError as error:
                raise ConfigurationError(f"{where} cannot be used: {error}") from error
            if not isinstance(metric, Metric):
                raise ConfigurationError(f"{where} must be a Metric, not {format_value(metric)}")
            found.append(replace(metric, package=installed.package))
    return found


def packages_with_metrics() -> dict[str, str]:
    """Return the versions of the other packages that add metrics, by name."""
    return {
        installed.package: installed.version
        for installed in parts_of_other_packages()
        if installed.part.metrics or installed.part.row_metrics
    }


def in_order(values: Mapping[str, Value], before: Mapping[str, str]) -> dict[str, Value]:
    """Return the values in order, but each that has a name in ``before`` before that other one."""
    names = [name for name in values if not before.get(name)]
    for name in values:
        if name not in names:
            following = before[name]
            place = names.index(following) if following in names else len(names)
            names.insert(place, name)
    return {name: values[name] for name in names}
