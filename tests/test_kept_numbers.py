"""Every number of the pages on results, against the tables that are kept.

A line of :data:`SENTENCES` is a page, a sentence of it with places for numbers, and the query whose
answer they are. What is left of the pages' sections once these sentences are taken out must hold no
number but those of :data:`STATED`, which are no results of these tables.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import pandas as pd
import pytest
from checks import best, final_errors

from documents import ROOT
from vsconstraints.bench.families.frozen import TestSet
from vsconstraints.bench.study import SHIPPED

README = "README.md"
WHICH = "docs/which-law.md"
BENCHMARK = "docs/benchmark.md"
FIRST = "robust-predictive"
OBSERVER = "robust-hierarchical-qp-observer"
PLAIN = "hierarchical-qp"
PAPER = "sliding-mode"
AHEAD = "sliding-mode-ahead"
UNSOLVED = ROOT / "comparisons" / "unsolved.parquet"
NUMBERS = {7: "seven", 8: "eight", 9: "nine"}
TOLERANCES = (1e-4, 1e-3, 1e-2, 1e-1)  #: From the strict standard on [L].


# --- queries ---


@cache
def study() -> Any:
    """The study that comes with the package."""
    return pd.read_parquet(SHIPPED)


@cache
def tuned() -> Any:
    """Laws before and after tuning."""
    return pd.read_parquet(ROOT / "comparisons" / "tuned-laws.parquet")


@cache
def literature() -> Any:
    """Laws of the literature."""
    return pd.read_parquet(ROOT / "comparisons" / "laws.parquet")


@cache
def errors() -> Any:
    """Final errors, law by law."""
    return final_errors.summary(pd.read_parquet(final_errors.TABLE))


@cache
def claims() -> Any:
    """What the report of the study says, as data."""
    return json.loads((ROOT / "reports" / "evidence" / "claims.json").read_text(encoding="utf-8"))


def rate(
    law: str, condition: str, column: str = "success", runs: Any = None, family: str = ""
) -> float:
    """Return a law's success in per cent, in all families or one."""
    runs = study() if runs is None else runs
    own = runs[(runs["controller"] == law) & (runs["condition"] == condition)]
    if family:
        own = own[own["family"] == family]
    assert len(own)
    return float(100.0 * own[column].mean())


def tolerated(law: str) -> float:
    """Return a law's success with disturbances at 1 % of L."""
    return rate(law, "disturbed", "tolerant_success")


def call(law: str) -> float:
    """Return the median time of a law's calls [µs]."""
    runs = study()
    return float(runs[runs["controller"] == law]["call_us"].median())


def ahead(first: str, second: str, column: str = "success") -> float:
    """Return by how many points one law succeeds more often than another one, with disturbances."""
    return rate(first, "disturbed", column) - rate(second, "disturbed", column)


def paper_runs() -> Any:
    """The paper's law without disturbances, with whether it left rows of speed only."""
    runs = study()
    own = runs[(runs["controller"] == PAPER) & (runs["condition"] == "nominal")]
    rows = own["violated"].fillna("").str.split("; ")
    speeds = rows.map(
        lambda labels: bool(labels[0]) and all(label.startswith("speed[") for label in labels)
    )
    return own.assign(speeds=speeds)


def paper_speeds() -> float:
    """Return the share of these runs that left rows of speed only, in per cent."""
    return float(100.0 * paper_runs()["speeds"].mean())


def paper_without_speeds() -> float:
    """Return how often the paper's law would succeed without rows of speed, in per cent."""
    runs = paper_runs()
    good = (runs["status"] == "converged") & (runs["speeds"] | (runs["violated"] == ""))
    return float(100.0 * good.mean())


def gap(law: str = PLAIN, after: bool = False) -> float:
    """Return by how many points a law is behind the first one in the scenes of the tuning, with
    disturbances.
    """
    own = f"{law}-tuned" if after else law
    return rate(FIRST, "disturbed", runs=tuned()) - rate(own, "disturbed", runs=tuned())


def lost() -> list[float]:
    """By how many points laws succeed less often with disturbances."""
    return [rate(law, "nominal") - rate(law, "disturbed") for law in study()["controller"].unique()]


