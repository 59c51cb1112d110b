"""Campaigns whose own laws load or read files: results of other contents are never taken for
these.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaigns import FAMILY
from vsconstraints.bench.evidence import (
    Campaign,
    Evidence,
    Plan,
    Shard,
    collect,
    merge,
    processes,
)
from vsconstraints.bench.evidence.folder import stored_batches
from vsconstraints.bench.tuning import Budget, Problem, tune
from vsconstraints.comparisons.runs.files import SUMS
from vsconstraints.comparisons.runs.identity import differences, scene_identity
from vsconstraints.errors import ConfigurationError
from vsconstraints.plugins import provenance

LAW = """
import json
from functools import cache
from pathlib import Path
from vsconstraints.controllers import Tracking
FILE = Path(__file__).with_name("gains.json")
@cache
def once():
    return json.loads(FILE.read_text())
{0}
class Own(Tracking):
    name = "own"
    def __init__(self):
        super().__init__()
        {1}
    def solve(self, rows, task):
        {2}
        return super().solve(rows, task)
"""

#: How a law depends on a file: its module, and the file that is edited.
KINDS = {
    "an imported helper": (LAW.format("import helper", "pass", "pass"), "helper.py"),
    "a helper imported in a run": (LAW.format("", "pass", "import helper"), "helper.py"),
    "a file read at import": (LAW.format("FILE.read_text()", "pass", "pass"), "gains.json"),
    "a file read when made": (LAW.format("", "FILE.read_text()", "pass"), "gains.json"),
    "a file read in a run": (LAW.format("", "pass", "FILE.read_text()"), "gains.json"),
    "a file read once": (LAW.format("", "pass", "once()"), "gains.json"),
}

POLICY = """
[controllers.learned]
type = "vsconstraints.bench.learning:Policy"
weights = "{}"
"""


class Here:
    """Workers that are this process."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function

    def run(
        self, calls: Mapping[Any, tuple[Any, ...]], limits: object = None, *, again: bool = True
    ) -> Iterator[tuple[Any, Any]]:
        for key, arguments in calls.items():
            yield key, self.function(*arguments)


@contextmanager
def here(function: Callable[..., Any]) -> Iterator[Here]:
    yield Here(function)


def plan(shard: str = "1/1") -> Plan:
    return Plan(Shard.parsed(shard), workers=here)


def campaign(
    folder: Path, law: str, controllers: str = '[controllers.own]\ntype = "law:Own"'
) -> Campaign:
    """The campaign's files in a folder, read as a new process reads them."""
    folder.mkdir(exist_ok=True)
    (folder / "law.py").write_text(law)
    (folder / "helper.py").write_text("GAIN = 1\n")
    (folder / "gains.json").write_text("[1]")
    (folder / "quick.toml").write_text(FAMILY)
    (folder / "small.toml").write_text(f'families = ["quick.toml"]\nscenes = 4\n{controllers}\n')
    return reread(folder)


def reread(folder: Path) -> Campaign:
    """The campaign as a new process reads it."""
    _forget()
    return Campaign.load(folder / "small.toml")


def edit(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"\n")


def _forget() -> None:
    for table in (
        provenance.read_by_imports,
        provenance.read_by_runs,
        provenance.written_by_runs,
    ):
        table.clear()
    for name in [name for name in sys.modules if "own file" in name or name == "helper"]:
        del sys.modules[name]


@pytest.fixture(autouse=True)
def _imports_are_forgotten() -> Iterator[None]:
    _forget()
    yield
    _forget()


@pytest.mark.parametrize("kind", KINDS)
def test_a_campaign_does_not_go_on_with_another_content_of_a_file(
    kind: str, tmp_path: Path
) -> None:
    law, file = KINDS[kind]
    collect(campaign(tmp_path, law), tmp_path / "out", plan())
    # every batch depends on the file, also where the process had it already
    found = [batch.facts.files for batch in stored_batches(tmp_path / "out")]
    assert all(f"law/{file}" in files for files in found), found
    assert collect(reread(tmp_path), tmp_path / "out", plan()).progress.runs == 0
    edit(tmp_path / file)
    with pytest.raises(
        ConfigurationError, match=rf"another campaign: the content of law/{file} has changed"
    ):
        collect(reread(tmp_path), tmp_path / "out", plan())


