"""Which conclusions hold in other conditions: on made-up runs by hand, and against tests of other
libraries.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from checks.conclusions import differing
from hypothesis import given, settings
from hypothesis import strategies as st

from made_evidence import drawn_runs, frame, made, run
from vsconstraints.bench.evidence import Evidence
from vsconstraints.bench.reports.dataset import Dataset
from vsconstraints.bench.reports.ranking import PairVerdict, finite
from vsconstraints.bench.reports.report import write_report_of
from vsconstraints.bench.reports.robustness import (
    MEASURES,
    Conclusion,
    Measure,
    conclusions,
    pairs,
    powers,
    robustness_findings,
)
from vsconstraints.bench.statistics import detectable, simultaneous
from vsconstraints.bench.statistics.judged import OUTCOMES

SUCCESS = MEASURES[0]
AHEAD = "+" * 20
BEHIND = "+" * 8 + "t" * 12

MADE: dict[str, dict[str, Any]] = {
    "+": {},
    "t": {"status": "trapped", "utilization": math.nan},
    "v": {"violated": "fov[marker 1]", "violation_depth": 0.1},
    "f": {"status": "failed", "reason": "nothing"},
}


def material(letters: Mapping[str, Mapping[str, str]], **columns: Any) -> Dataset:
    """By condition and law, one letter a scene."""
    lines = [
        run(condition, law, scene, **{**columns, **MADE[letter]})
        for condition, laws in letters.items()
        for law, each in laws.items()
        for scene, letter in enumerate(each)
    ]
    return Dataset(made(frame(lines), Path()))


def outcomes(made_up: Dataset, measure: str = "success") -> dict[tuple[str, str, str], str]:
    every = [one for one in conclusions(made_up) if one.measure.name == measure]
    return {(one.better, one.worse, one.condition): one.outcome for one in every}


def test_a_conclusion_holds_is_reversed_or_is_inconclusive(tmp_path: Path) -> None:
    made_up = material(
        {
            "nominal": {"a": AHEAD, "b": BEHIND},
            "same": {"a": AHEAD, "b": BEHIND},
            "over": {"a": BEHIND, "b": AHEAD},
            "alike": {"a": AHEAD, "b": AHEAD},
            "short": {"a": AHEAD[:5], "b": "t" * 5},
        }
    )
    assert outcomes(made_up) == {
        ("a", "b", "same"): "holds",
        ("a", "b", "over"): "reversed",
        ("a", "b", "alike"): "inconclusive",
        ("a", "b", "short"): "inconclusive",
    }
    (over,) = (
        one for one in conclusions(made_up) if one.condition == "over" and one.measure is SUCCESS
    )
    assert (over.first.difference, over.other.difference, over.other.scenes) == (
        12 / 20,
        -12 / 20,
        20,
    )
    assert over.other.low == pytest.approx(-over.first.high)
    found = {one.condition: one.numbers for one in robustness_findings(made_up)}
    counts = ("holds", "reversed", "inconclusive", "reversal_excluded", "scenes", "families")
    assert [found["over"][name] for name in counts] == [0, 1, 0, 0, 20, 1]
    # not one scene in which they differ, of 20: by 10 points they still may
    assert [found["alike"][name] for name in counts] == [0, 0, 1, 0, 20, 1]
    # five scenes are too few for a verdict, and no reversal on them would have been found
    assert [found["short"][name] for name in counts] == [0, 0, 1, 1, 5, 1]
    assert "detectable" in found["over"]
    assert "detectable" not in found["short"]
    report = write_report_of(Dataset(made(made_up.evidence.runs, tmp_path), figures=False))
    text = report.with_name("details.md").read_text(encoding="utf-8")
    table = text.partition("### Success\n\n")[2].partition("\n\n")[0]
    assert [line.split(" | ")[3:] for line in table.splitlines() if line.startswith("| a ")] == [
        ["holds, 60.0 points", "**reversed**, −60.0 points", "inconclusive", "inconclusive |"]
    ]
    assert pairs(made_up, MEASURES[1]) == {}


def test_what_is_not_told_without_disturbances_is_no_conclusion() -> None:
    made_up = material({"nominal": {"a": AHEAD, "b": AHEAD}, "over": {"a": AHEAD, "b": BEHIND}})
    assert conclusions(made_up) == []
    assert robustness_findings(made_up) == []
    assert powers(made_up) == []


def test_fewer_violations_are_better_and_who_only_fails_is_not_compared() -> None:
    ahead = "+" * 20
    behind = "v" * 15 + "+" * 5
    made_up = material(
        {
            "nominal": {"a": ahead, "b": behind, "c": "f" * 20},
            "over": {"a": behind, "b": ahead, "c": ahead},
        }
    )
    assert outcomes(made_up, "violation") == {("a", "b", "over"): "reversed"}


@pytest.mark.parametrize(
    ("name", "better"), [("utilization", 2.0), ("acceleration_variation", 0.5)]
)
def test_numbers_are_compared_where_both_succeed(name: str, better: float) -> None:
    """In scene k, the better law has k more of what is better, or half of what is worse."""
    for swapped in (False, True):
        lines = []
        for condition in ("nominal", "other"):
            for scene in range(1, 21):
                values = (better * scene, 1.0 * scene)
                if swapped and condition == "other":
                    values = values[::-1]
                lines += [
                    run(condition, law, scene, **{name: v})
                    for law, v in zip("ab", values, strict=True)
                ]
                lines.append(run(condition, "c", scene, **{**MADE["t"], name: better * values[0]}))
        made_up = Dataset(made(frame(lines), Path()))
        assert outcomes(made_up, name) == {("a", "b", "other"): "reversed" if swapped else "holds"}
        (one,) = (one for one in conclusions(made_up) if one.measure.name == name)
        sides = (10.5, -10.5) if name == "utilization" else (0.5, 2.0)
        assert (one.first.difference, one.other.difference) == pytest.approx(
            (sides[0], sides[int(swapped)])
        )


def test_conditions_are_held_together_in_the_families_that_both_have() -> None:
    """In the second family, which only the other condition has, everything is turned over."""
    lines = []
    for scene in range(20):
        for law, good in (("a", "+"), ("b", "t")):
            lines.append(run("nominal", law, scene, **MADE[good]))
            lines.append(run("other", law, scene, **MADE[good]))
            lines += [
                run("other", law, s, family="ur5", **MADE["+t"["+t".index(good) - 1]])
                for s in (scene, scene + 20)
            ]
    made_up = Dataset(made(frame(lines), Path()))
    assert outcomes(made_up) == {("a", "b", "other"): "holds"}


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_the_same_runs_hold_and_swapped_ones_are_reversed(seed: int, swap: bool) -> None:
    runs = drawn_runs({"nominal": {"a": 0.9, "b": 0.3}}, ["x"], 25, seed=seed)
    again = runs.assign(condition="other")
    if swap:
        again["controller"] = again["controller"].astype(str).replace({"a": "b", "b": "a"})
    both = frame(pd.concat([runs, again]).to_dict("records"))
    every = conclusions(Dataset(made(both, Path())))
    assert every
    assert {one.outcome for one in every} == {"reversed" if swap else "holds"}


@pytest.mark.parametrize(("scenes", "excluded"), [(20, False), (120, True)])
def test_a_reversal_by_the_margin_is_excluded_where_the_interval_says_so(
    scenes: int, excluded: bool
) -> None:
    """Two scenes to either side: of 20, more than 10 points are possible; of 120 they are not."""
    other = {"a": "tt" + "+" * (scenes - 2), "b": "+" * (scenes - 2) + "tt"}
    made_up = material({"nominal": {"a": AHEAD, "b": BEHIND}, "other": other})
    (one,) = (one for one in conclusions(made_up) if one.measure is SUCCESS)
    assert (one.outcome, one.other.difference, one.other.differ) == ("inconclusive", 0.0, 4)
    assert one.excluded == excluded == (one.other.low > -0.1) == one.as_data()["reversal_excluded"]


def test_the_margin_is_that_of_the_worse_side() -> None:
    success, violation, space, chattering = MEASURES
    narrow = {
        "p": 1.0,
        "scenes": 9,
        "differ": 9,
        "verdict": "not distinguishable",
        "difference": 0.0,
    }
    better = PairVerdict(low=-0.05, high=0.5, **narrow)
    worse = PairVerdict(low=-0.5, high=0.05, **narrow)

    def excludes(measure: Measure, pair: PairVerdict) -> bool:
        return Conclusion(measure, "a", "b", "other", "inconclusive", pair, pair).excluded

    assert (excludes(success, better), excludes(success, worse)) == (True, False)
    assert (excludes(violation, better), excludes(violation, worse)) == (False, True)
    assert not excludes(space, better)
    assert excludes(chattering, PairVerdict(low=0.5, high=1.2, **narrow))
    assert not excludes(chattering, PairVerdict(low=1.1, high=1.3, **narrow))


def test_the_power_is_that_of_the_scenes_the_pairs_and_how_often_they_differ() -> None:
    """Three laws are three pairs; of 20 scenes a and b differ in 12, a and c in 4, b and c in 8."""
    other = {"a": AHEAD, "b": BEHIND, "c": "+" * 16 + "t" * 4}
    made_up = material({"nominal": {"a": AHEAD, "b": BEHIND, "c": "t" * 20}, "other": other})
    found = {one.measure: one for one in powers(made_up)}["success"]
    pairs = {(one.better, one.worse) for one in conclusions(made_up) if one.measure is SUCCESS}
    assert pairs == {("a", "b"), ("a", "c"), ("b", "c")}
    assert found[1:] == ("other", 3, 20, detectable(20, 8 / 20, simultaneous(0.95, 3)))


def test_the_pages_say_of_the_kept_runs_what_the_report_says() -> None:
    root = Path(__file__).parents[1]
    each = [
        one.numbers
        for one in robustness_findings(
            Dataset(Evidence.load(root / "reports" / "real-world"), figures=False)
        )
    ]
    holds, unsure, excluded = (
        [int(one[k]) for one in each] for k in ("holds", "inconclusive", "reversal_excluded")
    )
    points = [round(100.0 * one["detectable"]) for one in each]
    (conclusions,) = {int(one["conclusions"]) for one in each}
    reversed_ = [int(one["reversed"]) for one in each]
    readme, page = (
        " ".join((root / name).read_text("utf-8").split())
        for name in ("README.md", "docs/real-world.md")
    )
    assert f"{conclusions} conclusions were tested again on arms with mass and by images" in readme
    assert (
        f"{min(holds)} to {max(holds)} of them hold. Mass reverses {max(reversed_)} at 0.01 % of L, "
        f"but none of these at 1 %." in readme
    )
    # where arms have mass
    assert [bool(count) for count in reversed_] == [False, True, False, True]
    # and none of these is one at 1 % of L
    runs = Evidence.load(root / "reports" / "real-world").runs
    judged = runs.assign(good=OUTCOMES["tolerant success"].flag(runs))
    rates = judged.groupby(["condition", "controller"], observed=True)["good"].mean()
    for condition in ("dynamics", "images-and-dynamics"):
        least = min(rates[condition, "cbf-filter"], rates[condition, "hierarchical-qp"])
        assert least > rates[condition, "potential-field"]
    names = "cbf-filter", "hierarchical-qp", "potential-field"
    said = [f"{100 * rates['dynamics', name]:.4g}" for name in names]
    assert (
        f"At 1 % of L it does not: {said[0]}, {said[1]} and {said[2]} % succeed on arms with mass"
        in page
    )
    a, b, c, d = holds
    assert (
        f"{a} hold with a calibrated camera, {b} on arms with mass, {c} by images and {d} by "
        f"images on arms" in page
    )
    for numbers in (reversed_, unsure, excluded, points):
        a, b, c, d = numbers
        assert f"{a}, {b}, {c} and {d}" in page


def test_all_of_it_found_again_by_other_libraries(tmp_path: Path) -> None:
    """McNemar's test and the sign test by statsmodels and SciPy, from the runs and the report's
    data.
    """
    rates = {"nominal": {"a": 0.9, "b": 0.6, "c": 0.3}, "worse": {"a": 0.4, "b": 0.6, "c": 0.35}}
    made_up = Dataset(made(drawn_runs(rates, ["x", "y"], 60, seed=3), tmp_path), figures=False)
    data = {"conclusions": [one.as_data() for one in conclusions(made_up)]}
    names = ("measure", "condition", "conclusions", "scenes", "detectable")
    data["power"] = [finite(dict(zip(names, one, strict=True))) for one in powers(made_up)]
    claims = json.loads(json.dumps(data, allow_nan=False))
    assert differing(made_up.runs, claims) == []
    assert len({one["outcome"] for one in claims["conclusions"]}) > 1
    # and what is said falsely is found
    swapped = made_up.runs.assign(
        controller=made_up.runs["controller"].replace({"a": "b", "b": "a"})
    )
    assert differing(swapped, claims)
    assert differing(made_up.runs, {**claims, "conclusions": claims["conclusions"][1:]})
    stronger = [{**one, "detectable": 0.5 * one["detectable"]} for one in claims["power"]]
    assert differing(made_up.runs, {**claims, "power": stronger})
    (sentence,) = robustness_findings(made_up)
    counted = Counter(one["outcome"] for one in claims["conclusions"])
    assert all(
        sentence.numbers[name] == counted[name] for name in ("holds", "reversed", "inconclusive")
    )
