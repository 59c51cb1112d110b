"""Laws named by file and class: where files are searched for, and the folder controllers."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from folder_laws import FOLDER, FOLDER_LAWS
from vsconstraints.bench.evidence.own_files import own_folders
from vsconstraints.bench.repetition import drawn_lines, moved_laws
from vsconstraints.bench.study import Study
from vsconstraints.comparisons import Suite, compare
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.controllers import CONTROLLERS, MOVED, controller_class, make_controller
from vsconstraints.errors import ConfigurationError

ROOT = FOLDER.parent
#: A law that imports a module beside it as late as in its first sample.
LATE = """
from vsconstraints.controllers import Controller

class Late(Controller):
    name = "late"

    def solve(self, rows, task):
        from neighbour_of_late import TRACKING
        return TRACKING.solve(rows, task)
"""
NEIGHBOUR = "from vsconstraints.controllers import Tracking\nTRACKING = Tracking()\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the law in ``laws/late.py`` and a suite in ``suites/suite.toml``."""
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "late.py").write_text(LATE, encoding="utf-8")
    (tmp_path / "laws" / "neighbour_of_late.py").write_text(NEIGHBOUR, encoding="utf-8")
    (tmp_path / "suites").mkdir()
    (tmp_path / "suites" / "suite.toml").write_text(
        'title = "late"\nscenarios = ["example-2d-fov"]\n'
        '[controllers.late]\ntype = "../laws/late.py:Late"\n',
        encoding="utf-8",
    )
    return tmp_path


def test_a_path_begins_in_the_folder_that_is_given_or_else_in_the_working_directory(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = controller_class("late.py:Late", folder / "laws")
    assert law.name == "late"
    assert controller_class(f"{folder}/laws/late.py:Late", folder / "suites") is law
    monkeypatch.chdir(folder)
    assert controller_class("laws/late.py:Late") is law
    assert ControllerSpec.called("laws/late.py:Late", folder=Path()).name == "late"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("laws/none.py:Late", r"there is no file .*/laws/none\.py"),
        ("laws/late.py:Early", "late has no Controller named 'Early'"),
        ("laws/late.py:", "must be module:Class or FILE.py:Class"),
        ("laws/late.txt:Late", "must be module:Class or FILE.py:Class"),
        ("laws:late.py", "must be module:Class or FILE.py:Class"),
        ("laws/\0.py:Late", "must be module:Class or FILE.py:Class"),
        ("laws/late.py", "unknown controller 'laws/late.py'"),
        *((name, re.escape(f"it is {file}")) for name, file in MOVED.items()),
    ],
)
def test_names_of_no_law_are_refused_with_what_is_right(
    name: str, words: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    with pytest.raises(ConfigurationError, match=words):
        make_controller(name)
    with pytest.raises(ConfigurationError, match=words):
        Suite.load().select(controllers=[name])


def test_a_suite_finds_its_laws_and_their_neighbours_from_any_working_directory(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    suite = Suite.load(folder / "suites" / "suite.toml").select(settings=["scenario.duration=0.1"])
    finished = compare(suite, folder / "out", workers=2)
    scores = {key[1]: result.result for key, result in finished.scores.items()}
    assert scores["late"]["status"] == scores["tracking"]["status"] == "unfinished"
    assert scores["late"]["violation_fraction"] == scores["tracking"]["violation_fraction"]
    folders = own_folders(suite.controllers, ())
    assert folders["late 2"] == str(folder / "laws")
    assert not any("/" in name for name in folders)


def test_every_file_of_the_folder_is_tested_and_listed() -> None:
    page = (ROOT / "docs" / "controllers.md").read_text(encoding="utf-8")
    laws = set()
    for path in FOLDER.glob("*.py"):
        for part in ast.parse(path.read_text(encoding="utf-8")).body:
            named = isinstance(part, ast.ClassDef) and any(
                isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "name"
                for line in part.body
            )
            if named:
                laws.add(f"{FOLDER}/{path.name}:{part.name}")
                assert f"| [`{path.name}`](../controllers/{path.name}) | `{part.name}` |" in page
    assert laws == set(FOLDER_LAWS.values())
    for name, file in FOLDER_LAWS.items():
        assert controller_class(file).name == name
    for name, file in MOVED.items():
        assert FOLDER_LAWS[name] == f"{ROOT}/{file}"
        assert name not in CONTROLLERS


@pytest.mark.parametrize("name", ["gradual", "careful"])
def test_the_guide_shows_the_files_as_they_are(name: str) -> None:
    guide = (ROOT / "docs" / "own-controller.md").read_text(encoding="utf-8")
    file = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    assert file.partition("\n\n")[2] in guide


def test_kept_runs_of_laws_that_moved_are_shown_and_not_repeated() -> None:
    study = Study.load(ROOT / "comparisons" / "laws.parquet")
    assert moved_laws(study) == MOVED
    runs = study.runs["controller"].value_counts()
    assert all(runs[name] > 0 for name in MOVED)
    lines = drawn_lines(study, 0.05, seed=1)
    assert lines
    assert not {line["controller"] for line in lines} & {*MOVED}
