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
    "test_documents::test_own_parts_take_part_in_a_comparison",
    "test_documents::test_the_example_law_keeps_scenes_that_it_was_not_made_for",
    "test_difference",
    "test_evidence::test_shards_merged_and_processes_give_the_same",
    "test_evidence_report::test_a_whole_report",
    "test_evidence_report::test_fronts_of_a_tuning_are_shown",
    "test_evidence_report::test_the_example_script_recomputes_every_claim",
    "test_families::test_the_same_scene_in_another_process_and_in_any_order",
    "test_figures",
    "test_first_five_minutes",
    "test_mutated",
    "test_notebooks",
    "test_on_arm::test_missed_periods_of_a_real_loop_are_a_column",
    "test_pool",
    "test_replay_in_a_browser",
    "test_report_pages",
    "test_reports::test_a_report_of_many_laws_has_figures_and_tables_of_few",
    "test_result_folders",
    "test_statistics_tables::test_of_all_verdicts_on_several_laws_none_is_false_in_95_of_100",
    "test_stored_runs",
    "test_arm_faults",
    "test_reproduction",
    "test_signals",
    "test_signals_held",
    "test_studies",
    "test_tuning",
}
"""Files and tests that start processes, compile from nothing or simulate for long: two thirds of all the time."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark slow tests."""
    for item in items:
        if {item.path.stem, f"{item.path.stem}::{item.name.partition('[')[0]}"} & SLOW:
            item.add_marker(pytest.mark.slow)


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs and figures are made by calls: starting processes takes longer than what tests ask of them."""

    def run_all(
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
        monkeypatch.setattr(f"vsconstraints.{module}.runner.run_all", run_all)
