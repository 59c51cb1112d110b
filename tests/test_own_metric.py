"""Metrics of other packages: one file and an entry point, as in docs/results.md, and their errors."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaigns import campaign
from documents import DOCS, ROOT, blocks
from test_metrics import SMALL
from test_own_files import here
from test_registry import command, installed, python
from vsconstraints.bench.evidence import MEASURED, Plan, call_times, collect
from vsconstraints.bench.tuning.problem import Budget, Problem
from vsconstraints.bench.tuning.tune import tune
from vsconstraints.comparisons import RunRecord, Suite, compare, keep_trajectories, metrics
from vsconstraints.comparisons.metrics import Metric, run_metrics, score
from vsconstraints.comparisons.record import run_file
from vsconstraints.comparisons.runner import run_stored
from vsconstraints.comparisons.runs.folder import LOCK
from vsconstraints.comparisons.runs.pool import DIED, Failure
from vsconstraints.comparisons.stored import ARM_LOG
from vsconstraints.comparisons.tables import append_lines, read_table
from vsconstraints.errors import ConfigurationError, FolderTaken
from vsconstraints.paper.runner import reproduce
from vsconstraints.paper.studies import run_studies
from vsconstraints.plugins import registry
from vsconstraints.plugins.provenance import digests
from vsconstraints.plugins.registry import InstalledPart, Part, added_metrics

#: Metric of another package that fails for every run.
BROKEN = Metric("path", lambda measured: 1 / 0, package="theirs")
CHECK = """
import sys
from pathlib import Path
from test_metrics import made
from test_reports import made as stored, result
from vsconstraints.comparisons.metrics import constraint_columns, definitions, result_columns, score
from vsconstraints.comparisons.runs.identity import identity
from vsconstraints.reports import write_report

