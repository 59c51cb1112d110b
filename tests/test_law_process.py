"""A custom law changes neither the runs of others nor its own scores, and its motion follows from
its commands.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vsconstraints.bench.evidence import Campaign, Evidence, Plan, collect, processes
from vsconstraints.comparisons import Suite, compare
from vsconstraints.comparisons.metrics import timing_columns
from vsconstraints.comparisons.run import Run, perform
from vsconstraints.comparisons.runs import law_process
from vsconstraints.comparisons.runs.law_process import (
    LawFailedError,
    LawProcessLostError,
    LawRun,
    end_law_processes,
)
from vsconstraints.comparisons.runs.pool import (
    DIED,
    MAX_PLAIN_LENGTH,
    Failure,
    Pool,
    unpacked_plain,
)
from vsconstraints.comparisons.runs.spec import ControllerSpec, RunSpec
from vsconstraints.errors import MAX_REASON_LENGTH, VsconstraintsError
from vsconstraints.plugins.provenance import noted
from vsconstraints.simulation import simulate
from vsconstraints.simulation.recorded import Recorded, replay

LAWS = '''
import ctypes
import os
from pathlib import Path

import numpy as np

from vsconstraints.controllers import HierarchicalQP, SlidingMode
from vsconstraints.rows import Command


def change_everything():
    """What judges, scores and moves the arm, and how the processor rounds."""
    from vsconstraints.comparisons import metrics, record
    from vsconstraints.simulation import loop

    loop.judge = lambda *arguments: ("converged", "")
    loop.intersample_clearance = lambda setup, world, plant, states, clearance: np.full(clearance.shape, np.inf)
    record.RunRecord.failed = None
    metrics.MetricInputs.utilization = lambda self: 1.0
    ctypes.CDLL(None).fesetround(0x800)  # upwards, on x86-64


class Cheat(SlidingMode):
    """Stands still and changes everything while it is made, reset and asked."""

    name = "cheat"

    def __init__(self):
        super().__init__()
        change_everything()

    def solve(self, rows, task):
        change_everything()
        return Command(np.zeros(task.J.shape[1]), "ok", np.zeros(len(rows.labels), dtype=bool), rows.labels)


class Honest(HierarchicalQP):
    """Compiled as the law that it is derived from."""

    name = "honest"


class Python(SlidingMode):
    """Asked in Python."""

    name = "python"

    def solve(self, rows, task):
        return super().solve(rows, task)


class Raises(SlidingMode):
    name = "raises"
    calls = 0

    def solve(self, rows, task):
        self.calls += 1
        if self.calls > 20:
            raise RuntimeError("on purpose")
        return super().solve(rows, task)


class Fails(SlidingMode):
    name = "fails"
    calls = 0

    def solve(self, rows, task):
        self.calls += 1
        if self.calls > 20:
            command = super().solve(rows, task)
            return Command(command.qdd, "failed", command.acted, rows.labels, reason="it had enough")
        return super().solve(rows, task)


class Dies(SlidingMode):
    name = "dies"

    def solve(self, rows, task):
        os._exit(3)


class NotMade(SlidingMode):
    name = "not-made"

    def __init__(self):
        raise ValueError("on purpose")


class Reads(SlidingMode):
    name = "reads"

    def __init__(self):
        super().__init__()
        Path(__file__).with_name("gains.json").read_text()
'''


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("laws")
    (folder / "laws_apart.py").write_text(LAWS)
    yield folder
    end_law_processes()


def spec(
    folder: Path, law: str, scenario: str = "example-2d-fov", duration: float = 1.0
) -> RunSpec:
    controller = ControllerSpec(law.lower(), f"laws_apart:{law}", folder=folder)
    return RunSpec(scenario, controller, {"duration": duration})


def same_runs(one: Run, other: Run, but: tuple[str, ...] = ("rows_time", "step_time")) -> None:
    for name, value in vars(one.trajectory).items():
        if name not in but:
            np.testing.assert_equal(getattr(other.trajectory, name), value, err_msg=name)


@pytest.mark.parametrize("by_public_call", [True, False])
@pytest.mark.parametrize("law", ["Honest", "Python", "Raises", "Fails"])
@pytest.mark.parametrize("scenario", ["example-2d-fov", "moving-target-unknown"])
def test_a_run_apart_is_bit_for_bit_that_in_one_process(
    scenario: str, law: str, by_public_call: bool, folder: Path
) -> None:
    asked = spec(folder, law, scenario)
    together = perform(asked, by_public_call=by_public_call, to_the_goal=True)
    apart = perform(asked, by_public_call=by_public_call, to_the_goal=True, in_own_process=True)
    same_runs(together, apart)
    assert len(apart.trajectory.step_time) == len(apart.trajectory.t) > 0


def test_what_a_law_changes_in_its_process_does_not_change_its_motion_and_scores(
    folder: Path,
) -> None:
    run = perform(spec(folder, "Cheat"), in_own_process=True)
    still = np.broadcast_to(run.setup.q0, run.trajectory.q.shape)
    np.testing.assert_allclose(run.trajectory.q, still, atol=1e-12)
    assert run.trajectory.status not in ("converged", "failed")
    assert np.isfinite(run.trajectory.between_clearance[run.trajectory.clearance < 0.0]).all()


def test_no_other_run_of_a_campaign_depends_on_a_law_that_changes_everything(
    folder: Path, tmp_path: Path
) -> None:
    """The law is not made in this process, which goes on with other tests."""
    shipped = Campaign.load(None).select(
        families=["planar-arm"],
        controllers=["sliding-mode", "hierarchical-qp"],
        scenes=2,
        settings=["conditions=['nominal', 'disturbed']"],
    )
    tracking, *others = shipped.controllers
    cheat = ControllerSpec("cheat", "laws_apart:Cheat", folder=folder)
    with_cheat = replace(shipped, controllers=(tracking, cheat, *others))
    tables = []
    for name, campaign in (("alone", shipped), ("beside", with_cheat)):
        collect(campaign, tmp_path / name, Plan(workers=processes(1)))
        tables.append(Evidence.load(tmp_path / name).runs.drop(columns=list(timing_columns())))
    alone, beside = tables
    own = beside[beside["controller"] == "cheat"]
    assert len(own) == 4
    assert not own["status"].isin(["converged", "failed"]).any()
    unchanged = beside[beside["controller"] != "cheat"].reset_index(drop=True)
    for column in alone:
        assert unchanged[column].astype(object).equals(alone[column].astype(object)), column


def test_no_other_run_of_a_comparison_depends_on_a_law_that_changes_everything(
    folder: Path, tmp_path: Path
) -> None:
    file = folder / "alone.toml"
    file.write_text('scenarios = ["example-2d-fov"]\n[controllers.sliding-mode]\n')
    shipped = Suite.load(file).select(settings=["scenario.duration=1.0"]).with_baseline()
    tracking, *others = shipped.controllers
    cheat = ControllerSpec("cheat", "laws_apart:Cheat", folder=folder)
    with_cheat = replace(shipped, controllers=(tracking, cheat, *others))
    scores: list[dict[str, Any]] = []
    for name, suite in (("alone", shipped), ("beside", with_cheat)):
        finished = compare(suite, tmp_path / name, workers=1)
        scores.append({key[1]: score.result for key, score in finished.scores.items()})
    alone, beside = scores
    assert beside["cheat"]["status"] not in ("converged", "failed")
    for law in ("tracking", "sliding-mode"):
        for column, value in alone[law].items():
            if column not in timing_columns():
                np.testing.assert_equal(beside[law][column], value, err_msg=f"{law}, {column}")


def test_a_law_that_cannot_be_made_or_ends_its_process_costs_its_own_run(folder: Path) -> None:
    with pytest.raises(LawFailedError, match="on purpose"):
        perform(spec(folder, "NotMade"), in_own_process=True)
    with pytest.raises(LawFailedError, match=DIED):
        perform(spec(folder, "Dies"), in_own_process=True)
    assert perform(spec(folder, "Honest"), in_own_process=True).trajectory.status != "failed"


@pytest.mark.parametrize(
    ("error", "raised"),
    [
        (VsconstraintsError("5 processes in a row ended"), LawProcessLostError),
        (BlockingIOError(11, "no more processes"), LawProcessLostError),
        (KeyboardInterrupt(), KeyboardInterrupt),
    ],
)
def test_a_process_that_cannot_be_asked_is_not_asked_again_and_says_nothing_of_its_law(
    error: BaseException,
    raised: type[BaseException],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    end_law_processes()

    def run(self: Any, run: LawRun) -> None:
        raise error

    monkeypatch.setattr(law_process.LawProcess, "run", run)
    asked = spec(folder, "Honest")
    with pytest.raises(raised):
        law_process.simulate_law(LawRun(asked, in_own_process=True), asked.load().setup())
    assert not law_process.law_processes


def test_what_a_law_reads_in_its_process_is_part_of_what_its_run_is_made_from(
    folder: Path, tmp_path: Path
) -> None:
    gains = folder / "gains.json"
    gains.write_text("1")
    file = folder / "reads.toml"
    file.write_text(
        'scenarios = ["example-2d-fov"]\n[controllers.reads]\ntype = "laws_apart:Reads"\n'
    )
    suite = Suite.load(file).select(settings=["scenario.duration=0.1"])
    stored = [compare(suite, tmp_path, workers=1).stored_before for _ in range(2)]
    gains.write_text("2")
    stored.append(compare(suite, tmp_path, workers=1).stored_before)
    assert stored == [0, 2, 1]


def test_commands_that_end_before_the_run_does_make_it_fail(folder: Path) -> None:
    setup = RunSpec("example-2d-fov", overrides={"duration": 0.1}).load().setup()
    law = ControllerSpec("sliding-mode")
    values = Recorded.of(setup, law.make()).plain()
    values["qdd"] = values["qdd"][: 10 * 8 * setup.scene.robot.n]
    values["rows_time"] = values["step_time"] = values["rows_time"][:80]
    trajectory = replay(setup, Recorded.from_plain(values, setup.scene.robot.n))
    assert trajectory.status == "failed"
    assert "gave no further commands" in trajectory.reason
    whole = simulate(setup, law.make())
    np.testing.assert_array_equal(trajectory.q, whole.q[:10])


@pytest.mark.parametrize(
    "change",
    [
        {"qdd": np.full(2, np.nan).tobytes()},
        {"qdd": [1.0, 2.0]},
        {"step_time": b""},
        {"ended": "converged"},
        {"qdd": b"1234567"},
    ],
)
def test_what_is_no_recording_is_refused(change: dict[str, Any]) -> None:
    time = np.zeros(1).tobytes()
    values = {
        "qdd": np.zeros(2).tobytes(), "ended": "", "reason": "", "remarks": (), "rows_time": time, "step_time": time,
        "fallbacks": 0, "compiled": False, "speeds": False,
    }  # fmt: skip
    assert len(Recorded.from_plain(values, 2).qdd) == 1
    with pytest.raises((ValueError, TypeError)):
        Recorded.from_plain({**values, **change}, 2)


@pytest.mark.parametrize(
    "files",
    [
        {"gains.json": ""},
        {"/gains\0.json": ""},
        {"/gains.json": "0123"},
        {"/gains.json": 1},
        {f"/{number}": "" for number in range(law_process.MAX_FILES + 1)},
        ["/gains.json"],
    ],
    ids=["relative path", "null byte", "no hash", "number", "too many", "list"],
)
def test_files_that_cannot_be_those_of_a_law_cost_its_own_run(
    files: object, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = spec(folder, "Honest")
    setup = asked.load().setup()
    monkeypatch.setattr(
        law_process, "ask_law", lambda run: {"files": files, "failed": "its reason"}
    )
    with noted() as files_of_results, pytest.raises(LawFailedError, match="cannot be used"):
        law_process.simulate_law(LawRun(asked, in_own_process=True), setup)
    assert not {*files_of_results} & {*files}  # type: ignore[misc]


class Bomb:
    """Runs code where it is read."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> Any:
        return Path.touch, (self.file,)