def seven(law: str) -> float:
    """Return a law's success with disturbances in the seven families that are no ladders."""
    runs = study()
    return rate(law, "disturbed", runs=runs[~runs["family"].str.startswith("ladder")])


def further(law: str) -> tuple[float, float]:
    """The interval of a law's success with disturbances in a further family [%], as the report
    prints it.
    """
    text = (ROOT / "reports" / "evidence" / "report.md").read_text(encoding="utf-8")
    section = text.partition("## Beyond these families")[2]
    line = next(line for line in section.splitlines() if line.startswith(f"| {law} "))
    low, high = re.findall(r"\(([\d.]+)–([\d.]+)\)", line.split("|")[3])[0]
    return float(low), float(high)


def reached(number: str) -> float:
    """Return how often the first law succeeds, or does and ends near the goal, in the scenes of the
    final errors.
    """
    return float(errors().loc[FIRST, number])


Query = Callable[[], Any]
SENTENCES: tuple[tuple[str, str, Query], ...] = (
    (
        README,
        "{:.0f} % of the runs of `robust-predictive` succeed and end within 5 mm and 5 mrad ({} "
        "scenes)",
        lambda: [reached("near"), len(scenes_of_final_errors())],
    ),
    (
        README,
        "`potential-field` is {:.0f} points ahead of `cbf-filter` at 0.01 % and {:.0f} points "
        "behind at 1 %",
        lambda: [
            ahead("potential-field", "cbf-filter"),
            -ahead("potential-field", "cbf-filter", "tolerant_success"),
        ],
    ),
    (
        README,
        "Tuned, `hierarchical-qp` is {:.0f} points behind `robust-predictive`; with default "
        "settings it is {:.0f} points behind.",
        lambda: [gap(after=True), gap()],
    ),
    (
        README,
        "in {:.0f} % of its runs without disturbances, the only violated rows are joint speeds. "
        "Without these rows it would succeed in {:.0f} %. At 1 % of L it succeeds in {:.0f} %, "
        "and in {:.0f} % with rows that look one period ahead.",
        lambda: [
            paper_speeds(),
            paper_without_speeds(),
            rate(PAPER, "nominal", "tolerant_success"),
            rate(AHEAD, "nominal", "tolerant_success"),
        ],
    ),
    (
        WHICH,
        "in {:.0f} % of its runs without disturbances, the only violated rows are joint speeds",
        lambda: [paper_speeds()],
    ),
    (
        WHICH,
        "Without these rows it would succeed in {:.0f} %. At 1 % of L it succeeds in {:.0f} %, "
        "and in {:.0f} % with rows that look one period ahead (`sliding-mode-ahead`).",
        lambda: [
            paper_without_speeds(),
            rate(PAPER, "nominal", "tolerant_success"),
            rate(AHEAD, "nominal", "tolerant_success"),
        ],
    ),
    (
        WHICH,
        "`robust-predictive` succeeds in {:.0f} to {:.0f} %, the robust QP with an observer in "
        "{:.0f} to {:.0f} %",
        lambda: [*further(FIRST), *further(OBSERVER)],
    ),
    (
        WHICH,
        "`potential-field` succeeds {:.0f} points more often than `cbf-filter` at 0.01 % of L and "
        "{:.0f} points less "
        "often at 1 %",
        lambda: [
            ahead("potential-field", "cbf-filter"),
            -ahead("potential-field", "cbf-filter", "tolerant_success"),
        ],
    ),
    (
        WHICH,
        "`hierarchical-qp` is {:.0f} points behind `robust-predictive`; with default settings it "
        "is {:.0f} points behind",
        lambda: [gap(after=True), gap()],
    ),
    (
        WHICH,
        "every law succeeds less often, by {:.0f} to {:.0f} points",
        lambda: [min(lost()), max(lost())],
    ),
    (
        WHICH,
        "with disturbances `reciprocal-barrier` ({:.0f} %) and `gradient-robust-barrier` ({:.0f} "
        "%) "
        "come nearest to the robust QP ({:.0f} %)",
        lambda: [
            rate(law, "disturbed", runs=literature())
            for law in ("reciprocal-barrier", "gradient-robust-barrier", "robust-hierarchical-qp")
        ],
    ),
    (
        WHICH,
        "equals the robust QP with an observer in seven families ({:.0f} against {:.0f} %, a tie)",
        lambda: [seven("predictive"), seven(OBSERVER)],
    ),
    (
        WHICH,
        "`robust-predictive` observes them: {:.0f} and {:.0f} % in the first two",
        lambda: [rate(FIRST, "disturbed", family=family) for family in ("ladder-panda", "moving")],
    ),
    (
        BENCHMARK,
        "it succeeds in {:.1f}/{:.1f}/{:.1f} % as written",
        lambda: [rate(PAPER, condition) for condition in ("nominal", "disturbed", "limited")],
    ),
    (
        BENCHMARK,
        "{:.1f}/{:.1f}/{:.1f} one period ahead",
        lambda: [rate(AHEAD, condition) for condition in ("nominal", "disturbed", "limited")],
    ),
)


