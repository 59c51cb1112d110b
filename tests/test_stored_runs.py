"""A stored run stands for what is run now, or is run again; and one bad thing costs one run."""

from __future__ import annotations

import os
import shutil
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vsconstraints.bench.evidence import Campaign
from vsconstraints.bench.families import Family
from vsconstraints.bench.tuning import Budget, Problem
from vsconstraints.comparisons import RunRecord, RunSpec, Suite, compare
from vsconstraints.comparisons.metrics import constraint_columns, result_columns
from vsconstraints.comparisons.record import run_file, stored_run
from vsconstraints.comparisons.runner import run_stored
from vsconstraints.comparisons.runs import machine
from vsconstraints.comparisons.runs.files import SUMS, read_arrays, write_arrays
from vsconstraints.comparisons.runs.identity import differences
from vsconstraints.comparisons.runs.machine import package_versions
from vsconstraints.comparisons.runs.spec import ControllerSpec, prepare_laws
from vsconstraints.comparisons.tables import append_lines, read_table, write_table
from vsconstraints.errors import ConfigurationError, StorageError
from vsconstraints.plugins import provenance
from vsconstraints.reports import write_report
from vsconstraints.reports.drawing import Drawn, scenario_jobs, stored_runs
from vsconstraints.reports.results import Results
from vsconstraints.scenarios import families

EXAMPLES = Path(__file__).parent.parent / "examples"
REAL_WORLD = Path(families.__file__).parent / "real-world" / "ur5.toml"

LAW = """
import os
from pathlib import Path
from vsconstraints.controllers import Tracking
{imports}

class Own(Tracking):
    name = "own"
    def __init__(self):
        super().__init__(rank_tolerance={tolerance})
        {begin}
    def solve(self, rows, task):
        {solve}
        return super().solve(rows, task)
"""


def law(
    imports: str = "", tolerance: str = "1e-3", begin: str = "pass", solve: str = "pass"
) -> str:
    return LAW.format(imports=imports, tolerance=tolerance, begin=begin, solve=solve)


