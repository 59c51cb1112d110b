"""Metrics of other packages: one file and an entry point, as in docs/results.md, and their errors."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from documents import DOCS, ROOT, blocks
from test_metrics import SMALL
from test_registry import command, installed, python
from vsconstraints.comparisons import RunRecord, Suite, compare, metrics
from vsconstraints.comparisons.metrics import METRICS, Metric, score
from vsconstraints.comparisons.record import run_file
from vsconstraints.comparisons.runner import run_stored
from vsconstraints.comparisons.tables import append_lines, read_table
from vsconstraints.errors import ConfigurationError
from vsconstraints.plugins import registry
from vsconstraints.plugins.registry import InstalledPart, Part, added_metrics

CHECK = """
import sys
from pathlib import Path
from test_metrics import made
from test_reports import made as stored, result
from vsconstraints.comparisons.metrics import CONSTRAINT_COLUMNS, DEFINITIONS, RESULT_COLUMNS, score
from vsconstraints.comparisons.runs.identity import identity
from vsconstraints.reports import write_report

assert RESULT_COLUMNS[-1] == "camera_path_m" and "camera_path_m" in DEFINITIONS
assert CONSTRAINT_COLUMNS[-1] == "clearance_end"
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


def test_a_part_imports_what_compares_controllers(tmp_path: Path) -> None:
    """Its metrics are loaded when they are used, and the package is imported without them."""
    code = "from vsconstraints.comparisons import Suite\n" + example() + OF_ROWS
    uses = "from vsconstraints.comparisons import DEFINITIONS, Suite; DEFINITIONS['camera_path_m']"
    done = python(installed(tmp_path, code), uses)
    assert done.returncode == 0, done.stderr


def test_a_broken_part_fails_where_metrics_are_used(tmp_path: Path) -> None:
    environment = installed(tmp_path, "raise RuntimeError('no licence')")
    done = python(environment, "from vsconstraints.comparisons import RunSpec, Suite, compare")
    assert done.returncode == 0, done.stderr
    used = python(
        environment, "from vsconstraints.comparisons import DEFINITIONS; len(DEFINITIONS)"
    )
    assert (
        "ConfigurationError: part my-part of theirs, theirs:PART, cannot be imported" in used.stderr
    )
    assert "no licence" in used.stderr


def test_no_run_starts_if_a_metric_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = InstalledPart(Part(metrics=("not_there:METRIC",)), "theirs", "1.0")
    monkeypatch.setattr(registry, "parts_of_other_packages", lambda: (theirs,))
    metrics.load_metrics.cache_clear()
    with pytest.raises(ConfigurationError, match="not_there:METRIC, a metric of theirs"):
        compare(Suite.load().select(["example-2d-fov"], ["tracking"]), tmp_path, workers=0)
    assert not (tmp_path / "results.csv").exists()


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
    assert done.stderr.startswith("error: another package adds the metric duration_s, but there is")


@pytest.mark.parametrize(
    ("metric", "told"),
    [
        (Metric("clearance_min", abs), "there is a column of this name already"),
        (Metric("trial", abs), "there is a column of this name already"),
        (Metric("path", abs, required=True), "with 'required'"),
        (Metric("path", None, over="duration_s"), "with 'path', which is no column"),
        (Metric("duration_s", None, over="paths"), "with 'paths', which is no column"),
    ],
)
def test_a_metric_must_fit_into_the_tables(metric: Metric, told: str) -> None:
    with pytest.raises(ConfigurationError, match=told):
        metrics.require_addable([metric])


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
    monkeypatch.setattr(metrics, "METRICS", (*METRICS, *added))
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
        broken = Metric("path", lambda measured: 1 / 0)
        patch.setattr(metrics, "METRICS", (*METRICS, broken))
        failed, _ = run_stored(spec, tmp_path)
    assert failed.result["status"] == "failed"
    assert "the metric path cannot be computed: ZeroDivisionError" in failed.result["reason"]
    scored, was_stored = run_stored(spec, tmp_path)
    assert was_stored
    assert scored.result["status"] != "failed"


def test_small_runs_have_all_kinds() -> None:
    """The metrics of the package itself return what they declare."""
    assert set(score(SMALL, SMALL).result) == {m.column for m in METRICS if m.value is not None}