# --- tables ---


def cells(line: str) -> list[str]:
    """Return the cells of a line of a table, without what marks them."""
    return [cell.strip(" *") for cell in line.strip().strip("|").split("|")]


def lines_below(page: str, head: str) -> dict[str, list[str]]:
    """Return the cells of the table with this head, by the law that its first cell names in
    code.
    """
    text = (ROOT / page).read_text(encoding="utf-8")
    table = text.partition(f"{head}\n")[2].partition("\n\n")[0]
    assert table, f"{page} has no table with the head {head}"
    lines = [cells(line) for line in table.splitlines()[1:]]
    return {re.findall(r"`(.+?)`", name)[0]: numbers for name, *numbers in lines}


BOTH = "| law | without disturbances | with disturbances | with them, at 1 % of L |"
RESULTS = f"{BOTH} with them, tuned | final error [mm] |"
STUDY = f"{BOTH} under the arms' limits | a call [µs] |"


def test_the_table_of_the_readme_is_that_of_the_kept_runs() -> None:
    lines = lines_below(README, RESULTS)
    assert len(lines) == 8
    laws = set(study()["controller"])
    assert len(laws) == 11
    text = (ROOT / README).read_text(encoding="utf-8")
    rest = text.partition("The table has eight of the eleven laws of the study")[2]
    assert laws - lines.keys() == set(re.findall("`(.+?)`", rest.partition(":\n\n")[0]))
    for law, numbers in lines.items():
        known = [f"{rate(law, name):.0f} %" for name in ("nominal", "disturbed")] + [
            f"{tolerated(law):.0f} %"
        ]
        after = f"{law}-tuned"
        if after in set(tuned()["controller"]):
            both = [rate(name, "disturbed", runs=tuned()) for name in (law, after)]
            known.append("{:.0f} → {:.0f} %".format(*both))
        else:
            known.append("–")
        own = errors().loc[law]
        known.append(f"{own['position']:.0f} / {own['position_95']:.0f}")
        assert numbers == known, law


def test_the_tables_of_the_page_are_those_of_the_kept_runs() -> None:
    lines = lines_below(WHICH, STUDY)
    assert len(lines) == 10
    for law, numbers in lines.items():
        known = [rate(law, "nominal"), rate(law, "disturbed"), tolerated(law), rate(law, "limited")]
        assert numbers[:4] == [f"{number:.0f}" for number in known], law
        assert float(numbers[4]) == pytest.approx(call(law), rel=0.03), law
    text = (ROOT / BENCHMARK).read_text(encoding="utf-8")
    assert "\n".join(final_errors.table_of_errors(errors())) in text
    assert f"{len(scenes_of_final_errors())} scenes, `python -m checks.final_errors`" in flat(text)


def scenes_of_final_errors() -> Any:
    """The scenes whose final errors are kept."""
    return pd.read_parquet(final_errors.TABLE)[["family", "scene"]].drop_duplicates()


def test_final_errors_are_of_runs_of_the_kept_study() -> None:
    """The same success, but for runs that rounding decides."""
    kept = pd.read_parquet(final_errors.TABLE)
    keys = ["family", "condition", "half", "scene", "controller"]
    both = kept.merge(study(), on=keys, suffixes=("", "_kept"))
    assert len(both) == len(kept)
    assert (both["success"] != both["success_kept"]).mean() <= 1e-3


