"""Settings that all tests share."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# `nohup`, and shells that start something in the background, ignore signals, and what is started inherits that
for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

# the same examples on every run and machine: a failure is repeatable, and slowness is none
settings.register_profile(
    "repeatable",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("repeatable")


SLOW = {
    "test_benchmarks",
    "test_cli",
    "test_cluster",
    "test_compiler",
    "test_difference",
    "test_figures",
    "test_first_five_minutes",
    "test_mutated",
    "test_notebooks",
    "test_pool",
    "test_replay_in_a_browser",
    "test_report_pages",
    "test_arm_faults",
    "test_reproduction",
    "test_signals",
    "test_signals_held",
    "test_studies",
    "test_tuning",
}
"""Files whose tests start processes, compile from nothing or simulate for minutes: half of the time of all tests."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of slow files."""
    for item in items:
        if item.path.stem in SLOW:
            item.add_marker(pytest.mark.slow)


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs and figures are made by calls: starting processes takes longer than what tests ask of them."""

    def carry_out(
        function: Callable[..., Any],
        *batches: Mapping[Any, tuple[Any, ...]],
        on_answer: Callable[[Any, Any], None] = lambda key, answer: None,
        **_: object,
    ) -> dict[Any, Any]:
        answers = {}
        for key, arguments in (call for batch in batches for call in batch.items()):
            answers[key] = function(*arguments)
            on_answer(key, answers[key])
        return answers

    for module in ("comparisons", "paper"):
        monkeypatch.setattr(f"vsconstraints.{module}.runner.carry_out", carry_out)
