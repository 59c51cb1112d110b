"""A worker of a cluster that is killed loses only what it was at; with its scheduler nothing is
lost that is stored.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from processes import left_over, marked, needs_proc
from vsconstraints.bench.evidence import (
    Campaign,
    Evidence,
    Part,
    Plan,
    Progress,
    collect,
    scored,
)
from vsconstraints.bench.evidence.cluster import cluster
from vsconstraints.bench.evidence.work import plan_batches
from vsconstraints.comparisons.metrics import timing_columns
from vsconstraints.errors import WorkersLost

pytestmark = [pytest.mark.faults, needs_proc]

PATIENCE = 120.0
"""How long a scheduler and its workers may take to come up [s]."""


@dataclass
class Machines:
    """A scheduler and the workers of three machines, each a process without anybody who would start
    it again.
    """

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    environment, mark = marked()
    started = []

    def start(name: str, *arguments: str) -> tuple[subprocess.Popen[bytes], Path]:
        log = tmp_path / f"{name}.log"
        with log.open("wb") as file:
            command = [
                sys.executable,
                "-m",
                "distributed.cli.dask_" + name.partition("-")[0],
                *arguments,
            ]
            process = subprocess.Popen(
                command, stdout=file, stderr=file, env=environment, cwd=tmp_path
            )
        started.append(process)
        return process, log

    scheduler, log = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    address = said(log, r"Scheduler at:\s*(tcp://\S+)")
    options = (
        address,
        "--no-nanny",
        "--nthreads",
        "1",
        "--no-dashboard",
        "--local-directory",
        str(tmp_path),
    )
    workers = [start(f"worker-{i}", *options) for i in range(3)]
    for _, log in workers:
        said(log, "Registered to")
    yield Machines(address, scheduler, [worker for worker, _ in workers])
    for process in started:
        process.kill()
        process.wait()
    assert not left_over(mark)


def said(log: Path, pattern: str) -> str:
    """What a process is waited for to say."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        found = re.search(pattern, log.read_text())
        if found:
            return found[found.re.groups]
        time.sleep(0.05)
    raise AssertionError(log.read_text())


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return Campaign.load().select(["planar-arm"], ["sliding-mode"], 48, ["conditions=nominal"])


@pytest.fixture(scope="module")
def in_one_process(campaign: Campaign) -> dict[str, Any]:
    here = Part.joined([scored(task) for task in plan_batches(campaign)])
    return {name: getattr(here, name).to_pandas() for name in ("runs", "rows", "scenes")}


def require_same(folder: Path, tables: dict[str, Any]) -> None:
    found = Evidence.load(folder)
    for name, table in tables.items():
        one = getattr(found, name)
        keys = ["scene", *(["controller"] if name != "scenes" else [])]
        columns = [column for column in table.columns if column not in timing_columns()]
        one, other = (
            each[columns].astype({"controller": str} if "controller" in columns else {})
            .sort_values(keys, kind="stable", ignore_index=True)
            for each in (one, table)
        )  # fmt: skip
        pd.testing.assert_frame_equal(
            one, other, check_dtype=False, check_categorical=False, check_exact=True
        )


def test_a_worker_is_killed_midway(
    campaign: Campaign, in_one_process: dict[str, Any], machines: Machines, tmp_path: Path
) -> None:
    victim = machines.workers[1]

    def kill(progress: Progress) -> None:
        if progress.done >= 6 and victim.poll() is None:
            os.kill(victim.pid, signal.SIGKILL)
            victim.wait()

    with cluster(machines.address, campaign.identities) as workers:
        finished = collect(campaign, tmp_path / "out", Plan(workers=workers), on_progress=kill)
    assert victim.poll() == -signal.SIGKILL
    assert not finished.interrupted
    assert finished.progress.runs == 96
    require_same(tmp_path / "out", in_one_process)


def test_the_scheduler_is_killed_midway(
    campaign: Campaign, in_one_process: dict[str, Any], machines: Machines, tmp_path: Path
) -> None:
    def kill(progress: Progress) -> None:
        if progress.done >= 6 and machines.scheduler.poll() is None:
            machines.scheduler.kill()
            machines.scheduler.wait()

    begun = time.monotonic()
    with (
        pytest.raises(WorkersLost, match=r"is gone .*the same command continues"),
        cluster(machines.address, campaign.identities) as workers,
    ):
        collect(campaign, tmp_path / "out", Plan(workers=workers), on_progress=kill)
    assert time.monotonic() - begun < PATIENCE
    stored = len(Evidence.load(tmp_path / "out").scenes)
    assert 6 <= stored < 48
    again = collect(campaign, tmp_path / "out", Plan())
    assert again.progress.stored_before == stored
    require_same(tmp_path / "out", in_one_process)


def test_ctrl_c_keeps_what_is_finished(
    campaign: Campaign, in_one_process: dict[str, Any], machines: Machines, tmp_path: Path
) -> None:
    def interrupt(progress: Progress) -> None:
        if 6 <= progress.done < 40:
            raise KeyboardInterrupt

    with cluster(machines.address, campaign.identities) as workers:
        finished = collect(campaign, tmp_path / "out", Plan(workers=workers), on_progress=interrupt)
        assert finished.interrupted == signal.SIGINT
    with cluster(machines.address, campaign.identities) as workers:
        again = collect(campaign, tmp_path / "out", Plan(workers=workers))
    assert 6 <= again.progress.stored_before < 48
    require_same(tmp_path / "out", in_one_process)
