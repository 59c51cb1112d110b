"""What a claim is, and what can be said of it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ..comparisons.run import Run
from ..comparisons.runs.spec import RunSpec
from ..rows.readable import counted
from ..simulation.trajectory import Outcome

Verdict = Literal["holds", "holds partly", "does not hold", "not measured"]

VERDICTS: tuple[Verdict, ...] = ("holds", "holds partly", "does not hold", "not measured")

ENDED_EARLY: tuple[Outcome, ...] = ("failed", "aborted")
"""Statuses of runs on which nothing can be measured but how they ended."""

TEXTS: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_name("claims.toml").read_text(encoding="utf-8"))
"""What ``claims.toml`` says: by key, the paper's words and the rule; ``shared``, what several rules contain."""


@dataclass(frozen=True)
class Finding:
    """What was found of a claim.

    Attributes
    ----------
    verdict
        Follows from the values by the claim's rule.
    text
        The measured numbers in a sentence, or why there are none.
    values
        The same numbers by name, unrounded.
    """

    verdict: Verdict
    text: str
    values: Mapping[str, float] = field(default_factory=dict)


class NotMeasured(Exception):
    """What a claim needs is not there; the message says what and why."""


@dataclass(frozen=True)
class Claim:
    """One sentence of the paper and how it is measured.

    Attributes
    ----------
    number, letter
        Which claim, and which of its sentences.
    where
        Section and figure of the paper.
    sentence
        What the paper says.
    rule
        When the verdict is ``holds``; and when ``holds partly``, if it can be.
    figure
        File name of the figure that shows it; empty if there is none.
    needs
        Simulations, and names of studies, whose results :attr:`measure` takes, in this order.
    measure
        From these to a finding.
    """

    number: int
    letter: str
    where: str
    sentence: str
    rule: str
    figure: str
    needs: tuple[RunSpec | str, ...]
    measure: Callable[..., Finding]

    @property
    def key(self) -> str:
        """For example ``"1a"``."""
        return f"{self.number}{self.letter}"

    def check(self, available: Mapping[RunSpec | str, Any]) -> Finding:
        """Measure it on what is available; whatever goes wrong becomes a finding ``not measured`` with its reason.

        Parameters
        ----------
        available
            Runs and study results by what was asked for; a string says why there is none.
        """
        try:
            return self.measure(*(_usable(need, available) for need in self.needs))
        except NotMeasured as reason:
            return Finding("not measured", str(reason))
        except Exception as error:  # one claim must not cost the others
            return Finding("not measured", f"{type(error).__name__}: {error}")


def _usable(need: RunSpec | str, available: Mapping[RunSpec | str, Any]) -> Any:
    found = available.get(need, "was not run")
    if isinstance(found, str):
        raise NotMeasured(f"{need}: {found}")
    tolerated = isinstance(need, RunSpec) and need.may_end_early
    if isinstance(found, Run) and found.trajectory.status in ENDED_EARLY and not tolerated:
        raise NotMeasured(f"{need}: {found.trajectory.status}, {found.trajectory.reason}")
    return found


CLAIMS: dict[str, Claim] = {}
"""Every claim by its key."""


def all_claims() -> list[Claim]:
    """Every claim, in the order of the report."""
    return sorted(CLAIMS.values(), key=lambda one: (one.number, one.letter))


def claim(key: str, *needs: RunSpec | str) -> Callable[[Callable[..., Finding]], Callable[..., Finding]]:
    """Register a function as the measurement of the claim that :data:`TEXTS` has under this key.

    Parameters
    ----------
    key
        Number and letter.
    needs
        See :class:`Claim`.
    """

    def register(measure: Callable[..., Finding]) -> Callable[..., Finding]:
        if key in CLAIMS:
            raise ValueError(f"there are two claims {key}")
        text = TEXTS[key]
        rule = text["rule"].format(**_shared())
        figure = text.get("figure", "")
        CLAIMS[key] = Claim(int(key[:-1]), key[-1], text["where"], text["sentence"], rule, figure, needs, measure)
        return measure

    return register


def _shared() -> dict[str, str]:
    """What several rules contain; one may contain those before it."""
    found: dict[str, str] = {}
    for name, text in TEXTS["shared"].items():
        found[name] = text.format(**found)
    return found


def judged(good: bool, part: bool = False) -> Verdict:
    """``holds`` if good, else ``holds partly`` if that is true, else ``does not hold``."""
    return "holds" if good else "holds partly" if part else "does not hold"


def finding(text: str, good: bool, part: bool = False, /, **values: float) -> Finding:
    """What was found, with the verdict that :func:`judged` gives."""
    return Finding(judged(good, part), text, values)


def plural(samples: int) -> str:
    """``1 sample``, ``14 samples``."""
    return counted(samples, "sample")


def shown_intervals(found: Sequence[tuple[float, float]]) -> str:
    """``2.96–4.90 s and 8.02–9.14 s``; ``never``."""
    return " and ".join(f"{first:.2f}–{last:.2f} s" for first, last in found) or "never"


def ends_of(found: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Of intervals: ``from_0``, ``to_0``, ``from_1`` and so on."""
    return {
        f"{side}_{k}": time for k, pair in enumerate(found) for side, time in zip(("from", "to"), pair, strict=True)
    }


def rounds_to(found: Sequence[tuple[float, float]], printed: Sequence[tuple[float, float]]) -> bool:
    """Whether as many intervals were found as are printed, and their ends are within half a second of these."""
    return len(found) == len(printed) and all(
        abs(a - b) <= 0.5 for one, other in zip(found, printed, strict=True) for a, b in zip(one, other, strict=True)
    )
