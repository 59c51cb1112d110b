"""What `vsconstraints list` shows: everything that can be named in files and on the command line."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable

from rich.console import Console
from rich.table import Table

from ..arms.drivers import DRIVERS, driver_class
from ..comparisons.metrics import METRICS
from ..constraints.curves import SHAPES
from ..controllers import CONTROLLERS, DEMANDS, RESOLVERS
from ..controllers.demands import USES
from ..controllers.resolvers import USES as OF_TASK
from ..errors import ConfigurationError
from ..qp import make_solver, solver_names
from ..robots.catalogue import READY_MADE
from ..scenarios import CONSTRAINTS, Scenario, shipped_scenarios
from ..vision.features import FEATURES


def print_listing(console: Console) -> None:
    """Print tables of all that has a name, scenarios first."""
    scenarios = [Scenario.load(name) for name in shipped_scenarios()]
    _print(console, "Scenarios", [(scenario.name, scenario.title) for scenario in scenarios])
    _print(console, "Controllers", [(name, _controller_line(name)) for name in CONTROLLERS])
    demands = [(demand.name, _part_line(demand, [USES[name] for name in demand.uses])) for demand in DEMANDS]
    _print(console, "Demands (of laws)", demands)
    resolvers = [(part.name, _part_line(part, [OF_TASK[name] for name in part.uses])) for part in RESOLVERS]
    _print(console, "Resolvers (of laws)", resolvers)
    _print(console, "QP solvers (for hierarchical-qp)", [(name, _solver_line(name)) for name in solver_names()])
    _print(console, "Robots", [(name, _first_line(make)) for name, make in READY_MADE.items()])
    _print(console, "Arms (addresses for run)", [(f"{name}://", _first_line(driver_class(name))) for name in DRIVERS])
    _print(console, "Constraints", [(name, _first_line(make)) for name, make in CONSTRAINTS.items()])
    _print(console, "Features", [(name, _first_line(feature)) for name, feature in FEATURES.items()])
    metrics = [(metric.column, metric.definition or metric.header) for metric in METRICS if metric.value is not None]
    _print(console, "Metrics (columns of results.csv)", metrics)
    _print(console, "Shapes (for occlusion)", [(name, _first_line(shape)) for name, shape in SHAPES.items()])


def _controller_line(name: str) -> str:
    law = CONTROLLERS[name]
    return _part_line(law, law().uses)


def _part_line(part: Callable[..., object], uses: Iterable[str] = ()) -> str:
    """What a law, a demand or a resolver is, its options with their defaults, and what it uses."""
    options = ", ".join(str(p.replace(annotation=p.empty)) for p in inspect.signature(part).parameters.values())
    lines = {"options": options, "uses": ", ".join(uses)}
    return "\n".join([_first_line(part), *(f"{what}: {text}" for what, text in lines.items() if text)])


def _solver_line(name: str) -> str:
    try:
        make_solver(name)
    except ConfigurationError as error:
        return str(error)
    return "installed"


def _first_line(thing: object) -> str:
    """The first line of a docstring, as one reads it: without the marks of references and code."""
    line = (inspect.getdoc(thing) or "").partition("\n")[0]
    return re.sub(r"(?::\w+:`\.?|`)([^`]*)`", r"\1", line.replace("``", "`"))


def _print(console: Console, title: str, lines: list[tuple[str, str]]) -> None:
    table = Table(title=title, title_justify="left", show_header=False, box=None, padding=(0, 2, 0, 0))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for name, text in lines:
        table.add_row(name, text)
    console.print(table)
    console.print()