# --- sentences ---


def flat(text: str) -> str:
    """Return a text with single spaces, without its lists' marks."""
    return " ".join(re.sub(r"^\s*- ", "", text, flags=re.MULTILINE).split())


@pytest.mark.parametrize(
    ("page", "sentence", "query"), SENTENCES, ids=[f"{p}: {s[:50]}" for p, s, _ in SENTENCES]
)
def test_a_sentence_says_what_the_kept_tables_say(page: str, sentence: str, query: Query) -> None:
    said = sentence.format(*query())
    assert said in flat((ROOT / page).read_text(encoding="utf-8")), said


def test_the_first_place_is_the_same_at_every_tolerance() -> None:
    runs = study()
    runs = runs[runs["condition"] == "disturbed"]
    for tolerance in TOLERANCES:
        good = (runs["status"] == "converged") & (
            runs["violation_fraction"].fillna(0.0) <= tolerance
        )
        assert good.groupby(runs["controller"]).mean().idxmax() == FIRST


def test_the_data_of_the_report_are_those_of_the_kept_runs() -> None:
    """Of each law in each condition, and in each family and condition."""
    for line in claims()["table"]:
        for condition in ("nominal", "disturbed", "limited"):
            assert 100.0 * line[condition] == pytest.approx(rate(line["law"], condition), abs=1e-9)
    success = study().groupby(["family", "condition", "controller"])["success"].mean()
    situations = {
        (one["family"], one["condition"], one["law"]): one["success"]
        for one in claims()["situations"]
    }
    assert situations == pytest.approx(success.to_dict(), abs=1e-12)


def test_the_text_of_the_report_is_that_of_its_data() -> None:
    text = (ROOT / "reports" / "evidence" / "report.md").read_text(encoding="utf-8")
    for line in claims()["sentences"]:
        if line["about"] in ("best", "alike"):
            assert line["text"] in text
    for law in study()["controller"].unique():
        (shown,) = (cells(line) for line in headline(text) if cells(line)[0] == law)
        for cell, condition in zip(shown[2:5], ("nominal", "disturbed", "limited"), strict=True):
            value = cell.strip("≈ ").partition(" ")[0]
            digits = len(value.partition(".")[2])
            assert float(value) == pytest.approx(rate(law, condition), abs=0.501 * 10.0**-digits), (
                law,
                condition,
            )


def headline(text: str) -> Iterator[str]:
    """The lines of the table of all laws in the report's first part."""
    part = text.partition("## Findings")[2].partition("## Which controller to choose")[0]
    return (line for line in part.splitlines() if line.startswith("| "))


def test_the_first_places_on_arms_with_mass_are_those_of_the_kept_runs() -> None:
    runs = pd.read_parquet(final_errors.WITH_MASS)
    page = (ROOT / "docs" / "real-world.md").read_text(encoding="utf-8")
    assert "\n".join(final_errors.table_of_places(runs)) in page
    scenes = runs.groupby(final_errors.SCENE).ngroups
    assert f"on {scenes} of the same scenes" in flat(page)
    strict = set(final_errors.places(runs).front)
    tolerant = set(final_errors.places(runs, "tolerant_success").front)
    assert strict == {FIRST, "predictive", OBSERVER, "robust-hierarchical-qp"}
    assert tolerant >= strict | {"cbf-filter"}


