"""Variants of scenarios in a suite: named, changed, told apart, and refused where they are
wrong.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vsconstraints.comparisons import RunSpec, Suite
from vsconstraints.errors import ConfigurationError, InvalidInput

CONTROLLERS = "\n[controllers.sliding-mode]\n"


def load(folder: Path, *entries: str) -> Suite:
    """A suite with these entries of ``scenarios``."""
    path = folder / "suite.toml"
    path.write_text(f"scenarios = [{', '.join(entries)}]\n{CONTROLLERS}", encoding="utf-8")
    return Suite.load(path)


def test_a_variant_is_the_scenario_with_other_values(tmp_path: Path) -> None:
    suite = load(
        tmp_path,
        '"example-2d-fov"',
        '{ scenario = "example-2d-fov", name = "slow", title = "Slow", set = { "task.Kp0" = 5.0, '
        "duration = 4.0 } }",
    )
    base, slow = suite.scenarios
    assert (slow.name, slow.title, slow.shipped) == ("slow", "Slow", True)
    assert slow.setup().task.gains.Kp0 == 5.0
    assert slow.setup().duration == 4.0
    assert base.setup().task.gains.Kp0 == 20.0, "the scenario itself is not changed"
    changed = {"title": "Slow", "task": {**base.tables["task"], "Kp0": 5.0}, "duration": 4.0}
    assert slow.tables == {**base.tables, **changed}


def test_each_makes_a_variant_of_every_combination(tmp_path: Path) -> None:
    suite = load(
        tmp_path,
        '{ scenario = "example-2d-fov", name = "fov", title = "FOV", set = { duration = 1.0 }, '
        'each = { "task.Kp0" = [10, 20], "constraints.0.n" = [2, 4] } }',
    )
    assert [scenario.name for scenario in suite.scenarios] == [
        "fov-10-2",
        "fov-10-4",
        "fov-20-2",
        "fov-20-4",
    ]
    assert suite.scenarios[1].title == "FOV, 10, 4"
    for scenario, Kp, n in zip(suite.scenarios, (10, 10, 20, 20), (2, 4, 2, 4), strict=True):
        assert scenario.tables["task"]["Kp0"] == Kp
        assert scenario.tables["constraints"][0]["n"] == n
        assert scenario.tables["duration"] == 1.0


def test_a_suite_is_named_as_text_too() -> None:
    path = Path(__file__).parents[1] / "comparisons" / "laws.toml"
    assert Suite.load(str(path)) == Suite.load(path)


def test_a_variant_of_a_file_finds_what_the_file_names(tmp_path: Path) -> None:
    example = (Path(__file__).parent.parent / "examples" / "my-arm.toml").resolve()
    suite = load(
        tmp_path,
        f'{{ scenario = "{example.as_posix()}", name = "short", set = {{ duration = 1.0 }} }}',
    )
    (variant,) = suite.scenarios
    assert variant.folder == example.parent
    assert not variant.shipped
    assert variant.files[0].name == "six_axis.urdf"
    assert variant.title == "short"


def test_overrides_are_in_the_configuration_and_the_fingerprint(tmp_path: Path) -> None:
    entry = '{{ scenario = "example-2d-fov", name = "fov", set = {{ "task.Kp0" = {} }} }}'
    one, other = (load(tmp_path, entry.format(Kp)) for Kp in (5.0, 6.0))
    assert one.resolved()["scenarios"]["fov"]["tables"]["task"]["Kp0"] == 5.0
    fingerprints = {
        RunSpec(suite.scenarios[0], suite.controllers[0]).fingerprint for suite in (one, other)
    }
    assert len(fingerprints) == 2


def test_the_command_line_selects_and_changes_variants(tmp_path: Path) -> None:
    suite = load(tmp_path, '"example-2d-fov"', '{ scenario = "example-2d-fov", name = "slow" }')
    chosen = suite.select(["slow"], settings=["slow.duration=2.0"])
    assert [scenario.name for scenario in chosen.scenarios] == ["slow"]
    assert chosen.scenarios[0].setup().duration == 2.0


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("3", ["scenarios[0]", "3"]),
        ("{ name = 'a' }", ["scenarios[0]", "'scenario' is missing"]),
        ("{ scenario = 'example-2d-fov' }", ["scenarios[0]", "'name' is missing"]),
        ("{ scenario = 'example-3d', name = 'a' }", ["example-3d", "example-2d-fov"]),
        ("{ scenario = 'example-2d-fov', name = 'a', sets = {} }", ["sets", "each"]),
        ("{ scenario = 'example-2d-fov', name = 'a', set = 1 }", ["set must be a table"]),
        (
            "{ scenario = 'example-2d-fov', name = 'a', each = { duration = 2.0 } }",
            ["each", "duration", "list"],
        ),
        (
            "{ scenario = 'example-2d-fov', name = 'a', each = { duration = [] } }",
            ["each", "duration", "list"],
        ),
        (
            "{ scenario = 'example-2d-fov', name = 'a', set = { 'tasks.Kp0' = 1 } }",
            ["tasks", "in a"],
        ),
        ("{ scenario = 'example-2d-fov', name = 'a', set = { 'task.Kp' = 1 } }", ["a.task", "Kp"]),
        ("{ scenario = 'example-2d-fov', name = 'a', set = { 'task.Kp0' = -1 } }", ["Kp0"]),
        (
            "{ scenario = 'example-2d-fov', name = 'a', set = { 'constraints.7.K' = 1 } }",
            ["7", "in a"],
        ),
        ("{ scenario = 'example-2d-fov', name = 'a/b' }", ["a/b", "file names"]),
        (
            "{ scenario = 'example-2d-fov', name = 'a', each = { duration = [1.0, 1.0] } }",
            ["a-1.0", "more than once"],
        ),
        ("{ scenario = 'example-2d-fov', name = 'a', each = { title = ['so/so'] } }", ["a-so/so"]),
    ],
)
def test_wrong_entries_are_refused_by_name(tmp_path: Path, entry: str, words: list[str]) -> None:
    with pytest.raises((ConfigurationError, InvalidInput)) as error:
        load(tmp_path, entry)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"trials": 10**9},
            r"1 scenarios × 1 controllers × 1000000000 trials are 1e\+09 runs; .* may have 100000",
        ),
        (
            {"entry": "each = { duration = [%s], 'task.Kp0' = [%s] }"},
            r"scenarios\[0\].each makes 6e\+07 variants.* 10000",
        ),
        ({"entry": "set = { x = %s }"}, "suite.toml.*limit"),
    ],
)
def test_sizes_have_bounds(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    sizes = (", ".join(map(str, range(1, 10_001))), ", ".join(map(str, range(1, 6_001))))
    entry = str(changes.get("entry", "set = {}"))
    entry = entry % (sizes if entry.startswith("each") else "9" * 5000) if "%" in entry else entry
    path = tmp_path / "suite.toml"
    path.write_text(
        f"trials = {changes.get('trials', 1)}\n"
        f'scenarios = [{{ scenario = "example-2d-fov", name = "a", {entry} }}]\n{CONTROLLERS}'
    )
    with pytest.raises(ConfigurationError, match=words):
        Suite.load(path)


def test_settings_have_bounds() -> None:
    suite = Suite.load().select(["example-2d-fov"], ["sliding-mode"])
    for setting, words in (
        ("trials=1000000000", "1e.09 runs"),
        ("trials=" + "9" * 5000, "--set: .*limit"),
        ("scenario.q0=" + "[" * 100 + "]" * 100, "--set: .* levels"),
        ("scenario.duration=1e9", "samples"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            suite.select(settings=[setting])


def test_a_set_of_a_suite_finds_files_beside_the_suite(tmp_path: Path) -> None:
    example = (Path(__file__).parent.parent / "examples" / "my-arm.toml").resolve()
    (tmp_path / "arm.urdf").write_bytes((example.parent / "six_axis.urdf").read_bytes())
    entry = (
        f'{{ scenario = "{example.as_posix()}", name = "own", set = {{ "robot.urdf" = '
        f'"arm.urdf" }} }}'
    )
    (variant,) = load(tmp_path, entry).scenarios
    assert variant.files[0] == tmp_path / "arm.urdf"


def test_a_relative_file_in_a_setting_is_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "arm.urdf").write_bytes(
        (Path(__file__).parent.parent / "examples" / "six_axis.urdf").read_bytes()
    )
    monkeypatch.chdir(tmp_path)
    suite = Suite.load().select(["ur5-fov"], ["sliding-mode"])
    with pytest.raises(
        ConfigurationError,
        match=r"starts outside|outside the image|in front of|hides markers|tool0",
    ) as error:
        suite.select(settings=['ur5-fov.robot={urdf = "arm.urdf", tip = "tool"}'])
    assert "no URDF file" not in str(error.value)
    with pytest.raises(ConfigurationError, match=f"no URDF file at '{tmp_path}/nowhere.urdf'"):
        suite.select(settings=['ur5-fov.robot={urdf = "nowhere.urdf"}'])


@pytest.mark.parametrize("name", ["mein Arm", "Ärmchen", "腕", "a.b c"])
def test_names_may_have_spaces_and_letters_of_any_language(tmp_path: Path, name: str) -> None:
    (variant,) = load(tmp_path, f'{{ scenario = "example-2d-fov", name = "{name}" }}').scenarios
    assert variant.name == name


@pytest.mark.parametrize("name", ["a ", " a", ".a", "a--b", "a\tb", "x" * 101, "ä" * 51])
def test_names_that_files_cannot_have_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigurationError, match="used in file names"):
        load(tmp_path, f"{{ scenario = 'example-2d-fov', name = {json.dumps(name)} }}")


def test_a_selection_is_called_one() -> None:
    """The title of a suite speaks of all that is in it."""
    suite = Suite.load()
    assert suite.select(seed=3, settings=["scenario.duration=1.0"]).title == suite.title
    assert suite.select([one.name for one in suite.scenarios]).title == suite.title
    assert suite.select(["ur5-fov"]).title == f"{suite.title}: a selection"
    assert suite.select(controllers=["sliding-mode"]).title == f"{suite.title}: a selection"


def test_a_folder_of_results_is_no_suite(tmp_path: Path) -> None:
    (tmp_path / "results.csv").touch()
    with pytest.raises(
        ConfigurationError, match=r"is a folder of results, not a suite: vsconstraints report"
    ):
        Suite.load(tmp_path)
