"""Which conclusions hold in other conditions: on made-up runs by hand, and against tests of other libraries."""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from made_evidence import drawn_runs, frame, made, run
from vsconstraints.reports.evidence.holding import MEASURES, became, conclusions, held, holding
from vsconstraints.reports.evidence.material import Material

sys.path.insert(0, str(Path(__file__).parents[1]))

from checks.conclusions import differing

SUCCESS = MEASURES[0]
AHEAD, BEHIND = "+" * 20, "+" * 8 + "t" * 12

MADE: dict[str, dict[str, Any]] = {
    "+": {},
    "t": {"status": "trapped", "utilization": math.nan},
    "v": {"violated": "fov[marker 1]", "violation_depth": 0.1},
    "f": {"status": "failed", "reason": "nothing"},
}


def material(letters: Mapping[str, Mapping[str, str]], **columns: Any) -> Material:
    """By condition and law, one letter a scene."""
    lines = [
        run(condition, law, scene, **{**columns, **MADE[letter]})
        for condition, laws in letters.items()
        for law, each in laws.items()
        for scene, letter in enumerate(each)
    ]
    return Material(made(frame(lines), Path()))


def outcomes(made_up: Material, measure: str = "success") -> dict[tuple[str, str, str], str]:
    every = [one for one in conclusions(made_up) if one.measure.name == measure]
    return {(one.better, one.worse, one.condition): one.outcome for one in every}


def test_a_conclusion_holds_is_reversed_or_cannot_be_told() -> None:
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
        ("a", "b", "alike"): "not told",
        ("a", "b", "short"): "too few",
    }
    (over,) = (one for one in conclusions(made_up) if one.condition == "over" and one.measure is SUCCESS)
    assert (over.first.difference, over.other.difference, over.other.scenes) == (12 / 20, -12 / 20, 20)
    assert over.other.low == pytest.approx(-over.first.high)
    said = {one.condition: one.text for one in held(made_up)}
    assert said["over"] == (
        "By the strict standard, of 1 conclusion on pairs of laws that hold without disturbances, 0 hold in the "
        "condition over, 1 is reversed, "
        "and of 0 it cannot be told (20 scenes of 1 family). Reversed: a before b by success."
    )
    assert said["short"].endswith(
        "and of 1 it cannot be told, 1 of these since there are too few scenes (5 scenes of 1 family)."
    )
    text = holding(made_up)
    assert [line.split(" | ")[3:] for line in text.splitlines() if line.startswith("| a ")] == [
        ["holds, 60.0 %", "**reversed**, −60.0 %", "not told", "too few |"]
    ]
    assert "a row is violated, strictly\n\nWithout disturbances, no law is told from another one." in text


def test_what_is_not_told_without_disturbances_is_no_conclusion() -> None:
    made_up = material({"nominal": {"a": AHEAD, "b": AHEAD}, "over": {"a": AHEAD, "b": BEHIND}})
    assert conclusions(made_up) == ()
    assert held(made_up) == []
    assert holding(made_up) == ""


def test_fewer_violations_are_better_and_who_only_fails_is_not_compared() -> None:
    ahead, behind = "+" * 20, "v" * 15 + "+" * 5
    made_up = material(
        {"nominal": {"a": ahead, "b": behind, "c": "f" * 20}, "over": {"a": behind, "b": ahead, "c": ahead}}
    )
    assert outcomes(made_up, "violation") == {("a", "b", "over"): "reversed"}


@pytest.mark.parametrize(("name", "better"), [("utilization", 2.0), ("acceleration_variation", 0.5)])
def test_numbers_are_compared_where_both_succeed(name: str, better: float) -> None:
    """In scene k, the better law has k more of what is better, or half of what is worse."""
    for swapped in (False, True):
        lines = []
        for condition in ("nominal", "other"):
            for scene in range(1, 21):
                values = (better * scene, 1.0 * scene)
                if swapped and condition == "other":
                    values = values[::-1]
                lines += [run(condition, law, scene, **{name: v}) for law, v in zip("ab", values, strict=True)]
                lines.append(run(condition, "c", scene, **{**MADE["t"], name: better * values[0]}))
        made_up = Material(made(frame(lines), Path()))
        assert outcomes(made_up, name) == {("a", "b", "other"): "reversed" if swapped else "holds"}
        (one,) = (one for one in conclusions(made_up) if one.measure.name == name)
        sides = (10.5, -10.5) if name == "utilization" else (0.5, 2.0)
        assert (one.first.difference, one.other.difference) == pytest.approx((sides[0], sides[int(swapped)]))


def test_conditions_are_held_together_in_the_families_that_both_have() -> None:
    """In the second family, which only the other condition has, everything is turned over."""
    lines = []
    for scene in range(20):
        for law, good in (("a", "+"), ("b", "t")):
            lines.append(run("nominal", law, scene, **MADE[good]))
            lines.append(run("other", law, scene, **MADE[good]))
            lines += [
                run("other", law, s, family="ur5", **MADE["+t"["+t".index(good) - 1]]) for s in (scene, scene + 20)
            ]
    made_up = Material(made(frame(lines), Path()))
    assert outcomes(made_up) == {("a", "b", "other"): "holds"}


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_the_same_runs_hold_and_swapped_ones_are_reversed(seed: int, swap: bool) -> None:
    runs = drawn_runs({"nominal": {"a": 0.9, "b": 0.3}}, ["x"], 25, seed=seed)
    again = runs.assign(condition="other")
    if swap:
        again["controller"] = again["controller"].astype(str).replace({"a": "b", "b": "a"})
    both = frame(pd.concat([runs, again]).to_dict("records"))
    every = conclusions(Material(made(both, Path())))
    assert every
    assert {one.outcome for one in every} == {"reversed" if swap else "holds"}


def test_what_becomes_of_a_conclusion() -> None:
    verdicts = ("better", "worse", "not distinguishable", "too few")
    assert [became(verdict, "better") for verdict in verdicts] == ["holds", "reversed", "not told", "not told"]
    assert [became(verdict, "too few") for verdict in verdicts] == ["holds", "reversed", "too few", "too few"]


def test_all_of_it_found_again_by_other_libraries(tmp_path: Path) -> None:
    """McNemar's test and Wilcoxon's by SciPy, Holm's correction by statsmodels, from the runs and the report's data."""
    rates = {"nominal": {"a": 0.9, "b": 0.6, "c": 0.3}, "worse": {"a": 0.4, "b": 0.6, "c": 0.35}}
    made_up = Material(made(drawn_runs(rates, ["x", "y"], 60, seed=3), tmp_path), figures=False)
    claims = json.loads(json.dumps({"conclusions": [one.as_data() for one in conclusions(made_up)]}, allow_nan=False))
    assert differing(made_up.runs, claims["conclusions"]) == []
    assert len({one["outcome"] for one in claims["conclusions"]}) > 1
    # and what is said falsely is found
    swapped = made_up.runs.assign(controller=made_up.runs["controller"].replace({"a": "b", "b": "a"}))
    assert differing(swapped, claims["conclusions"])
    assert differing(made_up.runs, claims["conclusions"][1:])
    (sentence,) = held(made_up)
    counted = Counter(one["outcome"] for one in claims["conclusions"])
    assert all(sentence.numbers[name] == counted[name] for name in ("holds", "reversed", "not told", "too few"))
