"""A campaign whose workers die or hang, which is killed or runs out of disk, comes to what it would
have come to.
"""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import time
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from commands import end

from campaigns import assert_same, campaign, tables
from processes import MAIN, marked, needs_proc, with_mark
from vsconstraints.bench.evidence import Evidence, Plan, collect, processes

pytestmark = [pytest.mark.faults, needs_proc]

ODD = '[controllers.odd]\ntype = "odd:Bad"\nhow = "{how}"\nabove = {above}\n'
REASONS = {
    "die": "the process that ran it died",
    "hang": "it took longer than its limit of 20 s and was ended",
}


@pytest.mark.parametrize("how", REASONS)
def test_a_law_that_kills_its_process_fails_alone(how: str, tmp_path: Path) -> None:
    """In some scenes only: what the law does in others, and what other laws do everywhere, is
    kept.
    """
    plain = campaign(tmp_path, ODD.format(how="raise", above=7.0), scenes=2)
    collect(plain, tmp_path / "plain", Plan(workers=processes(2)))
    odd = plain.select(settings=[f"odd.how={how}"])
    finished = collect(
        odd, tmp_path / "odd", Plan(workers=processes(2), limit=20.0 if how == "hang" else None)
    )
    assert finished.progress.done == 2
    expected, found = (
        Evidence.load(tmp_path / name).runs.drop(columns="reason") for name in ("plain", "odd")
    )
    failed = expected["status"] == "failed"
    assert 0 < failed.sum() < (expected["controller"] == "odd").sum()
    reasons = Evidence.load(tmp_path / "odd").runs["reason"]
    assert set(reasons[failed]) == {REASONS[how]}
    assert (found["status"] == expected["status"]).all()
    same = [name for name in found if not name.endswith("_us") and name != "missed_periods"]
    pd.testing.assert_frame_equal(found.loc[~failed, same], expected.loc[~failed, same])


def _start(folder: Path, out: Path, before: object = None) -> tuple[subprocess.Popen[str], str]:
    environment, mark = marked()
    process = subprocess.Popen(
        [*MAIN, "evidence", str(folder / "small.toml"), "--scenes", "48", "--out", str(out), "--jobs", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env=environment, start_new_session=True, preexec_fn=before,
    )  # fmt: skip
    return process, mark


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("undisturbed")
    campaign(folder)
    code, said = end(*_start(folder, folder / "out"))
    assert code == 0, said
    return folder, folder / "out"


@pytest.mark.parametrize(
    ("target", "number"),
    [
        ("parent", signal.SIGKILL),
        ("parent", signal.SIGTERM),
        ("parent", signal.SIGINT),
        ("worker", signal.SIGKILL),
        ("group", signal.SIGTERM),
        ("group", signal.SIGINT),
    ],
)
def test_what_is_killed_goes_on(
    target: str, number: signal.Signals, undisturbed: tuple[Path, Path], tmp_path: Path
) -> None:
    folder, out = undisturbed
    chance = random.Random(f"{target} {number}")
    process, mark = _start(folder, tmp_path / "out")
    while not list((tmp_path / "out").glob("runs/*.parquet")) and process.poll() is None:
        time.sleep(0.01)
    time.sleep(chance.random())
    if target == "group":
        os.killpg(process.pid, number)
    elif target == "parent":
        process.send_signal(number)
    else:
        workers = [
            found for found in with_mark(mark)
            if found != process.pid and b"spawn_main" in Path(f"/proc/{found}/cmdline").read_bytes()
        ]  # fmt: skip
        os.kill(chance.choice(workers), number)
    code, said = end(process, mark)
    if target == "worker":
        assert code == 0, said
    else:
        assert code in (0, -number, 128 + number), said
        code, said = end(*_start(folder, tmp_path / "out"))
        assert code == 0, said
    assert_same(tables(out), tables(tmp_path / "out"))
    assert not list((tmp_path / "out").rglob("*.part"))


@pytest.mark.parametrize("most", [0, 3000, 40_000])
def test_files_that_cannot_grow(undisturbed: tuple[Path, Path], most: int, tmp_path: Path) -> None:
    folder, out = undisturbed
    before = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most))
    code, said = end(*_start(folder, tmp_path / "out", before))
    assert code in (1, 2) or (most == 40_000 and code == 0), said
    assert code == 0 or "File too large" in said, said
    code, said = end(*_start(folder, tmp_path / "out"))
    assert code == 0, said
    assert_same(tables(out), tables(tmp_path / "out"))
