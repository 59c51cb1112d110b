"""Settings that all tests share."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from markers import MARKERS

# `nohup`, and shells that start something in the background, ignore signals, and what is started
# inherits that
for number, handler in (
    (signal.SIGINT, signal.default_int_handler),
    (signal.SIGHUP, signal.SIG_DFL),
):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

# the same examples on every run and machine: a failure is repeatable, and slowness is none
for profile, examples in (("quick", 25), ("thorough", 60)):
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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that are listed in ``markers``."""
    for item in items:
        file = item.path.stem
        function = item.name.partition("[")[0]
        for marker, names in MARKERS.items():
            if file in names or f"{file}::{function}" in names:
                item.add_marker(getattr(pytest.mark, marker))


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
