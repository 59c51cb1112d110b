"""Claims of the paper, findings about them, and the decorator that registers a measurement."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, SupportsFloat

import numpy as np

from ..comparisons.run import Run
from ..comparisons.runs.spec import RunSpec
from ..rows.readable import counted

Verdict = Literal["holds", "holds partly", "does not hold", "not measured"]

VERDICTS: tuple[Verdict, ...] = ("holds", "holds partly", "does not hold", "not measured")


def shown_intervals(intervals: Sequence[tuple[float, float]]) -> str:
    """Format intervals as ``2.96–4.90 s and 8.02–9.14 s``, or ``never``."""
    return " and ".join(f"{first:.2f}–{last:.2f} s" for first, last in intervals) or "never"


def shown_samples(count: float) -> str:
    """Format a number of samples: ``1 sample``, ``4 samples``."""
    return counted(int(count), "sample")


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
    return sorted(CLAIMS.values(), key=lambda claim: (claim.number, claim.letter))


def claim(
    key: str, *needs: RunSpec | str, where: str, sentence: str, rule: str, figure: str = ""
) -> Callable[[Callable[..., Finding]], Callable[..., Finding]]:
    """Register a function as the measurement of a sentence of the paper.

    ``key`` is the number of the claim and the letter of its sentence. The other arguments are those
    of :class:`Claim`. Without ``figure``, it is the counterpart of the last figure in ``where`` or,
    if there is none, the figure of a needed study. Raises ValueError if there is a claim with this
    key.
    """
    figure = figure or _shown_in(where, needs)

    def register(measure: Callable[..., Finding]) -> Callable[..., Finding]:
        if key in CLAIMS:
            raise ValueError(f"there are two claims {key}")
        CLAIMS[key] = Claim(int(key[:-1]), key[-1], where, sentence, rule, figure, needs, measure)
        return measure

    return register


def _shown_in(where: str, needs: Sequence[RunSpec | str]) -> str:
    """Return the file of the figure that shows a claim, by default; empty if there is none."""
    if named := re.search(r"Figs?\. (?:\d+, )*(\d+)", where):
        return f"fig-{int(named[1]):02d}.png"
    return next((f"study-{need}.png" for need in needs if isinstance(need, str)), "")


def judged(good: bool, part: bool = False) -> Verdict:
    """Return ``holds`` if good, else ``holds partly`` if ``part``, else ``does not hold``."""
    return "holds" if good else "holds partly" if part else "does not hold"


def finding(
    text: str, *, holds: bool | np.bool, partly: bool | np.bool = False, **values: SupportsFloat
) -> Finding:
    """Return a finding with this text and these values; see :func:`judged` for its verdict."""
    numbers = {name: float(value) for name, value in values.items()}
    return Finding(judged(bool(holds), bool(partly)), text, numbers)
