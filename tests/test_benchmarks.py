"""The benchmark measures what it says: every part in a tiny form, and its independent transcription
of the paper.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks import growth, own, targets, timing
from benchmarks.__main__ import PARTS, main, run
from benchmarks.appendix_b import AppendixB
from benchmarks.forms import three_active
from benchmarks.part import FULL, QUICK, TINY, Part, digits
from benchmarks.report import write
from benchmarks.steps import Walk

from vsconstraints.compiled import available
from vsconstraints.constraints import ConstraintSet
from vsconstraints.control import ControlStep
from vsconstraints.controllers import PredictiveControl, SlidingMode
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import simulate
from vsconstraints.vision.scene import Scene

ROOT = Path(__file__).resolve().parent.parent


def test_appendix_b_agrees_with_the_sliding_mode_on_the_case_study():
    """Written on its own, from the paper: the whole step, from joint coordinates to
    accelerations.
    """
    # line 2 of Appendix B takes ṡ from differences, as line 5 does J̇_s
    scenario = Scenario.load("case-study-6r").with_override("task.velocity", "differences")
    run = simulate(scenario.setup(), SlidingMode())
    assert run.status == "converged"
    assert run.active.any(axis=0).sum() >= 3
    law = AppendixB(scenario.tables)
    found = np.array([law.step(*state) for state in zip(run.t, run.q, run.qd, strict=True)])
    scale = np.maximum(1.0, np.abs(run.qdd_command).max(axis=1))
    assert (np.abs(found - run.qdd_command).max(axis=1) / scale).max() < 1e-9


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """Every part in its tiny form, and the report of all."""
    parts, failures = run(list(PARTS), TINY)
    folder = tmp_path_factory.mktemp("benchmarks")
    return parts, failures, write(parts, failures, folder, "python -m benchmarks", 1.0)


def test_laws_that_look_ahead_are_timed_at_consecutive_samples_and_others_along_the_whole_run():
    """Asked elsewhere than where its last plan leads, a law would compute what it never does in a
    loop.
    """
    setup = Scenario.load("case-study-6r").with_override("duration", 0.5).setup()
    run = simulate(setup, SlidingMode())
    ahead, alone = (Walk(setup, law, run, 20) for law in (PredictiveControl(), SlidingMode()))
    assert list(ahead.places) == list(range(20))
    assert alone.places[-1] == len(run.t) - 1


def test_every_part_runs(tiny):
    parts, failures, _ = tiny
    assert failures == {}
    assert list(parts) == list(PARTS)


@pytest.mark.parametrize("name", PARTS)
def test_numbers_are_sane(tiny, name):
    part = tiny[0][name]
    assert part.title
    for key, value in part.numbers.items():
        assert math.isfinite(value) or "slope" in key, key
        # differences may have either sign
        if "slope" not in key and "extra" not in key:
            assert value > 0.0, key
    for table in part.tables:
        assert table.lines
        assert {len(line) for line in table.lines} == {len(table.header)}


def test_report_has_every_table_and_figure(tiny):
    parts, _, report = tiny
    text = report.read_text(encoding="utf-8")
    for part in parts.values():
        assert f"## {part.title}" in text
        if part.figure:
            assert (report.parent / "benchmarks" / part.figure).stat().st_size > 1000
    for target in targets.TARGETS:
        assert target.what in text
    stored = json.loads((report.parent / "benchmarks" / "numbers.json").read_text(encoding="utf-8"))
    assert set(stored) == set(PARTS)


def test_targets_name_numbers_that_there_are(tiny):
    """A verdict "not measured" is for what a shorter form leaves out, never for a misspelt name."""
    left_out = {"comparison", "first"} if available() else {"comparison", "first", "own"}
    for target in targets.TARGETS:
        if target.part not in left_out:
            assert target.number in tiny[0][target.part].numbers, target


def test_rows_between_tracking_and_command_are_the_scenarios(tiny):
    lines = tiny[0]["steps"].tables[0].lines
    assert {line[1] for line in lines} >= {
        "tracking",
        "sliding-mode",
        "potential-field",
        "hierarchical-qp",
    }
    assert {(line[0], line[3]) for line in lines} == {
        ("case-study-6r", "9"),
        ("ur5-fov", "28"),
        ("panda-fov", "32"),
    }
    if available():
        assert {line[2] for line in lines} == {"compiled"}


def test_forms_of_effort():
    assert FULL.scenarios == shipped_scenarios()
    assert set(QUICK.scenarios) <= set(FULL.scenarios)
    assert (FULL.markers[0], FULL.markers[-1]) == (4, 400)
    assert (FULL.rows[0], FULL.rows[-1]) == (10, 1000)
    assert (FULL.joints[0], FULL.joints[-1]) == (3, 30)


def test_three_rows_are_active():
    setup = Scenario.load("case-study-6r").with_override("duration", 1.5).setup()
    rows, task, _ = three_active(setup, simulate(setup, SlidingMode()))
    command = SlidingMode().command(rows, task)
    assert command.status == "ok"
    assert len(command.active) == 3


@pytest.mark.parametrize("make", [growth.with_markers, growth.with_joints])
@pytest.mark.parametrize("size", [4, 9])
def test_growth_measures_steps_with_an_active_row(make, size):
    for name, step in make(size).items():
        _, command = step()
        assert command.status == "ok", name
        assert command.active == ("fov[marker 1]",), name


def test_growth_measures_commands_that_three_rows_resist():
    for name, command in growth.with_rows(50).items():
        answer = command()
        assert answer.status == "ok", name
        if name != "potential-field":
            assert set(answer.active) <= {"row 0", "row 1", "row 2"}, name
            assert answer.active, name


def test_slope_of_known_growth():
    slope, last = growth.slopes({10: 2.0, 100: 20.0, 1000: 2000.0})
    assert last == pytest.approx(2.0)
    assert slope == pytest.approx(1.5)


def test_times():
    times = timing.Times(np.array([1.0, 2.0, 3.0, 10.0]), 0.5)
    assert (times.median, times.max, times.ratio) == (2.5, 10.0, 5.0)
    assert times.spread == pytest.approx(times.p99 / 2.5)


def test_subjects_take_turns():
    calls = []
    timing.compare({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 2)
    assert "".join(calls) == "ab" * 3


def test_a_part_that_fails_costs_its_own_lines_alone(tmp_path, monkeypatch, capsys):
    def broken(effort):
        raise ValueError("no such thing")

    monkeypatch.setitem(PARTS, "growth", broken)
    monkeypatch.setitem(PARTS, "steps", lambda effort: Part("Steps", "text"))
    assert main(["--quick", "--part", "growth", "--part", "steps", "--out", str(tmp_path)]) == 1
    text = (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
    assert "growth: ValueError: no such thing" in text
    assert "## Steps" in text
    assert "growth: ValueError" in capsys.readouterr().err


def test_a_missing_peer_is_named(monkeypatch):
    from benchmarks import beside_peers

    monkeypatch.setattr(sys, "executable", "/no/such/python")
    monkeypatch.setenv(beside_peers.PYTHON, "/nor/this/python")
    with pytest.raises(RuntimeError, match=r"No such file.*; .*No such file"):
        beside_peers.peer("pink", 1)


@pytest.mark.parametrize(
    ("value", "text"), [(0.25, "0.250"), (12.345, "12.3"), (99.96, "100"), (math.nan, "–")]
)
def test_digits(value, text):
    assert digits(value) == text


@pytest.mark.parametrize(
    ("noise", "spread", "verdict"),
    [(1.2, 2.0, "met"), (1.2, 4.0, "**not met**"), (3.0, 4.0, "not judged")],
)
def test_verdicts_on_tails_need_an_idle_machine(noise, spread, verdict):
    part = Part("", "", numbers={"unit: p99/median": noise, "greatest p99/median": spread})
    line = next(
        line
        for line in targets.judged({"steps": part}).lines
        if line[0] == "p99 / median, every law and scenario"
    )
    assert line[4].startswith(verdict)


def test_times_stand_beside_ratios():
    part = Part(
        "",
        "",
        numbers={
            "case-study-6r, sliding-mode: ratio": 0.27,
            "case-study-6r, sliding-mode: median": 5.3e-6,
        },
    )
    line = next(iter(targets.judged({"steps": part}).lines))
    assert line[1:] == ["0.22", "0.270", "5.30", "**not met**"]


def test_own_constraints_are_the_built_in_ones():
    """What is compared costs differently, and does the same."""
    setup = Scenario.load("ur5-fov").setup()
    q = setup.q0
    qd = np.full(6, 0.1)
    for constraints in own.pairs().values():
        found = []
        for constraint in constraints.values():
            scene = Scene(
                setup.scene.robot, setup.scene.camera, setup.scene.markers, constraint.points
            )
            rows = (
                ControlStep(scene, ConstraintSet([constraint], scene), setup.task)
                .evaluate(0.0, q, qd)
                .rows
            )
            found.append((rows.phi, rows.Lg, rows.Lf))
        for others in found[1:]:
            for value, definition in zip(others, found[0], strict=True):
                np.testing.assert_allclose(value, definition, rtol=1e-5, atol=1e-7)
