"""Success on fresh scenes of a secret seed, compared with that on the held-out scenes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from scipy.stats import fisher_exact

from ...errors import ConfigurationError
from ...reports.markdown import Table, plain
from ..statistics import Rate, rate
from ..study import CONDITION, Study
from .ranking import condition_text

CONDITIONS = ("nominal", "disturbed")  #: Conditions in which fresh scenes are run.
SIGNIFICANT = 0.05  #: Significance level of all comparisons of a table together.


class FreshRate(NamedTuple):
    """Success of a law in a condition on fresh scenes and on published ones.

    ``p`` is the two-sided p-value of Fisher's exact test of equal rates on independent scenes.
    """

    law: str
    condition: str
    fresh: Rate
    published: Rate
    p: float


def fresh_rates(fresh: Study, published: Study) -> list[FreshRate]:
    """Compare the success of each law that both studies have run on the same families.

    Laws are ordered by their published success, best first. Raises ConfigurationError if the
    studies have no law or no condition in common.
    """
    found = []
    same_families = published.runs["family"].isin(fresh.runs["family"].unique())
    published = replace(published, runs=published.runs[same_families])
    success = published.runs.groupby("controller", observed=True)["success"].mean()
    for law in success.sort_values(ascending=False, kind="stable").index:
        for condition in CONDITIONS:
            on_fresh = _success(fresh, law, condition)
            on_published = _success(published, law, condition)
            if on_fresh.of and on_published.of:
                p = _p_value(on_fresh, on_published)
                found.append(FreshRate(law, condition, on_fresh, on_published, p))
    if not found:
        raise ConfigurationError(
            "the fresh runs have no law and condition in common with the published ones"
        )
    return found


def _success(study: Study, law: str, condition: str) -> Rate:
    runs = study.runs
    is_counted = (runs["controller"] == law) & (runs[CONDITION] == condition)
    return rate(runs.loc[is_counted, "success"].astype(bool))


def _p_value(fresh: Rate, published: Rate) -> float:
    table = []
    for success in (fresh, published):
        table.append([success.count, success.of - success.count])
    return float(fisher_exact(table).pvalue)


def fresh_page(fresh: Study, published: Study) -> str:
    """Return the table of :func:`fresh_rates` in Markdown and a sentence on the differences."""
    rates = fresh_rates(fresh, published)
    conditions = [name for name in CONDITIONS if any(each.condition == name for each in rates)]
    header = ["law"]
    for condition in conditions:
        header += [f"{condition_text(condition, inside=True)} [%]", "published [%]", "p"]
    lines = []
    for law in dict.fromkeys(each.law for each in rates):
        line = [plain(law)]
        for condition in conditions:
            line += _cells(rates, law, condition)
        lines.append(line)
    differing = [each for each in rates if each.p < SIGNIFICANT / len(rates)]
    names = ", ".join(f"{each.law} ({each.condition})" for each in differing)
    lowest = min(rates, key=lambda each: each.p)
    verdict = f"differ significantly: {names}" if differing else "differs significantly"
    sentence = (
        f"Success on {rates[0].fresh.of} fresh scenes, with exact 95 % intervals, and on the "
        f"{rates[0].published.of} published ones. Fisher's exact test, Bonferroni over "
        f"{len(rates)} comparisons: {len(differing) or 'none'} {verdict}. The smallest p is "
        f"{lowest.p:.2g} ({lowest.law}, {lowest.condition})."
    )
    return f"{Table(header, lines)}\n\n{sentence}"


def _cells(rates: list[FreshRate], law: str, condition: str) -> Iterator[str]:
    for each in rates:
        if (each.law, each.condition) == (law, condition):
            fresh = each.fresh
            interval = f"({100 * fresh.low:.1f}–{100 * fresh.high:.1f})"
            yield f"{100 * fresh.share:.1f} {interval}"
            yield f"{100 * each.published.share:.1f}"
            yield f"{each.p:.2f}"
            return
    yield from ("", "", "")
