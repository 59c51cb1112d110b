"""Settings that all tests share."""

from __future__ import annotations

import csv
import signal
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from markers import MARKERS, SAMPLED, sampled

NOTICED = Path(__file__).parents[1] / "checks/mutation/noticed.tsv"

# `nohup`, and shells that start something in the background, ignore signals, and what is started
# inherits that
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

# the same examples on every run and machine: a failure is repeatable, and slowness is none
for profile, examples in (("quick", 10), ("thorough", 60)):
    settings.register_profile(
        profile,
        derandomize=True,
        database=None,
        deadline=None,
        max_examples=examples,
        suppress_health_check=[HealthCheck.too_slow],
    )
# ``pytest --hypothesis-profile=thorough`` chooses the other one
settings.load_profile("quick")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files and folders none of whose tests would run: imports take seconds.

    What is named on the command line is collected, so that pytest says what it deselects.
    """
    chosen = config.getoption("markexpr")
    left_out = [marker for marker in MARKERS if f"not {marker}" in chosen]
    named = {config.invocation_params.dir / argument.partition("::")[0] for argument in config.args}
    if collection_path not in named and any(
        collection_path.stem in MARKERS[marker] for marker in left_out
    ):
        return True
    return None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that are listed in ``markers``, and the cases that the quick suite omits."""
    many: dict[str, list[pytest.Function]] = {}
    for item in items:
        file = item.path.stem
        test = f"{file}::{item.name.partition('[')[0]}"
        for marker, names in MARKERS.items():
            if file in names or test in names:
                item.add_marker(getattr(pytest.mark, marker))
        if test in SAMPLED and isinstance(item, pytest.Function):
            many.setdefault(test, []).append(item)
    noticing = _tests_of_named_mutants()
    for test, cases in many.items():
        kept = sampled([case.callspec.params for case in cases], SAMPLED[test])
        for number, case in enumerate(cases):
            if number not in kept and case.nodeid not in noticing:
                case.add_marker(pytest.mark.full)


def _tests_of_named_mutants() -> set[str]:
    """Return the names of the tests that notice the named mutants: the quick suite keeps them.

    In a copy of the tests without ``checks`` there are none.
    """
    if not NOTICED.exists():
        return set()
    with NOTICED.open(encoding="utf-8", newline="") as file:
        return {mutant["test"] for mutant in csv.DictReader(file, delimiter="\t")}


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs and figures are made by calls: starting processes takes longer than what tests ask of
    them.
    """

    def run_all(
        function: Callable[..., Any],
        calls: Mapping[Any, tuple[Any, ...]],
        on_answer: Callable[[Any, Any], None] = lambda key, answer: None,
        **_: object,
    ) -> dict[Any, Any]:
        answers = {}
        for key, arguments in calls.items():
            answers[key] = function(*arguments)
            on_answer(key, answers[key])
        return answers

    class Here:
        """A pool that is this process."""

        def __init__(self, function: Callable[..., Any], processes: int) -> None:
            self.function = function

        def __enter__(self) -> Here:
            return self

        def __exit__(self, *error: object) -> None:
            pass

        def run(
            self, calls: Mapping[Any, tuple[Any, ...]], limits: object
        ) -> Iterator[tuple[Any, Any]]:
            for key, arguments in calls.items():
                yield key, self.function(*arguments)

    monkeypatch.setattr("vsconstraints.comparisons.runs.pool.Pool", Here)
    monkeypatch.setattr("vsconstraints.paper.runner.run_all", run_all)
