"""The mutation run itself: which mistakes it makes, and that it sees whether a test notices
them.
"""

from __future__ import annotations

import csv
import math
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from checks.mutation.coverage import CoverageCache, Reached
from checks.mutation.mutants import edited, mutants_of, sampled
from checks.mutation.targets import (
    COMPILED_TOO,
    Mode,
    files_named,
    mode_of,
    suffices,
)

from vsconstraints.compiled.cache import sources

ROOT = Path(__file__).resolve().parent.parent

LISTS = ("equivalent.toml", "named.toml")

SOURCE = '''"""A docstring with 1 and 2."""

LIMIT = 0.5


def clipped(φ: float, low: int = 3) -> float:
    """Not 7."""
    if φ > LIMIT and not low:
        raise ValueError(f"{φ + 1} is too much")
    while φ < 0:
        φ += 1
    return abs(φ) - [1, 2][low]
'''

CHANGES = {
    ("LIMIT = 0.5", "LIMIT = 1.0"),
    ("LIMIT = 0.5", "LIMIT = 0.25"),
    (
        "def clipped(φ: float, low: int = 3) -> float:",
        "def clipped(φ: float, low: int = 4) -> float:",
    ),
    (
        "def clipped(φ: float, low: int = 3) -> float:",
        "def clipped(φ: float, low: int = 2) -> float:",
    ),
    ("if φ > LIMIT and not low:", "if φ >= LIMIT and not low:"),
    ("if φ > LIMIT and not low:", "if φ <= LIMIT and not low:"),
    ("if φ > LIMIT and not low:", "if φ > LIMIT or not low:"),
    ("if φ > LIMIT and not low:", "if φ > LIMIT and low:"),
    ('raise ValueError(f"{φ + 1} is too much")', "pass"),
    ("while φ < 0:", "while φ <= 0:"),
    ("while φ < 0:", "while φ >= 0:"),
    ("while φ < 0:", "while φ < 1:"),
    ("while φ < 0:", "while φ < -1:"),
    ("φ += 1", "pass"),
    ("φ += 1", "φ += 2"),
    ("φ += 1", "φ += 0"),
    ("return abs(φ) - [1, 2][low]", "return (φ) - [1, 2][low]"),
    ("return abs(φ) - [1, 2][low]", "return abs(φ) + [1, 2][low]"),
    ("return abs(φ) - [1, 2][low]", "return abs(φ) - [2, 2][low]"),
    ("return abs(φ) - [1, 2][low]", "return abs(φ) - [0, 2][low]"),
    ("return abs(φ) - [1, 2][low]", "return abs(φ) - [1, 3][low]"),
    ("return abs(φ) - [1, 2][low]", "return abs(φ) - [1, 1][low]"),
}

KERNEL = """def doubled(x: float) -> float:
    return 2.0 * x
"""

TESTS = """import os

import helper
from kernels.kernel import doubled
from module import clipped


def test_shared():
    assert clipped(0.25, 0) == -0.75


def test_loop():
    assert clipped(-2.0, 1) == -2.0


def test_wrong():
    assert clipped(-2.0, 1) == 2.0


def test_kernel():
    assert doubled(3.0) == 6.0


def test_compiled():
    assert os.environ["VSCONSTRAINTS_COMPILE"] == "alone"


def test_uncompiled():
    assert os.environ["VSCONSTRAINTS_COMPILE"] == "0"


def test_late():
    try:
        while True:
            pass
    except Exception:
        pass
"""