@pytest.mark.parametrize("kind", ["an imported helper", "a file read once"])
def test_batches_of_different_files_are_not_merged(kind: str, tmp_path: Path) -> None:
    law, file = KINDS[kind]
    collect(campaign(tmp_path / "one", law), tmp_path / "first", plan("1/2"))
    other = campaign(tmp_path / "two", law)
    collect(other, tmp_path / "same", plan("2/2"))
    assert merge(tmp_path / "whole", [tmp_path / "first", tmp_path / "same"]).scenes == 4
    edit(tmp_path / "two" / file)
    collect(reread(tmp_path / "two"), tmp_path / "second", plan("2/2"))
    with pytest.raises(
        ConfigurationError,
        match=f"were made with different contents of law/{file}, which custom parts",
    ):
        merge(tmp_path / "out", [tmp_path / "first", tmp_path / "second"])
    assert not (tmp_path / "out").exists()


def test_a_policy_depends_on_its_weights(tmp_path: Path) -> None:
    weights = tmp_path / "weights.npz"
    # 2 m + m n + k n + k + 2 n numbers of m rows, n joints and k features; a run that fails depends
    # on them, too
    np.savez(weights, W0=np.zeros((3, 40)), b0=np.zeros(3))
    collect(campaign(tmp_path, "", POLICY.format(weights)), tmp_path / "out", plan())
    np.savez(weights, W0=np.ones((3, 40)), b0=np.zeros(3))
    with pytest.raises(
        ConfigurationError,
        match=r"the content of vsconstraints\.bench\.learning/weights\.npz has changed",
    ):
        collect(reread(tmp_path), tmp_path / "out", plan())


def test_a_file_that_is_edited_while_a_campaign_runs_ends_it(tmp_path: Path) -> None:
    law, file = KINDS["a file read in a run"]
    small = campaign(tmp_path, law)

    def edited(progress: Any) -> None:
        if progress.done == 2:
            edit(tmp_path / file)

    with pytest.raises(
        ConfigurationError,
        match=f"the file law/{file}, which custom parts have loaded or read, was cha",
    ):
        collect(small, tmp_path / "out", plan(), on_progress=edited)
    assert [batch.facts.scenes for batch in stored_batches(tmp_path / "out")] == [(0,), (1,)]


def test_results_of_different_files_in_one_folder_are_noticed(tmp_path: Path) -> None:
    """Shards that a worker with another helper has made are no part of a whole campaign."""
    law, file = KINDS["an imported helper"]
    collect(campaign(tmp_path / "one", law), tmp_path / "first", plan("1/2"))
    campaign(tmp_path / "two", law)
    edit(tmp_path / "two" / file)
    collect(reread(tmp_path / "two"), tmp_path / "second", plan("2/2"))
    for path in (tmp_path / "second").rglob("part-*"):
        (tmp_path / "first" / path.relative_to(tmp_path / "second")).write_bytes(path.read_bytes())
    (tmp_path / "first" / SUMS).unlink()
    with pytest.raises(ConfigurationError, match=f"different contents of law/{file}"):
        Evidence.load(tmp_path / "first")


def test_what_results_depend_on_at_each_machine_includes_files_that_laws_load(
    tmp_path: Path,
) -> None:
    law, file = KINDS["an imported helper"]
    asked = campaign(tmp_path, law).on_each_machine()
    expected = asked()
    assert {"law/law.py", f"law/{file}"} <= expected["own files"].keys()
    edit(tmp_path / file)
    assert asked() != expected


