"""``python -m checks.statistics [--repetitions N] [--seed S]``: coverage and false verdicts.

Worlds whose truth is known are drawn repeatedly. For 95 % intervals, the check counts how many
cover the truth, and for verdicts how many are right. For all pairs of several laws, it counts how
often any verdict is false (family-wise error) and how often all intervals cover at once
(simultaneous coverage). The same seed gives the same numbers. The exit code is 1 if a requirement
is not met.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pandas
from scipy.special import expit
from scipy.stats import norm

from vsconstraints.bench.statistics import (
    Rate,
    across_families,
    compare_laws,
    difference_interval,
    median,
    paired,
    rate_of,
    simultaneous,
)

EXACT = 0.94
"""Least accepted coverage of exact intervals, which cover the truth in 95 % or more.

With four thousand repetitions, three standard deviations are 1 %.
"""

Generator = np.random.Generator
Interval = tuple[float, float]


class Case(NamedTuple):
    """Interval whose truth is known.

    Attributes
    ----------
    what
        Name of the estimated quantity.
    truth
        True value.
    interval
        Draws data and returns one interval.
    least, most
        Bounds on the coverage.
    """

    what: str
    truth: float
    interval: Callable[[Generator], Interval]
    least: float
    most: float


class Question(NamedTuple):
    """Two laws, and the right verdict.

    Attributes
    ----------
    what
        Description.
    metric
        Metric of the comparison.
    worse
        Factor by which the costs of the second law are greater.
    right
        Verdict of the first law against the second.
    noise
        Standard deviation of each law's logarithm of costs around the scene's.
    """

    what: str
    metric: str
    worse: float
    right: str
    noise: float = 0.05


@lru_cache(maxsize=100_000)
def rate_ends(count: int, of: int) -> Interval:
    """Interval of a rate."""
    found = rate_of(count, of)
    return found.low, found.high


ends = lru_cache(maxsize=100_000)(difference_interval)


def of_rate(p: float, n: int, most: float = 1.0) -> Case:
    """Clopper-Pearson interval of a rate.

    It is exact: its coverage is at least the nominal one, and greater if n p is small.
    """
    return Case(
        f"rate {p:g}, n = {n}", p, lambda rng: rate_ends(int(rng.binomial(n, p)), n), EXACT, most
    )


def of_difference(only_a: float, only_b: float, n: int) -> Case:
    """Interval of the difference of two rates on the same scenes."""

    def interval(rng: Generator) -> Interval:
        a, b, _ = rng.multinomial(n, [only_a, only_b, 1.0 - only_a - only_b])
        return ends(int(a), int(b), n)

    return Case(
        f"rate difference {only_a:g} − {only_b:g}, n = {n}", only_a - only_b, interval, EXACT, 1.0
    )


def skewed(rng: Generator, n: int) -> tuple[Any, Any]:
    """Costs of two laws on n scenes.

    Their difference has the median −0.1, with a lognormal distribution around it.
    """
    b = rng.lognormal(sigma=1.0, size=n)
    return b - 0.1 * rng.lognormal(sigma=1.0, size=n) + 1.0, b + 1.0


def of_median(n: int) -> Case:
    """Interval of the median of skewed paired differences."""
    return Case(
        f"median of skewed differences, n = {n}",
        -0.1,
        lambda rng: paired(*skewed(rng, n))[1:3],
        EXACT,
        1.0,
    )


def of_ratio(n: int) -> Case:
    """Interval of the median of log-ratios with a Gumbel distribution and the median ln 1.1."""

    def interval(rng: Generator) -> Interval:
        b = rng.lognormal(sigma=2.0, size=n)
        a = b * 1.1 * np.exp(rng.gumbel(size=n) + math.log(math.log(2.0)))
        return paired(a, b, "log-ratio")[1:3]

    return Case(f"median of log-ratios, n = {n}", math.log(1.1), interval, EXACT, 1.0)


def of_settling(n: int) -> Case:
    """Interval of a median of times in whole sampling periods; a third of the times equal it."""
    share = (0.3, 0.35, 0.2, 0.15)
    return Case(
        f"median with ties, n = {n}",
        1.0,
        lambda rng: median(rng.choice(4, n, p=share))[1:3],
        EXACT,
        1.0,
    )


CASES = (
    *(of_rate(p, n) for p, n in ((0.001, 1000), (0.05, 100), (0.9, 1000))),
    *(
        of_difference(a, b, n)
        for a, b, n in ((0.1, 0.1, 100), (0.05, 0.02, 1000), (0.3, 0.1, 200), (0.02, 0.0, 1000))
    ),
    *(of_median(n) for n in (7, 20, 51, 100, 1000)),
    *(of_ratio(n) for n in (50, 101, 1000)),
    of_settling(200),
)

Truth = Callable[[int, int], float]
"""True difference of two laws: of rates, or the median where they differ; NaN if they never do."""


class World(NamedTuple):
    """Several laws on the same scenes, whose true differences are known.

    Attributes
    ----------
    what
        Name.
    metric
        Metric of the comparison.
    draw
        Draws values (scenes, laws); for success, booleans.
    truth
        True difference of two laws.
    """

    what: str
    metric: str
    draw: Callable[[Generator, int, int], Any]
    truth: Truth = lambda i, j: 0.0


def behind(rng: Generator, scenes: int, laws: int) -> Any:
    """Values of laws that exceed the first law's by a skewed amount.

    In half of the scenes they are above the first one, in the others below it, but by less.
    """
    apart = rng.lognormal(sigma=1.0, size=(scenes, laws)) - 1.0
    return 0.1 + rng.lognormal(size=(scenes, 1)) * np.exp(np.where(np.arange(laws) > 0, apart, 0.0))


def slow(rng: Generator, scenes: int, laws: int) -> Any:
    """Values where every second law takes three times as long in 48 % of the scenes, never less."""
    hit = (rng.random((scenes, laws)) < 0.48) & (np.arange(laws) % 2 == 1)
    return rng.lognormal(size=(scenes, 1)) * np.where(hit, 3.0, 1.0)


def succeeding(rates: Callable[[Any], Any]) -> Callable[[Generator, int, int], Any]:
    """Return a function that draws successes with these rates.

    Half of a scene's difficulty is common to all laws.
    """

    def draw(rng: Generator, scenes: int, laws: int) -> Any:
        trouble = rng.standard_normal((scenes, 1)) + rng.standard_normal((scenes, laws))
        return trouble < math.sqrt(2.0) * norm.ppf(rates(np.arange(laws)))

    return draw


WORLDS = (
    World("no difference, symmetric", "jerk_rms", lambda rng, n,
          k: 9.0 + rng.standard_normal((n, k))),
    World("no difference, skewed", "jerk_rms", behind),
    World("no difference, ties", "jerk_rms", lambda rng, n,
          k: rng.integers(0, 3, (n, k)).astype(float)),
    World("no difference, success", "success", succeeding(lambda law: 0.7 + 0.0 * law)),
    World("differences, symmetric", "jerk_rms",
          lambda rng, n, k: 9.0 + rng.standard_normal((n, k)) + 0.5 * (np.arange(k) // 2),
          lambda i, j: 0.5 * (i // 2 - j // 2)),
    World("differences, skewed", "jerk_rms",
          lambda rng, n, k: behind(rng, n, k) + 0.5 * (np.arange(k) // 2),
          lambda i, j: 0.5 * (i // 2 - j // 2)),
    World("slower in 48 % of scenes, never faster", "jerk_rms", slow,
          lambda i, j: 2.0 * (i % 2 - j % 2) if i % 2 or j % 2 else math.nan),
    World("differences, success", "success", succeeding(lambda law: 0.5 + 0.4 * (law % 2)),
          lambda i, j: 0.4 * (i % 2 - j % 2)),
)  # fmt: skip

LAWS = (3, 8, 12)
SCENES = 200

QUESTIONS = (
    Question("the same law under two names, by a metric", "jerk_rms", 1.0, "not distinguishable"),
    Question("the same law under two names, by success", "success", 1.0, "not distinguishable"),
    Question(
        "the same law under two names, identical runs", "jerk_rms", 1.0, "not distinguishable", 0.0
    ),
    Question("a law made 1 % worse", "jerk_rms", 1.01, "better", 0.04),
)


def coverage(case: Case, repetitions: int, seed: int) -> Rate:
    """Share of intervals that cover the truth."""
    held = 0
    for rng in np.random.default_rng([seed, len(case.what)]).spawn(repetitions):
        low, high = case.interval(rng)
        held += low <= case.truth <= high
    return rate_of(held, repetitions)


def runs(question: Question, repetition: int, rng: Generator, scenes: int = 1000) -> Any:
    """Draw runs of two laws on the same scenes; a few fail or violate.

    Costs differ between scenes by far more than between laws.
    """
    scene = rng.lognormal(sigma=1.0, size=scenes)
    return pandas.concat(
        [
            pandas.DataFrame(
                {
                    "family": "simulated",
                    "condition": repetition,
                    "half": "held-out",
                    "scene": np.arange(scenes),
                }
                | {
                    "controller": law,
                    "jerk_rms": scene * factor * np.exp(rng.normal(0.0, question.noise, scenes)),
                }
                | {"status": np.where(rng.random(scenes) < 0.03, "trapped", "converged")}
                | {"violated": np.where(rng.random(scenes) < 0.05, "fov[marker 1]", "")}
            )
            for law, factor in (("a law", 1.0), ("the other", question.worse))
        ]
    )


def answered(question: Question, repetitions: int, seed: int) -> Rate:
    """Share of right verdicts."""
    streams = np.random.default_rng([seed, len(question.what)]).spawn(repetitions)
    drawn = pandas.concat(
        [runs(question, repetition, rng) for repetition, rng in enumerate(streams)]
    )
    right = compare_laws(drawn, question.metric)["verdict"] == question.right
    return rate_of(int(right.sum()), repetitions)


def table(world: World, laws: int, repetition: int, rng: Generator, scenes: int) -> Any:
    """Runs of several laws; each repetition is a separate condition."""
    values = world.draw(rng, scenes, laws)
    success = values if world.metric == "success" else np.ones_like(values, dtype=bool)
    law, scene = np.meshgrid(np.arange(laws), np.arange(scenes))
    return pandas.DataFrame(
        {"family": "simulated", "condition": repetition, "half": "held-out", "scene": scene.ravel()}
        | {
            "controller": [f"{i:02d}" for i in law.ravel()],
            "jerk_rms": values.ravel().astype(float),
        }
        | {"status": np.where(success.ravel(), "converged", "trapped"), "violated": ""}
    )


def families(
    world: World, laws: int, repetitions: int, seed: int, scenes: int = SCENES
) -> tuple[Rate, Rate]:
    """Share of repetitions with any false verdict, and share in which all intervals cover."""
    streams = np.random.default_rng([seed, laws, len(world.what)]).spawn(repetitions)
    drawn = pandas.concat(
        [table(world, laws, each, rng, scenes) for each, rng in enumerate(streams)]
    )
    found = compare_laws(drawn, world.metric)
    truth = np.array(
        [world.truth(int(a), int(b)) for a, b in zip(found["a"], found["b"], strict=True)]
    )
    better = truth > 0.0 if world.metric == "success" else truth < 0.0
    told = found["verdict"].map({"better": 1, "worse": -1}).fillna(0)
    false = (told != 0) & (told != np.where(better, 1, np.where(truth == 0.0, 0, -1)))
    covered = np.isnan(truth) | ((found["low"] <= truth + 1e-12) & (truth - 1e-12 <= found["high"]))
    each = pandas.DataFrame({"false": false, "covered": covered}).groupby(found["condition"])
    return rate_of(int(each["false"].any().sum()), repetitions), rate_of(
        int(each["covered"].all().sum()), repetitions
    )


def like_families(
    laws: int, repetitions: int, seed: int, groups: int = 7, scenes: int = 100
) -> tuple[Rate, Rate]:
    """Share of repetitions in which a law seems worse than the best one, although all are equal.

    The laws are equal over all families, but differ in each. Logits of families vary by 1, those of
    a law in a family by 0.7. The second rate is the coverage of the interval of the first law's
    success.
    """
    middle = 1.0
    truth = float(
        np.mean(expit(middle + math.hypot(1.0, 0.7) * norm.ppf((np.arange(10_000) + 0.5) / 10_000)))
    )
    false = held = 0
    for rng in np.random.default_rng([seed, laws, groups]).spawn(repetitions):
        logits = (
            middle
            + rng.standard_normal((groups, 1, 1))
            + 0.7 * rng.standard_normal((groups, laws, 1))
        )
        good = rng.random((groups, laws, scenes)) < expit(logits)
        best = good.sum(axis=(0, 2)).argmax()
        first = good[:, [best]]
        others = np.delete(good, best, axis=1)
        only, differ = (flags.sum(axis=2).T for flags in (first & ~others, first ^ others))
        false += any(
            pair.low > 0.5 for pair in across_families(only, differ, simultaneous(0.95, laws - 1))
        )
        (own,) = across_families(good[:, 0].sum(axis=1)[None], np.full((1, groups), scenes))
        held += own.low <= truth <= own.high
    return rate_of(false, repetitions), rate_of(held, repetitions)


def promised(repetitions: int) -> float:
    """Accepted share of false findings for a nominal 0.05: three standard deviations more."""
    return 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / repetitions)


def told(what: str, found: Rate, least: float, most: float = 1.0) -> bool:
    """Print a rate; return True if it meets the requirement."""
    ok = least <= found.share <= most
    demand = (
        f"{100 * least:.3g} to {100 * most:.3g} %"
        if most < 1.0
        else f"at least {100 * least:.3g} %"
    )
    print(f"{what:58s} {100 * found.share:6.2f} %, {demand}{'' if ok else ': MISSED'}", flush=True)
    return ok


def main(arguments: Sequence[str]) -> int:
    """Print all coverages and shares of right verdicts; return 1 if a requirement is not met."""
    parser = argparse.ArgumentParser(prog="python -m checks.statistics", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    print(f"Intervals at 95 % that hold the truth, of {given.repetitions}:")
    met = [
        told(case.what, coverage(case, given.repetitions, given.seed), case.least, case.most)
        for case in CASES
    ]
    fewer = max(given.repetitions // 4, 1)
    print(f"Right verdicts on 1000 scenes, of {fewer}:")
    least = 1.0 - promised(fewer)
    met += [
        told(question.what, answered(question, fewer, given.seed), least) for question in QUESTIONS
    ]
    fewer = max(given.repetitions // 8, 1)
    print(
        f"Families of comparisons on {SCENES} scenes, of {fewer}: any verdict false, all "
        f"intervals hold:"
    )
    most = promised(fewer)
    for world in WORLDS:
        for laws in LAWS:
            false, held = families(world, laws, fewer, given.seed)
            what = f"{world.what}, {laws} laws"
            met += [
                told(f"{what}: false", false, 0.0, most),
                told(f"{what}: hold", held, 1.0 - most),
            ]
    print(
        f"Families as random effects, 7 of 100 scenes, of {fewer}: any verdict false, the "
        f"interval of success holds:"
    )
    for laws in LAWS:
        false, held = like_families(laws, fewer, given.seed)
        met += [
            told(f"{laws} laws: false", false, 0.0, most),
            told(f"{laws} laws: hold", held, 1.0 - most),
        ]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
