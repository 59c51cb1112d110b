"""Names of earlier versions: of modules that moved into optional parts, and of constants.

They are for code of users; the package itself imports nothing by them. Importing the name of a
module gives the module of today, no second copy of it. Suites, stored campaigns and kept tables
(``comparisons/policy.parquet``) name ``vsconstraints.learning``, and are part of an identity that a
new name would change.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, cast

#: Modules and packages by their earlier names. Those within a package are found, too. A module that
#: moved elsewhere than its package stands before it: the first name that fits counts.
MOVED_MODULES = {
    "vsconstraints.comparisons.difference": "vsconstraints.bench.difference",
    "vsconstraints.comparisons.evidence": "vsconstraints.bench.evidence",
    "vsconstraints.comparisons.statistics": "vsconstraints.bench.statistics",
    "vsconstraints.comparisons.study": "vsconstraints.bench.study",
    "vsconstraints.comparisons.tuning": "vsconstraints.bench.tuning",
    "vsconstraints.controllers.planner": "vsconstraints.prediction.planner",
    "vsconstraints.controllers.predictive": "vsconstraints.prediction.predictive",
    "vsconstraints.controllers.robust_predictive": "vsconstraints.prediction.robust_predictive",
    "vsconstraints.controllers.velocity.base": "vsconstraints.controllers.velocity_controller",
    "vsconstraints.controllers.velocity": "vsconstraints.velocity",
    "vsconstraints.learning": "vsconstraints.bench.learning",
    "vsconstraints.reports.evidence": "vsconstraints.bench.reports",
    "vsconstraints.reports.notebooks": "vsconstraints.view.notebooks",
    "vsconstraints.reports.preview": "vsconstraints.view.preview",
    "vsconstraints.reports.replay": "vsconstraints.view.replay",
    "vsconstraints.scenarios.families": "vsconstraints.bench.families",
    "vsconstraints.simulation.dynamics": "vsconstraints.dynamics",
    "vsconstraints.velocity.base": "vsconstraints.controllers.velocity_controller",
    "vsconstraints.vision.images": "vsconstraints.images",
}


class EarlierNames:
    """Finder of modules by their earlier names, and loader that gives those of today."""

    @classmethod
    def find_spec(
        cls, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the specification of a module that moved; None for any other module."""
        today = cls.today(name)
        return None if today is None else ModuleSpec(name, cast("Any", cls), origin=today)

    @staticmethod
    def today(name: str) -> str | None:
        """Return the name of today of a module that moved; None for any other module."""
        if name.startswith("vsconstraints."):
            for earlier, today in MOVED_MODULES.items():
                if name == earlier or name.startswith(f"{earlier}."):
                    return f"{today}{name.removeprefix(earlier)}"
        return None

    @staticmethod
    def create_module(spec: ModuleSpec) -> None:
        """Let the import system create a module, which :meth:`exec_module` replaces."""

    @classmethod
    def exec_module(cls, module: ModuleType) -> None:
        """Put the module of today in the place of a module."""
        today = cls.today(module.__name__)
        assert today is not None
        sys.modules[module.__name__] = import_module(today)


def install() -> None:
    """Let earlier names be imported, once."""
    if EarlierNames not in sys.meta_path:
        sys.meta_path.insert(0, EarlierNames)


def earlier_constants(
    module: str, functions: Mapping[str, Callable[[], Any]]
) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a module whose constants are the values of functions today.

    ``functions`` maps the name of each constant to the function that returns its value.
    """

    def get(name: str) -> Any:
        if name not in functions:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        return functions[name]()

    return get
