"""Runs and comparisons as a session has them, and the notebooks, executed."""

from __future__ import annotations

import gc
import re
import sys
from io import StringIO
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.text import Text
from nbclient import NotebookClient
from rich.console import Console
from typer.testing import CliRunner

import vsconstraints
from documents import ROOT
from vsconstraints import compare, comparisons, run
from vsconstraints.cli import app
from vsconstraints.comparisons.metrics import constraint_columns, result_columns, timing_columns
from vsconstraints.comparisons.runs.spec import ControllerSpec
from vsconstraints.comparisons.tables import read_table
from vsconstraints.controllers import (
    CONTROLLERS,
    Controller,
    HierarchicalQP,
    SlidingMode,
    Tracking,
    make_controller,
)
from vsconstraints.errors import ConfigurationError
from vsconstraints.reports import replay
from vsconstraints.reports.summary import MARKS
from vsconstraints.rows import Command, Rows, Task
from vsconstraints.scenarios import Scenario
from vsconstraints.view.notebooks import Comparison, NotebookRun, copies
from vsconstraints.view.notebooks import comparison as session
from vsconstraints.view.notebooks.inputs import InstanceSpec, spec_of, specs_of

SHORT = Scenario.load("example-2d-fov").with_override("duration", 3.5)
"""Long enough for tracking to leave the image."""

SINGLE = "fov[marker 1]"
ROW = "fov[marker 2]"


class Half(Controller):
    """Half of what tracking does; an own law."""

    name = "half"

    def __init__(self, *, share: float = 0.5) -> None:
        self.share = share
        self.tracking = Tracking()

    def solve(self, rows: Rows, task: Task) -> Command:
        command = self.tracking.solve(rows, task)
        command.qdd *= self.share
        return command


class Failing(Half):
    name = "failing"

    def solve(self, rows: Rows, task: Task) -> Command:
        raise RuntimeError("on purpose")


class Closed(Half):
    """Cannot be copied."""

    name = "closed"

    def __reduce__(self) -> Any:
        raise TypeError("it holds a camera")


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return compare([SlidingMode(), HierarchicalQP(), Half(), Failing()], SHORT, workers=0)


@pytest.fixture(scope="module")
def sliding() -> NotebookRun:
    return run(SHORT, SlidingMode())


