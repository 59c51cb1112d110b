"""Test sets: frozen scenes are those that were drawn, whoever changed one is told, and campaigns
run on them.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import shutil
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from vsconstraints.bench.evidence import Campaign, Evidence
from vsconstraints.bench.families import SHIPPED, Drawn, Family, families
from vsconstraints.bench.families.drawing import Streams
from vsconstraints.bench.families.frozen import V1, TestSet
from vsconstraints.cli import app
from vsconstraints.controllers import SlidingMode
from vsconstraints.errors import ConfigurationError
from vsconstraints.simulation import simulate

V1_INDEX = "8cf2a521309f8da11afe91a6d3ba585dae6f1919221340ec1f32f70a223ccbe7"
FILE = "planar-arm.held-out.jsonl.gz"


def quiet(*_: object) -> None: ...


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> TestSet:
    """One held-out scene of each shipped family, drawn on this machine."""
    loaded = [Family.load(name) for name in families()]
    return TestSet.make(tmp_path_factory.mktemp("every"), loaded, "t", {"held-out": 1}, 3, quiet)


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> TestSet:
    counts = {"training": 1, "held-out": 3}
    return TestSet.make(
        tmp_path_factory.mktemp("three"), [Family.load("planar-arm")], "t", counts, 0, quiet
    )


@pytest.fixture
def copy(three: TestSet, tmp_path: Path) -> Path:
    return Path(shutil.copytree(three.folder, tmp_path / "copy"))


def lines(folder: Path) -> list[str]:
    return gzip.decompress((folder / FILE).read_bytes()).decode().splitlines()


def write(folder: Path, changed: list[str], index: bool = False) -> None:
    """Write lines instead of those that are there, and their hashes too if somebody makes a set of
    them by hand.
    """
    (folder / FILE).write_bytes(gzip.compress("".join(f"{line}\n" for line in changed).encode()))
    if index:
        said = json.loads((folder / "testset.json").read_text())
        said["families"]["planar-arm"]["sha256"]["held-out"] = [
            hashlib.sha256(s.encode()).hexdigest() for s in changed
        ]
        (folder / "testset.json").write_text(json.dumps(said))


def say(*words: str) -> Result:
    return CliRunner().invoke(app, ["testset", *words])


def told(scene: Drawn) -> str:
    return repr({**vars(scene), "tables": json.dumps(scene.tables), "folder": ""})


# what is frozen is what was drawn


@pytest.mark.parametrize("name", families())
def test_a_frozen_scene_is_the_drawn_one_bit_by_bit(name: str, every: TestSet) -> None:
    frozen = next(family for family in every.families if family.name == name)
    read, setups = frozen.set_up(0, seed=3)
    drawn, others = frozen.source.set_up(0, seed=3)
    assert told(read) == told(drawn)
    assert tuple(setups) == frozen.conditions == frozen.source.conditions
    for condition in (frozen.conditions[0], frozen.conditions[-1]):
        ours, theirs = (simulate(each[condition], SlidingMode()) for each in (setups, others))
        assert ours.status == theirs.status
        for array in ("q", "qdd_command", "sigma"):
            assert np.array_equal(getattr(ours, array), getattr(theirs, array), equal_nan=True)


def test_the_shipped_set_is_whole() -> None:
    shipped = TestSet.load()
    assert (shipped.version, shipped.sha256) == ("v1", V1_INDEX)
    assert not list(shipped.problems())
    assert {family.name for family in shipped.families} == {*families()}
    assert sum(len(kept) for file, kept in shipped.hashes.items() if "held-out" in file) >= 2000
    assert sum(path.stat().st_size for path in V1.iterdir()) < 3e6


def test_families_of_a_test_set_do_not_draw_the_same_numbers(every: TestSet) -> None:
    scenes = {family.name: family.scene(0, seed=3) for family in every.families}
    # without the name in the seed, whoever takes as many attempts as another family has the same
    # noise
    assert len({scene.noise for scene in scenes.values()}) == len(scenes)
    for first, second in combinations(scenes.values(), 2):
        shared = first.values.keys() & second.values.keys() - {"q0"}
        assert not any(
            first.values[key] == second.values[key] != 1.0
            for key in shared
            if isinstance(first.values[key], float)
        )


def test_families_outside_of_test_sets_draw_what_they_always_did() -> None:
    always = int.from_bytes(hashlib.sha256(b"7 held-out 4 2 task.Kp0").digest()[:16], "big")
    assert Streams(7, "held-out", 4, 2).entropy("task.Kp0") == always
    assert Streams(7, "held-out", 4, 2, "t/ur5 ").entropy("task.Kp0") != always


def test_scenes_that_test_the_tracker_are_left_out(tmp_path: Path) -> None:
    extended = SHIPPED / "planar-arm.toml"
    (tmp_path / "short.toml").write_text(f'extends = "{extended}"\nduration = 0.5\nattempts = 20\n')
    family = Family.load(tmp_path / "short.toml")
    assert family.scene(0).found
    with pytest.raises(ConfigurationError, match="unconstrained baseline does not converge"):
        TestSet.make(tmp_path / "set", [family], "t", {"held-out": 1}, 0, quiet)


# changes are told


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda all_: [all_[0], all_[1].replace('"focal_px":[5', '"focal_px":[6', 1), all_[2]],
            "scene 1 was changed",
        ),
        (lambda all_: all_[:2], "scene 2 is missing"),
        (lambda all_: [*all_, all_[0]], "scene 3 is not in the index"),
        (lambda all_: [all_[1], all_[0], all_[2]], "scene 0 was changed"),
    ],
)
def test_what_is_not_as_it_was_made_is_named(
    change: Callable[..., list[str]], words: str, copy: Path
) -> None:
    assert say("verify", str(copy)).exit_code == 0
    before = lines(copy)
    assert change(before) != before
    write(copy, change(before))
    checked = say("verify", str(copy))
    assert checked.exit_code == 1
    assert f"{FILE}: {words}" in checked.output
    with pytest.raises(ConfigurationError, match=r"was changed: .* names the scenes"):
        TestSet.load(copy).families[0].scene(0)


def _with(line: str, **changes: Any) -> str:
    return json.dumps({**json.loads(line), **changes})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda line: _with(line, duration=float("nan")), "invalid character"),
        (
            lambda line: line.replace('"disturbed"', '"disturbd"', 1),
            "number 1 with conditions nominal, disturbd, limited; they are nominal, disturbed, "
            "limited",
        ),
        (lambda line: _with(line, number=2), "states number 2"),
        (lambda line: _with(line, noise="many"), "Expected `int`, got `str`"),
        (lambda line: _with(line, nose=1), "unknown field `nose`"),
        (lambda line: line[: len(line) // 2], "truncated"),
    ],
)
def test_lines_that_are_no_scenes_are_refused_even_with_their_hashes(
    change: Callable[[str], str], words: str, copy: Path
) -> None:
    all_ = lines(copy)
    write(copy, [all_[0], change(all_[1]), all_[2]], index=True)
    by_hand = TestSet.load(copy)
    (problem,) = by_hand.problems()
    assert problem.startswith(f"{FILE}: scene 1")
    assert words in problem
    with pytest.raises(ConfigurationError, match="scene 1"):
        by_hand.families[0].scene(1)
    assert by_hand.families[0].scene(0).found


def test_files_that_are_cut_off_added_or_gone_are_named(copy: Path) -> None:
    whole = (copy / FILE).read_bytes()
    (copy / FILE).write_bytes(whole[:-20])
    (copy / "planar-arm.secret.jsonl.gz").write_bytes(whole)
    (copy / "planar-arm.training.jsonl.gz").unlink()
    text = say("verify", str(copy)).output
    assert f"{FILE} of a test set cannot be read: Compressed file ended" in text
    assert "planar-arm.secret.jsonl.gz is not a file of the test set" in text
    assert "planar-arm.training.jsonl.gz of a test set cannot be read" in text
    (copy / "testset.json").write_text("{")
    with pytest.raises(ConfigurationError, match=r"testset.json cannot be read"):
        TestSet.load(copy)
    with pytest.raises(ConfigurationError, match="there is no test set in"):
        TestSet.load(copy / "nowhere")


def test_scenes_that_are_drawn_otherwise_are_found(copy: Path) -> None:
    assert not list(TestSet.load(copy).problems(redraw=1.0))
    all_ = lines(copy)
    write(
        copy, [all_[0], all_[1].replace('"focal_px":[5', '"focal_px":[6', 1), all_[2]], index=True
    )
    assert list(TestSet.load(copy).problems(redraw=1.0)) == [
        f"{FILE}: scene 1 differs when it is drawn here"
    ]
    assert say("verify", str(copy), "--redraw", "1").exit_code == 1


# campaigns


@pytest.mark.slow
def test_laws_are_run_on_frozen_and_on_secret_scenes(
    three: TestSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    law = (
        "from vsconstraints.controllers import SlidingMode\nclass Mine(SlidingMode):\n    name "
        "= 'mine'\n"
    )
    (tmp_path / "law_of_testset.py").write_text(law)
    few = ("--set", "conditions=['nominal']", "--scenes", "1", "--jobs", "1", "--no-figures")
    for out, more in (("frozen", ()), ("secret", ("--secret-seed", "5"))):
        done = say(
            "run", str(three.folder), "--entry", "law_of_testset:Mine", "--out", out, *few, *more
        )
        assert done.exit_code == 0, done.exception or done.output
    frozen, secret = (Evidence.load(tmp_path / out, trust=True) for out in ("frozen", "secret"))
    assert {"mine", "sliding-mode", "predictive", "tracking"} <= {*frozen.controllers}
    for evidence in (frozen, secret):
        own, reference = (
            evidence.runs[evidence.runs.controller == name] for name in ("mine", "sliding-mode")
        )
        assert own.settling_time_s.tolist() == reference.settling_time_s.tolist()
    assert told(frozen.drawn("planar-arm", 0)) == told(three.families[0].scene(0))
    assert told(secret.drawn("planar-arm", 0)) == told(three.families[0].source.scene(0, seed=5))
    assert secret.drawn("planar-arm", 0).values != frozen.drawn("planar-arm", 0).values


def test_laws_of_a_suite_are_run_on_its_scenes(
    three: TestSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[Campaign] = []
    monkeypatch.setattr(
        "vsconstraints.bench.commands.testset.run_campaign",
        lambda campaign, *_: ran.append(campaign),
    )
    suite = tmp_path / "two.toml"
    suite.write_text(
        'scenarios = ["example-2d-fov"]\n[controllers.calm]\ntype = '
        '"sliding-mode"\nswitching_gain = 0.5\n'
        '[controllers.saturation]\ntype = "law"\ndemand = "barrier"\nresolver = "saturation"\n'
    )
    assert say("run", str(three.folder), "--laws", str(suite)).exit_code == 0
    assert [entry.name for entry in ran[0].controllers] == ["tracking", "calm", "saturation"]
    assert [family.name for family in ran[0].families] == [family.name for family in three.families]


def test_velocity_laws_take_part_where_accelerations_are_limited(
    three: TestSet, tmp_path: Path
) -> None:
    """Their runs elsewhere fail, and the command names the scenes that suit them."""
    laws = tmp_path / "speeds.toml"
    laws.write_text('families = ["planar-arm"]\n[controllers.velocity-qp]\n')
    conditions = "conditions=['nominal', 'limited']"
    few = ("--scenes", "1", "--set", conditions, "--jobs", "1", "--no-figures")
    out = tmp_path / "results"
    done = say("run", str(three.folder), "--laws", str(laws), "--out", str(out), *few)
    assert done.exit_code == 0, done.exception or done.output
    runs = Evidence.load(out).runs
    status = runs[runs.controller == "velocity-qp"].set_index("condition").status
    assert status["nominal"] == "failed"
    assert status["limited"] in ("converged", "slow", "unfinished", "trapped")
    printed = " ".join(done.output.split())
    assert "velocity-qp" in printed
    assert "1 of 1 runs failed" in printed
    assert 'those of the condition "limited" have such limits' in printed


def test_results_of_another_version_are_not_mixed_in(three: TestSet, copy: Path) -> None:
    write(copy, lines(copy)[:2], index=True)
    ours, theirs = (
        Campaign.load().changed(families=each.families) for each in (three, TestSet.load(copy))
    )
    assert ours.identities() != theirs.identities()


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (("--family", "planer-arm"), "Did you mean 'planar-arm'"),
        (("--half", "secret"), "Available: held-out, training"),
        (("--scenes", "4"), "has 3 held-out scenes of each family; 4 are requested"),
        (("--secret-seed", "0"), "seed 0 is that of the test set"),
        (("--slower", "20"), "need --time-passes"),
    ],
)
def test_what_cannot_be_run_is_refused(
    words: tuple[str, ...], answer: str, three: TestSet, tmp_path: Path
) -> None:
    refused = say("run", str(three.folder), "--out", str(tmp_path / "out"), *words)
    assert isinstance(refused.exception, ConfigurationError)
    assert answer in str(refused.exception)
    with pytest.raises(
        ConfigurationError, match="has 3 scenes of seed 0, and no scene 3 of seed 1"
    ):
        three.families[0].scene(3, seed=1)


def test_a_test_set_is_made_once_and_of_scenes_alone(tmp_path: Path) -> None:
    made = say(
        "make",
        "--family",
        "planar-arm",
        "--scenes",
        "1",
        "--version",
        "t",
        "--out",
        str(tmp_path / "a"),
    )
    assert made.exit_code == 0, made.exception
    again = say("make", "--family", "planar-arm", "--scenes", "1", "--out", str(tmp_path / "a"))
    assert "never changed" in str(again.exception)
    (tmp_path / "arm.urdf").write_text("<robot/>")
    (tmp_path / "own.toml").write_text(
        'extends = "example-2d-fov"\nrobot = { urdf = "arm.urdf" }\n'
    )
    needs = say("make", "--family", str(tmp_path / "own.toml"), "--out", str(tmp_path / "b"))
    assert "needs files" in str(needs.exception)
    twice = ("--family", "planar-arm", "--family", "planar-arm", "--scenes", "1")
    assert "appears twice" in str(say("make", *twice, "--out", str(tmp_path / "c")).exception)
