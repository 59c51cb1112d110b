"""The lists of tests that the quick suite leaves out name tests that exist, each once."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

from markers import FULL, SAMPLED, SLOW, sampled

LISTS = [SLOW, FULL, SAMPLED.keys()]


def test_every_listed_test_exists() -> None:
    """A test that was renamed would return to the quick suite with all its cases."""
    existing = set()
    for path in Path(__file__).parent.glob("test_*.py"):
        existing.add(path.stem)
        text = path.read_text(encoding="utf-8")
        for test in re.findall(r"^ *def (test_\w+)\(", text, re.MULTILINE):
            existing.add(f"{path.stem}::{test}")
    assert set().union(*LISTS) - existing == set()


def test_no_test_is_listed_twice() -> None:
    """Neither in two lists, nor beside its whole file."""
    for first, second in combinations(LISTS, 2):
        assert first & second == set()
    whole_files = SLOW | FULL
    tests = [name for name in set().union(*LISTS) if "::" in name]
    assert [test for test in tests if test.partition("::")[0] in whole_files] == []


def test_sampled_cases_contain_each_value_of_the_parameters() -> None:
    cases = [{"law": law, "seed": seed} for law in "abc" for seed in range(5)]
    kept = [cases[number] for number in sampled(cases, ("law", "seed"))]
    assert len(kept) == 5
    assert {case["law"] for case in kept} == {*"abc"}
    assert {case["seed"] for case in kept} == {*range(5)}
    assert sampled(cases, ("law",)) == {0, 5, 10}
    assert sampled(cases, 3) == {0, 5, 10}
    assert sampled(cases[:1], 3) >= {0}
