"""Runs made by the workers of a Dask scheduler: the same runs, and what goes wrong with a
cluster.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import dask
import pytest
import yaml
from distributed import Client, LocalCluster
from distributed.security import Security
from typer.testing import CliRunner

from documents import DOCS, blocks
from test_own_files import KINDS, campaign
from vsconstraints.bench.evidence import Campaign, Evidence, Part, Plan, collect, scored
from vsconstraints.bench.evidence import cluster as near
from vsconstraints.bench.evidence.cluster import cluster
from vsconstraints.bench.evidence.work import plan_batches
from vsconstraints.cli import app
from vsconstraints.comparisons.metrics import timing_columns
from vsconstraints.comparisons.runs.pool import DIED, Failure
from vsconstraints.errors import ConfigurationError

PAGE = list(blocks(DOCS / "suites.md"))
(SETTINGS,) = (block.code for block in PAGE if block.language == "yaml")
(KEYS,) = (block.code for block in PAGE if "openssl" in block.code)
"""Of the documentation's recipe: Dask's configuration, and how keys are made."""

LAW, _ = KINDS["an imported helper"]


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
    """A scheduler and a worker with two threads, both in this process; the processes that make
    calls are their own.
    """
    with LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        dashboard_address=":0",
        protocol="tcp",
        host="127.0.0.1",
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
        pytest.raises(
            ConfigurationError,
            match=rf"{worker} would give other results: packages\.numpy is '\d+' there",
        ),
        cluster(scheduler.scheduler_address, told_otherwise),
    ):
        pass
    monkeypatch.setenv("TEST_OF_CLUSTER", str(os.getpid()))
    with (
        pytest.raises(
            ConfigurationError, match=f"{worker} cannot make runs: RuntimeError: no idea"
        ),
        cluster(scheduler.scheduler_address, not_told),
    ):
        pass


def test_a_campaign_gives_the_same_on_a_cluster(scheduler: LocalCluster, tmp_path: Path) -> None:
    campaign = Campaign.load().select(["planar-arm"], ["sliding-mode"], 4, ["conditions=nominal"])
    with cluster(scheduler.scheduler_address, campaign.on_each_machine()) as workers:
        collect(campaign, tmp_path, Plan(keep="first", workers=workers))
    found = Evidence.load(tmp_path)
    here = Part.joined([scored(task) for task in plan_batches(campaign)])
    for name in ("runs", "rows", "scenes"):
        one = getattr(found, name)
        other = getattr(here, name).to_pandas()
        assert len(one) == len(other) > 0
        for column in set(one.columns).difference(timing_columns()):
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
        arguments = [
            "evidence",
            "--cluster",
            address,
            "--family",
            "planar-arm",
            "--out",
            str(tmp_path / "out"),
        ]
        failed = CliRunner().invoke(app, arguments).exception
        assert isinstance(failed, ConfigurationError)
        assert why in str(failed)
        assert address in str(failed)
    assert not (tmp_path / "out").exists()
    failed = CliRunner().invoke(app, [*arguments, "--jobs", "2"]).exception
    assert isinstance(failed, ConfigurationError)
    assert "--jobs" in str(failed)


def test_a_scheduler_without_workers() -> None:
    with (
        LocalCluster(
            n_workers=0, processes=False, dashboard_address=":0", protocol="tcp", host="127.0.0.1"
        ) as local,
        pytest.raises(ConfigurationError, match=r"has no worker; start one .* `dask worker tcp://"),
        cluster(local.scheduler_address, told),
    ):
        pass


# --- those that come later ---


def told_by_environment() -> dict[str, Any]:
    return {"code": os.environ.get("OTHER_CODE", "same")}


def environment(number: int) -> tuple[int, str]:
    time.sleep(0.1)
    return number, os.environ.get("OTHER_CODE", "") + os.environ.get("GOOD_WORKER", "")


@contextmanager
def joining(address: str, folder: Path, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """A Dask worker with an environment of its own, which is told where this module is."""
    path = environment.pop("PYTHONPATH", "")
    before = [path, str(Path(__file__).parent), *filter(None, sys.path)]
    options = (
        "--host",
        "127.0.0.1",
        "--no-nanny",
        "--nthreads",
        "1",
        "--no-dashboard",
        "--local-directory",
        str(folder),
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_worker", address, *options],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, before)), **environment},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def wait_for(what: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 120.0
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_workers_that_join_midway_with_other_code_are_given_nothing(
    scheduler: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that would give other results, and one on which nothing of this package can be imported;
    a third helps.
    """
    given = []
    submit = Client.submit

    def submitted(*arguments: Any, workers: list[str], **options: Any) -> Any:
        given.append(workers)
        return submit(*arguments, workers=workers, **options)

    monkeypatch.setattr(Client, "submit", submitted)
    broken = tmp_path / "broken" / "vsconstraints"
    broken.mkdir(parents=True)
    (broken / "__init__.py").write_text("raise ImportError('no such luck')")
    address = scheduler.scheduler_address
    found = []
    said = list[str]()
    after = 0
    there = len(scheduler.scheduler_info["workers"])
    with cluster(address, told_by_environment) as workers, ExitStack() as stack:
        for own in (
            {"OTHER_CODE": "older"},
            {"PYTHONPATH": str(broken.parent)},
            {"GOOD_WORKER": "good"},
        ):
            stack.enter_context(joining(address, tmp_path, **own))
        wait_for(lambda: len(scheduler.scheduler_info["workers"]) == there + 3)
        with workers(environment) as open_workers, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for key, answer in open_workers.run({i: (i,) for i in range(1000)}):
                assert answer[0] == key
                found.append(answer[1])
                said = [
                    str(warning.message) for warning in caught if warning.category is RuntimeWarning
                ]
                after += len(said) == 2
                if after > 40 and found.count("good") > 5:
                    break
    assert set(found) == {"", "good"}
    assert len(said) == 2
    other, nothing = sorted(said, key=lambda text: "ended" in text)
    for text in said:  # asked what results depend on there, and nothing else
        assert [workers for workers in given if text.split()[1] in workers] == [[text.split()[1]]]
    assert re.search(
        r"^worker \S+ would give other results: the package's source differs .*; it is not used$",
        other,
    )
    assert re.search(r"^worker \S+ ended when it was asked .*; it is not used$", nothing)


