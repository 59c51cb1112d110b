"""Suites, the runner, stored results and scores."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from vsconstraints.comparisons import (
    ControllerSpec,
    RunRecord,
    StoredComparison,
    Suite,
    compare,
    score,
)
from vsconstraints.comparisons.metrics import constraint_columns, result_columns, timing_columns
from vsconstraints.comparisons.record import ARRAYS, FACTS, run_file, stored_run
from vsconstraints.comparisons.runs.files import read_arrays, write_arrays
from vsconstraints.comparisons.tables import read_table
from vsconstraints.errors import ConfigurationError, InvalidInput, VsconstraintsError
from vsconstraints.scenarios import Scenario

# The columns that DESIGN promises to other people's scripts: changing them breaks those scripts.
PROMISED_RESULTS = [
    "suite",
    "scenario",
    "controller",
    "trial",
    "status",
    "reason",
    "duration_s",
    "settling_time_s",
    "final_translation_error_m",
    "final_rotation_error_rad",
    "final_feature_error_px",
    "utilization",
    "violated",
    "violation_depth",
    "violation_time_s",
    "phi_band",
    "phi_band_bound",
    "switching_rate_hz",
    "acceleration_variation",
    "jerk_rms",
    "step_time_median_us",
    "step_time_p99_us",
    "step_time_max_us",
    "rows_time_median_us",
    "missed_periods",
    "compiled",
    "within_band",
    "sliding_lost_s",
    "held_time_s",
    "saturated_time_s",
    "violation_fraction",
    "violated_tolerant",
    "acceleration_max",
]
PROMISED_CONSTRAINTS = [
    "suite",
    "scenario",
    "controller",
    "trial",
    "constraint",
    "kind",
    "unit",
    "challenged",
    "active_time_s",
    "first_active_s",
    "last_active_s",
    "clearance_min",
    "usage_max",
    "mean_unused_margin",
    "violation_depth",
    "violation_time_s",
    "phi_max",
    "longest_positive_run_s",
    "sampling_band",
    "band_depth",
    "held_time_s",
    "usage_held",
    "share_to_hold",
    "utilization",
]
PROMISED_ARRAYS = {
    "t", "q", "qd", "qdd_command", "error", "features_px", "labels", "phi", "sigma", "clearance", "active"
}  # fmt: skip

BROKEN = """
import os
import numpy as np
from vsconstraints.controllers import Controller
from vsconstraints.rows import Command

class Raises(Controller):
    name = "raises"
    def solve(self, rows, task):
        raise RuntimeError("on purpose")

class Dies(Controller):
    name = "dies"
    def solve(self, rows, task):
        os._exit(3)

class NotANumber(Controller):
    name = "nan"
    def solve(self, rows, task):
        return Command(np.full(task.J.shape[1], np.nan), "ok", rows.phi > 0, rows.labels)
