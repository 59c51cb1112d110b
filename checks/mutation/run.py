"""Runner of mutants: packages are imported once, and a forked process judges each mutant."""

from __future__ import annotations

import gc
import hashlib
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
from .coverage import CoverageCache, Instrumented, Reached, instrumented
from .mutants import Mutant
from .targets import QUICK, RUNS, WATCHED, Mode, mode_of

ROOT = Path(__file__).resolve().parents[2]

COPIED = ("src", "tests", "controllers", "examples", "comparisons", "README.md", "pyproject.toml")

WATCHED_FOLDERS = ("src", "controllers")
"""Folders of sources of which it is found which tests enter their functions."""

THIRD_PARTY = (
    "numpy", "numba", "scipy.linalg", "scipy.optimize", "pinocchio", "coal", "qpsolvers",
    "daqp", "osqp", "proxsuite", "matplotlib.pyplot", "hypothesis", "cvxpy", "clarabel",
    "typer", "rich.console", "rich.table", "rich.progress", "numpy.testing", "pandas",
    "scipy.stats", "statsmodels.api", "scikit_posthocs",
)  # fmt: skip
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
        Name of the test that failed or took too long.
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
    modes
        Modes in which tests run: all, or :attr:`Mode.UNCOMPILED` for every mutant.
    longest
        Time limit [s] of all tests of a mutant together, by the time that they take without it: the
        quickest that reach it are run.
    cache
        Folder in which the coverage of tests is kept between runs; None keeps nothing.
    watch_until
        Time of ``time.monotonic`` after which no further test file is watched.

    Attributes
    ----------
    reached
        Duration and coverage of each test, by mode.
    unwatched
        Modes and test files of which it is not known which functions they enter.
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
        modes: Sequence[Mode] = tuple(Mode),
    ) -> None:
        self.folder = folder.resolve()
        self.jobs = jobs
        self.longest = longest
        self.watch_until = watch_until
        self.modes = modes
        self.unwatched: list[tuple[Mode, str]] = []
        # compiled code is read from beside the sources, and copied with them
        os.environ.pop("NUMBA_CACHE_DIR", None)
        for name in COPIED:
            there = root / name
            if there.is_dir():
                shutil.copytree(there, self.folder / name, ignore=shutil.ignore_patterns("*.pyc"))
            elif there.exists():
                shutil.copy(there, self.folder / name)
        if known is not None:
            tests = sorted({test.partition("::")[0] for test in known.values()})
        if Mode.COMPILED in modes and (self.folder / "src" / "vsconstraints").is_dir():
            self._compile()
        if RUNS in tests:
            self._keep_runs()
        os.chdir(self.folder)
        sys.path.insert(0, str(self.folder / "src"))
        for name in THIRD_PARTY:
            importlib.import_module(name)
        gc.freeze()
        self.known = known
        if known is None:
            self.reached = self._coverage(tests, cache)
        else:
            self.reached = {
                mode: {test: Reached(QUICK[mode]) for test in known.values()} for mode in modes
            }

    def _compile(self) -> None:
        """Compile what is not compiled yet, so that no test of a mutant has to wait for it."""
        self._run(Path(__file__).with_name("compile_all.py"))

    def _keep_runs(self) -> None:
        """Simulate the runs that tests of claims judge, once and compiled."""
        folder = self.folder / "runs"
        folder.mkdir()
        os.environ["VSCONSTRAINTS_KEPT_RUNS"] = str(folder)
        self._run(self.folder / RUNS)

    def _run(self, script: Path) -> None:
        """Run a script with the copy of the tree, compiled."""
        paths = os.pathsep.join(str(self.folder / name) for name in ("src", "tests"))
        environment = {**os.environ, "VSCONSTRAINTS_COMPILE": "1", "PYTHONPATH": paths}
        # -P: the modules beside a script are not found by their names alone
        subprocess.run([sys.executable, "-P", str(script)], check=True, env=environment)

    def mode_of(self, file: str) -> Mode:
        """Return the mode for mutants of a source file."""
        mode = mode_of(file)
        return mode if mode in self.modes else Mode.UNCOMPILED

    def _coverage(self, tests: Sequence[str], cache: Path | None) -> dict[Mode, dict[str, Reached]]:
        """Return the coverage of each test; test files without a kept one are watched."""
        kept = {}
        if cache is not None:
            for mode in self.modes:
                limits = f"at most {QUICK[mode]} s, {WATCHED[mode]} s a file"
                settings = f"{limits}, {self._digest_of_compiled(mode)}"
                kept[mode] = CoverageCache(cache / mode, self.folder, settings)
        reached: dict[Mode, dict[str, Reached]] = {mode: {} for mode in self.modes}
        unknown = []
        for test_file in tests:
            for mode in self.modes:
                coverage = kept[mode].get(test_file) if kept else None
                if coverage is None:
                    unknown.append((mode, test_file))
                else:
                    reached[mode] |= coverage
        if kept:
            total = len(self.modes) * len(tests)
            print(
                f"coverage of {total - len(unknown)} test files and modes, of {total}, kept in "
                f"{cache}",
                file=sys.stderr,
                flush=True,
            )
        for mode, test_file, found, sources, are_missing in self._watch(unknown):
            reached[mode] |= found
            # a file with tests that fail is watched again, and they are named again
            if kept and not are_missing:
                kept[mode].put(test_file, found, sources)
        return reached

    def _python_files(self, mode: Mode) -> dict[str, bool]:
        """Return whether the functions of each source file run as Python in a mode."""
        found = {}
        for folder in WATCHED_FOLDERS:
            for path in sorted((self.folder / folder).rglob("*.py")):
                file = path.relative_to(self.folder).as_posix()
                found[file] = mode is Mode.UNCOMPILED or self.mode_of(file) is Mode.COMPILED
        return found

    def _digest_of_compiled(self, mode: Mode) -> str:
        """Return the digest of the files whose functions run compiled in a mode, and their names.

        Which tests enter such functions is not seen.
        """
        digest = hashlib.sha256()
        for file, runs_as_python in self._python_files(mode).items():
            if not runs_as_python:
                digest.update(file.encode())
                digest.update((self.folder / file).read_bytes())
        return digest.hexdigest()

    def _instrumented(self, mode: Mode) -> Instrumented:
        """Return the sources whose functions run as Python in a mode, instrumented."""
        files = self._python_files(mode)
        return instrumented(self.folder, [file for file in files if files[file]])

    def _watch(
        self, tests: Sequence[tuple[Mode, str]]
    ) -> Iterator[tuple[Mode, str, dict[str, Reached], set[str], bool]]:
        """Watch test files; yield each with its tests and the source files that these enter.

        The last value says whether tests are left out since they fail.

        Those that are not begun in time are noted as unwatched.
        """
        if not tests:
            return
        every = {mode: self._instrumented(mode) for mode in {mode for mode, _ in tests}}
        running = {}
        waiting = list(tests)
        while waiting or running:
            if time.monotonic() >= self.watch_until:
                self.unwatched += waiting
                waiting.clear()
            while waiting and len(running) < self.jobs:
                mode, test = waiting.pop(0)
                result = self.folder / f"reached-{mode}-{Path(test).stem}.json"
                output = result.with_suffix(".log")
                process = fork(lambda m=mode, t=test, r=result: watch(t, every[m], m, r), output)
                running[process] = (mode, test, result, output)
            if not running:
                break
            mode, test, result, output = running.pop(os.waitpid(-1, 0)[0])
            if not result.exists():
                raise RuntimeError(
                    f"the tests cannot be run:\n{output.read_text(encoding='utf-8')}"
                )
            found = json.loads(result.read_text(encoding="utf-8"))
            failed = found["failed"]
            # uncompiled, tests of the compiler fail
            are_missing = bool(failed) and mode is Mode.COMPILED
            if are_missing:
                print(f"left out, since they fail without a mutant: {failed}", flush=True)
            sources = every[mode]
            reached = {
                name: Reached(seconds, {sources.functions[place] for place in entered})
                for name, (seconds, entered) in found["tests"].items()
            }
            entered_files = {sources.functions[place][0] for place in found["ever"]}
            yield mode, test, reached, entered_files, are_missing

    def tests_for(self, mutant: Mutant) -> list[str]:
        """Tests that enter the mutated function, the quickest first; then others of their files.

        The others are included because they may share results. Outside of functions, the tests are
        those that enter any function of the file, or all tests if there are none.
        """
        if self.known is not None:
            return [self.known[mutant.key]] if mutant.key in self.known else []
        file = mutant.file
        mode = self.mode_of(file)
        known = self.reached[mode]
        place = {(file, mutant.function)}
        if not mutant.function:
            place = {
                entered
                for reached in known.values()
                for entered in reached.functions
                if entered[0] == file
            }
        first = [test for test, reached in known.items() if reached.functions & place]
        if not first and not mutant.function:
            first = list(known)
        files = {test.split("::")[0] for test in first}
        others = [test for test in known if test.split("::")[0] in files]
        first.sort(key=lambda test: known[test].seconds)
        others.sort(key=lambda test: known[test].seconds)
        chosen: list[str] = []
        seconds = 0.0
        for test in dict.fromkeys([*first, *others]):
            seconds += known[test].seconds
            if chosen and seconds > self.longest:
                break
            chosen.append(test)
        return chosen

    def limits(self, mode: Mode, tests: Iterable[str]) -> dict[str, float]:
        """Return the time limit [s] of each test."""
        known = self.reached[mode]
        return {test: SLACK + FACTOR * known[test].seconds for test in tests}

    def failing_without_mutant(self, mode: Mode, tests: Sequence[str]) -> str:
        """Return the first of these tests that fails on the tree as it is, or an empty string."""
        if not tests:
            return ""
        result = self.folder / f"unchanged-{mode}.txt"
        limits = self.limits(mode, tests)
        output = Path(f"{result}.log")
        process = fork(lambda: judge(None, self.folder, mode, limits, result), output)
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
                    mode = self.mode_of(mutant.file)
                    if not tests:
                        is_unknown = any(unwatched == mode for unwatched, _ in self.unwatched)
                        yield Verdict(mutant, "undecided" if is_unknown else "not reached")
                        continue
                    result = self.folder / f"mutant-{number}.txt"
                    limits = self.limits(mode, tests)
                    process = fork(
                        lambda m=mutant, w=mode, t=limits, r=result: judge(m, self.folder, w, t, r),
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
                state: State = "killed"
                if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGALRM:
                    state = "timed out"
                elif status == 0:
                    state = "survived"
                    by = ""
                yield Verdict(mutant, state, by)
                for left in (result, Path(f"{result}.log")):
                    left.unlink(missing_ok=True)