def test_a_worker_with_another_helper_of_a_law_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The law is the same file on both, and imports a module of another content on the worker."""
    folder = tmp_path / "campaign"
    law = LAW.replace("import helper", "import cluster_helper")
    for name, gain in (("here", 1), ("on the worker", 2)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "cluster_helper.py").write_text(f"GAIN = {gain}\n")
    monkeypatch.syspath_prepend(tmp_path / "here")
    asked = campaign(folder, law).on_each_machine()
    with LocalCluster(
        n_workers=0, processes=False, dashboard_address=":0", protocol="tcp", host="127.0.0.1"
    ) as local:
        address = local.scheduler_address
        for name in ("here", "on the worker"):
            with joining(address, tmp_path, PYTHONPATH=str(tmp_path / name)) as worker:
                wait_for(lambda: len(local.scheduler_info["workers"]) == 1)
                with ExitStack() as stack:
                    if name != "here":
                        why = r"would give other results: own files\.import cluster_helper"
                        stack.enter_context(pytest.raises(ConfigurationError, match=why))
                    stack.enter_context(cluster(address, asked))
                worker.kill()
                wait_for(lambda: not local.scheduler_info["workers"])


def test_calls_outlive_the_only_worker(tmp_path: Path) -> None:
    """What it was at, and what it was sent ahead, is done by one that comes later."""
    with LocalCluster(
        n_workers=0, processes=False, dashboard_address=":0", protocol="tcp", host="127.0.0.1"
    ) as local:
        address = local.scheduler_address
        with ExitStack() as stack:
            first = stack.enter_context(joining(address, tmp_path, GOOD_WORKER="first"))
            wait_for(lambda: len(local.scheduler_info["workers"]) == 1)
            answers = {}
            with (
                cluster(address, told_by_environment) as workers,
                workers(environment) as open_workers,
            ):
                for key, (_, who) in open_workers.run({i: (i,) for i in range(20)}):
                    answers[key] = who
                    if len(answers) == 3:
                        first.kill()
                        stack.enter_context(joining(address, tmp_path, GOOD_WORKER="second"))
    assert sorted(answers) == list(range(20))
    assert set(answers.values()) == {"first", "second"}


# --- who may take part ---


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two authorities, ``own`` and ``foreign``, and a key that each has signed, made as the
    documentation says.
    """
    folder = tmp_path_factory.mktemp("keys")
    if shutil.which("openssl") is None:
        pytest.skip("keys are made by openssl, which is not installed")
    for name in ("own", "foreign"):
        (folder / name).mkdir()
        for command in KEYS.strip().splitlines():
            subprocess.run(shlex.split(command), cwd=folder / name, check=True, capture_output=True)
    return folder


def tls(folder: Path) -> dict[str, Any]:
    """The documentation's settings, with keys from this folder."""
    text = SETTINGS.replace("/etc/dask/keys", str(folder))
    return {
        "distributed": dask.config.merge(
            dask.config.get("distributed"), yaml.safe_load(text)["distributed"]
        )
    }


def test_only_who_has_a_key_takes_part(keys: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The documentation's recipe; a client without a key, or with one that another authority has
    signed, is refused.
    """
    monkeypatch.setattr(near, "CONNECT", 2.0)
    with (
        dask.config.set(tls(keys / "own")),
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, protocol="tls", security=Security(), host="127.0.0.1",
            dashboard_address=":0",
        ) as local,
    ):  # fmt: skip
        address = local.scheduler_address
        assert address.startswith("tls://127.0.0.1:")
        with cluster(address, told) as workers, workers(pow) as open_workers:
            assert dict(open_workers.run({0: (2, 5)})) == {0: 32}
        refused = pytest.raises(ConfigurationError, match="no Dask scheduler answers")
        with refused, cluster(address.replace("tls://", "tcp://"), told):
            pass
        with refused, dask.config.set(tls(keys / "foreign")), cluster(address, told):
            pass
    without = pytest.raises(
        ConfigurationError, match=r"no Dask scheduler answers at tls://.*: TLS .*docs/suites"
    )
    with without, cluster(address, told):
        pass
