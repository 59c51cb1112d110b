"""A track in which time passes: call times that are stated, measured, and those that results were
made with.
"""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from campaigns import campaign
from test_evidence import HERE, here
from vsconstraints.bench.evidence import (
    MEASURED,
    CallTimes,
    Campaign,
    Evidence,
    call_times,
    collect,
    work,
)
from vsconstraints.bench.evidence.call_times import time_calls
from vsconstraints.bench.evidence.work import plan_batches
from vsconstraints.cli import app
from vsconstraints.comparisons.runs.pool import Failure
from vsconstraints.comparisons.runs.spec import AS_THE_SCENE, RunTiming
from vsconstraints.errors import ConfigurationError, InvalidInput

ROOT = Path(__file__).parent.parent
TUNED = '[controllers.qp-tuned]\ntype = "hierarchical-qp"\nalpha = 9.0\n'
STATED = CallTimes({"sliding-mode": 0.5, "hierarchical-qp": 2.0}, 1e-4)


def timing(timed: Campaign) -> dict[str, RunTiming]:
    return {entry.name: entry.run for entry in timed.controllers}


def test_laws_are_late_by_what_is_stated_of_them_or_of_their_type(tmp_path: Path) -> None:
    timed = STATED.of(campaign(tmp_path, TUNED))
    assert timing(timed) == {
        "tracking": AS_THE_SCENE,
        "sliding-mode": RunTiming(call_time=5e-5),
        "hierarchical-qp": RunTiming(call_time=2e-4),
        "qp-tuned": RunTiming(call_time=2e-4),
    }
    own = CallTimes({**STATED.calls, "qp-tuned": 3.0}, 1e-4, slower=20.0).of(
        campaign(tmp_path, TUNED)
    )
    assert timing(own)["qp-tuned"] == RunTiming(call_time=6e-3)
    assert timing(own)["sliding-mode"] == RunTiming(call_time=1e-3)
    assert timed.title == "Small, time passes"


@pytest.mark.parametrize(
    ("budget", "factors"), [(1e-4, (0.5, 2.0)), (4e-4, (0.25, 0.5)), (2e-5, (2.5, 4.0))]
)
def test_of_equal_time_laws_make_calls_as_often_as_it_allows(
    budget: float, factors: tuple[float, float], tmp_path: Path
) -> None:
    timed = timing(replace(STATED, budget_s=budget).of(campaign(tmp_path)))
    assert timed["sliding-mode"] == RunTiming(factors[0], 5e-5)
    assert timed["hierarchical-qp"] == RunTiming(factors[1], 2e-4)
    assert timed["tracking"] == AS_THE_SCENE


def test_times_are_measured_once_for_a_folder_and_said_in_it(tmp_path: Path) -> None:
    small = campaign(tmp_path)
    out = tmp_path / "out"
    times = call_times(MEASURED, small, out, here)
    assert {*times.calls} == {"sliding-mode", "hierarchical-qp"}
    assert all(1e-8 < times.unit_s * call < 1e-2 for call in times.calls.values())
    timed = times.of(small.select(scenes=1))
    collect(timed, out, HERE)
    assert (
        call_times(MEASURED, small, out, here) == call_times(str(out), small, None, here) == times
    )
    stored = json.loads((out / "manifest.json").read_text())["configuration"]
    assert CallTimes(**stored["call_times"]) == times
    assert stored["controllers"]["sliding-mode"]["run"] == {
        "call_time": timing(timed)["sliding-mode"].call_time
    }
    assert Evidence.load(out).controllers == ("tracking", "sliding-mode", "hierarchical-qp")
    with pytest.raises(ConfigurationError, match=r"hierarchical-qp\.run is only there"):
        collect(small, out, HERE)


