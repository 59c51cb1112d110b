"""Files and tests that are not part of the quick suite."""

SLOW = {
    "test_arm_faults",
    "test_benchmarks",
    "test_bounds_checks",
    "test_cli",
    "test_cluster",
    "test_compiler",
    "test_control_step::test_every_feature_with_every_constraint",
    "test_difference",
    "test_documents::test_own_parts_take_part_in_a_comparison",
    "test_documents::test_the_example_law_keeps_scenes_that_it_was_not_made_for",
    "test_evidence::test_shards_merged_and_processes_give_the_same",
    "test_evidence_report::test_a_tuning_is_shown",
    "test_evidence_report::test_a_whole_report",
    "test_evidence_report::test_the_example_script_recomputes_every_claim",
    "test_families::test_most_attempts_are_worth_making",
    "test_families::test_the_same_scene_in_another_process_and_in_any_order",
    "test_figures",
    "test_first_five_minutes",
    "test_fresh::test_fresh_scenes_are_run_by_the_published_laws_and_the_same_seed_gives_the_same_table",
    "test_law_process",
    "test_leaderboard::test_a_check_says_how_many_runs_it_repeated_by_which_secret_seed",
    "test_mutated",
    "test_notebooks",
    "test_nothing_outside_changes",
    "test_on_arm::test_missed_periods_of_a_real_loop_are_a_column",
    "test_pool",
    "test_portable",
    "test_replay_in_a_browser",
    "test_report_pages",
    "test_reports::test_a_report_of_many_laws_has_figures_and_tables_of_few",
    "test_reproduction",
    "test_result_folders",
    "test_signals",
    "test_signals_held",
    "test_statistics_tables::test_of_all_verdicts_on_several_laws_none_is_false_in_95_of_100",
    "test_stored_runs",
    "test_studies",
    "test_tuning",
}
"""Tests that start processes, compile without a cache or simulate for long."""

FULL = {
    # the checks of `python -m checks.NAME`, and the structure of the code
    "test_advice::test_the_check_leaves_a_family_out",
    "test_bands",
    "test_best",
    "test_calibration::test_mutated_files_are_read_or_refused_by_name",
    "test_calibration::test_the_fuzz_sees_what_it_looks_for",
    "test_checksums::test_some_changed_copies_are_refused_or_read",
    "test_dynamics::test_mujoco_and_this_package_run_the_case_study_alike",
    "test_fuzz",
    "test_known",
    "test_misplaced",
    "test_mutation",
    "test_statistics_tables::test_intervals_cover",
    "test_statistics_tables::test_laws_are_told_apart_when_they_differ_and_only_then",
    "test_structure",
    # the compiler's internals
    "test_allocations",
    "test_numba_interface",
    "test_scratch",
    "test_uncompiled",
    # documentation and the published results
    "test_documented_formulas",
    "test_documents",
    "test_kept_numbers",
    "test_own_metric",
    "test_scenario_reference",
    "test_which_conclusions_hold::test_all_of_it_found_again_by_other_libraries",
    "test_which_law",
}
"""Tests of the project's own checks, of the compiler's internals and of documentation."""

MARKERS = {"slow": SLOW, "full": FULL}
"""Names of files, and of single tests as ``file::function``, by marker."""
