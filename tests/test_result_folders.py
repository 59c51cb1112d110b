"""Whose a folder of results is: nothing in it is lost, and two processes never store in it at
once.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from vsconstraints.comparisons import StoredComparison, Suite, compare
from vsconstraints.comparisons.metrics import result_columns
from vsconstraints.comparisons.runs.folder import LOCK, Kind, locked
from vsconstraints.comparisons.stored import require_nothing_lost
from vsconstraints.comparisons.tables import write_table
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports import write_report

ROOT = Path(__file__).parent.parent
MAIN = [sys.executable, "-W", "error", "-c", "from vsconstraints.cli import main; main()"]

SHORT = ("scenario.duration=0.05", "scenario.start_deviation=0.001")


def suite(*settings: str, controllers: tuple[str, ...] = ("sliding-mode",)) -> Suite:
    return Suite.load().select(["example-2d-fov"], controllers, settings=[*SHORT, *settings])


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A folder of somebody's own, in which everything is called as a comparison calls its files."""
    (tmp_path / "figures").mkdir()
    for name in ("results.csv", "report.md", "figures/example-2d-fov--phi.png"):
        (tmp_path / name).write_text("mine")
    (tmp_path / "manifest.json").write_text('{"name": "an app"}')
    return tmp_path


@pytest.mark.parametrize("out", ["", "."])
def test_a_folder_with_something_else_is_refused_untouched(
    out: str, foreign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents(foreign)
    monkeypatch.chdir(foreign)
    with pytest.raises(ConfigurationError, match="is not empty and holds no comparison"):
        compare(suite(), Path(out), workers=1)
    done = subprocess.run(
        [*MAIN, "compare", "--out", out], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert str(foreign) in done.stderr
    assert "Traceback" not in done.stderr
    with pytest.raises(ConfigurationError):
        write_report(Path(out))
    assert contents(foreign) == before


def test_an_empty_folder_and_one_of_a_comparison_are_taken(tmp_path: Path) -> None:
    with locked(tmp_path, "a comparison"), locked(tmp_path, "a comparison"):
        assert (tmp_path / LOCK).is_file()
    # whatever else is damaged
    (tmp_path / "manifest.json").write_bytes(b"")
    with locked(tmp_path, "a comparison"):
        pass
    (tmp_path / LOCK).unlink()
    (tmp_path / "manifest.json").write_text('{"configuration": {}}')
    with locked(tmp_path, "a comparison"):
        pass


MANIFESTS: dict[Kind, str] = {
    "a comparison": '{"configuration": {"scenarios": {}}}',
    "evidence": '{"configuration": {"families": {}}}',
    "a tuning": '{"tuning": {}, "campaign": {}}',
}


@pytest.mark.parametrize("mine", MANIFESTS)
@pytest.mark.parametrize("theirs", MANIFESTS)
def test_results_of_another_kind_are_never_taken(mine: Kind, theirs: Kind, tmp_path: Path) -> None:
    with locked(tmp_path, theirs):
        (tmp_path / "manifest.json").write_text(MANIFESTS[theirs])
    if mine == theirs:
        with locked(tmp_path, mine):
            pass
    else:
        with (
            pytest.raises(ConfigurationError, match=f"holds {theirs}, not {mine}"),
            locked(tmp_path, mine),
        ):
            pass
    assert (tmp_path / "manifest.json").read_text() == MANIFESTS[theirs]


def test_not_even_by_a_fresh_comparison(tmp_path: Path) -> None:
    for manifest in (MANIFESTS["evidence"], MANIFESTS["a tuning"]):
        (tmp_path / "manifest.json").write_text(manifest)
        with pytest.raises(ConfigurationError, match="not a comparison"):
            compare(suite(), tmp_path, workers=1, fresh=True)
        assert (tmp_path / "manifest.json").read_text() == manifest


def kept(folder: Path, *suites: Suite) -> Path:
    """A folder with the tables of a comparison whose runs all finished."""
    (one,) = suites
    folder.mkdir(exist_ok=True)
    (folder / "manifest.json").write_text(
        json.dumps({"configuration": one.with_baseline().resolved()})
    )
    lines = [
        dict(
            dict.fromkeys(result_columns(), 1.0),
            scenario=scenario,
            controller=controller,
            trial=trial,
        )
        for scenario, controller, trial in (job.key for job in one.with_baseline().runs())
    ]
    write_table(folder / "results.csv", result_columns(), lines)
    return folder


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (
            suite("scenario.sampling_time=0.004"),
            "example-2d-fov with tracking, trial 0, has other settings",
        ),
        (
            suite("sliding-mode.rank_tolerance=1e-7"),
            "example-2d-fov with sliding-mode, trial 0, has other settings",
        ),
        (suite("seed=7"), "has other settings"),
        (
            suite(controllers=("potential-field",)),
            "example-2d-fov with sliding-mode, trial 0, is not part",
        ),
        (
            Suite.load().select(["ur5-fov"], ["sliding-mode"]),
            "example-2d-fov with tracking, trial 0, is not part",
        ),
    ],
    ids=["setting", "option", "seed", "controllers", "scenarios"],
)
def test_another_comparison_in_the_same_folder_is_refused(
    other: Suite, why: str, tmp_path: Path
) -> None:
    before = contents(kept(tmp_path, suite()))
    with pytest.raises(ConfigurationError, match=why) as caught:
        compare(other, tmp_path, workers=1)
    assert "--out" in str(caught.value)
    assert "--fresh" in str(caught.value)
    assert {name: text for name, text in contents(tmp_path).items() if name != LOCK} == before