def test_scenes_that_no_law_solves_are_examined() -> None:
    """All of them, in the table of the test set or in their own; and the page names their
    outcomes.
    """
    runs = study()
    solved = runs[runs["condition"] == "nominal"].groupby(["family", "scene"])["success"].any()
    unsolved = set(solved.index[~solved])
    own = {
        key[::2]: line for line in best.read(UNSOLVED, TestSet.load()) for key in [best.key(line)]
    }
    known = {
        key[::2]: line for line in best.read(best.TABLE, TestSet.load()) for key in [best.key(line)]
    }
    assert unsolved == own.keys() | (unsolved & known.keys())
    assert not own.keys() & known.keys()
    page = flat((ROOT / BENCHMARK).read_text(encoding="utf-8"))
    assert f"No law of the study solves {NUMBERS[len(unsolved)]} of the 2000 nominal scenes" in page
    for outcome, words in (
        (best.REACHABLE, "by optimal control"),
        (best.UNKNOWN, "no motion found and no proof"),
    ):
        named = [
            f"`{family}` {scene}"
            for (family, scene), line in own.items()
            if line["outcome"] == outcome
        ]
        assert f"{outcome}, {words}: {', '.join(named)}" in page
    assert not list(
        best.wrong([line for line in own.values() if line["motion"]][:1], TestSet.load())
    )


# --- no number is left over ---

#: Of each page where its results begin and end.
SECTIONS = {
    README: ("How often each law satisfies", "The package implements"),
    WHICH: ("## What thousands of scenes say", "### Why"),
}
#: What is no result of a kept table, and what it is.
STATED = {
    README: (
        ("2000 held-out scenes", "of the test set"),
        (
            "within 5 mm and 5 mrad, with them within 20 to 50 mm and 20 to 80 mrad",
            "tolerances of families",
        ),
        ("95 % quantile", "a definition"),
        ("count from 0.01 % of L", "a definition"),
        ("up to 10 % of L", "see the test of the first place"),
        ("in 350 scenes", "see test_which_law"),
        ("95 % confidence intervals are ±0.5 to ±2.3 points", "see the leaderboard"),
        (
            "63 conclusions were tested again on arms with mass and by images ([200 scenes]): 50 to "
            "61 of them hold. Mass reverses 4 at 0.01 % of L, but none of these at 1 %.",
            "see test_which_conclusions_hold",
        ),
        ("at 1 % of L `cbf-filter` shares it", "see the test of the arms with mass"),
    ),
    WHICH: (
        ("all 2000 held-out scenes", "of the test set"),
        ("200 of each of ten", "of the test set"),
        ("in 1800 scenes", "of the test set"),
        ("deeper than 0.01 % of L", "a definition"),
        ("about 0.02 px where pixels have 0.05 to 0.5 px of noise", "the families' settings"),
        ("up to 10 % of L", "see the test of the first place"),
        ("within 5 mm and 5 mrad (`free-camera`: 2 px)", "tolerances of families"),
        ("within 20 to 50 mm and 20 to 80 mrad (5 px)", "tolerances of families"),
        ("Of 36 [laws]", "see test_which_law"),
        ("on 500 of these scenes, 14 tie", "see test_which_law"),
    ),
}


@pytest.mark.parametrize("page", SECTIONS)
def test_no_number_of_a_page_is_left_unchecked(page: str) -> None:
    begin, end = SECTIONS[page]
    text = (ROOT / page).read_text(encoding="utf-8")
    text = text[text.index(begin) : text.index(end)]
    text = flat("\n".join(line for line in text.splitlines() if not line.startswith("|")))
    text = re.sub(r"\]\([^)]*\)", "]", text)
    for where, sentence, query in SENTENCES:
        text = text.replace(sentence.format(*query()) if where == page else "\0", "")
    text = text.replace(f"{len(scenes_of_final_errors())} scenes", "")
    for words, _ in STATED[page]:
        assert words in text, words
        text = text.replace(words, "")
    assert re.findall(r"\d[\d.,]*", text) == []


def test_tolerances_of_goals_are_as_the_pages_say() -> None:
    """5 mm and 5 mrad without disturbances; with them 20 to 50 mm and 20 to 80 mrad."""
    families = TestSet.load().families
    own = [family.scene(0, "held-out", TestSet.load().seed) for family in families]
    for condition, translation, rotation in (
        ("nominal", (5, 5), (5, 5)),
        ("disturbed", (20, 50), (20, 80)),
    ):
        tolerances = [scene.setup(condition).tolerances for scene in own]
        for numbers, (low, high) in (
            ([1e3 * one.translation_m for one in tolerances], translation),
            ([1e3 * one.rotation_rad for one in tolerances], rotation),
        ):
            assert (min(numbers), max(numbers)) == pytest.approx((low, high))