def test_the_least_of_equal_calls_counts_and_99_percent_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Calls of 1, 2, …, 101 µs but the first, of which one is interrupted in every run."""
    (task,) = plan_batches(campaign(tmp_path).select(scenes=1, settings=["conditions=['nominal']"]))
    runs = iter(np.tile(1e-6 * np.arange(102.0), (6, 1)))

    class Interrupted:
        def __init__(self, *_: Any) -> None: ...

        def run(self, _: Any) -> Any:
            times = next(runs)
            times[0] = 1.0
            times[np.random.default_rng().integers(1, 50)] = 1e-3
            return SimpleNamespace(trajectory=SimpleNamespace(step_time=times))

    monkeypatch.setattr(work, "Bench", Interrupted)
    for _, family, call in time_calls(task):
        assert (family, call) == ("quick", pytest.approx(1e-4, abs=1e-9))


def test_the_longest_of_the_families_medians_is_taken(tmp_path: Path) -> None:
    small = campaign(tmp_path)

    def answering(answer: Any) -> Any:
        """Workers that answer the first task so, and nothing else."""
        return lambda _: nullcontext(
            SimpleNamespace(run=lambda calls: [(next(iter(calls)), answer)])
        )

    found = [("law", "near", call) for call in (1e-6, 9e-6, 2.0004e-6)] + [("law", "far", 1.5e-6)]
    assert call_times(MEASURED, small, None, answering(found)).calls == {"law": 2.0}
    with pytest.raises(ConfigurationError, match="calls cannot be measured: no idea"):
        call_times(MEASURED, small, None, answering(Failure("no idea")))


FILE = "unit_s = 1e-4\nhow = 'as stated'\n[calls]\nsliding-mode = 5.0\nhierarchical-qp = 20.0\n"


def say(*words: str) -> Any:
    return CliRunner().invoke(app, ["evidence", *words])


@pytest.mark.slow
def test_a_command_with_a_file_of_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign(tmp_path)
    monkeypatch.chdir(tmp_path)
    Path("times.toml").write_text(FILE)
    few = ("small.toml", "--scenes", "2", "--jobs", "1", "--no-figures")
    for out, more in (
        ("now", ()),
        ("late", ("--time-passes", "times.toml", "--slower", "3", "--budget-us", "1000")),
    ):
        done = say(*few, "--out", out, *more)
        assert done.exit_code == 0, done.exception or done.output
    now, late = (Evidence.load(Path(out)) for out in ("now", "late"))
    entry = late.manifest["configuration"]["controllers"]
    assert entry["sliding-mode"]["run"] == {"sampling_time_factor": 1.5, "call_time": 0.0015}
    assert entry["tracking"] == {"type": "tracking"}
    first, second = (each.runs[each.runs.controller == "sliding-mode"] for each in (now, late))
    assert first.acceleration_variation.tolist() != second.acceleration_variation.tolist()
    text = Path("late/details.md").read_text()
    assert (
        "begins to act [µs]: sliding-mode 1500, hierarchical-qp 6000; as stated; the computer is "
        "3 times" in text
    )
    assert (
        "run = { sampling_time_factor = 1.5, call_time = 0.0015 }"
        in Path("late/report.md").read_text()
    )
    assert "call_time" not in Path("now/details.md").read_text()


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (
            ("unit_s = 1e-4", "unit_s = 0"),
            InvalidInput,
            "call times: unit_s must be positive, not 0",
        ),
        (("unit_s = 1e-4", ""), ConfigurationError, "times.toml: the key 'unit_s' is missing"),
        (("unit_s", "unit"), ConfigurationError, "key in times.toml 'unit'"),
        (
            ("= 5.0", "= -5.0"),
            ConfigurationError,
            "calls.sliding-mode must be zero or more, not -5",
        ),
        (("= 5.0", "= 'fast'"), ConfigurationError, "calls"),
        (
            ("hierarchical-qp", "hierarchical"),
            ConfigurationError,
            "call times are missing for hierarchical-qp",
        ),
        (
            ("sliding-mode = 5.0", "sliding-mode = 2e5"),
            ConfigurationError,
            "run: call_time must be from 0 to 10",
        ),
    ],
)
def test_times_of_nonsense_are_refused_before_anything_runs(
    change: tuple[str, str],
    error: type[Exception],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    campaign(tmp_path)
    monkeypatch.chdir(tmp_path)
    Path("times.toml").write_text(FILE.replace(*change))
    refused = say("small.toml", "--time-passes", "times.toml", "--out", "out", "--jobs", "1")
    assert isinstance(refused.exception, error)
    assert words in str(refused.exception)
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (("--slower", "2"), "need --time-passes"),
        (("--budget-us", "2"), "need --time-passes"),
        (
            ("--time-passes", "measured", "--cluster", "tls://127.0.0.1:1"),
            "with --cluster, give a file",
        ),
        (("--time-passes", "nowhere.toml"), "nowhere.toml"),
        (("--time-passes", "."), "the key 'calls' is missing"),
        (("--time-passes", "measured", "--slower", "0"), "slower must be positive"),
    ],
)
def test_options_of_nonsense_are_refused(
    words: tuple[str, ...], answer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign(tmp_path)
    monkeypatch.chdir(tmp_path)
    refused = say("small.toml", "--out", "out", *words)
    assert isinstance(refused.exception, ConfigurationError | InvalidInput)
    assert answer in str(refused.exception)


def test_the_stated_times_fit_the_laws_of_the_verdict() -> None:
    stated = call_times(str(ROOT / "comparisons/time-passes.toml"), Campaign.load(), None, here)
    late = timing(stated.of(Campaign.load(ROOT / "comparisons/verdict.toml")))
    three = timing(stated.of(Campaign.load(ROOT / "comparisons/paper-law.toml")))
    assert three["sliding-mode-quarter"] == RunTiming(0.25, late["sliding-mode"].call_time)
    assert 3e-4 < late["predictive"].call_time < 5e-4
    assert len({run.call_time for run in late.values()}) > 9
