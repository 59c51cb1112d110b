"""The claims of the report of evidence, on made-up runs worked out by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import beta, norm

from made_evidence import drawn_runs, frame, made, run
from vsconstraints.bench.evidence import Campaign
from vsconstraints.bench.reports.dataset import Dataset
from vsconstraints.bench.reports.findings import (
    Finding,
    always_failing,
    best,
    calmest,
    findings,
    reversals,
    tuning_gain,
)
from vsconstraints.bench.reports.ranking import CONDITIONS, Share, condition_text, ranking
from vsconstraints.bench.reports.report import claims_of
from vsconstraints.reports.numbers import percentage

Successes = Mapping[str, Mapping[str, str]]
"""By condition and law, one letter a scene: ``+`` success, ``v`` goal reached but a row violated,
``t`` trapped.
"""

MADE: dict[str, dict[str, Any]] = {
    "+": {},
    "v": {"violated": "fov[marker 1]", "violation_depth": 0.1},
    "t": {"status": "trapped", "utilization": math.nan, "settling_time_s": math.nan},
    "w": {"status": "trapped", "violated": "fov[marker 1]", "violation_depth": 0.2},
    "f": {"status": "failed", "reason": "the law gave nothing at 0.1 s"},
}


def material(
    successes: Successes, controllers: dict[str, dict[str, Any]] | None = None, **columns: Any
) -> Dataset:
    lines = [
        run(condition, law, scene, **{**columns, **MADE[letter]})
        for condition, laws in successes.items()
        for law, letters in laws.items()
        for scene, letter in enumerate(letters)
    ]
    configuration = {} if controllers is None else {"controllers": controllers}
    return Dataset(made(frame(lines), Path(), **configuration))


def claims(made_up: Dataset, about: str) -> list[Finding]:
    return [one for own in findings(made_up).values() for one in own if one.about == about]


def clopper_pearson(count: int, of: int) -> tuple[float, float]:
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return float(low), float(high)


# --- how a share is printed ---


def test_digits_are_those_that_an_interval_can_tell_apart() -> None:
    assert Share(0.9312, 0.9151, 0.9448).text == "93.1 % (91.5–94.5 %)"
    assert Share(0.25, 0.16, 0.36).text == "25 % (16–36 %)"
    assert Share(0.017, 0.006, 0.03).points == "1.7 points (0.6–3.0)"
    assert Share(0.041, 0.026, 0.056).text == "4.1 % (2.6–5.6 %)"
    assert Share(-0.01, -0.03, 0.02).cell == "−1.0 (−3.0 to 2.0)"
    assert Share(0.0, 0.0, 3.7e-4).text == "0 % (0–0.037 %)"
    assert Share(1.0, 1.0, 1.0).text.startswith("100 %")
    assert Share(0.93, 0.91, 0.95).complement == Share(1.0 - 0.93, 1.0 - 0.95, 1.0 - 0.91)


def test_sentences_have_words_for_every_condition_that_is_shipped() -> None:
    shipped = [
        name
        for study in (None, "real-world")
        for each in Campaign.load(study).families
        for name in each.conditions
    ]
    assert set(shipped) == set(CONDITIONS)
    assert condition_text("images", inside=True) == "by images"
    assert condition_text("own", inside=True) == "in the condition own"


def test_what_is_not_all_is_never_printed_as_all() -> None:
    assert percentage(0.9996, 0) == "99.96"
    assert percentage(0.0004, 0) == "0.04"
    assert percentage(-0.0004, 1) == "−0.04"
    assert percentage(1.0, 1) == "100"
    assert percentage(0.0, 2) == "0"
    assert percentage(math.nan, 2) == "–"


# --- the best law ---


def test_a_law_that_is_ahead_is_said_to_be_by_how_much() -> None:
    """Of 12 scenes a succeeds in 11 and b in 2, both in scenes 0 and 1: only a in 9, only b in
    none.
    """
    made_up = material({"nominal": {"a": "+" * 11 + "t", "b": "++" + "v" * 10}})
    (sentence,) = claims(made_up, "best")
    low, high = clopper_pearson(11, 12)
    assert sentence.numbers["success[a]"] == 11 / 12
    assert sentence.numbers["low[a]"] == pytest.approx(low)
    assert sentence.numbers["high[a]"] == pytest.approx(high)
    assert sentence.numbers["success[b]"] == 2 / 12
    assert sentence.numbers["difference"] == 9 / 12
    assert sentence.numbers["difference_low"] == pytest.approx(tango(9, 0, 12, -1), abs=1e-4)
    assert sentence.numbers["difference_high"] == pytest.approx(tango(9, 0, 12, 1), abs=1e-4)
    assert sentence.numbers["scenes"] == 12
    assert sentence.laws == ("a", "b")


def tango(only_a: int, only_b: int, n: int, side: int, pairs: int = 1) -> float:
    """The end of Tango's interval for one of so many pairs, by looking at all differences on a fine
    grid.
    """
    deltas = np.linspace(-1.0, 1.0, 200_001)
    linear = (2 * n - only_a + only_b) * deltas - only_a - only_b
    p = (np.sqrt(np.maximum(linear**2 + 8 * n * only_b * deltas * (1 - deltas), 0.0)) - linear) / (
        4 * n
    )
    spread = norm.isf(0.025 / pairs) * np.sqrt(np.maximum(n * (2 * p + deltas * (1 - deltas)), 0.0))
    inside = deltas[np.abs(only_a - only_b - n * deltas) - 1.0 <= spread]
    return float(inside[0] if side < 0 else inside[-1])


def test_all_pairs_of_a_condition_are_corrected_for() -> None:
    """Eight scenes in which only a succeeds: (8 − 1)/√8, p = .0133, stands three comparisons and
    not six.
    """
    assert 2.0 * norm.sf(7 / math.sqrt(8)) == pytest.approx(0.0133, abs=1e-4)
    ahead = "+" * 8 + "t"
    behind = "t" * 9
    three = material({"nominal": {"a": ahead, "b": behind, "c": behind}})
    (sentence,) = claims(three, "best")
    assert sentence.laws == ("a", "b")
    assert ranking(three, "nominal").front == ("a",)
    four = material({"nominal": {"a": ahead, "b": behind, "c": behind, "d": behind}})
    assert ranking(four, "nominal").front == ("a", "b", "c", "d")
    (sentence,) = claims(four, "alike")
    assert (
        "no significant difference to the best (9 scenes of 1 family): **a** 89 % ("
        in sentence.text
    )
    assert "difference" not in sentence.numbers


def test_the_same_law_under_two_names_is_not_distinguishable_from_itself() -> None:
    runs = drawn_runs({"nominal": {"a": 0.8}}, ["x", "y"], 300)
    again = runs[runs["controller"] == "a"].assign(controller="b")
    made_up = Dataset(made(frame(pd.concat([runs, again]).to_dict("records")), Path()))
    (sentence,) = claims(made_up, "alike")
    assert sentence.numbers["scenes"] == 600
    assert not claims(made_up, "calmest")
    (violations,) = claims(made_up, "violations")
    assert violations.laws == ("a", "b")


def test_laws_in_front_together_are_named_with_the_next_behind_them() -> None:
    made_up = material({"nominal": {"a": "+" * 20, "b": "+" * 19 + "t", "c": "+" * 5 + "t" * 15}})
    (sentence,) = claims(made_up, "best")
    assert sentence.laws == ("a", "b", "c")
    assert (
        "without significant difference: **a** 100 % (83–100 %) and **b** 95 % (75–99.9 %); next: "
        "c " in sentence.text
    )
    assert sentence.numbers["difference"] == 0.75


def test_more_than_four_laws_in_front_are_counted() -> None:
    made_up = material({"nominal": dict.fromkeys("abcde", "+" * 20)})
    (sentence,) = claims(made_up, "alike")
    assert sentence.laws == ("a", "b", "c")
    assert "**c** 100 % (83–100 %) and 2 more." in sentence.text


def test_few_scenes_tell_nothing_apart() -> None:
    made_up = material({"nominal": {"a": "+++++", "b": "ttttt"}})
    (sentence,) = claims(made_up, "alike")
    assert "too few scenes to rank controllers (5 scenes of 1 family)" in sentence.text


def test_where_nobody_gets_anywhere_it_is_said_what_that_still_allows() -> None:
    made_up = material({"nominal": {"a": "t" * 10, "b": "v" * 10}})
    (sentence,) = claims(made_up, "best")
    assert "no controller succeeds in any of 10 scenes of 1 family" in sentence.text
    assert "0 % (0–31 %) each" in sentence.text
    assert sentence.numbers["high[a]"] == pytest.approx(1.0 - 0.025**0.1)


def test_one_law_in_one_scene_is_told_as_it_is() -> None:
    made_up = material({"nominal": {"a": "+"}})
    (sentence,) = claims(made_up, "best")
    assert (
        sentence.text
        == "Without disturbances: **a** succeeds in 100 % (3–100 %); 1 scene of 1 family."
    )
    assert sentence.numbers["low[a]"] == pytest.approx(0.025)
    (violations,) = claims(made_up, "violations")
    assert violations.text == "Violated: **a** 0 % (0–98 %)."


def test_scenes_that_one_law_has_not_run_are_left_out_for_all() -> None:
    made_up = material({"nominal": {"a": "+" * 10, "b": "t" * 8}})
    one = ranking(made_up, "nominal")
    assert one.scenes == 8
    assert one.shares["a"].value == 1.0


def test_tracking_is_not_compared() -> None:
    assert material({"nominal": {"tracking": "+", "a": "t"}}).laws == ("a",)


# --- violations, and the calmest ---


def test_a_violation_counts_whether_the_goal_is_reached_or_not() -> None:
    made_up = material({"nominal": {"a": "t" * 20, "b": "v" * 10 + "w" * 10}})
    (sentence,) = claims(made_up, "violations")
    high = 1.0 - 0.025 ** (1 / 20)
    assert sentence.numbers["violation[a]"] == 0.0
    assert sentence.numbers["high[a]"] == pytest.approx(high)


def test_the_calmest_of_laws_in_front_is_found_where_it_is_sure() -> None:
    """In scene k, a varies by 2 k and b by k, but for scenes in which either fails, where b is said
    to be wild.
    """
    lines = []
    for scene in range(1, 31):
        failed = scene > 28
        lines.append(run("nominal", "a", scene, acceleration_variation=2.0 * scene))
        lines.append(
            run(
                "nominal",
                "b",
                scene,
                acceleration_variation=1e6 if failed else 1.0 * scene,
                **MADE["t" if failed else "+"],
            )
        )
        lines.append(run("nominal", "c", scene, acceleration_variation=1e-3, **MADE["t"]))
    made_up = Dataset(made(frame(lines), Path()))
    one = ranking(made_up, "nominal")
    assert one.front == ("a", "b")
    sentence = calmest(made_up, one)
    assert sentence is not None
    assert sentence.laws == ("b", "a")
    assert sentence.numbers["ratio"] == pytest.approx(0.5)
    assert sentence.numbers["ratio_scenes"] == 28
    assert (
        "**b**, 0.500 times (0.500–0.500) that of a, the next (median over 28 scenes"
        in sentence.text
    )


def test_nobody_is_calmest_where_it_is_not_sure() -> None:
    rng = np.random.default_rng(0)
    lines = [
        run("nominal", law, scene, acceleration_variation=float(rng.lognormal()))
        for scene in range(40)
        for law in "ab"
    ]
    made_up = Dataset(made(frame(lines), Path()))
    assert calmest(made_up, ranking(made_up, "nominal")) is None


# --- what laws use ---


LAWS = {
    "qp": {"type": "hierarchical-qp"},
    "sliding": {"type": "sliding-mode"},
    "additive": {"type": "potential-field"},
    "plan": {"type": "predictive"},
}


def without(successes: dict[str, str]) -> dict[str, Finding]:
    made_up = material({"nominal": successes}, {name: LAWS[name] for name in successes})
    found = findings(made_up)["nominal"]
    return {one.about: one for one in found if one.about.startswith("without")}


def test_the_best_of_laws_without_the_drift_is_told_where_it_is_behind() -> None:
    found = without({"qp": "+" * 30, "sliding": "+" * 15 + "t" * 15, "additive": "t" * 30})
    sentence = found["without L_fφ"]
    assert sentence.text.startswith(
        "Best without L_fφ: **sliding** 50 % (31–69 %); sliding 50 points"
    )
    assert sentence.text.endswith("less than qp.")
    assert sentence.numbers["difference"] == 0.5
    assert set(found) == {"without L_fφ"}  # that qp needs no model goes without saying


def test_where_laws_without_the_drift_are_in_front_it_is_said() -> None:
    ahead = "+" * 30
    behind = "t" * 30
    assert (
        without({"sliding": ahead, "qp": behind})["without L_fφ"].text
        == "Of these, L_fφ is not required by sliding."
    )
    both = without({"sliding": ahead, "additive": ahead, "qp": behind})
    assert both["without L_fφ"].text == "Of these, L_fφ is not required by sliding and additive."
    mixed = without({"sliding": ahead, "qp": ahead, "additive": behind})
    assert mixed["without L_fφ"].text == "Of these, L_fφ is not required by sliding."
    assert without({"qp": ahead}) == {}


def test_a_law_with_a_model_in_front_is_held_against_those_without() -> None:
    found = without({"plan": "+" * 30, "sliding": "+" * 10 + "t" * 20})
    assert (
        found["without L_fφ"].text == "Of these, L_fφ is not required by plan."
        if "without L_fφ" in found
        else True
    )
    assert found["without model"].text.startswith(
        "Best without a model: **sliding** 33 % (17–53 %)"
    )


# --- several conditions ---


def test_an_order_that_turns_over_is_said_and_one_that_does_not_is_not() -> None:
    ahead = "+" * 20
    behind = "+" * 8 + "t" * 12
    over = material({"nominal": {"a": ahead, "b": behind}, "disturbed": {"a": behind, "b": ahead}})
    (sentence,) = reversals(over)
    assert sentence.numbers["difference[nominal]"] == 12 / 20
    assert sentence.numbers["difference[disturbed]"] == 12 / 20
    assert sentence.text.startswith(
        "Rank reversal: without disturbances, a succeeds more often than b by 60 points"
    )
    assert "with disturbances, b more often than a by 60 points" in sentence.text
    assert "more pair" not in sentence.text
    same = material({"nominal": {"a": ahead, "b": behind}, "disturbed": {"a": ahead, "b": behind}})
    assert list(reversals(same)) == []
    unsure = material(
        {"nominal": {"a": ahead, "b": behind}, "disturbed": {"a": ahead[:-1] + "t", "b": ahead}}
    )
    assert list(reversals(unsure)) == []


def test_orders_are_compared_in_the_families_that_both_conditions_have() -> None:
    """b is ahead when disturbed, but in a family that has no other condition."""
    lines = []
    for scene in range(20):
        for law, good in (("a", True), ("b", False)):
            lines.append(run("nominal", law, scene, **MADE["+" if good else "t"]))
            lines.append(run("disturbed", law, scene, **MADE["+" if good else "t"]))
            lines.append(run("disturbed", law, scene, family="ur5", **MADE["t" if good else "+"]))
            lines.append(
                run("disturbed", law, scene + 20, family="ur5", **MADE["t" if good else "+"])
            )
    made_up = Dataset(made(frame(lines), Path()))
    assert ranking(made_up, "disturbed").leader == "b"
    assert list(reversals(made_up)) == []


def test_what_tuning_gains_is_told_law_by_law() -> None:
    made_up = material(
        {
            "nominal": {
                "a": "+" * 5 + "t" * 15,
                "a-tuned": "+" * 20,
                "b": "+" * 20,
                "b-tuned": "+" * 5 + "t" * 15,
                "c": "+" * 10 + "t" * 10,
                "c-tuned": "+" * 10 + "t" * 10,
            }
        }
    )
    sentence = tuning_gain(made_up)
    assert sentence is not None
    assert sentence.numbers["difference[a]"] == 0.75
    assert sentence.numbers["difference[b]"] == -0.75
    assert sentence.numbers["low[b]"] == pytest.approx(-sentence.numbers["high[a]"])
    assert sentence.numbers["high[b]"] == pytest.approx(-sentence.numbers["low[a]"])
    assert "more successful: a by 75 points" in sentence.text
    assert "less successful: b by 75 points (16–95)" in sentence.text
    assert "no significant difference: c (20 held-out scenes)" in sentence.text
    assert tuning_gain(material({"nominal": {"a": "+"}})) is None


def test_a_law_that_fails_everywhere_is_named_with_its_reason() -> None:
    made_up = material(
        {"nominal": {"a": "+" * 10, "b": "f" * 10}, "disturbed": {"a": "t" * 10, "b": "f" * 10}}
    )
    (sentence,) = always_failing(made_up)
    assert sentence.text == (
        "**b** failed or was aborted in each of its 20 runs, most often: the law gave nothing at "
        "0.1 s."
    )


# --- all of it, against pandas alone ---


def shares(
    runs: pd.DataFrame, condition: str, laws: Sequence[str], tolerance: float = 1e-4
) -> pd.DataFrame:
    """One line per scene, one column per law: whether it succeeded, with a depth tolerated."""
    own = runs[(runs["condition"] == condition) & runs["controller"].isin(laws)]
    good = (own["status"] == "converged") & (own["violation_fraction"] <= tolerance)
    return own.assign(good=good).pivot(
        index=["family", "scene"], columns="controller", values="good"
    )


@pytest.mark.parametrize("seed", range(3))
def test_every_number_is_found_again_in_the_runs(seed: int) -> None:
    rates = {
        "nominal": {"sliding-mode": 0.8, "hierarchical-qp": 0.93, "predictive": 0.92},
        "disturbed": {"sliding-mode": 0.7, "hierarchical-qp": 0.5, "predictive": 0.45},
    }
    runs = drawn_runs(rates, ["x", "y"], 120, seed)
    made_up = Dataset(made(runs, Path()))
    checked = 0
    for condition, sentences in findings(made_up).items():
        for sentence in sentences:
            tolerance = {"strict": 1e-4, "tolerant": 1e-2}[sentence.standard]
            good = shares(runs, condition, list(rates[condition]), tolerance)
            for law in sentence.laws:
                if f"success[{law}]" in sentence.numbers:
                    count = int(good[law].sum())
                    of = len(good)
                    low, high = clopper_pearson(count, of)
                    found = [
                        sentence.numbers[f"{name}[{law}]"] for name in ("success", "low", "high")
                    ]
                    assert found == pytest.approx([count / of, low, high])
                    checked += 1
            if "difference" in sentence.numbers:
                first = sentence.laws[0]
                second = sentence.laws[-1]
                if sentence.about not in ("best", "tolerant"):
                    first, second = second, first
                a = good[first]
                b = good[second]
                assert sentence.numbers["difference"] == pytest.approx(a.mean() - b.mean())
                low = tango(int((a & ~b).sum()), int((b & ~a).sum()), len(good), -1, pairs=3)
                assert sentence.numbers["difference_low"] == pytest.approx(low, abs=2e-5)
                checked += 1
    assert checked > 3
    (sentence,) = reversals(made_up)
    a, b = sentence.laws
    for condition, sign in (("nominal", 1.0), ("disturbed", -1.0)):
        good = shares(runs, condition, [a, b])
        assert sentence.numbers[f"difference[{condition}]"] == pytest.approx(
            sign * (good[a].mean() - good[b].mean())
        )


def test_what_is_printed_is_what_the_sentences_hold() -> None:
    """Numbers of a text, rounded as printed, are among the numbers of its sentence."""
    runs = drawn_runs({"nominal": {"sliding-mode": 0.8, "hierarchical-qp": 0.95}}, ["x"], 200)
    for sentence in claims_of(Dataset(made(runs, Path()), figures=False)):
        if sentence.about != "best":
            continue
        pool = [abs(100.0 * value) for name, value in sentence.numbers.items()] + list(
            sentence.numbers.values()
        )
        text = sentence.text.replace("95 % confidence", "")
        for word in (
            text.replace("–", " ").replace("(", " ").replace(",", " ").replace(";", " ").split()
        ):
            if word.replace(".", "").isdigit():
                value = float(word.rstrip("."))
                assert min(abs(value - other) for other in pool) <= 0.5, word


def test_best_of_a_standing_is_as_of_its_laws() -> None:
    made_up = material({"nominal": {"a": "t" * 20, "b": "+" * 20, "c": "+" * 10 + "t" * 10}})
    own = ranking(made_up, "nominal").among(["a", "c"])
    assert own.leader == "c"
    assert best(own).laws == ("c", "a")


def test_who_only_fails_is_not_praised_for_violating_nothing() -> None:
    made_up = material({"nominal": {"a": "f" * 20, "b": "+" * 10 + "v" * 10, "c": "v" * 20}})
    (sentence,) = claims(made_up, "violations")
    assert sentence.text == "Violated: **b** 50 % (27–73 %)."
    (alone,) = claims(material({"nominal": {"a": "f" * 20, "b": "f" * 20}}), "violations")
    assert alone.laws == ("a", "b")


def test_where_tracking_alone_misses_the_goal_it_is_said() -> None:
    made_up = material({"nominal": {"tracking": "v" * 8 + "t" * 2, "a": "+" * 10, "b": "+" * 10}})
    (sentence,) = claims(made_up, "attainable")
    assert sentence.numbers["reached"] == 0.8
    assert "reaches the goal in only 80 % (44–97 %) of 10 scenes" in sentence.text
    assert not claims(
        material({"nominal": {"tracking": "v" * 9 + "t", "a": "+" * 10}}), "attainable"
    )
