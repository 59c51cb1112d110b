"""The comparison that faults happen to: how it is started, ended, and held against one that nothing
happened to.
"""

from __future__ import annotations

import csv
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from processes import MAIN, left_over, marked
from vsconstraints.comparisons.metrics import timing_columns

SUITE = """
trials = {trials}
seed = 3
[[scenarios]]
scenario = "example-2d-fov"
name = "short"
set = {{ duration = 1.0, sampling_time = 0.0005, start_deviation = 0.01 }}
[controllers.sliding-mode]
[controllers.hierarchical-qp]
"""

PATIENCE = 300.0
"""Nothing here takes this long [s], on a busy machine either."""

Table = list[dict[str, str]]


@dataclass(frozen=True)
class Command:
    """A comparison, and the folder it writes to."""

    suite: Path
    folder: Path

    def start(
        self, *more: str, before: Callable[[], None] | None = None
    ) -> tuple[subprocess.Popen[str], str]:
        """Begin it in a group of its own; the process, and the mark of it and all it starts."""
        environment, mark = marked()
        process = subprocess.Popen(
            [*MAIN, "compare", str(self.suite), "--out", str(self.folder), "--jobs", "2", *more],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=environment, start_new_session=True, preexec_fn=before,
        )  # fmt: skip
        return process, mark

    def carry_out(self, *more: str, before: Callable[[], None] | None = None) -> tuple[int, str]:
        """Exit code and what it said; nothing it started is left."""
        return end(*self.start(*more, before=before))

    def tables(self) -> tuple[Table, Table]:
        """results.csv and constraints.csv, without what differs from run to run."""
        return _table(self.folder / "results.csv"), _table(self.folder / "constraints.csv")


def end(process: subprocess.Popen[str], mark: str) -> tuple[int, str]:
    """Wait for the end; exit code and what was said. Nothing it started is left."""
    try:
        said, _ = process.communicate(timeout=PATIENCE)
    finally:
        left = left_over(mark)
        process.wait()
    assert left == [], f"{len(left)} processes are left"
    assert "Traceback" not in said, said
    return process.returncode, said


def report(folder: Path, *more: str) -> tuple[int, str]:
    """``vsconstraints report``: exit code and what it said."""
    done = subprocess.run(
        [*MAIN, "report", str(folder), *more],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE,
    )  # fmt: skip
    assert "Traceback" not in done.stdout, done.stdout
    return done.returncode, done.stdout


def suite(folder: Path, trials: int = 1) -> Path:
    """A small suite's file."""
    file = folder / "faults.toml"
    file.write_text(SUITE.format(trials=trials))
    return file


def _table(file: Path) -> Table:
    with file.open(newline="", encoding="utf-8") as lines:
        return [
            {name: text for name, text in line.items() if name not in timing_columns()}
            for line in csv.DictReader(lines)
        ]
