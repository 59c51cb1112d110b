"""Laws named by file and class: where files are searched for, and the folder controllers."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from folder_laws import FOLDER, FOLDER_LAWS
from vsconstraints.bench.evidence.own_files import own_folders
from vsconstraints.bench.repetition import drawn_lines, moved_laws
from vsconstraints.bench.study import Study
from vsconstraints.cli import app
from vsconstraints.comparisons import Suite, compare
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.controllers import CONTROLLERS, FORMER_LAWS, controller_class, make_controller
from vsconstraints.errors import ConfigurationError

ROOT = FOLDER.parent
#: A law that imports modules beside it as late as when it is made, and in its first sample.
LATE = """
from vsconstraints.controllers import Controller, PredictiveControl

class Late(Controller):
    name = "late"

    def __init__(self):
        import neighbour_of_made

    def solve(self, rows, task):
        from neighbour_of_late import TRACKING
        return TRACKING.solve(rows, task)

class Nameless(Controller):
    def solve(self, rows, task): ...

class Inherited(PredictiveControl): ...
"""
NEIGHBOUR = "from vsconstraints.controllers import Tracking\nTRACKING = Tracking()\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the law in ``laws/late.py`` and a suite in ``suites/suite.toml``."""
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "late.py").write_text(LATE, encoding="utf-8")
    (tmp_path / "laws" / "neighbour_of_late.py").write_text(NEIGHBOUR, encoding="utf-8")
    (tmp_path / "laws" / "neighbour_of_made.py").touch()
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
        *((name, re.escape(f"it is {file}")) for name, file in FORMER_LAWS.items()),
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


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ("Nameless", "has no name: write name"),
        ("Inherited", "has the name of a law of the package, 'predictive'"),
    ],
)
def test_a_class_without_a_name_of_its_own_is_refused(law: str, words: str, folder: Path) -> None:
    """Results would show it as another law."""
    file = f"{folder}/laws/late.py:{law}"
    with pytest.raises(ConfigurationError, match=words):
        ControllerSpec.called(file)
    assert ControllerSpec.called("vsconstraints.controllers:SlidingMode").name == "sliding-mode"


def test_a_link_to_a_file_has_the_neighbours_of_the_file(folder: Path) -> None:
    link = folder / "suites" / "link.py"
    link.symlink_to(folder / "laws" / "late.py")
    law = ControllerSpec.called(f"{link}:Late")
    assert law.folder_of_neighbours == folder / "laws"
    law.make()


def test_a_run_on_an_arm_has_a_folder_named_after_the_law(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    command = ["run", "ur5-fov", "--controller", "laws/late.py:Late", "--no-figures"]
    done = CliRunner().invoke(app, [*command, "--set", "scenario.duration=0.02"])
    assert done.exit_code == 0, done.output
    (made,) = (folder / "vsconstraints-runs").iterdir()
    assert re.fullmatch(r"ur5-fov--late--\d{8}-\d{6}", made.name)


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
    for name, file in FORMER_LAWS.items():
        assert FOLDER_LAWS[name] == f"{ROOT}/{file}"
        assert name not in CONTROLLERS


@pytest.mark.parametrize("name", ["gradual", "careful"])
def test_the_guide_shows_the_files_as_they_are(name: str) -> None:
    guide = (ROOT / "docs" / "own-controller.md").read_text(encoding="utf-8")
    file = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    assert file.partition("\n\n")[2] in guide


def test_kept_runs_of_laws_that_moved_are_shown_and_not_repeated() -> None:
    study = Study.load(ROOT / "comparisons" / "laws.parquet")
    assert moved_laws(study) == FORMER_LAWS
    runs = study.runs["controller"].value_counts()
    assert all(runs[name] > 0 for name in FORMER_LAWS)
    lines = drawn_lines(study, 0.05, seed=1)
    assert lines
    assert not {line["controller"] for line in lines} & {*FORMER_LAWS}
