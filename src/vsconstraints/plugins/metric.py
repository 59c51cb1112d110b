"""Metric: a value of a run or of its rows, with its column and its look in reports.

Metrics of this package are in ``comparisons/metrics.py``; a part of another package adds its own by
:class:`.Part`. This module imports nothing of comparisons, so that a file with a metric can be
imported in any order.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal, get_args

import numpy as np

from ..errors import ConfigurationError, described, format_value, unknown_name

Kind = Literal["number", "time", "text", "flag"]
Better = Literal["less", "more"]
Group = Literal["outcome", "task", "chattering", "time"]
Judged = Literal["any", "inside", "sliding"]
NumberStyle = Literal["number", "error", "percent", "count"]
Condensed = Literal["median", "worst"]


@dataclass(frozen=True)
class Metric:
    """A column of results.csv or constraints.csv, and of the tables of reports.

    ``value`` computes the value of a run or, in constraints.csv, of each of its rows, from a
    :class:`.MetricInputs`; it is None for the ratio ``column / over``. It is called only for runs
    with samples, unless ``without_samples``; for others the cell is empty. ``better`` is None for
    facts and noise. A ``kind`` of ``time`` is a number that differs between runs on the same
    machine. Columns are ordered by ``column_order``: a new column gets a greater number than all
    others. Stored tables without a column are read with it empty, unless it is ``required`` because
    an empty cell would be read as a result.

    In reports, ``header`` (with unit; hidden if empty) is the heading in the table ``group`` of a
    scenario, and ``overall`` in the tables over all scenarios. There, runs are ``condensed`` to the
    worst, or to the median of those that converged (for times: of all runs). ``factor`` and
    ``style`` format the number: three digits; at least a thousandth; two decimals; whole.
    ``finding`` is the sentence that names the best law, and the unit. ``judged`` selects the
    converged runs that are compared: ``any``; those ``inside``, which violated no row; or, of
    these, the ones ``sliding``, which never lost a sliding mode.

    ``package`` is the name of the other package that adds the metric, which its part sets.

    Raises ConfigurationError if an entry is not one of its choices.
    """

    column: str
    value: Callable[[Any], Any] | None
    header: str = ""
    better: Better | None = "less"
    definition: str = ""
    kind: Kind = "number"
    group: Group = "chattering"
    judged: Judged = "inside"
    factor: float = 1.0
    style: NumberStyle = "number"
    over: str = ""
    overall: str = ""
    condensed: Condensed = "median"
    finding: tuple[str, str] = ("", "")
    column_order: int = 0
    required: bool = False
    without_samples: bool = False
    package: str = ""

    def __post_init__(self) -> None:
        if not (isinstance(self.column, str) and re.fullmatch(r"[A-Za-z]\w*", self.column)):
            raise ConfigurationError(
                "the column of a metric must be a name of letters, digits and '_', not "
                f"{format_value(self.column)}"
            )
        choices = {
            "kind": Kind,
            "group": Group,
            "judged": Judged,
            "style": NumberStyle,
            "condensed": Condensed,
        }
        if self.better is not None:
            choices["better"] = Better
        for name, kinds in choices.items():
            value = getattr(self, name)
            if value not in get_args(kinds):
                raise unknown_name(f"{name} of the metric {self.column}", value, get_args(kinds))
        if self.value is None and not self.over:
            raise ConfigurationError(f"the metric {self.column} has neither a value nor 'over'")
        if self.value is not None and self.over:
            raise ConfigurationError(
                f"the metric {self.column} has a value and 'over', which a ratio alone has"
            )
        if self.value is not None and not callable(self.value):
            raise ConfigurationError(
                f"the value of the metric {self.column} must be a function of a run, not "
                f"{format_value(self.value)}"
            )

    def __str__(self) -> str:
        return f"metric {self.column}" + (f" of {self.package}" if self.package else "")

    @property
    def is_number(self) -> bool:
        """True if values are numbers, times included."""
        return self.kind in ("number", "time")

    @property
    def empty(self) -> Any:
        """Value of an empty cell."""
        if self.kind == "text":
            return ""
        return None if self.kind == "flag" else math.nan

    def of_run(self, inputs: Any) -> Any:
        """Return the value of a run. Raises ConfigurationError if it fails or has another kind."""
        value = self._computed(inputs)
        self._require_kind(value)
        return value

    def of_rows(self, inputs: Any, rows: int) -> list[Any]:
        """Return the value of each row of a run.

        Raises ConfigurationError if this fails, or if there is not one value of the metric's kind
        for each row.
        """
        values = self._computed(inputs)
        try:
            each = list(values)
        except TypeError:
            each = []
        if len(each) != rows:
            raise ConfigurationError(
                f"the {self} must return one value for each of {rows} rows, not "
                f"{format_value(values)}"
            )
        for value in each:
            self._require_kind(value)
        return each

    def _computed(self, inputs: Any) -> Any:
        assert self.value is not None
        try:
            return self.value(inputs)
        except (Exception, SystemExit) as error:  # code of others may fail in any way
            raise ConfigurationError(
                f"the {self} cannot be computed: {described(error)}"
            ) from error

    def _require_kind(self, value: Any) -> None:
        is_flag = isinstance(value, (bool, np.bool_))
        is_valid = {
            "text": isinstance(value, str),
            "flag": is_flag,
            "number": isinstance(value, Real) and not is_flag,
        }
        kind = "number" if self.is_number else self.kind
        if not is_valid[kind]:
            raise ConfigurationError(f"the {self} must return a {kind}, not {format_value(value)}")