def jobs(
    folder: Path, kind: str = "law:Own", scenario: str = "example-2d-fov", trials: int = 1
) -> list[RunSpec]:
    """The runs of an own law in a suite of that folder, 0.05 s each."""
    named = f'"{scenario}"'
    if trials > 1:
        named = (
            f'{{ scenario = "{scenario}", name = "{scenario}", set = {{ start_deviation = '
            f"0.001 }} }}"
        )
    (folder / "s.toml").write_text(
        f'scenarios = [{named}]\ntrials = {trials}\n[controllers.own]\ntype = "{kind}"\n',
        encoding="utf-8",
    )
    suite = Suite.load(folder / "s.toml").select(settings=["scenario.duration=0.05"])
    return [job for job in suite.with_baseline().runs() if job.controller.name == "own"]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Where runs are stored."""
    (tmp_path / "out" / "trajectories").mkdir(parents=True)
    return tmp_path / "out"


@pytest.fixture(autouse=True)
def _imports_are_forgotten() -> Iterator[None]:
    """As in a process of its own."""
    before = list(sys.path)
    _forget_imports()
    yield
    _forget_imports()
    sys.path[:] = before


# --- old results are never taken for new ones ---


def test_a_law_edited_while_a_comparison_runs_is_run_again(tmp_path: Path, out: Path) -> None:
    """The process keeps what it has imported; its results are those of the old file, whenever they
    are made.
    """
    (tmp_path / "law.py").write_text(law())
    first, second = jobs(tmp_path, trials=2)
    assert run_stored(first, out, False)[0].result["status"] == "unfinished"
    assert stored_run(first, out) is not None
    (tmp_path / "law.py").write_text(law(tolerance="1e-9"))
    run_stored(second, out, False)
    assert (stored_run(first, out), stored_run(second, out)) == (None, None)


def _law(text: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        (folder / "law.py").write_text(text)

    return write


def _package(within: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        package = folder / within / "lawful" / "inner"
        package.mkdir(parents=True)
        (package.parent / "__init__.py").touch()
        (package / "__init__.py").write_text("from .gain import GAIN\n")
        (package / "gain.py").write_text("GAIN = 1e-3\n")
        (package / "own.py").write_text(law("from ..inner import GAIN", "GAIN"))
        sys.path.insert(0, str(folder / within))

    return write


def _beside(folder: Path) -> None:
    (folder / "helpers").mkdir()
    (folder / "helpers" / "gain.py").write_text("GAIN = 1e-3\n")
    (folder / "law.py").write_text(law("from helpers.gain import GAIN", "GAIN"))


READ = 'Path({!r}).joinpath("gain.txt").read_text()'


@pytest.mark.parametrize(
    ("kind", "write", "changed"),
    [
        ("law:Own", _law(law()), "law.py"),
        ("law:Own", _beside, "helpers/gain.py"),
        ("lawful.inner.own:Own", _package("on-the-path"), "on-the-path/lawful/inner/gain.py"),
        ("lawful.inner.own:Own", _package("site-packages"), "site-packages/lawful/inner/gain.py"),
        ("law:Own", _law(law("GAIN = Path(__file__).with_name('gain.txt').read_text()")), "gain.txt"),
        ("law:Own", _law(law(begin="Path(__file__).with_name('gain.txt').read_text()")), "gain.txt"),
        ("law:Own", _law(law(solve="Path(__file__).with_name('gain.txt').read_text()")), "gain.txt"),
        ("law:Own", _law(law(begin="np.load(Path(__file__).with_name('gain.npy'))", imports="import numpy as np")),
         "gain.npy"),
    ],
    ids=["law", "beside", "on the path", "installed", "read at import", "read when made", "read in a run", "array"],
)  # fmt: skip
def test_a_changed_file_of_an_own_law_is_noticed(
    kind: str, write: Callable[[Path], None], changed: str, tmp_path: Path, out: Path
) -> None:
    (tmp_path / "gain.txt").write_text("1")
    np.save(tmp_path / "gain.npy", np.ones(3))
    write(tmp_path)
    (job,) = jobs(tmp_path, kind)
    _forget_imports()
    assert run_stored(job, out, False)[0].result["reason"].startswith("still moving")
    assert run_stored(job, out, False)[1]
    record = stored_run(job, out)
    assert record is not None
    assert not any("site-packages" in path and "lawful" not in path for path in record.files)
    (tmp_path / changed).write_bytes((tmp_path / changed).read_bytes() + b"\n# 2\n")
    assert stored_run(job, out) is None


def _forget_imports() -> None:
    provenance.read_by_imports.clear()
    for name in [
        name for name in sys.modules if "own file" in name or name.startswith(("lawful", "helpers"))
    ]:
        del sys.modules[name]


def test_a_law_imports_what_lies_beside_it_even_in_a_run_and_the_path_stays_as_it_is(
    tmp_path: Path, out: Path
) -> None:
    (tmp_path / "helpers").mkdir()
    (tmp_path / "helpers" / "late.py").write_text("LATE = 1\n")
    (tmp_path / "law.py").write_text(law(solve="from helpers.late import LATE"))
    before = list(sys.path)
    (job,) = jobs(tmp_path)
    assert run_stored(job, out)[0].result["status"] == "unfinished"
    assert sys.path == before


def test_what_a_run_writes_is_not_what_it_is_made_from(tmp_path: Path, out: Path) -> None:
    log = (
        "Path(__file__).with_name('log').open('a').close(); "
        "Path(__file__).with_name('log').read_text()"
    )
    answer = (
        "name = __file__ + '.answer'; os.system(f'echo > {name}'); Path(name).read_text(); "
        "os.remove(name)"
    )
    (tmp_path / "law.py").write_text(law(begin=answer, solve=log))
    (job,) = jobs(tmp_path)
    run_stored(job, out, False)
    (tmp_path / "log").write_text("more")
    assert run_stored(job, out, False)[1]


BOX = "\n".join(
    ["solid box"]
    + [
        f"facet normal 0 0 0\nouter loop\n{vertices}\nendloop\nendfacet"
        for vertices in (
            "vertex 0 0 0\nvertex 0.1 0 0\nvertex 0 0.1 0",
            "vertex 0 0 0\nvertex 0.1 0 0\nvertex 0 0 0.1",
            "vertex 0 0 0\nvertex 0 0.1 0\nvertex 0 0 0.1",
            "vertex 0.1 0 0\nvertex 0 0.1 0\nvertex 0 0 0.1",
        )
    ]
    + ["endsolid box\n"]
)

ARM = """
extends = "arm.toml"
duration = 0.01

