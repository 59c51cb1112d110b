"""Runs made by the workers of a Dask scheduler: the same runs, and what goes wrong with a cluster."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster
from typer.testing import CliRunner

from vsconstraints.cli import app
from vsconstraints.comparisons.metrics import TIMING_COLUMNS
from vsconstraints.errors import ConfigurationError
from vsconstraints.evidence import Campaign, Evidence, Part, Plan, collect, scored
from vsconstraints.evidence import cluster as near
from vsconstraints.evidence.cluster import cluster
from vsconstraints.evidence.task import Work
from vsconstraints.runs.pool import DIED, Failure


def told() -> dict[str, Any]:
    return {"code": "same", "packages": {"numpy": "1"}}


def told_otherwise() -> dict[str, Any]:
    return {"code": "same", "packages": {"numpy": str(os.getpid())}}


def not_told() -> dict[str, Any]:
    if os.environ.get("TEST_OF_CLUSTER") == str(os.getpid()):
        return {}
    raise RuntimeError("no idea")


def answer(number: int) -> tuple[int, int]:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 5:
        raise ValueError("five")
    time.sleep(30.0 if number == 7 else 0.01)
    return number, os.getpid()


@pytest.fixture(scope="module")
def scheduler() -> Iterator[LocalCluster]:
    """A scheduler and a worker with two threads, both in this process; the processes that make calls are their own."""
    with LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0", protocol="tcp", host="127.0.0.1"
    ) as local:
        yield local


def nobody() -> str:
    """An address at which nobody listens."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{found.getsockname()[1]}"


def test_a_call_that_fails_costs_only_itself(scheduler: LocalCluster) -> None:
    with cluster(scheduler.scheduler_address, told) as workers, workers(answer) as open_workers:
        found = list(open_workers.run({i: (i,) for i in range(12)}, {7: 0.5}, again=False))
    answers = dict(found)
    assert len(found) == len(answers) == 12
    assert answers.pop(3) == Failure(DIED)
    assert answers.pop(5) == Failure("ValueError: five")
    assert "longer than its limit of 0.5 s" in answers.pop(7).reason
    assert {key: number for key, (number, _) in answers.items()} == {key: key for key in answers}
    made = {process for _, process in answers.values()}
    # processes of their own, one for each thread and one for each that died
    assert os.getpid() not in made
    assert 2 <= len(made) <= 4
    # they end with the session
    assert not [process for process in made if Path(f"/proc/{process}").exists()]


def test_workers_that_would_give_other_results_are_refused(
    scheduler: LocalCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    (worker,) = scheduler.scheduler_info["workers"]
    with (
        pytest.raises(ConfigurationError, match=rf"{worker} would give other results: packages\.numpy is '\d+' there"),
        cluster(scheduler.scheduler_address, told_otherwise),
    ):
        pass
    monkeypatch.setenv("TEST_OF_CLUSTER", str(os.getpid()))
    with (
        pytest.raises(ConfigurationError, match=f"{worker} cannot make runs: RuntimeError: no idea"),
        cluster(scheduler.scheduler_address, not_told),
    ):
        pass


def test_a_campaign_gives_the_same_on_a_cluster(scheduler: LocalCluster, tmp_path: Path) -> None:
    campaign = Campaign.load().select(["planar-arm"], ["sliding-mode"], 4, ["conditions=nominal"])
    with cluster(scheduler.scheduler_address, campaign.identities) as workers:
        collect(campaign, tmp_path, Plan(keep="first", workers=workers))
    found = Evidence.load(tmp_path)
    here = Part.joined([scored(task) for task in Work(campaign).tasks().values()])
    for name in ("runs", "rows", "scenes"):
        one, other = getattr(found, name), getattr(here, name).to_pandas()
        assert len(one) == len(other) > 0
        for column in set(one.columns).difference(TIMING_COLUMNS):
            values = one[column].astype(other[column].dtype)
            assert values.equals(other[column]), (name, column)
    assert len(found.runs) == 8
    assert len(list((tmp_path / "trajectories").iterdir())) == 2


def test_a_scheduler_that_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(near, "CONNECT", 0.5)
    for address, why in (
        (nobody(), "no Dask scheduler answers"),
        ("nonsense://127.0.0.1", "unknown address scheme 'nonsense'"),
    ):
        arguments = ["evidence", "--cluster", address, "--family", "planar-arm", "--out", str(tmp_path / "out")]
        failed = CliRunner().invoke(app, arguments).exception
        assert isinstance(failed, ConfigurationError)
        assert why in str(failed)
        assert address in str(failed)
    assert not (tmp_path / "out").exists()
    failed = CliRunner().invoke(app, [*arguments, "--jobs", "2"]).exception
    assert "--jobs is how many processes of this machine" in str(failed)


def test_a_scheduler_without_workers() -> None:
    with (
        LocalCluster(n_workers=0, processes=False, dashboard_address=":0", protocol="tcp", host="127.0.0.1") as local,
        pytest.raises(ConfigurationError, match=r"has no worker; start one .* `dask worker tcp://"),
        cluster(local.scheduler_address, told),
    ):
        pass
