"""Runner of mutants: packages are imported once, and a forked process judges each mutant."""

from __future__ import annotations

import gc
import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .child import Reached, fork, judge, watch
from .mutants import Mutant
from .targets import QUICK

ROOT = Path(__file__).resolve().parents[2]

COPIED = ("src", "tests", "controllers", "examples", "comparisons", "README.md", "pyproject.toml")

THIRD_PARTY = ("numpy", "scipy.linalg", "scipy.optimize", "pinocchio", "coal", "qpsolvers", "daqp",
               "osqp", "proxsuite",
               "matplotlib.pyplot", "hypothesis", "cvxpy", "clarabel", "typer", "rich.console",
               "rich.table",
               "rich.progress", "numpy.testing", "pandas", "scipy.stats", "statsmodels.api",
               "scikit_posthocs")  # fmt: skip
"""Imported before the first fork: they take seconds, and no mutant changes them."""

SLACK = 20.0
FACTOR = 10.0
"""Time limit of each test of a mutant: additional seconds, and factor on its usual time."""

State = Literal["killed", "timed out", "survived", "not reached"]


@dataclass(frozen=True)
class Verdict:
    """Outcome for a mutant.

    Attributes
    ----------
    mutant
        Mutant.
    state
        ``not reached`` if no test enters the function.
    by
        Name of the test that failed.
    """

    mutant: Mutant
    state: State
    by: str = ""

    @property
    def noticed(self) -> bool:
        """True if a test failed, or exceeded its time limit."""
        return self.state in ("killed", "timed out")


class Runner:
    """Copy of the tree, coverage of its tests, and processes that judge mutants in it.

    Parameters
    ----------
    folder
        Empty folder for the copy: the tree itself is never changed.
    tests
        Test files to run.
    files
        Files that have mutants.
    jobs
        Number of mutants at a time.
    root
        The tree; it holds ``src`` and ``tests``.
    known
        The one test to run for each mutant, by the mutant's key; by default all tests that reach it
        run.
    most
        Greatest number of tests for a mutant, the quickest that reach it; all if None.
    """

    def __init__(
        self,
        folder: Path,
        tests: Sequence[str],
        files: Sequence[str],
        jobs: int = 1,
        root: Path = ROOT,
        known: Mapping[tuple[str, str, str], str] | None = None,
        most: int | None = None,
    ) -> None:
        self.folder = folder.resolve()
        self.jobs = jobs
        self.most = most
        for name in COPIED:
            there = root / name
            if there.is_dir():
                shutil.copytree(
                    there, self.folder / name, ignore=shutil.ignore_patterns("__pycache__")
                )
            elif there.exists():
                shutil.copy(there, self.folder / name)
        self._keep_runs(root)
        os.chdir(self.folder)
        sys.path.insert(0, str(self.folder / "src"))
        for name in THIRD_PARTY:
            importlib.import_module(name)
        gc.freeze()
        self.known = known
        if known is None:
            self.reached = self._watch(tests, [self.folder / file for file in files])
        else:
            self.reached = {test: Reached(QUICK) for test in known.values()}

    def _keep_runs(self, root: Path) -> None:
        """Simulate the runs that tests of claims judge, once and compiled."""
        folder = self.folder / "runs"
        script = root / "tests" / "test_reproduction.py"
        if not script.exists():
            return
        folder.mkdir()
        os.environ["VSCONSTRAINTS_KEPT_RUNS"] = str(folder)
        paths = os.pathsep.join(str(root / name) for name in ("src", "tests"))
        environment = {**os.environ, "VSCONSTRAINTS_COMPILE": "1", "PYTHONPATH": paths}
        subprocess.run([sys.executable, str(script)], check=True, env=environment)

    def _watch(self, tests: Sequence[str], files: Sequence[Path]) -> dict[str, Reached]:
        reached: dict[str, Reached] = {}
        running = {}
        waiting = list(enumerate(tests))
        while waiting or running:
            while waiting and len(running) < self.jobs:
                i, test = waiting.pop()
                result = self.folder / f"reached-{i}.json"
                output = self.folder / f"reached-{i}.log"
                running[fork(lambda t=test, r=result: watch([t], files, r), output)] = (
                    result,
                    output,
                )
            result, output = running.pop(os.waitpid(-1, 0)[0])
            if not result.exists():
                raise RuntimeError(
                    f"the tests cannot be run:\n{output.read_text(encoding='utf-8')}"
                )
            for test, (seconds, entered) in json.loads(result.read_text(encoding="utf-8")).items():
                reached[test] = Reached(seconds, {(f, n) for f, n in entered})
        return reached

    def tests_for(self, mutant: Mutant) -> list[str]:
        """Tests that enter the mutated function, the quickest first; then others of their files.

        The others are included because they may share results. Outside of functions, the tests are
        those that enter any function of the file, or all tests if there are none.
        """
        if self.known is not None:
            return [self.known[mutant.key]] if mutant.key in self.known else []
        file = str(self.folder / mutant.file)
        place = {(file, mutant.function)}
        if not mutant.function:
            place = {
                entered
                for reached in self.reached.values()
                for entered in reached.functions
                if entered[0] == file
            }
        first = [test for test, reached in self.reached.items() if reached.functions & place]
        if not first and not mutant.function:
            first = list(self.reached)
        files = {test.split("::")[0] for test in first}
        others = [test for test in self.reached if test.split("::")[0] in files]
        quickest = sorted(first, key=lambda test: self.reached[test].seconds)
        if self.most is not None:
            return quickest[: self.most]
        return list(dict.fromkeys([*quickest, *others]))

    def judge(self, mutants: Sequence[Mutant]) -> Iterator[Verdict]:
        """Judge mutants; yield verdicts in the order in which they are known."""
        waiting = list(enumerate(mutants))[::-1]
        running: dict[int, tuple[Mutant, Path]] = {}
        try:
            while waiting or running:
                while waiting and len(running) < self.jobs:
                    number, mutant = waiting.pop()
                    tests = self.tests_for(mutant)
                    if not tests:
                        yield Verdict(mutant, "not reached")
                        continue
                    result = self.folder / f"mutant-{number}.txt"
                    limits = {test: SLACK + FACTOR * self.reached[test].seconds for test in tests}
                    process = fork(
                        lambda m=mutant, t=limits, r=result: judge(m, self.folder, t, r),
                        Path(f"{result}.log"),
                    )
                    running[process] = mutant, result
                yield from self._ended(running)
                time.sleep(0.01)
        finally:
            for process in running:
                os.killpg(process, signal.SIGKILL)

    def _ended(self, running: dict[int, tuple[Mutant, Path]]) -> Iterator[Verdict]:
        for process, (mutant, result) in list(running.items()):
            ended, status = os.waitpid(process, os.WNOHANG)
            if ended:
                del running[process]
                by = result.read_text(encoding="utf-8") if result.exists() else ""
                late = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM
                yield Verdict(
                    mutant, "timed out" if late else "killed" if status else "survived", by
                )
                for left in (result, Path(f"{result}.log")):
                    left.unlink(missing_ok=True)
