"""Work of a forked process: run tests on the tree, or on the tree with one file changed."""

from __future__ import annotations

import builtins
import json
import math
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType

import pytest

from .coverage import ENTERED, Instrumented
from .mutants import Mutant
from .targets import COMPARED, QUICK, RUNS, WATCHED, Mode

IMPORTS = 300
"""Time limit of importing the test files on a busy machine [s]."""

MEMORY = 8 * 2**30
"""Memory limit of a process [bytes]: a wrong size must not exhaust the machine."""

NOTHING_RUN = 71
"""Exit code of a process that found none of the tests that it was to run."""

QUIET = ("-o", "addopts=", "-p", "no:xdist", "-p", "no:cacheprovider", "-q", "--no-header",
         "--no-summary", "--tb=no",
         "--assert=plain")  # fmt: skip


def fork(work: Callable[[], int], output: Path) -> int:
    """Fork a child that only does this work; return its process id.

    Its output is written to a file.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    process = os.fork()
    if process:
        return process
    code = 70
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(written, 1)
        os.dup2(written, 2)
        code = work()
    except BaseException:  # a forked process must not return into its parent's work
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def watch(test_file: str, sources: Instrumented, mode: Mode, result: Path) -> int:
    """Run the tests of a file and write which functions each of them enters, as places in a list.

    Tests that fail, or are not quick, are left out, and those that are left when the time of a file
    is over. ``result`` is a JSON object: ``tests`` has the CPU time [s] and the functions of each
    test; ``ever`` all functions that were entered, also while tests were collected; ``failed`` the
    tests that failed though they were quick. If the file cannot be imported, nothing is written.
    """
    _choose(mode)
    watcher = _Watcher(len(sources.functions), mode)
    builtins.__dict__[ENTERED] = watcher.flags
    _replace_sources(sources.code)
    ended = pytest.main([*QUIET, test_file], plugins=[watcher])
    if ended not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        return 1  # the file cannot be imported
    tests = {test: watcher.tests[test] for test in watcher.tests if test in watcher.passed}
    found = {"tests": tests, "ever": sorted(watcher.ever), "failed": watcher.failed}
    result.write_text(json.dumps(found), encoding="utf-8")
    return 0


def judge(
    mutant: Mutant | None, root: Path, mode: Mode, limits: Mapping[str, float], result: Path
) -> int:
    """Run tests, in this order, on a mutant, or on the tree as it is; return 0 if none fails.

    The name of the test that runs, and so of the one that fails, is written to ``result``.
    ``limits`` [s] are those of the tests: SIGALRM ends the process if one takes longer. If none of
    the tests can be run, the result is :data:`NOTHING_RUN`: it is not that the tests have noticed
    the mutant.
    """
    _choose(mode)
    if mutant is not None:
        _replace_sources({str(root / mutant.file): mutant.source})
    files = list(dict.fromkeys(test.split("::")[0] for test in limits))
    signal.alarm(IMPORTS)
    ended = pytest.main([*QUIET, *files], plugins=[_Chosen(limits, result)])
    if ended in (pytest.ExitCode.NO_TESTS_COLLECTED, pytest.ExitCode.USAGE_ERROR):
        return NOTHING_RUN
    return int(ended)


def list_missing(tests: Iterable[str], result: Path) -> int:
    """Write the names of the tests that cannot be run on the tree as it is, one a line."""
    _choose(Mode.UNCOMPILED)
    collected = _Collected()
    files = {test.split("::")[0] for test in tests}
    pytest.main([*QUIET, *filter(os.path.exists, sorted(files))], plugins=[collected])
    missing = sorted(set(tests) - collected.tests)
    result.write_text("\n".join(missing), encoding="utf-8")
    return 0


def _choose(mode: Mode) -> None:
    """Let functions be compiled or not; this precedes the import of the package."""
    # without a second process that helps to compile
    os.environ["VSCONSTRAINTS_COMPILE"] = "alone" if mode is Mode.COMPILED else "0"


class _LateError(Exception):
    """A test takes longer than a quick one."""


def _may_be_quick(item: pytest.Item) -> bool:
    if COMPARED in getattr(item, "fixturenames", ()):
        return False
    is_slow = item.get_closest_marker("slow") is not None
    return not is_slow or item.path.name == Path(RUNS).name


class _Watcher:
    """Pytest plugin that notes which functions each quick test enters, and its CPU time."""

    def __init__(self, n_functions: int, mode: Mode) -> None:
        self.flags = bytearray(n_functions)
        self.quick = QUICK[mode]
        self.watched = WATCHED[mode]
        self.tests: dict[str, tuple[float, list[int]]] = {}
        self.running = ""
        self.late: set[str] = set()
        self.passed: set[str] = set()
        self.failed: list[str] = []
        self.ever: set[int] = set()
        self.seconds = 0.0

    def entered(self) -> list[int]:
        """Return the functions that were entered since the last call."""
        found = [i for i, flag in enumerate(self.flags) if flag]
        self.flags[:] = bytes(len(self.flags))
        self.ever.update(found)
        return found

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        quick = [item for item in items if _may_be_quick(item)]
        items[:] = sorted(quick, key=lambda item: item.get_closest_marker("full") is not None)

    def _interrupt(self, *_: object) -> None:
        # noted, since a test or a law may catch the exception and go on
        self.late.add(self.running)
        raise _LateError

    def pytest_runtest_setup(self) -> None:
        if self.seconds > self.watched:
            pytest.skip("the time of the file is over")

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.entered()
        started = time.process_time()
        self.running = item.nodeid
        signal.signal(signal.SIGPROF, self._interrupt)
        # CPU time: other work on the machine does not change which tests are quick
        # again and again, if the test goes on
        signal.setitimer(signal.ITIMER_PROF, self.quick, self.quick)
        yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        seconds = time.process_time() - started
        self.seconds += seconds
        self.tests[item.nodeid] = (seconds, self.entered())

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed and report.nodeid not in self.late:
            self.passed.add(report.nodeid)

    def pytest_exception_interact(
        self, call: pytest.CallInfo[object], report: pytest.CollectReport | pytest.TestReport
    ) -> None:
        # a fixture that was late raises the same again for the tests that share it
        is_late = call.excinfo is not None and call.excinfo.errisinstance(_LateError)
        if not is_late and report.nodeid not in self.late:
            self.failed.append(report.nodeid)


class _Collected:
    """Pytest plugin that notes the names of the tests in files, and runs none."""

    def __init__(self) -> None:
        self.tests: set[str] = set()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self.tests = {item.nodeid for item in items}
        items.clear()


class _Chosen:
    """Pytest plugin that runs some tests in a given order, and ends the process if one fails."""

    def __init__(self, limits: Mapping[str, float], result: Path) -> None:
        self.limits = limits
        self.result = result
        self.place = {test: i for i, test in enumerate(limits)}

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = sorted(
            (item for item in items if item.nodeid in self.place),
            key=lambda item: self.place[item.nodeid],
        )

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.result.write_text(nodeid, encoding="utf-8")
        signal.alarm(math.ceil(self.limits[nodeid]))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            os._exit(1)


def _replace_sources(sources: Mapping[str, str] | Mapping[str, CodeType]) -> None:
    """Let every import of these files in this process use another text or code.

    Modules that are found by their name and laws that are loaded by their path are read by the same
    loader.
    """
    original = SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        source = sources.get(loader.path)
        if source is None:
            return original(loader, fullname)
        if isinstance(source, CodeType):
            return source
        code: CodeType = compile(source, loader.path, "exec", dont_inherit=True)
        return code

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign]
