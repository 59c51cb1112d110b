"""The comparison of stacks: gains with one meaning, the choice of gains, and the kept numbers."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from checks import stacks, stacks_page
from checks.stacks import Gains, Task, chosen, grid, with_gains

from vsconstraints.bench.evidence import Campaign
from vsconstraints.comparisons.runs.spec import BASELINE, ControllerSpec, stack_law
from vsconstraints.errors import ConfigurationError
from vsconstraints.simulation import simulate
from vsconstraints.stacks import external

ENTRIES = {
    each.name: each for each in Campaign.load(stacks.SUITE).controllers if each.name != BASELINE
}


@pytest.mark.parametrize("gain", stacks.GAINS)
def test_the_slower_rate_of_a_second_order_task_is_the_gain(gain: float) -> None:
    law, scene = with_gains(ENTRIES["hierarchical-qp"], Gains(gain, 2.0))
    assert "gain" not in law.options
    tsid, _ = with_gains(ENTRIES["tsid"], Gains(gain, np.nan))
    default_damping = 3.0 * np.sqrt(scene["task.Kp0"])
    for stiffness, damping in (
        (scene["task.Kp0"], default_damping),
        (tsid.options["stiffness"], tsid.options["damping"]),
    ):
        rates = np.roots([1.0, damping, stiffness])
        assert max(rates) == pytest.approx(-gain)


def test_the_gain_of_the_image_is_the_rate_of_the_rows() -> None:
    """A velocity that approaches the edge at exactly α times the distance is just allowed."""
    law, _ = with_gains(ENTRIES["velocity-qp"], Gains(1.5, 8.0))
    factor = law.options["K"]["fov"]
    assert 1.0 / (factor * stacks.SCENE_K) == pytest.approx(8.0)
    for family in Campaign.load(stacks.SUITE).families:
        assert family.tables["constraints"][0]["K"] == stacks.SCENE_K
        assert family.tables["arm"] == {"command": "velocity", "lag": 0.02}
    damper, _ = with_gains(ENTRIES["velocity-damper"], Gains(1.5, 8.0))
    assert damper.options["speed"] / damper.options["influence"] == pytest.approx(8.0)


def test_every_entry_has_the_same_gains_and_can_be_made() -> None:
    for entry in ENTRIES.values():
        tried = grid(entry)
        assert {gains.task for gains in tried} == set(stacks.GAINS)
        views = {gains.view for gains in tried if not np.isnan(gains.view)}
        assert views == (set() if entry.name in stacks_page.BLIND else set(stacks.VIEW_GAINS))
        assert len(tried) == len(stacks.GAINS) * max(len(views), 1)
        for gains in tried:
            with_gains(entry, gains)[0].make()


def line(gain: str, view: str, status: str, time: float, margin: float) -> dict[str, Any]:
    key = ("ur5", "limit-8", "training", "0", "mine", gain, view)
    return {"key": key, "status": status, "settling_time_s": time, "margin_px": margin}


def test_gains_are_chosen_by_successes_then_time_then_margin() -> None:
    slow = [line("1", "2", "converged", 5.0, 10.0), line("1", "2", "converged", 6.0, 1.0)]
    fast = [line("3", "2", "converged", 2.0, 5.0), line("3", "2", "converged", 2.0, -0.1)]
    faster = [line("2", "2", "converged", 3.0, 0.0), line("2", "2", "converged", 3.5, 4.0)]
    assert chosen([*slow, *fast]) == (1.0, 2.0)
    assert chosen([*slow, *fast, *faster]) == (2.0, 2.0)
    deep = [line("1", "2", "converged", 1.0, -9.0), line("1", "2", "failed", np.nan, np.nan)]
    less = [line("2", "2", "slow", np.nan, -3.0), line("2", "2", "slow", np.nan, -2.0)]
    assert chosen([*deep, *less]) == (2.0, 2.0)


def test_a_marker_outside_the_image_is_no_success() -> None:
    """Without the rows of the image the velocity QP loses the markers that it keeps with them."""
    scene = stacks.scenes_of("ur5", "training", 1)[0]
    blind = ControllerSpec("blind", "resolved-rate")
    lines = {
        entry.name: stacks.run(Task(scene, "limit-40", entry, Gains(3.0, 8.0)))
        for entry in (ENTRIES["velocity-qp"], blind)
    }
    assert stacks.score_of(lines["velocity-qp"])[0]
    assert not stacks.score_of(lines["blind"])[0]
    setup = stacks.setup_of(scene, "limit-40", {})
    run = simulate(setup, with_gains(blind, Gains(3.0, 8.0))[0].make())
    u, v = np.abs(run.features_px[..., 0]).max(), np.abs(run.features_px[..., 1]).max()
    assert lines["blind"]["margin_px"] == pytest.approx(min(320.0 - u, 240.0 - v))


def test_runs_that_are_interrupted_are_kept(tmp_path: Path) -> None:
    journal = stacks.Journal(tmp_path)
    first = line("1", "2", "converged", 5.0, 10.0)
    journal.add(first)
    with (tmp_path / "runs.jsonl").open("a", encoding="utf-8") as file:
        file.write('{"key": ["ur5", "lim')
    again = stacks.Journal(tmp_path)
    assert list(again.lines) == [first["key"]]
    again.add(line("2", "2", "converged", 5.0, 10.0))
    assert len(stacks.Journal(tmp_path).lines) == 2


def test_runs_of_another_code_or_scene_are_not_continued(tmp_path: Path) -> None:
    made_of = stacks.depends_on()
    for _ in range(2):
        stacks.Journal(tmp_path, made_of).add(line("1", "2", "converged", 5.0, 10.0))
    made_of["families"]["ur5"]["tables"]["duration"] = 99.0
    with pytest.raises(ConfigurationError, match=r"families\.ur5\.tables\.duration"):
        stacks.Journal(tmp_path, made_of)


def test_late_runs_are_made_once_more_and_then_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sentence is that of a stack that does not answer in time."""
    sleeping = [sys.executable, "-c", "import time; time.sleep(9.0)"]
    monkeypatch.setattr(external, "START_LIMIT", 0.2)
    scene = stacks.scenes_of("ur5", "training", 1)[0]
    calls = []

    def run(task: Task) -> dict[str, Any]:
        calls.append(task.entry.name)
        return made(task)

    made = stacks.run
    monkeypatch.setattr(stacks, "run", run)
    entries = [ENTRIES["velocity-qp"], ControllerSpec("late", stack_law(), {"command": sleeping})]
    tasks = [Task(scene, "limit-40", entry, Gains(3.0, 8.0)) for entry in entries]
    journal = stacks.Journal(tmp_path)
    with ThreadPoolExecutor(1) as workers:
        stacks.finish(tasks, journal, workers, "test")
    assert calls == ["velocity-qp", "late", "late"]
    assert [journal.lines[task.key]["status"] for task in tasks] == ["converged", "failed"]


# --- kept numbers ---


def test_page_and_readme_have_the_kept_numbers() -> None:
    for page, name, made in stacks_page.parts(stacks_page.load()):
        _, there, _ = stacks_page.part_of(page, name)
        assert there.strip() == made.strip(), name


def test_the_kept_choice_follows_from_the_kept_training_runs() -> None:
    runs = stacks_page.load()
    for (*_, name), own in runs.groupby(["family", "condition", "controller"]):
        training = own[own["half"] == "training"].to_dict("records")
        for each in training:
            each["key"] = (f"{each['gain']:g}", f"{each['view_gain']:g}")
        gains = chosen(training)
        tests = own[own["half"] == "held-out"]
        assert set(tests["gain"]) == {gains.task}, name
        assert np.isnan(gains.view) or set(tests["view_gain"]) == {gains.view}, name
        success = (own["status"] == "converged") & (own["margin_px"] >= 0.0)
        assert (success == own["success"]).all()
