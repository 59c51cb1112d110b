"""Claims, verdicts on them, and their sentences as Jinja templates with numbers filled in."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal

from jinja2 import Environment, StrictUndefined

from ..comparisons.run import Run
from ..comparisons.runs.spec import RunSpec
from ..reports.numbers import number, percent
from ..rows.readable import amount, counted
from ..scenarios.reading import require_known

Verdict = Literal["holds", "holds partly", "does not hold", "not measured"]

KEYS = (
    "where",
    "sentence",
    "rule",
    "figure",
    "measured",
    "runs",
    "shown",
    "values",
    "holds",
    "partly",
    "measure",
)
VERDICTS: tuple[Verdict, ...] = ("holds", "holds partly", "does not hold", "not measured")

#: Contents of ``claims.toml``: by key the paper's words, the rule, and the wording of the
#: measurement; ``shared``, the parts that several rules contain; ``measures``, the wording of
#: measures that several claims share.
TEXTS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("claims.toml").read_text(encoding="utf-8")
)


def shown_intervals(intervals: Sequence[tuple[float, float]]) -> str:
    """Format intervals as ``2.96–4.90 s and 8.02–9.14 s``, or ``never``."""
    return " and ".join(f"{first:.2f}–{last:.2f} s" for first, last in intervals) or "never"


ENVIRONMENT = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
#: Filters of templates: a value or a multiple of it in a format of Python; amounts and numbers as
#: reports print them; shares in per cent; intervals; samples.
ENVIRONMENT.filters |= {
    "fmt": lambda value, spec, factor=1: format(factor * value, spec),
    "amount": amount,
    "number": number,
    "percent": percent,
    "intervals": shown_intervals,
    "samples": lambda samples: counted(samples, "sample"),
}
ENVIRONMENT.tests["finite"] = math.isfinite
template = cache(ENVIRONMENT.from_string)
expression = cache(partial(ENVIRONMENT.compile_expression, undefined_to_none=False))


def filled(text: str, **values: Any) -> str:
    """Fill values into a template."""
    return template(text).render(values)


def calculated(formula: str, known: Mapping[str, Any]) -> Any:
    """Evaluate an expression of a template on named values."""
    return expression(formula)(known)


@dataclass(frozen=True)
class Finding:
    """Result of measuring a claim."""

    verdict: Verdict  #: Follows from the values by the claim's rule.
    text: str  #: Measured numbers in a sentence, or the reason why there are none.
    #: The same numbers by name, unrounded.
    values: Mapping[str, float] = field(default_factory=dict)


class NotMeasured(Exception):
    """A claim lacks a run or study; the message names it and the reason."""


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper, and its measurement."""

    #: Number of the claim, and letter of its sentence.
    number: int
    letter: str
    where: str  #: Section and figure of the paper.
    sentence: str  #: Statement of the paper.
    rule: str  #: Condition for the verdict ``holds`` and, if possible, for ``holds partly``.
    figure: str  #: File name of the figure that shows it; empty if there is none.
    #: Simulations, and names of studies, whose results are the arguments of :attr:`measure`, in
    #: order.
    needs: tuple[RunSpec | str, ...]
    measure: Callable[..., Finding]  #: Converts these results to a finding.

    @property
    def key(self) -> str:
        """Key of the claim, for example ``"1a"``."""
        return f"{self.number}{self.letter}"

    def check(self, available: Mapping[RunSpec | str, Any]) -> Finding:
        """Measure the claim on the available runs and studies.

        A string stands for a missing one. Errors lead to ``not measured``.
        """
        try:
            return self.measure(*(_usable(need, available) for need in self.needs))
        except NotMeasured as reason:
            return Finding("not measured", str(reason))
        except Exception as error:  # an error of one claim must not affect the others
            return Finding("not measured", f"{type(error).__name__}: {error}")