@pytest.mark.parametrize(
    "other",
    [
        suite(),
        suite("trials=3"),
        suite("scenario.title=New"),
        suite(controllers=("sliding-mode", "potential-field")),
    ],
    ids=["same", "more trials", "title", "more controllers"],
)
def test_what_loses_nothing_goes_on(other: Suite, tmp_path: Path) -> None:
    require_nothing_lost(kept(tmp_path, suite()), other.with_baseline())


def test_fewer_trials_are_another_comparison(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="trial 1, is not part"):
        require_nothing_lost(kept(tmp_path, suite("trials=2")), suite().with_baseline())


def test_fresh_replaces_another_comparison(tmp_path: Path) -> None:
    compare(suite(controllers=("potential-field",)), tmp_path, workers=1)
    compare(suite(), tmp_path, workers=1, fresh=True)
    assert [line["controller"] for line in StoredComparison.load(tmp_path).results] == [
        "tracking",
        "sliding-mode",
    ]


HOLD = """
import sys, time
from pathlib import Path
from vsconstraints.comparisons.runs.folder import locked
with locked(Path(sys.argv[1]), "a comparison"):
    print("held", flush=True)
    time.sleep(300)
"""


@pytest.fixture
def holder(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that stores a comparison in ``tmp_path``."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_a_second_comparison_is_refused_with_the_process_that_holds_the_folder(
    holder: subprocess.Popen[str], tmp_path: Path
) -> None:
    for _ in range(2):
        with pytest.raises(ConfigurationError, match=f"process {holder.pid} is storing results in"):
            compare(suite(), tmp_path, workers=1)
    done = subprocess.run(
        [*MAIN, "compare", "--out", str(tmp_path)], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert f"process {holder.pid} is storing" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [LOCK]


def test_a_lock_ends_with_its_process(holder: subprocess.Popen[str], tmp_path: Path) -> None:
    os.kill(holder.pid, signal.SIGKILL)
    holder.wait()
    with locked(tmp_path, "a comparison"):
        assert (tmp_path / LOCK).read_text() == f"{os.getpid()}\n"


STUB = """#!/bin/sh
name=$(basename "$0")
case "$name $*" in
  "python3 -m venv "*)
    mkdir -p "$3/bin" && touch "$3/bin/activate"
    for tool in ruff pip; do ln -s "$0" "$3/bin/$tool"; done ;;
  "vsconstraints compare"*) mkdir -p vsconstraints-results && echo new > vsconstraints-results/report.md ;;
  "vsconstraints reproduce"*) mkdir -p vsconstraints-paper && echo new > vsconstraints-paper/report.md ;;
esac
echo "$name $*" >> "$CALLS"
"""


def test_the_gate_leaves_a_developers_results_alone(tmp_path: Path) -> None:
    """With stand-ins for everything that it calls: where they would write is what matters here."""
    checkout = tmp_path / "checkout"
    stubs = tmp_path / "bin"
    stubs.mkdir()
    for name in (
        "python3",
        "python",
        "pip",
        "vsconstraints",
        "pytest",
        "chromium",
        "sphinx-build",
        "ruff",
        "mypy",
    ):
        (stubs / name).write_text(STUB)
        (stubs / name).chmod(0o755)
    for name in (".ci/run", "README.md", "CONTRIBUTING.md", ".gitignore"):
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, checkout / name)
    for name in (
        "reports/paper/claims.csv",
        "reports/paper/report.md",
        "vsconstraints-results/report.md",
    ):
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / name).write_text("mine")
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(checkout)]
    for arguments in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "all"]):
        subprocess.run(
            [*git, *arguments], check=True, env={**os.environ, "GIT_CONFIG_GLOBAL": "/dev/null"}
        )
    environment = {**os.environ, "PATH": f"{stubs}:/usr/bin:/bin", "CALLS": str(tmp_path / "calls")}
    environment["FULL"] = "yes"
    done = subprocess.run(
        ["bash", str(checkout / ".ci/run")],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    calls = (tmp_path / "calls").read_text()
    for name in (
        "vsconstraints compare",
        "vsconstraints reproduce",
        "pytest",
        "ruff check",
        "mypy",
    ):
        assert name in calls
    for name in ("reports/paper/report.md", "vsconstraints-results/report.md"):
        assert (checkout / name).read_text() == "mine"