def bomb(file: Path) -> Bomb:
    return Bomb(file)


def test_no_code_is_run_to_read_the_answer_of_a_process_that_is_not_trusted(tmp_path: Path) -> None:
    pickle.loads(pickle.dumps(Bomb(tmp_path / "any")))
    assert (tmp_path / "any").exists()
    with Pool(bomb, 1, plain=True) as pool:
        ((_, answer),) = pool.run({0: (tmp_path / "bomb",)})
    assert isinstance(answer, Failure)
    assert "cannot be sent" in answer.reason
    # as a process sends it that writes to its connection itself
    read = unpacked_plain(pickle.dumps(Bomb(tmp_path / "bomb")))
    assert isinstance(read, Failure)
    assert "cannot be read" in read.reason
    assert not (tmp_path / "bomb").exists()


def long_reason() -> None:
    raise ValueError("x" * 10**6)


def long_answer() -> bytes:
    return bytes(MAX_PLAIN_LENGTH)


def surrogate() -> None:
    raise ValueError("\udcff")


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (long_reason, "ValueError: xxx"),
        (long_answer, "is longer than"),
        (surrogate, "ValueError: ?"),
    ],
)
def test_what_a_process_that_is_not_trusted_may_send_is_bounded(
    function: Callable[[], Any], reason: str
) -> None:
    with Pool(function, 1, plain=True) as pool:
        ((_, answer),) = pool.run({0: ()})
    assert type(answer) is Failure
    assert reason in answer.reason
    assert len(answer.reason) <= MAX_REASON_LENGTH
    assert vars(answer) == {"reason": answer.reason}


def test_settings_of_a_law_share_its_process(folder: Path) -> None:
    end_law_processes()
    for name, alpha in (("slow", 2.0), ("fast", 40.0)):
        controller = ControllerSpec(name, "laws_apart:Honest", {"alpha": alpha}, folder)
        perform(RunSpec("example-2d-fov", controller, {"duration": 0.02}), in_own_process=True)
    assert len(law_process.law_processes) == 1