"""


def small_suite(**changes: object) -> Suite:
    """The first example for 3.5 s: long enough for tracking to leave the image."""
    suite = Suite.load().select(
        ["example-2d-fov"], ["sliding-mode", "hierarchical-qp"], settings=["scenario.duration=3.5"]
    )
    return replace(suite, **changes)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> StoredComparison:
    folder = tmp_path_factory.mktemp("small")
    compare(small_suite(), folder, workers=1, command=["vsconstraints", "compare"])
    return StoredComparison.load(folder)


def test_columns_and_files_are_those_promised(stored: StoredComparison) -> None:
    assert list(result_columns()) == PROMISED_RESULTS
    assert list(constraint_columns()) == PROMISED_CONSTRAINTS
    header = (stored.folder / "results.csv").read_text().splitlines()[0]
    assert header == ",".join(PROMISED_RESULTS)
    with np.load(stored.folder / "trajectories" / "example-2d-fov--sliding-mode--0.npz") as arrays:
        assert set(arrays.files) >= PROMISED_ARRAYS
        assert arrays["features_px"].shape == (701, 2, 2)
        assert arrays["active"].shape == (701, len(arrays["labels"]))
    for key in ("version", "git_commit", "command", "seed", "configuration", "machine", "packages"):
        assert key in stored.manifest
    assert (
        stored.manifest["loaded"].items()
        >= {name: version(name) for name in ("numpy", "pin", "numba")}.items()
    )
    assert not list(stored.folder.rglob("*.part"))


def test_results_have_one_line_per_run_with_tracking_first(stored: StoredComparison) -> None:
    assert [line["controller"] for line in stored.results] == [
        "tracking",
        "sliding-mode",
        "hierarchical-qp",
    ]
    rows_per_run = 2  # two markers
    assert len(stored.constraints) == 3 * rows_per_run


def test_scores_agree_with_the_trajectories(stored: StoredComparison) -> None:
    """Each number is worked out again here, from the stored arrays and the definitions in words."""
    tracking = stored.run("example-2d-fov", "tracking").trajectory
    run = stored.run("example-2d-fov", "sliding-mode").trajectory
    line = next(line for line in stored.results if line["controller"] == "sliding-mode")
    marker = next(
        c
        for c in stored.constraints
        if c["controller"] == "sliding-mode" and c["constraint"] == "fov[marker 2]"
    )
    half = 256 * 0.95
    assert (tracking.clearance[:, 1] < 0).any()
    assert marker["challenged"]
    # on the side of the image the clearance is the distance to it
    closest = np.abs(run.features_px[:, 1]).max()
    assert marker["clearance_min"] == pytest.approx(half - closest, abs=0.05)
    assert marker["usage_max"] == pytest.approx(closest / half, abs=2e-4)
    # stopped before the goal is reached
    assert np.isnan(line["utilization"])
    assert 0.9 < marker["usage_held"] <= 1.0
    assert marker["utilization"] == pytest.approx(
        1.0 - marker["mean_unused_margin"] / half, rel=1e-6
    )
    assert marker["phi_max"] == pytest.approx(run.phi[:, 1].max())
    outside = np.minimum(tracking.clearance, tracking.between_clearance)[:, 1] < -1e-4 * half
    assert marker["mean_unused_margin"] == pytest.approx(
        np.maximum(run.clearance[outside, 1], 0).mean(), rel=1e-6
    )
    active = run.phi[:, 1] >= 0
    assert marker["active_time_s"] == pytest.approx(active.sum() * 0.005)
    assert marker["first_active_s"] == pytest.approx(run.t[active][0])
    changes = np.abs(np.diff(run.qdd_command, axis=0))
    assert line["acceleration_variation"] == pytest.approx(
        np.sqrt((changes**2).sum(1)).sum() / 3.5, rel=1e-6
    )
    assert line["phi_band_bound"] == pytest.approx(0.005 * 10.0)
    assert line["switching_rate_hz"] == pytest.approx(
        (np.diff(active.astype(int)) != 0).sum() / 3.5, rel=1e-6
    )


def test_tracking_alone_violates_what_it_challenges(stored: StoredComparison) -> None:
    line = stored.results[0]
    assert line["violated"] == "fov[marker 2]"
    row = next(
        c
        for c in stored.constraints
        if c["controller"] == "tracking" and c["constraint"] == "fov[marker 2]"
    )
    assert row["violation_depth"] > 5.0
    assert line["violation_depth"] == pytest.approx(row["violation_depth"] / (256 * 0.95), rel=1e-6)
    assert row["usage_max"] == pytest.approx(1.0 + line["violation_depth"], rel=1e-6)


def test_the_same_seed_gives_the_same_results(stored: StoredComparison, tmp_path: Path) -> None:
    compare(small_suite(), tmp_path, workers=2)
    again = StoredComparison.load(tmp_path)
    for ours, theirs in zip(stored.results, again.results, strict=True):
        for name in set(result_columns()) - set(timing_columns()):
            assert ours[name] == theirs[name] or (
                ours[name] != ours[name] and theirs[name] != theirs[name]
            ), name
    first, second = (
        np.load(folder / "trajectories" / "example-2d-fov--hierarchical-qp--0.npz")
        for folder in (stored.folder, tmp_path)
    )
    for name in PROMISED_ARRAYS:
        np.testing.assert_array_equal(first[name], second[name])


def test_a_stored_run_is_kept_and_a_changed_one_is_not(tmp_path: Path) -> None:
    suite = small_suite().select(settings=["scenario.duration=0.1"])
    assert compare(suite, tmp_path, workers=1).stored_before == 0
    assert compare(suite, tmp_path, workers=1).stored_before == 3
    assert compare(suite, tmp_path, workers=1, fresh=True).stored_before == 0
    more = replace(
        suite,
        controllers=(
            *suite.controllers,
            ControllerSpec("other", "sliding-mode", {"rank_tolerance": 1e-7}),
        ),
    )
    assert compare(more, tmp_path, workers=1).stored_before == 3
    elsewhere = suite.select(settings=["scenario.q0=[-0.72, -1.744, 1.075]"])
    assert [stored_run(job, tmp_path) for job in elsewhere.with_baseline().runs()] == [None] * 3
    # half a file, as a full disk leaves it
    file = run_file(tmp_path, "example-2d-fov", "tracking", 0)
    file.write_bytes(file.read_bytes()[:1000])
    assert compare(more, tmp_path, workers=1).stored_before == 3


def test_trials_deviate_alike_for_every_controller(tmp_path: Path) -> None:
    suite = small_suite(trials=3).select(
        settings=["scenario.duration=0.1", "scenario.start_deviation=0.01"]
    )
    compare(suite, tmp_path, workers=1)
    stored = StoredComparison.load(tmp_path)
    starts = {
        controller: np.array(
            [stored.run("example-2d-fov", controller, k).trajectory.q[0] for k in range(3)]
        )
        for controller in stored.controllers
    }
    np.testing.assert_array_equal(starts["tracking"], starts["sliding-mode"])
    np.testing.assert_array_equal(starts["sliding-mode"][0], [-0.72, -1.744, 1.074])
    assert (np.abs(np.diff(starts["sliding-mode"], axis=0)) > 1e-5).all()
    assert (np.abs(starts["sliding-mode"] - starts["sliding-mode"][0]) <= 0.01).all()
    other = suite.select(seed=5)
    assert not np.array_equal(other.scenarios[0].setup(1, 5).q0, starts["sliding-mode"][1])


def test_failing_runs_become_rows_with_their_reason(tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text(BROKEN)
    (tmp_path / "broken.toml").write_text(
        'scenarios = ["example-2d-fov"]\n[controllers.sliding-mode]\n'
        '[controllers.raises]\ntype = "broken:Raises"\n'
        '[controllers.dies]\ntype = "broken:Dies"\n[controllers.nan]\ntype = "broken:NotANumber"\n'
    )
    suite = Suite.load(tmp_path / "broken.toml").select(settings=["scenario.duration=0.1"])
    compare(suite, tmp_path / "out", workers=2)
    lines = {line["controller"]: line for line in StoredComparison.load(tmp_path / "out").results}
    assert len(lines) == 5
    assert lines["sliding-mode"]["status"] == "unfinished"
    reason = "t = 0 s: RuntimeError: on purpose (broken.py, line 10)"
    assert (lines["raises"]["status"], lines["raises"]["reason"]) == ("failed", reason)
    assert (lines["dies"]["status"], lines["dies"]["reason"]) == (
        "failed",
        "the process that ran it died",
    )
    assert lines["nan"]["status"] == "failed"
    assert "not finite" in lines["nan"]["reason"]
    # what is unknown is blank, what is known stays
    assert np.isnan(lines["dies"]["utilization"])
    assert "nan" not in (tmp_path / "out" / "results.csv").read_text().replace(",nan,0,", "")


def test_a_failed_baseline_challenges_nothing() -> None:
    setup = Scenario.load("example-2d-fov").with_override("duration", 0.1).setup()
    from vsconstraints.controllers import SlidingMode
    from vsconstraints.simulation import simulate

    record = RunRecord.of(setup, simulate(setup, SlidingMode()), "x")
    for baseline in (None, RunRecord.failed("gone", "y")):
        result = score(record, baseline)
        assert not any(row["challenged"] for row in result.constraints)
        assert np.isnan(result.result["utilization"])


def test_a_record_survives_storing(tmp_path: Path) -> None:
    record = RunRecord.failed("why — σ ≤ 0", "abc")
    record.save(tmp_path / "run.npz")
    again = RunRecord.load(tmp_path / "run.npz")
    assert again is not None
    assert (again.trajectory.reason, again.fingerprint) == ("why — σ ≤ 0", "abc")
    assert RunRecord.load(tmp_path / "missing.npz") is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            'scenarios = ["example-2d-fow"]\n[controllers.tracking]',
            ("example-2d-fow", "example-2d-fov"),
        ),
        (
            'scenarios = ["example-2d-fov"]\n[controllers.slidingmode]',
            ("slidingmode", "sliding-mode"),
        ),
        (
            'scenarios = ["example-2d-fov"]\n[controllers.sliding-mode]\nrank = 1',
            ("rank", "rank_tolerance"),
        ),
        (
            'scenarios = ["example-2d-fov"]\ntrails = 3\n[controllers.tracking]',
            ("trails", "trials"),
        ),
        ('scenarios = ["example-2d-fov"]\ntrials = 0\n[controllers.tracking]', ("trials", "0")),
        (
            "scenarios = []\n[controllers.tracking]",
            ("has no scenario: there is nothing to compare",),
        ),
        ('scenarios = ["example-2d-fov"]', ("controllers", "missing")),
        ("scenarios = [3]\n[controllers.tracking]", ("a name, a path, or a table",)),
        ('scenarios = ["gone.toml"]\n[controllers.tracking]', ("gone.toml",)),
        ('scenarios = ["example-2d-fov"]\n[controllers.a]\ntype = "nowhere:Law"', ("nowhere",)),
        (
            'scenarios = ["example-2d-fov"]\n[controllers.a]\ntype = "json:JSONDecoder"',
            ("JSONDecoder", "Controller"),
        ),
        (
            'scenarios = ["example-2d-fov"]\n[controllers."a--b"]\ntype = "tracking"',
            ("a--b", "file names"),
        ),
        ("scenarios = [", ("is not TOML",)),
        (
            'scenarios = ["example-2d-fov"]\n[controllers.hierarchical-qp]\nsolver = "daqq"',
            ("daqq", "daqp"),
        ),
        (
            'scenarios = ["example-2d-fov"]\n[controllers.potential-field]\nregion = -1',
            ("region", "-1"),
        ),
    ],
)
def test_a_bad_suite_is_refused_with_words_that_help(
    tmp_path: Path, text: str, words: tuple[str, ...]
) -> None:
    (tmp_path / "suite.toml").write_text(text)
    with pytest.raises((ConfigurationError, InvalidInput)) as caught:
        Suite.load(tmp_path / "suite.toml")
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("scenario.sampling_tim=0.1", ("sampling_tim", "sampling_time")),
        ("scenario.task.Kp=1", ("Kp", "Kp0")),
        ("scenarios.duration=1", ("scenarios", "scenario")),
        ("sliding-mode.gain=1", ("gain", "rank_tolerance")),
        ("scenario.constraints.7.K=1", ("7",)),
        ("scenario.duration=-1", ("duration", "-1")),
        ("scenario.duration=long", ("duration", "long")),
        ("scenario.q0=[1.0]", ("q0", "3")),
        ("scenario", ("KEY=VALUE",)),
        ("scenario=1", ("scenario.KEY",)),
        ("trials=many", ("trials", "many")),
    ],
)
def test_a_bad_setting_is_refused_with_words_that_help(
    setting: str, words: tuple[str, ...]
) -> None:
    with pytest.raises(VsconstraintsError) as caught:
        small_suite().select(settings=[setting])
    for word in words:
        assert word in str(caught.value)


def test_settings_reach_what_they_name() -> None:
    suite = small_suite().select(
        settings=[
            "example-2d-fov.constraints.0.K=0.3",
            "hierarchical-qp.rows=active",
            "trials=2",
            "scenario.start_deviation=0.01",
            "scenario.duration=1",
        ]
    )
    assert suite.trials == 2
    assert suite.scenarios[0].tables["constraints"][0]["K"] == 0.3
    assert suite.controllers[1].options == {"rows": "active"}
    # the file's own stays as it is
    assert Scenario.load("example-2d-fov").tables["constraints"][0]["K"] == 0.2


# A program started in the background of a script inherits an ignored SIGINT; at a terminal it does
# not.
INTERRUPTIBLE = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from vsconstraints.cli import main
main()
"""