[[constraints]]
type = "self-collision"
srdf = "arm.srdf"
K = 0.2
switching_gain = 2.0
link_radius = 0.01
pairs = [["hand", "shoulder"]]

[[constraints]]
type = "collision"
name = "box"
obstacle = { shape = "mesh", file = "meshes/box.stl", xyz = [2.0, 2.0, 2.0] }
K = 0.2
switching_gain = 2.0
link_radius = 0.01
"""


@pytest.mark.parametrize(
    "changed", ["six_axis.urdf", "arm.srdf", "meshes/box.stl", "meshes/link.stl"]
)
def test_a_changed_file_of_the_scene_is_noticed(changed: str, tmp_path: Path, out: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for name in ("box", "link"):
        (tmp_path / "meshes" / f"{name}.stl").write_text(BOX)
    (tmp_path / "arm.srdf").write_text('<robot name="arm"/>')
    shutil.copy(EXAMPLES / "my-arm.toml", tmp_path / "arm.toml")
    urdf = (EXAMPLES / "six_axis.urdf").read_text(encoding="utf-8")
    mesh = '<mesh filename="package://meshes/link.stl"/>'
    link = f'<link name="far"><collision><geometry>{mesh}</geometry></collision></link>'
    joint = (
        '<joint name="off" type="fixed"><parent link="tool"/><child link="far"/><origin '
        'xyz="0 0 -0.5"/></joint>'
    )
    (tmp_path / "six_axis.urdf").write_text(
        urdf.replace("</robot>", f"{link}{joint}</robot>"), encoding="utf-8"
    )
    (tmp_path / "scene.toml").write_text(ARM)
    suite = replace(Suite.load(), scenarios=())
    suite = suite.select([str(tmp_path / "scene.toml")], ["tracking"])
    (job,) = suite.runs()
    assert tmp_path / changed in job.files
    run_stored(job, out, False)
    assert stored_run(job, out) is not None
    (tmp_path / changed).write_bytes((tmp_path / changed).read_bytes() + b" ")
    assert stored_run(job, out) is None


def test_versions_and_the_form_that_runs_are_in_the_fingerprint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert {"coal", "numba", "numpy", "pin"} <= package_versions().keys()
    (tmp_path / "law.py").write_text(law())
    (job,) = jobs(tmp_path)
    before = job.fingerprint
    monkeypatch.setattr("vsconstraints.compiled.compiler.interface", None)
    assert job.fingerprint != before


def test_another_python_is_another_identity(monkeypatch: pytest.MonkeyPatch) -> None:
    assert package_versions()["Python"] == f"CPython {'.'.join(map(str, sys.version_info[:3]))}"
    job = RunSpec("example-2d-fov")
    before = job.fingerprint
    monkeypatch.setattr(machine, "python_version", lambda: "CPython 3.99.0")
    package_versions.cache_clear()
    try:
        assert job.fingerprint != before
    finally:
        monkeypatch.undo()
        package_versions.cache_clear()


def test_what_a_configuration_uses_is_in_its_identity(monkeypatch: pytest.MonkeyPatch) -> None:
    """Packages of which no other result depends: of images, of another engine, of a solver, of the
    tuner.
    """
    nominal = RunSpec("ur5-fov")
    images = RunSpec("ur5-images")
    engine = RunSpec("ur5-fov", overrides={"plant": {"type": "mujoco"}})
    solver = RunSpec("ur5-fov", ControllerSpec("hierarchical-qp", options={"solver": "clarabel"}))
    campaign = Campaign.load().select(
        ["planar-arm"], ["hierarchical-qp"], settings=["hierarchical-qp.solver=clarabel"]
    )
    real = replace(campaign, families=(Family.load("ur5"), Family.load(REAL_WORLD)))
    tuning = Problem(replace(campaign, half="training"), Budget())

    def identities() -> tuple[list[str], list[dict[str, object]]]:
        found = [real.identity(family) for family in real.families]
        return [spec.fingerprint for spec in (nominal, images, engine, solver)], [
            *found,
            tuning.configuration(),
        ]

    before, tables = identities()
    assert tables[0]["family"]["packages"] == {}  # type: ignore[index]
    assert tables[1]["family"]["packages"].keys() == {"cv2", "pupil_apriltags"}  # type: ignore[index]
    loaded = machine.module_version

    for module, changed, said in (
        ("cv2", [1], [1]),
        ("pupil_apriltags", [1], [1]),
        ("mujoco", [2], []),
        ("optuna", [], [2]),
    ):
        monkeypatch.setattr(
            machine, "module_version", lambda name, its=module: "9" if name == its else loaded(name)
        )
        now, words = identities()
        assert [i for i in range(4) if now[i] != before[i]] == changed, module
        differing = {
            i: list(differences(tables[i], words[i])) for i in range(3) if tables[i] != words[i]
        }
        assert list(differing) == said
        assert all(module in text for texts in differing.values() for text in texts)
    monkeypatch.setattr(machine, "module_version", loaded)
    monkeypatch.setattr(machine, "version", lambda name: "9" if name == "clarabel" else "1")
    now, words = identities()
    assert [i for i in range(4) if now[i] != before[i]] == [3]
    assert all("package clarabel" in next(differences(tables[i], words[i])) for i in range(3))


def test_an_old_baseline_challenges_no_row(out: Path) -> None:
    suite = Suite.load().select(
        ["example-2d-fov"], ["sliding-mode"], settings=["scenario.duration=3.5"]
    )
    baseline, job = suite.with_baseline().runs()
    run_stored(baseline, out, False, baseline)
    assert any(row["challenged"] for row in run_stored(job, out, True, baseline)[0].constraints)
    path = run_file(out, *baseline.key)
    record = RunRecord.load(path)
    assert record is not None
    replace(record, fingerprint="of another code").save(path)
    for fresh in (True, False):
        score, _ = run_stored(job, out, fresh, baseline)
        assert not any(row["challenged"] for row in score.constraints)


def test_a_run_whose_process_dies_leaves_neither_an_old_trajectory_nor_a_figure(
    tmp_path: Path,
) -> None:
    (tmp_path / "law.py").write_text(law(solve="os.path.exists('die') and os._exit(3)"))
    (job,) = jobs(tmp_path)
    suite = Suite.load(tmp_path / "s.toml").select(settings=["scenario.duration=0.05"])
    here = Path.cwd()
    os.chdir(tmp_path)
    try:
        assert (
            compare(suite, tmp_path / "out", workers=1).scores[job.key].result["status"]
            == "unfinished"
        )
        (tmp_path / "die").touch()
        lines = compare(suite, tmp_path / "out", workers=1, fresh=True).scores
    finally:
        os.chdir(here)
    assert lines[job.key].result["reason"] == "the process that ran it died"
    assert not run_file(tmp_path / "out", *job.key).exists()


def test_figures_show_no_run_that_the_tables_do_not_have(tmp_path: Path) -> None:
    suite = Suite.load().select(
        ["example-2d-fov"], ["sliding-mode"], settings=["scenario.duration=0.1"]
    )
    compare(suite, tmp_path, workers=1)
    lines = read_table(tmp_path / "results.csv")
    write_table(tmp_path / "results.csv", result_columns(), lines[:1])
    (tmp_path / SUMS).unlink()
    from vsconstraints.comparisons import StoredComparison

    (job,) = scenario_jobs(Results(StoredComparison.load(tmp_path)))
    assert set(stored_runs(job, Drawn())) == {"tracking"}


def test_a_table_from_before_a_column_was_added_is_read_with_it_empty(tmp_path: Path) -> None:
    """Not a text whose empty cell would say that no row was violated."""
    line: dict[str, object] = dict.fromkeys(result_columns(), 1.0)
    line |= {
        "suite": "s",
        "scenario": "a",
        "controller": "b",
        "status": "converged",
        "reason": "",
        "trial": 0,
    }
    line |= {"violated": "", "within_band": "", "violated_tolerant": "", "compiled": True}
    path = tmp_path / "results.csv"
    required = ("duration_s", "violated_tolerant", "violation_depth")
    for missing in ("acceleration_max", "reason", *required):
        columns = [name for name in result_columns() if name != missing]
        write_table(path, columns, [line])
        if missing in required:
            with pytest.raises(ConfigurationError, match=f"it has no column '{missing}'"):
                read_table(path, result_columns())
        else:
            (read,) = read_table(path, result_columns())
            value = read.pop(missing)
            assert value == "" if missing == "reason" else np.isnan(value)
            assert read["jerk_rms"] == 1.0


def test_a_damaged_name_of_a_column_is_no_missing_column(tmp_path: Path) -> None:
    """Columns of metrics that are not installed are read where no other column is missing."""
    path = tmp_path / "constraints.csv"
    line: dict[str, object] = dict.fromkeys(constraint_columns(), 1.0)
    line |= {"suite": "s", "scenario": "a", "controller": "b", "trial": 0, "challenged": True}
    columns = [*constraint_columns(), "path_m"]
    write_table(path, columns, [line | {"path_m": 2.0}])
    (read,) = read_table(path, constraint_columns())
    assert (read["usage_max"], read["path_m"]) == (1.0, 2.0)
    path.write_text(path.read_text().replace("usage_max", "usage_mbx").replace(",path_m", ",usage"))
    told = "it has no column 'usage_max', but 'usage_mbx', which is a damaged name"
    with pytest.raises(ConfigurationError, match=told):
        read_table(path, constraint_columns())


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("jerk_rms", "fast"),
        ("jerk_rms", "inf"),
        ("trial", "nan"),
        ("trial", "0.5"),
        ("trial", "-inf"),
    ],
)
def test_a_cell_that_is_no_number_is_named(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(f"{name}\n{text}\n")
    with pytest.raises(ConfigurationError, match=f"line 2: {name} must be a number, not '{text}'"):
        read_table(tmp_path / "t.csv")


def test_a_cell_of_an_unknown_metric_is_a_number_or_a_text(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("path_m\n1.5\ninf\nleft\n")
    assert [line["path_m"] for line in read_table(tmp_path / "t.csv")] == [1.5, "inf", "left"]


# --- one bad thing costs one run ---


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive"])
def test_a_damaged_trajectory_is_no_trajectory(content: bytes, tmp_path: Path, out: Path) -> None:
    (tmp_path / "law.py").write_text(law())
    (job,) = jobs(tmp_path)
    run_stored(job, out, False)
    run_file(out, *job.key).write_bytes(content)
    assert stored_run(job, out) is None
    score, stored = run_stored(job, out, False)
    assert (stored, score.result["status"]) == (False, "unfinished")


def test_no_damage_of_a_trajectory_raises(tmp_path: Path, out: Path) -> None:
    (tmp_path / "law.py").write_text(law())
    (job,) = jobs(tmp_path)
    run_stored(job, out, False)
    whole = run_file(out, *job.key).read_bytes()
    path = tmp_path / "damaged.npz"
    rng = np.random.default_rng(0)
    for _ in range(300):
        damaged = bytearray(whole)
        begin = int(rng.integers(len(whole)))
        damaged[begin : begin + 64] = rng.bytes(len(damaged[begin : begin + 64]))
        path.write_bytes(damaged)
        RunRecord.load(path)


def test_a_full_disk_fails_the_run_in_one_line_and_leaves_nothing_half_written(
    tmp_path: Path, out: Path
) -> None:
    (tmp_path / "law.py").write_text(law())
    (job,) = jobs(tmp_path)
    run_stored(job, out, False)
    path = run_file(out, *job.key)
    path.with_name(path.name + ".part").symlink_to("/dev/full")
    score, stored = run_stored(job, out, True)
    assert (stored, score.result["status"]) == (False, "failed")
    assert "No space left on device" in score.result["reason"]
    assert "\n" not in score.result["reason"]
    assert list(path.parent.iterdir()) == []


def test_tables_that_cannot_be_written_are_an_error_that_keeps_what_is_there(
    tmp_path: Path,
) -> None:
    suite = Suite.load().select(
        ["example-2d-fov"], ["tracking"], settings=["scenario.duration=0.05"]
    )
    (tmp_path / "constraints.csv").touch()
    (tmp_path / ".vsconstraints-lock").touch()
    (tmp_path / "constraints.csv.part").mkdir()
    with pytest.raises(
        StorageError, match=r"results cannot be stored in .*; finished runs are kept"
    ):
        compare(suite, tmp_path, workers=1)
    assert run_file(tmp_path, "example-2d-fov", "tracking", 0).exists()
    assert len(read_table(tmp_path / "results.csv")) == 1


def test_a_report_that_does_not_fit_leaves_the_one_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    suite = Suite.load().select(
        ["example-2d-fov"], ["tracking"], settings=["scenario.duration=0.05"]
    )
    compare(suite, tmp_path, workers=1)
    report = write_report(tmp_path)
    before = report.read_bytes()

    def full(path: Path, *arguments: object, **options: object) -> int:
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(
        StorageError, match=r"the report cannot be written .*No space left on device"
    ):
        write_report(tmp_path)
    assert report.read_bytes() == before
    assert not list(tmp_path.rglob("*.part"))


def test_a_line_that_does_not_fit_is_not_added(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = dict.fromkeys(constraint_columns(), 1.0)
    append_lines(tmp_path / "t.csv", constraint_columns(), [line])
    before = (tmp_path / "t.csv").read_bytes()
    real = Path.open

    def fills_up(path: Path, *arguments: object, **options: object) -> object:
        with real(path, *arguments, **options) as file:  # type: ignore[call-overload]
            file.write(b"half a li")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "open", fills_up)
    with pytest.raises(OSError, match="No space"):
        append_lines(tmp_path / "t.csv", constraint_columns(), [line])
    monkeypatch.undo()
    assert (tmp_path / "t.csv").read_bytes() == before


def test_a_law_that_changes_the_working_directory_changes_it_for_itself(
    tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "law.py").write_text(
        law("os.chdir('/')", begin="os.chdir('/')", solve="os.chdir('/')")
    )
    monkeypatch.chdir(tmp_path)
    first, second = jobs(Path(), trials=2)
    for job in (first, second):
        assert run_stored(job, Path("out"), False)[0].result["status"] == "unfinished"
        assert run_file(out, *job.key).exists()
    assert Path.cwd() == tmp_path


@pytest.mark.parametrize(
    "message",
    ["'x' * 200_000", "chr(0xD800)", "'two\\nlines'", "'a\\x1b[2J\\a bell'", "Nasty()"],
    ids=["long", "surrogate", "lines", "escape sequence", "nasty"],
)
def test_whatever_a_law_says_is_a_reason_of_one_line(
    message: str, tmp_path: Path, out: Path
) -> None:
    nasty = "class Nasty:\n    def __str__(self):\n        raise ValueError('even that')"
    (tmp_path / "law.py").write_text(law(nasty, solve=f"raise RuntimeError({message})"))
    (job,) = jobs(tmp_path)
    score, _ = run_stored(job, out, False)
    assert score.result["status"] == "failed"
    line = {"suite": "s", "scenario": "s", "controller": "own", "trial": 0, **score.result}
    write_table(tmp_path / "results.csv", result_columns(), [line])
    (again,) = read_table(tmp_path / "results.csv")
    assert again["reason"] == score.result["reason"]
    assert 10 < len(again["reason"]) < 2500
    assert again["reason"].isprintable()
    assert "RuntimeError" in again["reason"]


def test_names_that_make_no_file_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(
        f'scenarios = ["example-2d-fov"]\n[controllers.{"a" * 250}]\ntype = "sliding-mode"\n'
    )
    with pytest.raises(ConfigurationError, match="file names and longer than 100 bytes"):
        Suite.load(tmp_path / "s.toml")


@pytest.mark.parametrize("begin", ["import sys; sys.exit()", "raise SystemExit(0)"])
def test_a_module_that_exits_is_an_error(begin: str, tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(law(begin))
    with pytest.raises(ConfigurationError, match="cannot import 'law': SystemExit"):
        jobs(tmp_path)


def test_a_law_that_exits_when_it_is_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(law(begin="raise SystemExit(0)"))
    with pytest.raises(ConfigurationError, match=r"cannot be made with .*SystemExit: 0"):
        jobs(tmp_path)


CONSTRAINT = """
import numpy as np
from vsconstraints.constraints import ImageConstraint

