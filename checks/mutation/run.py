"""Runner of mutants: packages are imported once, and a forked process judges each mutant."""

from __future__ import annotations

import gc
import importlib
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .child import NOTHING_RUN, fork, judge, list_missing, watch
from .coverage import CoverageCache, Reached, instrumented
from .mutants import Mutant
from .targets import QUICK, RUNS, WATCHED

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

State = Literal["killed", "timed out", "survived", "not reached", "undecided"]


@dataclass(frozen=True)
class Verdict:
    """Outcome for a mutant.

    Attributes
    ----------
    mutant
        Mutant.
    state
        ``not reached`` if no test enters the function; ``undecided`` if no test is known to enter
        it, and there are test files that were not watched; ``survived`` if no test that is known
        to enter it has failed, whether or not all files were watched.
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
    jobs
        Number of mutants at a time.
    root
        The tree; it holds ``src`` and ``tests``.
    known
        The one test to run for each mutant, by the mutant's key; by default all tests that reach it
        run.
    longest
        Time limit [s] of all tests of a mutant together, by the time that they take without it: the
        quickest that reach it are run.
    cache
        Folder in which the coverage of tests is kept between runs; None keeps nothing.
    watch_until
        Time of ``time.monotonic`` after which no further test file is watched.

    Attributes
    ----------
    unwatched
        Test files of which it is not known which functions they enter.
    """

    def __init__(
        self,
        folder: Path,
        tests: Sequence[str],
        jobs: int = 1,
        root: Path = ROOT,
        known: Mapping[tuple[str, str, str], str] | None = None,
        longest: float = math.inf,
        cache: Path | None = None,
        watch_until: float = math.inf,
    ) -> None:
        self.folder = folder.resolve()
        self.jobs = jobs
        self.longest = longest
        self.watch_until = watch_until
        self.unwatched: list[str] = []
        for name in COPIED:
            there = root / name
            if there.is_dir():
                shutil.copytree(
                    there, self.folder / name, ignore=shutil.ignore_patterns("__pycache__")
                )
            elif there.exists():
                shutil.copy(there, self.folder / name)
        if known is not None:
            tests = sorted({test.partition("::")[0] for test in known.values()})
        if RUNS in tests:
            self._keep_runs(root)
        os.chdir(self.folder)
        sys.path.insert(0, str(self.folder / "src"))
        for name in THIRD_PARTY:
            importlib.import_module(name)
        gc.freeze()
        self.known = known
        if known is None:
            self.reached = self._coverage(tests, cache)
        else:
            self.reached = {test: Reached(QUICK) for test in known.values()}

    def _keep_runs(self, root: Path) -> None:
        """Simulate the runs that tests of claims judge, once and compiled."""
        folder = self.folder / "runs"
        script = root / RUNS
        folder.mkdir()
        os.environ["VSCONSTRAINTS_KEPT_RUNS"] = str(folder)
        paths = os.pathsep.join(str(root / name) for name in ("src", "tests"))
        environment = {**os.environ, "VSCONSTRAINTS_COMPILE": "1", "PYTHONPATH": paths}
        subprocess.run([sys.executable, str(script)], check=True, env=environment)

    def _coverage(self, tests: Sequence[str], cache: Path | None) -> dict[str, Reached]:
        """Return the coverage of each test; test files without a kept one are watched."""
        limits = f"at most {QUICK} s, {WATCHED} s a file"
        kept = None if cache is None else CoverageCache(cache, self.folder, limits)
        reached: dict[str, Reached] = {}
        unknown = []
        for test_file in tests:
            coverage = None if kept is None else kept.get(test_file)
            if coverage is None:
                unknown.append(test_file)
            else:
                reached |= coverage
        if cache is not None:
            print(
                f"coverage: {len(tests) - len(unknown)} of {len(tests)} test files kept in {cache}",
                file=sys.stderr,
                flush=True,
            )
        for test_file, found, sources in self._watch(unknown):
            reached |= found
            if kept is not None:
                kept.put(test_file, found, sources)
        return reached

    def _watch(self, tests: Sequence[str]) -> Iterator[tuple[str, dict[str, Reached], set[str]]]:
        """Watch test files; yield each with its tests and the source files that these enter.

        Those that are not begun in time are noted as unwatched.
        """
        if not tests:
            return
        python_files = sorted((self.folder / "src").rglob("*.py"))
        sources = instrumented(
            self.folder, [file.relative_to(self.folder).as_posix() for file in python_files]
        )
        running = {}
        waiting = list(enumerate(tests))
        while waiting or running:
            if time.monotonic() >= self.watch_until:
                self.unwatched += [test for _, test in waiting]
                waiting.clear()
            while waiting and len(running) < self.jobs:
                i, test = waiting.pop(0)
                result = self.folder / f"reached-{i}.json"
                output = self.folder / f"reached-{i}.log"
                process = fork(lambda t=test, r=result: watch(t, sources, r), output)
                running[process] = (test, result, output)
            if not running:
                break
            test, result, output = running.pop(os.waitpid(-1, 0)[0])
            if not result.exists():
                raise RuntimeError(
                    f"the tests cannot be run:\n{output.read_text(encoding='utf-8')}"
                )
            found = json.loads(result.read_text(encoding="utf-8"))
            reached = {
                name: Reached(seconds, {sources.functions[place] for place in entered})
                for name, (seconds, entered) in found["tests"].items()
            }
            yield test, reached, {sources.functions[place][0] for place in found["ever"]}

    def tests_for(self, mutant: Mutant) -> list[str]:
        """Tests that enter the mutated function, the quickest first; then others of their files.

        The others are included because they may share results. Outside of functions, the tests are
        those that enter any function of the file, or all tests if there are none.
        """
        if self.known is not None:
            return [self.known[mutant.key]] if mutant.key in self.known else []
        file = mutant.file
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
        first.sort(key=self._seconds)
        others.sort(key=self._seconds)
        chosen: list[str] = []
        seconds = 0.0
        for test in dict.fromkeys([*first, *others]):
            seconds += self._seconds(test)
            if chosen and seconds > self.longest:
                break
            chosen.append(test)
        return chosen

    def _seconds(self, test: str) -> float:
        return self.reached[test].seconds

    def limits(self, tests: Iterable[str]) -> dict[str, float]:
        """Return the time limit [s] of each test."""
        return {test: SLACK + FACTOR * self._seconds(test) for test in tests}

    def failing_without_mutant(self, tests: Sequence[str]) -> str:
        """Return the first of these tests that fails on the tree as it is, or an empty string."""
        if not tests:
            return ""
        result = self.folder / "unchanged.txt"
        limits = self.limits(tests)
        output = Path(f"{result}.log")
        process = fork(lambda: judge(None, self.folder, limits, result), output)
        status = os.waitpid(process, 0)[1]
        if status == 0:
            return ""
        if result.exists():
            return result.read_text(encoding="utf-8")
        return f"one of {len(tests)} tests"

    def missing_tests(self, tests: Sequence[str]) -> list[str]:
        """Return those of the tests that do not exist, or whose file cannot be imported."""
        result = self.folder / "missing.txt"
        output = Path(f"{result}.log")
        os.waitpid(fork(lambda: list_missing(tests, result), output), 0)
        if not result.exists():
            raise RuntimeError(f"tests cannot be listed:\n{output.read_text(encoding='utf-8')}")
        return result.read_text(encoding="utf-8").splitlines()

    def judge(self, mutants: Sequence[Mutant], until: float = math.inf) -> Iterator[Verdict]:
        """Judge mutants; yield verdicts in the order in which they are known.

        No mutant is begun after the time ``until`` of ``time.monotonic``. Those that were begun are
        finished: to leave out what takes long would leave out the mutants that no test notices.
        Raises RuntimeError if none of a mutant's tests can be run.
        """
        waiting = list(enumerate(mutants))[::-1]
        running: dict[int, tuple[Mutant, Path]] = {}
        try:
            while waiting or running:
                if time.monotonic() >= until:
                    waiting.clear()
                while waiting and len(running) < self.jobs:
                    number, mutant = waiting.pop()
                    tests = self.tests_for(mutant)
                    if not tests:
                        yield Verdict(mutant, "undecided" if self.unwatched else "not reached")
                        continue
                    result = self.folder / f"mutant-{number}.txt"
                    limits = self.limits(tests)
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
                if os.WIFEXITED(status) and os.WEXITSTATUS(status) == NOTHING_RUN:
                    named = ", ".join(self.tests_for(mutant))
                    raise RuntimeError(f"no test was run for {mutant}: there is no {named}")
                by = result.read_text(encoding="utf-8") if result.exists() else ""
                state: State = "survived"
                if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
                    state = "timed out"
                elif status:
                    state = "killed"
                yield Verdict(mutant, state, by)
                for left in (result, Path(f"{result}.log")):
                    left.unlink(missing_ok=True)