@pytest.mark.parametrize(
    "statement",
    [
        "import early",
        "from early import GAIN",
        "import deep.early",
    ],
)
def test_modules_that_the_program_has_imported_before_a_law_are_compared(
    statement: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are elsewhere on the path of the program, which imports one more for itself."""
    library = tmp_path / "library"
    (library / "deep").mkdir(parents=True)
    (library / "inner.py").write_text("GAIN = 1\n")
    (library / "unrelated.py").write_text("")
    # outside a package, a module has no neighbours by a dot
    expected_to_fail = "try:\n    from . import nothing\nexcept ImportError:\n    pass\n"
    for file in ("early.py", "deep/early.py"):
        imports = "def gain():\n    from inner import GAIN\nGAIN = 1\n"
        (library / file).write_text(expected_to_fail + imports)
    (library / "deep" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(library)
    before = {*sys.modules}
    try:
        for name in ("inner", "unrelated", "deep.early", "early"):
            importlib.import_module(name)
        asked = campaign(tmp_path / "law", LAW.format("", "pass", statement)).on_each_machine()
        expected = asked()
        edit(library / "inner.py")
        changed = asked()["own files"]
    finally:
        for name in {*sys.modules} - before:
            del sys.modules[name]
    module = statement.split()[1]
    files = {name for name in expected["own files"] if name.startswith("import ")}
    packages = {"import deep"} if "." in module else set()
    assert files == {f"import {module}", "import inner", *packages}
    assert {name for name in files if changed[name] != expected["own files"][name]} == {
        "import inner"
    }


def test_files_of_one_name_are_told_apart(tmp_path: Path) -> None:
    """Folders of two machines have other names, and their files the same identity."""
    machines = []
    for machine in ("one", "two"):
        files = [tmp_path / machine / folder / "own.py" for folder in ("a", "b")]
        for file in files:
            file.parent.mkdir(parents=True)
            file.write_text(file.parent.name)
        machines.append(files)
    first, second = machines
    before = scene_identity({}, first)
    assert before == scene_identity({}, second)
    for file in second:
        edit(file)
        (difference,) = differences(before, scene_identity({}, second))
        assert difference.startswith("files.own.py is ")
        file.write_text(file.parent.name)
    assert scene_identity({}, first[::-1]) != before
    # a single file has its hash, as in results of earlier versions
    assert scene_identity({}, first[:1])["files"] == {"own.py": provenance.digest(first[0])}


def test_processes_say_what_they_have_read(tmp_path: Path) -> None:
    law, file = KINDS["a helper imported in a run"]
    collect(campaign(tmp_path, law), tmp_path / "out", Plan(workers=processes(1)))
    edit(tmp_path / file)
    with pytest.raises(ConfigurationError, match=f"law/{file} has changed"):
        collect(reread(tmp_path), tmp_path / "out", plan())


WRITES = """
from itertools import count
from pathlib import Path
from vsconstraints.controllers import Tracking
FILE = Path(__file__).with_name("state.txt")
RUNS = count()
class Own(Tracking):
    name = "own"
    def __init__(self):
        super().__init__()
        run = next(RUNS)
        if run % 2:
            FILE.read_text()
        else:
            FILE.write_text(f"after run {run}")
"""


def test_a_law_in_its_process_may_read_what_it_has_written(tmp_path: Path) -> None:
    small = campaign(tmp_path, WRITES)
    done = collect(small, tmp_path / "out", Plan(workers=processes(1)))
    assert done.progress.done == 4
    assert not any(done.progress.failed.values())
    assert (tmp_path / "state.txt").read_text() != "after run 0"


def test_a_tuning_does_not_go_on_with_another_content_of_a_file(tmp_path: Path) -> None:
    law, file = KINDS["an imported helper"]
    problem = Problem(campaign(tmp_path, law), Budget(evaluations=1, seeds=1, scenes=1))
    tune(problem, tmp_path / "tuned", workers=1)
    edit(tmp_path / file)
    problem = Problem(reread(tmp_path), Budget(evaluations=1, seeds=1, scenes=1))
    with pytest.raises(
        ConfigurationError,
        match=f"holds another tuning: the content of law/{file} has changed",
    ):
        tune(problem, tmp_path / "tuned", workers=1)