RUN = """
import sys
from pathlib import Path
from checks.mutation import child, run
from checks.mutation.coverage import CoverageCache, Reached
from checks.mutation.mutants import edited, mutants_of
from checks.mutation.targets import Mode
run.SLACK, run.THIRD_PARTY, tree = 3.0, (), Path(sys.argv[1])
child.QUICK.update(dict.fromkeys(Mode, 0.5))
named = edited(tree, "src/module.py", "- [1, 2]", "- [1, 9]", "a name")
runner = run.Runner(
    Path(sys.argv[2]), ["tests/test_module.py"], 2, tree, cache=Path(sys.argv[3])
)
reached = runner.reached[Mode.COMPILED]
tests = list(reached)
assert [test.split("::")[1] for test in tests] == "test_shared test_loop test_kernel test_compiled".split()
uncompiled = runner.reached[Mode.UNCOMPILED]
assert uncompiled.keys() - reached.keys() == {"tests/test_module.py::test_uncompiled"}
# where it is compiled, it is not seen which tests enter it
kernel = {("src/kernels/kernel.py", 1)}
assert [test for test in uncompiled if kernel & uncompiled[test].functions] == ["tests/test_module.py::test_kernel"]
assert not any(kernel & reached[test].functions for test in tests)
assert runner.failing_without_mutant(Mode.COMPILED, tests) == ""
assert list(runner.judge([named], until=0.0)) == []
runner.longest = 0.0
assert len(runner.tests_for(named)) == 1
runner.longest = 60.0
broken = tree / "copy" / "tests" / "test_broken.py"
broken.write_text("import no_such_module", encoding="utf-8")
wrong = [f"tests/{name}" for name in ("test_broken.py::test_a", "test_gone.py::test_b", "test_module.py::test_c")]
assert runner.missing_tests([*tests, *wrong]) == wrong
runner.known = {named.key: wrong[2]}
reached[wrong[2]] = Reached(0.1)
try:
    list(runner.judge([named]))
except RuntimeError as error:
    assert "test_module.py::test_c" in str(error)
else:
    raise AssertionError("a test that does not exist has noticed a mutant")
runner.known = None
del reached[wrong[2]]
wrong_kernel = edited(tree, "src/kernels/kernel.py", "2.0 * x", "3.0 * x", "a name")
(verdict,) = runner.judge([wrong_kernel])
assert (verdict.state, verdict.by) == ("killed", "tests/test_module.py::test_kernel")
for verdict in runner.judge([*mutants_of(tree, "src/module.py"), named]):
    print(verdict.state, "|", verdict.mutant.old, "|", verdict.mutant.new, "|", verdict.by.split("::")[-1])
late = run.Runner(Path(sys.argv[2]) / "late", ["tests/test_module.py"], 2, tree, watch_until=0.0)
assert late.unwatched == [(mode, "tests/test_module.py") for mode in Mode]
assert [verdict.state for verdict in late.judge([named])] == ["undecided"]
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, text in (("src/module.py", SOURCE), ("tests/test_module.py", TESTS)):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "src" / "kernels").mkdir()
    (tmp_path / "src" / "kernels" / "kernel.py").write_text(KERNEL, encoding="utf-8")
    (tmp_path / "tests" / "helper.py").touch()
    (tmp_path / "pyproject.toml").touch()
    (tmp_path / "copy").mkdir()
    return tmp_path


def test_every_mistake_is_made_once_and_texts_are_left_alone(tree: Path) -> None:
    made = mutants_of(tree, "src/module.py")
    assert {(mutant.old, mutant.new) for mutant in made} == CHANGES
    assert len(made) == len(CHANGES)
    assert {mutant.function for mutant in made if mutant.line > 6} == {6}
    assert {mutant.function for mutant in made if mutant.line <= 6} == {0}
    for mutant in made:
        assert mutant.old != mutant.new
        before = SOURCE.splitlines()
        after = mutant.source.splitlines()
        assert [i + 1 for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b] == [
            mutant.line
        ]


def test_defaults_and_limits_of_options_are_mutated_and_search_ranges_are_not(
    tmp_path: Path,
) -> None:
    line = 'rate = option(20.0, "α [1/s]", (1.0, 200.0), at_least=3.0)'
    (tmp_path / "module.py").write_text(f"{line}\n", encoding="utf-8")
    changed = {mutant.new for mutant in mutants_of(tmp_path, "module.py")}
    pairs = [("20.0", "10.0"), ("20.0", "40.0"), ("3.0", "1.5"), ("3.0", "6.0")]
    assert changed == {line.replace(old, new, 1) for old, new in pairs}


def test_all_that_compiled_code_is_made_of_runs_as_python() -> None:
    package = ROOT / "src/vsconstraints"
    files = set(sources())
    files |= {
        path
        for path in package.rglob("*.py")
        if re.search(r"^ *(@formula|def formula\()", path.read_text(encoding="utf-8"), re.M)
    }
    names = {path.relative_to(ROOT).as_posix() for path in files}
    assert {name for name in names if mode_of(name) is Mode.UNCOMPILED} == names
    listed = {name for name in COMPILED_TOO if (ROOT / name).is_file()}
    assert listed == set(COMPILED_TOO) <= names
    assert mode_of("src/vsconstraints/simulation/plant.py") is Mode.COMPILED


def test_a_named_mistake_must_be_found(tree: Path) -> None:
    mutant = edited(tree, "src/module.py", "abs(φ) - ", "φ - ", "why")
    assert (mutant.line, mutant.function, mutant.new) == (12, 6, "return φ - [1, 2][low]")
    for old, times in (("no such text", 0), ("φ", 6)):
        with pytest.raises(ValueError, match=f"has {times} times, not once"):
            edited(tree, "src/module.py", old, "", "why")


def test_samples_are_repeatable(tree: Path) -> None:
    made = mutants_of(tree, "src/module.py")
    assert sampled(made, 5, "1") == sampled(made, 5, "1") != sampled(made, 5, "2")
    assert len(sampled(made, 5, "1")) == 5
    assert sampled(made, 100, "1") == made


def test_a_sample_is_judged_by_what_chance_allows() -> None:
    """The sum of the binomial distribution's terms, written out: the most misses of 100.

    95 % of the 94 % that can be noticed must be.
    """
    missed = 1.0 - 0.95 * 0.94
    terms = [math.comb(100, k) * missed**k * (1.0 - missed) ** (100 - k) for k in range(101)]
    most = max(k for k in range(101) if sum(terms[k:]) >= 0.05)
    assert most == 16
    assert suffices(100 - most, 100)
    assert not suffices(99 - most, 100)
    assert suffices(0, 0)


def test_what_tests_notice(tree: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", RUN, str(tree), str(tree / "copy"), str(tree / "cache")],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=True,
    )
    lines = ended.stdout.splitlines()
    remarks = [line for line in lines if " | " not in line]
    found = {tuple(line.split(" | ")) for line in lines if line not in remarks}
    # tests that fail anyway notice nothing, and are named
    (remark,) = remarks
    failing = re.findall(r"::(\w+)'", remark)
    assert failing == ["test_wrong", "test_uncompiled"]
    states = {(old, new): (state, by) for state, old, new, by in found}
    assert len(found) == len(CHANGES) + 1
    # no test has φ at the limit or beyond, leaves out the second number, or starts from an odd one
    # below zero
    survivors = {key for key, (state, _) in states.items() if state == "survived"}
    assert survivors == {
        ("LIMIT = 0.5", "LIMIT = 1.0"),
        ("LIMIT = 0.5", "LIMIT = 0.25"),
        (
            "def clipped(φ: float, low: int = 3) -> float:",
            "def clipped(φ: float, low: int = 4) -> float:",
        ),
        (
            "def clipped(φ: float, low: int = 3) -> float:",
            "def clipped(φ: float, low: int = 2) -> float:",
        ),
        ('raise ValueError(f"{φ + 1} is too much")', "pass"),
        ("if φ > LIMIT and not low:", "if φ >= LIMIT and not low:"),
        ("if φ > LIMIT and not low:", "if φ > LIMIT and low:"),
        ("φ += 1", "φ += 2"),
        ("return abs(φ) - [1, 2][low]", "return (φ) - [1, 2][low]"),
    }
    assert states["φ += 1", "pass"] == ("timed out", "test_loop")
    assert states["while φ < 0:", "while φ < -1:"] == ("killed", "test_loop")
    assert states["return abs(φ) - [1, 2][low]", "return abs(φ) - [1, 9][low]"] == (
        "killed",
        "test_loop",
    )
    assert states["return abs(φ) - [1, 2][low]", "return abs(φ) - [0, 2][low]"] == (
        "killed",
        "test_shared",
    )
    assert (tree / "src/module.py").read_text(encoding="utf-8") == SOURCE


REACHED = {
    "tests/test_module.py::test_loop": Reached(0.5, {("src/module.py", 6)}),
    "tests/test_module.py::test_shared": Reached(0.25, set()),
}


def kept(tree: Path) -> dict[str, Reached] | None:
    """Coverage that another run finds."""
    return CoverageCache(tree / "cache", tree).get("tests/test_module.py")


def test_coverage_is_kept_until_something_changes(tree: Path) -> None:
    (tree / "src" / "other.py").write_text("def unused():\n    pass\n", encoding="utf-8")
    (tree / "src" / "table.toml").write_text("x = 1\n", encoding="utf-8")
    assert kept(tree) is None
    cache = CoverageCache(tree / "cache", tree)
    cache.put("tests/test_module.py", REACHED, ["src/module.py"])
    assert kept(tree) == REACHED
    assert CoverageCache(tree / "cache", tree, "other limits").get("tests/test_module.py") is None
    # no test enters a function of this file
    (tree / "src" / "other.py").write_text("def unused():\n    return 1\n", encoding="utf-8")
    assert kept(tree) == REACHED
    (tree / "tests" / "unused.py").write_text("", encoding="utf-8")
    assert kept(tree) == REACHED
    for name in ("src/module.py", "tests/test_module.py", "src/table.toml", "tests/helper.py"):
        path = tree / name
        text = path.read_text(encoding="utf-8") if path.exists() else None
        path.write_text(f"{text}\n", encoding="utf-8")
        assert kept(tree) is None, name
        if text is None:
            path.unlink()
        else:
            path.write_text(text, encoding="utf-8")
        assert kept(tree) == REACHED


def test_damaged_coverage_is_made_again(tree: Path) -> None:
    cache = CoverageCache(tree / "cache", tree)
    cache.put("tests/test_module.py", REACHED, ["src/module.py"])
    (file,) = (tree / "cache").iterdir()
    whole = file.read_text(encoding="utf-8")
    for text in ("", whole[:-9], "[]", "{}", whole.replace("tests", "text")):
        file.write_text(text, encoding="utf-8")
        assert kept(tree) is None


def test_what_is_listed_is_there() -> None:
    """Every mutant that is called equivalent is one, every named mistake can be made, and what must
    be noticed is a mutant or a named mistake.
    """
    every = {mutant.key for file in files_named(ROOT) for mutant in mutants_of(ROOT, file)}
    lists = {
        name: tomllib.loads((ROOT / "checks/mutation" / name).read_text("utf-8"))["mutant"]
        for name in LISTS
    }
    assert [
        table
        for table in lists["equivalent.toml"]
        if (table["file"], table["old"], table["new"]) not in every
    ] == []
    named = {edited(ROOT, **table).key for table in lists["named.toml"]}
    with (ROOT / "checks/mutation/noticed.tsv").open(encoding="utf-8", newline="") as file:
        lines = csv.DictReader(file, delimiter="\t")
        noticed = {(line["file"], line["old"], line["new"]) for line in lines}
    assert noticed - every - named == set()