assert result_columns()[-1] == "camera_path_m" and "camera_path_m" in definitions()
assert constraint_columns()[-1] == "clearance_end"
scored = score(made([[3.0, 2.0]]), None)
assert scored.result["camera_path_m"] == 0.0 and scored.constraints[0]["clearance_end"] == 2.0
assert identity([])["metrics"] == {"theirs": "1.0"}
lines = [result("tracking", violated="x"), result("a", camera_path_m=0.25), result("b", camera_path_m=0.5)]
report = write_report(stored(Path(sys.argv[1]), lines), figures=False).read_text()
details = (Path(sys.argv[1]) / "details.md").read_text()
assert "| Shortest path of the camera [mm] |" in report
assert "camera path [mm]" in report and "**250**" in report and "**camera_path_m**: Length" in details
assert "camera_path_m" in (Path(sys.argv[1]) / "results.csv").read_text().splitlines()[0]
"""
OF_ROWS = """
from vsconstraints.plugins.metric import Metric
CLEARANCE_END = Metric("clearance_end", lambda measured: measured.run.clearance[-1])
PART = Part(metrics=("theirs:CAMERA_PATH",), row_metrics=("theirs:CLEARANCE_END",))
"""


def example() -> str:
    """Return the file of docs/results.md."""
    (code,) = [
        block.code for block in blocks(DOCS / "results.md") if block.file == "camera_path.py"
    ]
    return code


def test_one_file_and_an_entry_point_are_a_metric(tmp_path: Path) -> None:
    environment = installed(tmp_path, example() + OF_ROWS)
    environment["PYTHONPATH"] += f":{ROOT / 'tests'}"
    done = python(
        environment, f"import sys; sys.argv[1:] = [{str(tmp_path / 'report')!r}]\n{CHECK}"
    )
    assert done.returncode == 0, done.stderr
    # its own tests import the file before anything else
    alone = python(environment, "import theirs; from vsconstraints.comparisons import score")
    assert alone.returncode == 0, alone.stderr


@pytest.mark.parametrize(
    "imports",
    [
        "from vsconstraints.comparisons import Suite",
        "from vsconstraints.bench.evidence import Evidence",
        "from vsconstraints.bench.difference import difference",
        "from vsconstraints.reports import write_report",
    ],
)
def test_a_part_imports_any_module_of_this_package(imports: str, tmp_path: Path) -> None:
    """Its metrics are loaded when they are used, and the package is imported without them."""
    code = f"{imports}\n{example()}{OF_ROWS}"
    uses = (
        "from vsconstraints.comparisons import definitions, Suite; definitions()['camera_path_m']"
    )
    done = python(installed(tmp_path, code), uses)
    assert done.returncode == 0, done.stderr


def test_a_broken_part_fails_where_metrics_are_used(tmp_path: Path) -> None:
    environment = installed(tmp_path, "raise RuntimeError('no licence')")
    done = python(environment, "from vsconstraints.comparisons import RunSpec, Suite, compare")
    assert done.returncode == 0, done.stderr
    used = python(
        environment, "from vsconstraints.comparisons import definitions; len(definitions())"
    )
    assert (
        "ConfigurationError: part my-part of theirs, theirs:PART, cannot be imported" in used.stderr
    )
    assert "no licence" in used.stderr


def compare_laws(folder: Path) -> None:
    compare(Suite.load().select(["example-2d-fov"], ["tracking"]), folder, workers=0, fresh=True)


def run_campaign(folder: Path) -> None:
    collect(campaign(folder.parent), folder, Plan(fresh=True, workers=here))


def measure_calls(folder: Path) -> None:
    call_times(MEASURED, campaign(folder.parent), folder, here)


def tune_laws(folder: Path) -> None:
    tune(Problem(campaign(folder.parent), Budget(1, 1, 1)), folder, workers=0)


def make_studies(folder: Path) -> None:
    run_studies(["sampling-time"], folder, small=True, workers=0)


def reproduce_paper(folder: Path) -> None:
    reproduce(folder, workers=0)


@pytest.mark.parametrize(
    "make_runs",
    [compare_laws, run_campaign, measure_calls, tune_laws, make_studies, reproduce_paper],
)
def test_no_run_starts_if_a_metric_cannot_be_used(
    make_runs: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a folder holds stays, also with --fresh."""
    theirs = InstalledPart(Part(metrics=("not_there:METRIC",)), "theirs", "1.0")
    monkeypatch.setattr(registry, "parts_of_other_packages", lambda: (theirs,))
    monkeypatch.setattr("vsconstraints.comparisons.runs.law_process.simulate_law", pytest.fail)
    metrics.load_metrics.cache_clear()
    folder = tmp_path / "out"
    with pytest.raises(ConfigurationError, match="not_there:METRIC, a metric of theirs"):
        make_runs(folder)
    assert not any(path.is_file() for path in folder.rglob("[!.]*"))


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("raise RuntimeError('no licence')", "no licence"),
        ("METRIC = 3", "must be a Metric, not 3"),
        ("", "has no attribute 'METRIC'"),
        ("METRIC = Metric('path', abs, group='tasks')", "unknown group of the metric path 'tasks'"),
        ("METRIC = Metric('path', abs, better='least')", "unknown better of the metric path"),
        ("METRIC = Metric('my path', abs)", "must be a name of letters, digits and '_'"),
        ("METRIC = Metric('path', 3)", "must be a function of a run, not 3"),
        ("METRIC = Metric('path', None)", "neither a value nor 'over'"),
        ("METRIC = Metric('path', abs, over='jerk_rms')", "a value and 'over'"),
    ],
)
def test_a_bad_metric_is_an_error_that_names_its_package(
    code: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bad_metric.py").write_text(
        f"from vsconstraints.plugins.metric import Metric\n{code}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "bad_metric", raising=False)
    theirs = InstalledPart(Part(metrics=("bad_metric:METRIC",)), "theirs", "1.0")
    monkeypatch.setattr(registry, "parts_of_other_packages", lambda: (theirs,))
    with pytest.raises(ConfigurationError) as raised:
        added_metrics("metrics")
    assert str(raised.value).startswith("bad_metric:METRIC, a metric of theirs,")
    assert told in str(raised.value)


def test_a_command_ends_with_the_error_of_a_bad_metric(tmp_path: Path) -> None:
    code = example().replace('"camera_path_m"', '"duration_s"').replace("camera_path:", "theirs:")
    done = command(installed(tmp_path, code), "list", "metrics")
    assert done.returncode == 2
    assert done.stderr.startswith("error: theirs adds the metric duration_s, but there is a column")


@pytest.mark.parametrize(
    ("metric", "told"),
    [
        (Metric("clearance_min", abs), "there is a column of this name already"),
        (Metric("trial", abs), "there is a column of this name already"),
        (Metric("path", abs, required=True), "with 'required'"),
        (Metric("path", None, over="duration_s"), "'path' is no score"),
        (Metric("duration_s", None, over="paths"), "'paths' is no score"),
        (Metric("phi_max", None, over="clearance_min"), "'phi_max' is no score"),
        (Metric("jerk_rms", None, over="phi_max"), "'phi_max' is no score"),
        (Metric("suite", None, over="trial"), "'suite' is no score"),
        (Metric("jerk_rms", None, over="trial"), "'trial' is no score of results.csv"),
        (Metric("constraint", None, over="status"), "'constraint' is no score"),
        (Metric("jerk_rms", None, over="status"), "'status' is no score"),
        (Metric("jerk_rms", None, over="duration_s", kind="text"), "kind must be number, not text"),
    ],
)
def test_a_metric_must_fit_into_the_tables(metric: Metric, told: str) -> None:
    theirs = replace(metric, package="theirs")
    with pytest.raises(ConfigurationError, match=f"^theirs adds the metric .*{told}"):
        metrics.require_addable([theirs])


@pytest.mark.parametrize("over", ["clearance_min", "duration_s", "clearance_end"])
def test_rows_have_no_ratios(over: str) -> None:
    """They would repeat a column of constraints.csv, and have no value."""
    of_rows = [Metric("clearance_end", abs), Metric("phi_max", None, over=over, package="theirs")]
    with pytest.raises(ConfigurationError, match=r"theirs adds the metric phi_max .* to rows"):
        metrics.require_addable([], of_rows)


def test_a_ratio_adds_no_column(monkeypatch: pytest.MonkeyPatch) -> None:
    before = metrics.result_columns()
    path = Metric("path_m", lambda measured: 2.0)
    ratios = [Metric("path_m", None, over="duration_s"), Metric("jerk_rms", None, over="path_m")]
    metrics.require_addable([*ratios, path])
    monkeypatch.setattr(metrics, "load_metrics", lambda: ((*ratios, path), ()))
    assert metrics.result_columns() == (*before, "path_m")
    assert score(SMALL, SMALL).result.keys() == {*before[4:], "path_m"}


@pytest.mark.parametrize(
    ("kind", "value"),
    [("number", "long"), ("number", True), ("time", None), ("text", 1.0), ("flag", 1.0)],
)
def test_a_value_of_another_kind_is_refused(kind: Any, value: Any) -> None:
    metric = Metric("path", lambda measured: value, kind=kind)
    with pytest.raises(ConfigurationError, match="the metric path must return a"):
        metric.of_run(None)


@pytest.mark.parametrize("values", [[1.0], 1.0, [1.0, 2.0, 3.0], ["a", 1.0]])
def test_a_metric_of_rows_has_one_value_for_each_row(values: Any) -> None:
    metric = Metric("path", lambda measured: values)
    assert Metric("path", lambda measured: np.array([1.0, math.nan])).of_rows(None, 2)[0] == 1.0
    with pytest.raises(ConfigurationError, match="the metric path must return"):
        metric.of_rows(None, 2)


def test_a_run_without_samples_has_empty_cells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The function of another package's metric is not called; empty cells are read again."""
    added = [Metric(f"path_{kind}", abs, kind=kind) for kind in ("number", "text", "flag")]
    monkeypatch.setattr(metrics, "load_metrics", lambda: (added, ()))
    result = score(RunRecord.failed("no law", ""), None).result
    assert math.isnan(result["path_number"])
    assert (result["path_text"], result["path_flag"]) == ("", None)
    append_lines(tmp_path / "t.csv", tuple(result), [dict(result)])
    assert (tmp_path / "t.csv").read_text().splitlines()[1].endswith(",,,")


def test_a_table_with_a_metric_that_is_not_installed_is_read(tmp_path: Path) -> None:
    with (tmp_path / "t.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["path_m", "side"], ["1.5", "left"], ["", "right"]])
    first, second = read_table(tmp_path / "t.csv")
    assert (first["path_m"], first["side"], second["side"]) == (1.5, "left", "right")
    assert math.isnan(second["path_m"])


def test_a_run_whose_metric_fails_is_stored_and_scored_once_that_is_repaired(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    suite = Suite.load().select(
        ["example-2d-fov"], ["tracking"], settings=["scenario.duration=0.05"]
    )
    (spec,) = suite.runs()
    file = run_file(tmp_path, *spec.key)
    file.parent.mkdir()
    with monkeypatch.context() as patch:
        patch.setattr(metrics, "load_metrics", lambda: ((BROKEN,), ()))
        failed, _ = run_stored(spec, tmp_path)
    assert failed.result["status"] == "failed"
    told = "the metric path of theirs cannot be computed: ZeroDivisionError"
    assert told in failed.result["reason"]
    scored, was_stored = run_stored(spec, tmp_path)
    assert was_stored
    assert scored.result["status"] != "failed"


ON_ARM = "on ros2://arm; still moving"


def with_run_on_arm(folder: Path, reason: str = ON_ARM) -> tuple[Suite, Path]:
    """Store a run in a new folder as if it had been on an arm; return its suite and its file."""
    suite = Suite.load().select(
        ["example-2d-fov"], ["tracking"], settings=["scenario.duration=0.05"]
    )
    (spec,) = suite.runs()
    trajectory = replace(SMALL.trajectory, reason=reason)
    record = replace(SMALL, trajectory=trajectory, fingerprint=spec.fingerprint)
    file = run_file(folder, *spec.key)
    for path in (file, folder / ARM_LOG):
        path.parent.mkdir(parents=True)
    for path in (folder / LOCK, folder / ARM_LOG):
        path.touch()
    replace(record, files=digests(spec.files)).save(file)
    return suite, file


def exits(measured: Any) -> float:
    sys.exit(3)


@pytest.mark.parametrize(
    ("value", "told"), [(lambda measured: 1 / 0, "ZeroDivisionError"), (exits, "SystemExit")]
)
def test_a_stored_run_whose_metric_fails_stays_stored(
    value: Callable[[Any], float], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is not simulated, and its reason still says that it was on an arm, which protects it."""
    suite, file = with_run_on_arm(tmp_path)
    driven = file.read_bytes()
    broken = Metric("path", value, package="theirs")
    for _ in range(2):
        with monkeypatch.context() as patch:
            patch.setattr(metrics, "load_metrics", lambda: ((broken,), ()))
            compare(suite, tmp_path, workers=0)
        (line,) = read_table(tmp_path / "results.csv")
        assert line["status"] == "failed"
        assert line["reason"].startswith(f"{ON_ARM}; the run cannot be scored: ")
        assert f"the metric path of theirs cannot be computed: {told}" in line["reason"]
        assert file.read_bytes() == driven
    with pytest.raises(FolderTaken, match="a run on ros2://arm"):
        compare(suite, tmp_path, workers=0, fresh=True)
    assert keep_trajectories(tmp_path, "none") == 1
    finished = compare(suite, tmp_path, workers=0)
    assert finished.stored_before == 1
    (score_of_run,) = finished.scores.values()
    assert score_of_run.result["reason"] == ON_ARM


def test_a_stored_run_whose_metric_ends_its_process_stays_stored(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    _, file = with_run_on_arm(folder)
    driven = file.read_bytes()
    code = example().replace("camera_path:", "theirs:")
    code = code.replace("    steps =", "    __import__('os')._exit(3)\n    steps =")
    program = f"""
from pathlib import Path
from vsconstraints.comparisons import Suite, compare
suite = Suite.load().select(["example-2d-fov"], ["tracking"], settings=["scenario.duration=0.05"])
compare(suite, Path({str(folder)!r}), workers=1)
"""
    done = python(installed(tmp_path, code), program)
    assert done.returncode == 0, done.stderr
    (line,) = read_table(folder / "results.csv")
    assert line["status"] == "failed"
    assert line["reason"].startswith(f"{ON_ARM}; ")
    assert "the process that ran it died" in line["reason"]
    assert file.read_bytes() == driven


def test_a_run_is_protected_wherever_its_reason_names_the_arm(tmp_path: Path) -> None:
    suite, _ = with_run_on_arm(tmp_path, "the start is outside a bound; on ros2://arm; aborted")
    compare(suite, tmp_path, workers=0)
    with pytest.raises(FolderTaken, match="a run on ros2://arm, example-2d-fov with tracking"):
        compare(suite, tmp_path, workers=0, fresh=True)
    assert keep_trajectories(tmp_path, "none") == 1


@pytest.mark.parametrize("is_of_this_run", [True, False])
def test_a_lost_process_takes_no_trajectory_of_its_run(
    is_of_this_run: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it has saved stays, also with fresh, and this process reads none of its arrays."""
    suite = Suite.load().select(
        ["example-2d-fov"], ["tracking"], settings=["scenario.duration=0.05"]
    )

    def lost(function: Any, first: Any, second: Any, *, on_answer: Any, **options: Any) -> None:
        for key, call in (first | second).items():
            function(*call)
            if not is_of_this_run:
                record = RunRecord.load(run_file(tmp_path, *key))
                assert record is not None
                replace(record, fingerprint="other").save(run_file(tmp_path, *key))
            with monkeypatch.context() as patch:
                patch.setattr(RunRecord, "load", pytest.fail)
                on_answer(key, Failure(DIED))

    monkeypatch.setattr("vsconstraints.comparisons.runner.run_all", lost)
    (score_of_run,) = compare(suite, tmp_path, workers=0, fresh=True).scores.values()
    assert score_of_run.result["status"] == "failed"
    assert score_of_run.result["reason"].endswith(DIED)
    (spec,) = suite.runs()
    assert run_file(tmp_path, *spec.key).exists() == is_of_this_run


def test_small_runs_have_all_kinds() -> None:
    """The metrics of the package itself return what they declare."""
    assert set(score(SMALL, SMALL).result) == {
        m.column for m in run_metrics() if m.value is not None
    }