def _usable(need: RunSpec | str, available: Mapping[RunSpec | str, Any]) -> Any:
    result = available.get(need, "was not run")
    if isinstance(result, str):
        raise NotMeasured(f"{need}: {result}")
    tolerated = isinstance(need, RunSpec) and need.may_end_early
    if (
        isinstance(result, Run)
        and result.trajectory.status in ("failed", "aborted")
        and not tolerated
    ):
        raise NotMeasured(f"{need}: {result.trajectory.status}, {result.trajectory.reason}")
    return result


CLAIMS: dict[str, Claim] = {}  #: All claims by key.


def all_claims() -> list[Claim]:
    """Return all claims in the order of the report."""
    return sorted(CLAIMS.values(), key=lambda one: (one.number, one.letter))


def claim(
    key: str, *needs: RunSpec | str
) -> Callable[[Callable[..., Finding]], Callable[..., Finding]]:
    """Register a function as the measurement of a claim in :data:`TEXTS`.

    For ``needs`` see :class:`Claim`.
    """

    def register(measure: Callable[..., Finding]) -> Callable[..., Finding]:
        if key in CLAIMS:
            raise ValueError(f"there are two claims {key}")
        shared: dict[str, str] = {}
        for name, part in TEXTS["shared"].items():  # a part may contain earlier ones
            shared[name] = part.format(**shared)
        text = TEXTS[key]
        require_known(text, KEYS, f"claims.toml, {key}")
        rule = text["rule"].format(**shared)
        figure = text.get("figure", "")
        CLAIMS[key] = Claim(
            int(key[:-1]), key[-1], text["where"], text["sentence"], rule, figure, needs, measure
        )
        return measure

    return register


def judged(good: bool, part: bool = False) -> Verdict:
    """Return ``holds`` if good, else ``holds partly`` if ``part``, else ``does not hold``."""
    return "holds" if good else "holds partly" if part else "does not hold"


def finding(
    key: str,
    good: bool,
    part: bool = False,
    shown: Mapping[str, Any] | None = None,
    /,
    **values: Any,
) -> Finding:
    """Return the finding of a claim or shared measure, in the words of :data:`TEXTS`.

    For ``good`` and ``part`` see :func:`judged`. The text may contain ``shown`` and the finding's
    values.
    """
    return Finding(judged(good, part), worded(key, **values, **(shown or {})), values)


def worded(key: str, /, **values: Any) -> str:
    """Fill values into the sentence of :data:`TEXTS` for a measurement, on one line."""
    template = TEXTS[key]["measured"] if key in TEXTS else TEXTS["measures"][key]
    return " ".join(filled(template, **values).split())


def register_formulas(names: Mapping[str, Any]) -> None:
    """Register the claims that :data:`TEXTS` measures by formulas.

    Claims whose runs are not all in ``names`` are skipped.
    """
    for key, text in TEXTS.items():
        needs = text.get("runs", "").split()
        if needs and names.keys() >= {*needs}:
            claim(key, *(names[need] for need in needs))(partial(by_formulas, key, names))


def by_formulas(key: str, names: Mapping[str, Any], *results: Any) -> Finding:
    """Return the finding of a claim, by applying its formulas in :data:`TEXTS` to results."""
    text = TEXTS[key]
    known = {**names, **dict(zip(text["runs"].lower().split(), results, strict=True))}
    if "measure" in text:
        measured: Finding = calculated(text["measure"], known)
        return measured
    values: dict[str, Any] = {}
    for name, formula in text.get("shown", {}).items():
        known[name] = calculated(formula, known)
        if isinstance(known[name], Finding):
            values |= known[name].values
            known |= known[name].values
    given = text.get("values", {})
    for name, formula in given.items() if isinstance(given, dict) else ():
        known[name] = values[name] = calculated(formula, known)
    values |= calculated(given, known) if isinstance(given, str) else {}
    known["partly"] = bool(calculated(text.get("partly", "false"), known))
    verdict = judged(bool(calculated(text["holds"], known)), known["partly"])
    return Finding(verdict, worded(key, **known), values)