def test_an_interrupt_keeps_what_was_finished_and_the_same_command_goes_on(tmp_path: Path) -> None:
    command = [
        sys.executable, "-c", INTERRUPTIBLE, "compare", "--scenario", "case-study-6r",
        "--controller", "sliding-mode", "--controller", "potential-field", "--jobs", "1", "--out", str(tmp_path / "o"),
    ]  # fmt: skip
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    first = run_file(tmp_path / "o", "case-study-6r", "tracking", 0)
    results = tmp_path / "o" / "results.csv"
    deadline = time.monotonic() + 60.0
    while not results.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    # to the whole group, as a terminal does
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "1 of 3" in errors
    assert first.exists()
    lines = read_table(results)
    assert [line["controller"] for line in lines] == ["tracking"]
    assert json.loads((tmp_path / "o" / "manifest.json").read_text())["finished"] == 1
    assert "Traceback" not in errors
    again = subprocess.run(
        [*command, "--set", "case-study-6r.duration=10.0"],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert again.returncode == 0, again.stderr
    assert "1 of 3 runs were stored" in again.stdout
    assert len(read_table(results)) == 3


LAW = """
from vsconstraints.controllers import Tracking

class Own(Tracking):
    def __init__(self):
        super().__init__(rank_tolerance={tolerance})
"""


def test_own_modules_of_the_same_name_stay_apart(tmp_path: Path) -> None:
    tolerances = []
    for tolerance in (1e-3, 1e-4):
        folder = tmp_path / str(tolerance)
        folder.mkdir()
        (folder / "law.py").write_text(LAW.format(tolerance=tolerance))
        (folder / "s.toml").write_text(
            'scenarios = ["example-2d-fov"]\n[controllers.own]\ntype = "law:Own"\n'
        )
        controller = Suite.load(folder / "s.toml").controllers[0].make()
        tolerances.append(controller.rank_tolerance)
    assert tolerances == [1e-3, 1e-4]


@pytest.mark.parametrize("setting", ["start_deviation=0.01", "disturbances={pixel_noise = 0.1}"])
def test_trials_need_something_random(setting: str) -> None:
    with pytest.raises(
        ConfigurationError,
        match=r"3 trials of example-2d-fov would be identical.*start_deviation",
    ):
        small_suite().select(settings=["trials=3"])
    assert small_suite().select(settings=[f"scenario.{setting}", "trials=3"]).trials == 3


def test_even_an_exit_inside_a_run_ends_that_run_only(tmp_path: Path) -> None:
    (tmp_path / "leaves.py").write_text(
        "from vsconstraints.controllers import Controller\n"
        "class Leaves(Controller):\n    name = 'leaves'\n"
        "    def solve(self, rows, task):\n        raise SystemExit(3)\n"
    )
    (tmp_path / "s.toml").write_text(
        'scenarios = ["example-2d-fov"]\n[controllers.leaves]\ntype = '
        '"leaves:Leaves"\n[controllers.sliding-mode]\n'
    )
    suite = Suite.load(tmp_path / "s.toml").select(settings=["scenario.duration=0.1"])
    lines = compare(suite, tmp_path / "out", workers=1).scores
    assert (
        lines["example-2d-fov", "leaves", 0].result["reason"]
        == "t = 0 s: SystemExit: 3 (leaves.py, line 5)"
    )
    assert lines["example-2d-fov", "sliding-mode", 0].result["status"] == "unfinished"


@pytest.mark.parametrize("name", [*ARRAYS, *FACTS])
def test_everything_that_a_record_holds_is_checked_when_it_is_read(
    name: str, tmp_path: Path
) -> None:
    path = tmp_path / "run.npz"
    RunRecord.failed("no law", "").save(path)
    assert RunRecord.load(path) is not None
    values = read_arrays(path)
    # no array has four axes, and no text or other entry is a list
    values[name] = np.zeros((1, 1, 1, 1)) if name in ARRAYS else []
    write_arrays(path, values)
    assert RunRecord.load(path) is None