def test_the_same_as_the_command_line(
    comparison: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    carried_out = comparisons.compare
    # in this process: that others come to the same is seen where the notebooks run
    monkeypatch.setattr(
        comparisons,
        "compare",
        lambda suite, out, **given: carried_out(suite, out, **(given | {"workers": 0})),
    )
    laws = ["--controller", "sliding-mode", "--controller", "hierarchical-qp"]
    scene = ["--scenario", "example-2d-fov", "--set", "scenario.duration=3.5"]
    done = CliRunner().invoke(
        app, ["compare", *scene, *laws, "--out", str(tmp_path), "--no-figures"]
    )
    assert done.exit_code == 0, done.output
    for name, columns in (
        ("results.csv", result_columns()),
        ("constraints.csv", constraint_columns()),
    ):
        own = getattr(comparison.stored, name.removesuffix(".csv"))
        kept = [column for column in columns if column not in ("suite", *timing_columns())]
        other = read_table(tmp_path / name, columns)
        names = {line["controller"] for line in other}
        assert names == {"tracking", "sliding-mode", "hierarchical-qp"}
        alike = [[str(line[key]) for key in kept] for line in own if line["controller"] in names]
        assert alike == [[str(line[key]) for key in kept] for line in other]


def test_a_comparison_is_tables_runs_and_figures(comparison: Comparison) -> None:
    results = comparison.results
    assert tuple(results.columns) == tuple(result_columns())
    assert tuple(comparison.constraints.columns) == tuple(constraint_columns())
    assert list(results["controller"]) == [
        "tracking",
        "sliding-mode",
        "hierarchical-qp",
        "half",
        "failing",
    ]
    assert comparison.to_dataframe() is results
    html = comparison._repr_html_()
    assert html.count("<tr>") == 1 + 4
    assert "<td>half</td>" in html
    assert MARKS in html  # the marks mean what they do in a report
    assert repr(comparison).startswith("<Comparison of 4 laws on 1 scenario, 1 trial: 0 of 4 runs")
    assert isinstance(comparison.plot().tracks(), Figure)
    assert len(comparison.plot().command().axes) == 4  # the failing law left nothing to draw
    with pytest.raises(ConfigurationError, match=r"unknown law 'halv'.*Did you mean 'half'"):
        comparison.run("halv")
    with pytest.raises(ConfigurationError, match="there is no trial 1"):
        comparison.run("half", trial=1)
    with pytest.raises(ConfigurationError, match=r"unknown scenario 'ur5-fov'"):
        comparison.plot("ur5-fov")


def test_which_scenario_is_asked_where_there_are_several() -> None:
    both = [
        Scenario.load(name).with_override("duration", 0.05)
        for name in ("example-2d-fov", "example-2d-fast")
    ]
    of_two = compare(SlidingMode(), both, workers=0, progress=False)
    assert of_two.run("sliding-mode", "example-2d-fast").scenario == "example-2d-fast"
    asked = "several scenarios were compared: name one of example-2d-fov, example-2d-fast"
    for ask in (of_two.plot, of_two.replay, lambda: of_two.run("sliding-mode")):
        with pytest.raises(ConfigurationError, match=asked):
            ask()
    with pytest.raises(
        ConfigurationError, match=r"unknown law 'sliding'.*Did you mean 'sliding-mode'"
    ):
        of_two.run("sliding")


def test_a_run_of_a_comparison_is_the_run_by_itself(
    comparison: Comparison, sliding: NotebookRun
) -> None:
    again = comparison.run("sliding-mode")
    assert np.array_equal(again.trajectory.q, sliding.trajectory.q)
    line = next(line for line in comparison.stored.results if line["controller"] == "sliding-mode")
    for one in (again, sliding):
        scores = one.scores()
        assert scores.keys() == set(result_columns()) - {"suite", "scenario", "controller", "trial"}
        for name, value in scores.items():
            if name in timing_columns():
                continue
            assert (
                value == pytest.approx(line[name], rel=1e-8, nan_ok=True)
                if value != line[name]
                else True
            ), name
        assert one.row_scores()["challenged"].to_dict() == {SINGLE: False, ROW: True}


def test_a_law_that_fails_costs_its_own_runs(comparison: Comparison) -> None:
    line = next(line for line in comparison.stored.results if line["controller"] == "failing")
    assert line["status"] == "failed"
    assert "RuntimeError: on purpose" in line["reason"]
    alone = run(SHORT, Failing())
    assert alone.scores()["status"] == "failed"
    assert "on purpose" in repr(alone)
    assert "on purpose" in alone._repr_html_()


class Quits(Tracking):
    """Ends the process: where it is asked, before, or where it is copied."""

    name = "quits"

    def __init__(self, where: str) -> None:
        super().__init__()
        self.where = where

    def solve(self, rows: Rows, task: Task) -> Command:
        if self.where == "solve":
            sys.exit("enough")
        return super().solve(rows, task)

    def reset(self, period: float | None = None) -> None:
        if self.where == "reset":
            sys.exit("enough")

    def __setstate__(self, state: dict[str, Any]) -> None:
        if state["where"] == "copy":
            sys.exit("enough")
        self.__dict__.update(state)


@pytest.mark.parametrize("where", ["solve", "reset"])
def test_a_law_that_ends_its_process_ends_its_run_alone(where: str) -> None:
    for scenario in ("example-2d-fov", Scenario.load("example-2d-fov").setup()):
        found = run(scenario, Quits(where))
        assert found.trajectory.status == "failed"
        assert "SystemExit: enough" in found.trajectory.reason
        assert "enough" in repr(found)
        assert "failed" in found._repr_html_()


def test_a_law_that_ends_its_process_where_it_is_copied_is_not_copied() -> None:
    _, (note,) = specs_of([Quits("copy")])
    assert "it cannot be sent to another one (SystemExit: enough)" in note


def test_a_run_as_a_data_frame(sliding: NotebookRun) -> None:
    frame = sliding.to_dataframe()
    run = sliding.trajectory
    assert frame.index.name == "t"
    assert np.array_equal(frame.index, run.t)
    assert np.array_equal(frame["q"].to_numpy(), run.q)
    assert np.array_equal(frame["qdd_command", "joint 3"], run.qdd_command[:, 2])
    assert np.array_equal(frame["phi", ROW], sliding.phi(ROW))
    assert np.array_equal(frame["active"].to_numpy(), run.active)
    assert np.array_equal(frame[["u_px", "v_px"]].to_numpy()[:, [1, 3]], run.features_px[:, 1])
    assert np.array_equal(frame["camera_error"].to_numpy(), run.camera_error)
    assert np.array_equal(frame["feature_error_px"].to_numpy().ravel(), run.feature_error_px)


def said(figure: Figure) -> set[str]:
    """All texts of a figure, labels of its axes among them."""
    return {text.get_text() for text in figure.findobj(Text)} - {""}


def test_a_run_draws_itself(sliding: NotebookRun) -> None:
    tracks = sliding.plot.tracks()
    drawn = [line.get_xydata() for line in tracks.axes[0].lines]
    for marker in range(2):
        assert any(
            np.array_equal(xy[-1:], sliding.trajectory.features_px[-1:, marker])
            for xy in drawn
            if len(xy)
        )
    picture, size = tracks._repr_png_()
    assert picture.startswith(b"\x89PNG")
    assert size["width"] == 800
    errors = sliding.plot.errors()
    command = sliding.plot.command()
    assert (len(errors.axes), len(command.axes)) == (2, 2)
    # each shows what it is called by, of all laws: not the other's
    assert "q̈ [rad/s²]" in said(command) - said(errors)
    assert "error" in " ".join(said(errors) - said(command))
    assert len(sliding.plot.rows().axes) == 2
    assert len(sliding.plot.rows(SINGLE, ROW).axes) == 3
    with pytest.raises(ConfigurationError, match=r"unknown row 'fov\[marker 3\]'.*Available"):
        sliding.plot.rows("fov[marker 3]")
    assert (
        repr(sliding.plot)
        == "<Plots of tracking, sliding-mode: tracks(), rows(), errors(), command()>"
    )


def test_a_run_shows_itself(sliding: NotebookRun) -> None:
    html = sliding._repr_html_()
    assert "data:image/png;base64," in html
    assert "<td>acceleration variation [rad/s³]</td>" in html
    assert len(html) < 150_000
    assert repr(sliding).startswith(
        "<Run of sliding-mode on example-2d-fov: unfinished (still moving"
    )


def test_a_setup_made_in_python_can_be_run_and_scored() -> None:
    made = run(SHORT.setup(), "sliding-mode")
    assert np.array_equal(made.trajectory.q, run(SHORT, SlidingMode()).trajectory.q)
    assert made.row_scores().loc[ROW, "challenged"]


def test_a_replay_shows_the_runs_that_are_asked_for(
    comparison: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is handed over; pages have tests of their own."""
    seen: list[Any] = []
    monkeypatch.setattr(replay, "replay_html", lambda runs: seen.append(runs) or "<p>a page</p>")
    monkeypatch.setattr(
        replay, "write_replay", lambda runs, path: Path(path).write_text(runs[0].law)
    )
    page = comparison.replay(["sliding-mode", "half"])
    assert [(one.law, one.title) for one in seen[0]] == [
        (law, SHORT.title) for law in ("sliding-mode", "half")
    ]
    assert "srcdoc=" in page._repr_html_()
    assert page.save(tmp_path / "one.html").read_text() == "<p>a page</p>"
    assert comparison.run("half").replay(path=tmp_path / "two.html").read_text() == "half"


@pytest.mark.parametrize("name", CONTROLLERS)
def test_shipped_laws_are_told_by_name_and_options(name: str) -> None:
    spec, note = spec_of(CONTROLLERS[name](), "mine")
    assert not note
    assert (spec.name, spec.law, dict(spec.options)) == ("mine", name, {})
    assert not isinstance(spec, InstanceSpec)


OPTIONS = (
    {"observer": 0.2},
    {"observer": 0.3, "dead_time": 0.01, "K": 2.0},
    {"command_delay": 0.03},
    {"command_delay": 0.03, "observer": 0.2},
)


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("options", OPTIONS)
def test_laws_behind_others_are_told_by_name_and_options(
    name: str, options: dict[str, Any]
) -> None:
    law = make_controller(name, options)
    spec, note = spec_of(law, "mine")
    assert not note
    assert (spec.name, spec.law, dict(spec.options)) == ("mine", name, options)
    made = spec.make()
    assert (repr(made), made.factors) == (repr(law), law.factors)
    law.law.solve = law.solve  # type: ignore[attr-defined]
    assert isinstance(spec_of(law)[0], InstanceSpec)


@given(
    rows=st.sampled_from(["barrier", "active"]),
    alpha=st.floats(0.1, 100.0),
    solver=st.sampled_from(["auto", "daqp", "osqp"]),
    weights=st.none()
    | st.dictionaries(st.sampled_from(["fov", "range"]), st.floats(0.1, 10.0), min_size=1),
)
@settings(max_examples=8)
def test_options_of_an_instance_are_those_of_the_law_that_is_made(
    rows: str, alpha: float, solver: str, weights: Any
):
    law = HierarchicalQP(rows=rows, alpha=alpha, solver=solver, weights=weights)
    spec, _ = spec_of(law)
    assert not isinstance(spec, InstanceSpec)
    assert repr(spec.make()) == repr(law)
    pair = CONTROLLERS["law"](demand="barrier", resolver="filter", alpha=alpha, solver=solver)
    spec, _ = spec_of(pair)
    assert spec.options["demand"] == "barrier"
    assert repr(spec.make()) == repr(pair)


def test_an_instance_is_copied_for_each_run() -> None:
    law = Half(share=0.25)
    spec, note = spec_of(law)
    assert not note
    made = spec.make()
    again = spec.make()
    assert made is not again
    assert made is not law
    assert made.share == 0.25
    assert spec.law == "test_notebooks:Half"
    assert spec.files == (Path(__file__),)
    assert spec.options != spec_of(Half(share=0.3))[0].options
    changed = SlidingMode()
    changed.solve = law.solve  # type: ignore[method-assign]
    assert isinstance(spec_of(changed)[0], InstanceSpec)


def test_a_law_that_cannot_be_copied_runs_here_and_that_is_said() -> None:
    with pytest.warns(
        UserWarning, match=r"closed runs in this process.*TypeError: it holds a camera"
    ):
        found = compare(Closed(), SHORT, workers=0)
    assert found.run("closed").trajectory.status == "unfinished"
    assert "closed runs in this process" in found._repr_html_()


def test_without_cloudpickle_a_law_of_the_session_runs_here(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mine = type("Mine", (Half,), {"__module__": "__main__", "name": "mine"})
    monkeypatch.setattr(sys.modules["__main__"], "Mine", mine, raising=False)
    assert not spec_of(mine())[1]
    monkeypatch.setattr(copies, "find_spec", lambda module: None)
    spec, note = spec_of(mine())
    assert spec.main_process_only
    assert "pip install 'vsconstraints[notebooks]'" in note
    assert not spec_of(Half())[1]


def test_bad_input_is_named() -> None:
    with pytest.raises(
        ConfigurationError, match="two laws have the name 'half'; give each its own"
    ):
        compare([Half(), Half(share=0.3)], SHORT)
    with pytest.raises(
        ConfigurationError,
        match=r"a law is a name, module:Class, or a class or an instance .* not 3",
    ):
        compare([3], SHORT)
    with pytest.raises(
        ConfigurationError, match=r"a class or an instance of a Controller, not <class .int.>"
    ):
        compare(int, SHORT)
    with pytest.raises(ConfigurationError, match=r"Needy\(\) cannot be made: .*strength"):
        compare(Needy, SHORT)
    with pytest.raises(
        ConfigurationError, match=r"unknown controller 'sliding'.*Did you mean 'sliding-mode'"
    ):
        compare("sliding", SHORT)
    with pytest.raises(ConfigurationError, match=r"unknown scenario 'ur5'.*Did you mean 'ur5-fov'"):
        compare(SlidingMode(), "ur5")
    with pytest.raises(
        ConfigurationError, match="a scenario is a name, a path, a Scenario or a Setup, not 5"
    ):
        compare(SlidingMode(), [5])
    with pytest.raises(ConfigurationError, match="2 trials of example-2d-fov would be identical"):
        compare(SlidingMode(), SHORT, trials=2)
    with pytest.raises(
        ConfigurationError, match="scenario 'example-2d-fov' appears more than once"
    ):
        compare(SlidingMode(), [SHORT, SHORT])
    with pytest.raises(ConfigurationError, match="has no controller: there is nothing to compare"):
        compare([], SHORT)
    nameless = type("Nameless", (Half,), {"name": None})
    with pytest.raises(ConfigurationError, match="Nameless has no name: write name"):
        specs_of([nameless()])
    with pytest.raises(AttributeError, match="no attribute 'comparee'"):
        _ = vsconstraints.comparee


def test_an_interrupt_is_heard_and_nothing_is_left(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Interrupted(Closed):
        name = "interrupted"

        def solve(self, rows: Rows, task: Task) -> Command:
            raise KeyboardInterrupt

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(KeyboardInterrupt), pytest.warns(UserWarning, match="in this process"):
        compare(Interrupted(), SHORT, workers=0)
    assert not list(tmp_path.iterdir())


def test_what_is_not_kept_goes_with_the_comparison(tmp_path: Path) -> None:
    brief = SHORT.with_override("duration", 0.2)
    found = compare("sliding-mode", brief, workers=0)
    folder = found.stored.folder
    assert folder.is_dir()
    del found
    gc.collect()
    assert not folder.exists()
    kept = compare({"mine": Half()}, brief, workers=0, out=tmp_path / "kept")
    assert Comparison.load(tmp_path / "kept").laws == kept.laws == ("tracking", "mine")


def test_how_far_a_comparison_is_is_told_in_a_terminal_alone(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    brief = SHORT.with_override("duration", 0.1)
    compare("sliding-mode", brief, workers=0)
    assert capfd.readouterr() == ("", "")
    terminal = StringIO()
    monkeypatch.setattr(
        session, "Console", lambda **given: Console(file=terminal, force_terminal=True, width=80)
    )
    compare("sliding-mode", brief, workers=0, progress=False)
    assert terminal.getvalue() == ""
    compare("sliding-mode", brief, workers=0)
    assert "2 of 2" in terminal.getvalue()
    assert capfd.readouterr() == ("", "")


def test_trials_differ(tmp_path: Path) -> None:
    varied = SHORT.with_override("duration", 0.2).with_override("start_deviation", 0.01)
    found = compare("sliding-mode", varied, trials=3, seed=4, workers=0)
    starts = [found.run("sliding-mode", trial=trial).trajectory.q[0] for trial in range(3)]
    assert np.array_equal(starts[1], run(varied, "sliding-mode", trial=1, seed=4).trajectory.q[0])
    assert not np.array_equal(starts[1], starts[2])


WHERE = """
import os

class Where(Controller):
    name = "where"

    def solve(self, rows, task):
        raise RuntimeError(f"process {os.getpid()}.")
"""

TOLD = """
scores = comparison.run("sliding").scores()
print(comparison.run("where").scores()["reason"].split("process ")[1].split(".")[0], os.getpid())
print(comparison.run("cautious").scores()["status"], scores["jerk_rms"], scores["utilization"])
"""

FORGET = """
for name in [name for name in globals() if not name.startswith("_") and name not in ("In", "Out", "get_ipython")]:
    del globals()[name]
"""


def test_the_notebooks_run() -> None:
    """One kernel for all, since a kernel takes seconds to start; names of one are gone before the
    next.
    """
    paths = sorted((ROOT / "notebooks").glob("*.ipynb"))
    assert len(paths) == 3
    whole = nbformat.v4.new_notebook()
    for path in paths:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        assert all(not cell.outputs and cell.execution_count is None for cell in code), (
            f"{path.name} has outputs"
        )
        if path.stem == "own-law":
            (asks,) = [cell for cell in code if "workers=2" in cell.source]
            asks.source = WHERE + asks.source.replace(
                "compare(\n    {", 'compare(\n    {"where": Where(), '
            )
            code.append(told := nbformat.v4.new_code_cell(TOLD))
        whole.cells += [*code, nbformat.v4.new_code_cell(FORGET)]
    NotebookClient(whole, timeout=300, kernel_name="python3").execute()
    (processes, scores) = told.outputs[0].text.splitlines()
    theirs, kernel = map(int, processes.split())
    assert theirs != kernel
    here = run("example-2d-fov", SlidingMode()).scores()
    assert scores == f"converged {here['jerk_rms']} {here['utilization']}"
    for cell in whole.cells:
        for output in cell.outputs:
            assert output.output_type != "error"
            expected = "a constraint or feature of it is defined in this session"
            assert (
                output.get("name") != "stderr"
                or expected in output.text
                or "compiling" in output.text
            ), output.text
    pictures = [o for cell in whole.cells for o in cell.outputs if "image/png" in o.get("data", {})]
    assert len(pictures) == 6
    # each comparison has told how far it is, and at the end that it is done
    lines = [
        o.data["text/plain"]
        for cell in whole.cells
        for o in cell.outputs
        if o.output_type == "display_data"
    ]
    counts = [re.match(r"comparing: (\d+) of (\d+) runs, \d+ s$", line) for line in lines]
    told_at_end = [(int(found[1]), int(found[2])) for found in counts if found]
    assert told_at_end
    assert all(done == total > 1 for done, total in told_at_end)


class Needy(Half):
    name = "needy"

    def __init__(self, strength: float) -> None:
        super().__init__(share=strength)


def test_a_law_is_the_same_by_name_by_class_and_as_an_instance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mylaw.py").write_text(
        "from vsconstraints.controllers import SlidingMode\n\n\n"
        'class Law(SlidingMode):\n    """One of one\'s own."""\n\n    name = "own"\n'
    )
    for law in ("sliding-mode", SlidingMode, SlidingMode()):
        assert spec_of(law)[0] == ControllerSpec("sliding-mode")
    assert spec_of("mylaw:Law")[0].name == "own"
    found = compare(["mylaw:Law", SlidingMode], SHORT, workers=0, progress=False)
    assert found.laws == ("tracking", "own", "sliding-mode")
    first, second = (found.run(law).trajectory for law in ("own", "sliding-mode"))
    np.testing.assert_array_equal(first.q, second.q)
    np.testing.assert_array_equal(run(SHORT, "mylaw:Law").trajectory.q, first.q)
    np.testing.assert_array_equal(run(SHORT, SlidingMode).trajectory.q, first.q)


def test_setups_made_in_python_are_compared() -> None:
    setup = SHORT.setup()
    with pytest.warns(UserWarning, match="runs in this process"):
        found = compare([SlidingMode()], setup, progress=False)
    (name,) = found.scenarios
    by_file = compare([SlidingMode()], SHORT, progress=False)
    np.testing.assert_array_equal(
        found.run("sliding-mode").trajectory.q, by_file.run("sliding-mode").trajectory.q
    )
    assert found.plot(name).rows() is not None
    with pytest.raises(ConfigurationError, match="is a Setup, which has one trial"):
        compare([SlidingMode()], setup, trials=2)  # before any warning


@pytest.mark.usefixtures("in_this_process")
def test_a_law_of_ones_own_is_named_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ownlaw.py").write_text(
        "from vsconstraints.controllers import SlidingMode\n\n\n"
        'class Law(SlidingMode):\n    """One of one\'s own."""\n\n    name = "own law"\n'
    )
    chosen = [
        "--scenario",
        "example-2d-fov",
        "--set",
        "scenario.duration=1.0",
        "--no-figures",
        "--out",
        "out",
    ]
    said = CliRunner().invoke(app, ["compare", "--controller", "ownlaw:Law", *chosen])
    assert said.exit_code == 0, said.output
    lines = read_table(tmp_path / "out" / "results.csv", result_columns())
    assert {line["controller"] for line in lines} == {"tracking", "own law"}
    said = CliRunner().invoke(
        app,
        [
            "run",
            "ur5-fov",
            "--controller",
            "ownlaw:Law",
            "--set",
            "scenario.duration=0.1",
            "--no-figures",
            "--out",
            "arm",
        ],
    )
    assert said.exit_code == 0, said.output
    said = CliRunner().invoke(app, ["compare", "--controller", "ownlaw:Lav", *chosen])
    assert "ownlaw has no Controller named 'Lav'" in str(said.exception)