class Wrong(ImageConstraint):
    kind = "wrong"
    def __init__(self):
        super().__init__(K=0.2, switching_gain=10.0, length=100.0)
    def sigma(self, y):
        return y[..., 1] / 100.0 - 10.0
    def gradient(self, y):
        return np.zeros((3, 5, 7))
"""


def test_a_constraint_with_a_gradient_of_the_wrong_shape_fails_its_own_runs(
    tmp_path: Path, out: Path
) -> None:
    (tmp_path / "limit.py").write_text(CONSTRAINT)
    (tmp_path / "wrong.toml").write_text(
        'extends = "example-2d-fov"\n[[constraints]]\ntype = "limit:Wrong"\n'
    )
    (tmp_path / "s.toml").write_text(
        'scenarios = ["example-2d-fov", "wrong.toml"]\n[controllers.tracking]\n'
    )
    suite = Suite.load(tmp_path / "s.toml").select(settings=["scenario.duration=0.05"])
    assert [remark.partition(": ")[0] for remark in suite.remarks()] == ["wrong"]
    right, wrong = (run_stored(job, out, False)[0].result for job in suite.runs())
    assert (right["status"], wrong["status"]) == ("unfinished", "failed")
    assert "Error" in wrong["reason"]


def test_what_does_not_become_smaller_is_stored_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "some.npz"
    numbers = np.random.default_rng(0).normal(size=(5000, 3))
    given = {
        "numbers": numbers,
        "flags": numbers > 9.0,
        "none": np.empty((0, 3)),
        "one": np.array(3.5),
        "k": 4,
    }
    write_arrays(file, given)
    with zipfile.ZipFile(file) as archive:
        sizes = {
            member.filename: member.compress_size / member.file_size
            for member in archive.infolist()
        }
    assert sizes["numbers.npy"] == 1.0
    assert sizes["flags.npy"] < 0.05
    again = read_arrays(file)
    assert again.keys() == given.keys()
    for name, value in given.items():
        np.testing.assert_array_equal(again[name], value, strict=name != "k")


def test_what_laws_need_is_compiled_before_runs_and_no_code_of_own_laws_is_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(
        "vsconstraints.comparisons.runs.spec.prepare", lambda *names: asked.append(names)
    )
    prepare_laws(
        [
            *map(ControllerSpec, ("predictive", "sliding-mode")),
            ControllerSpec("mine", "nowhere:Law"),
        ]
    )
    assert asked == [("task_priority", "vsconstraints.prediction.kernels.predictive")]
