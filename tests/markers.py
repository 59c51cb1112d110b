"""Files, tests and cases of tests that are not part of the quick suite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

SLOW = {
    "test_arm_faults",
    "test_benchmarks",
    "test_bounds_checks",
    "test_checksums::test_a_command_that_is_killed_leaves_what_can_be_read_and_gone_on_with",
    "test_checksums::test_no_flipped_bit_of_a_batch_gives_other_numbers_even_without_sums",
    "test_cli",
    "test_cluster",
    "test_comparisons::test_a_stored_run_is_kept_and_a_changed_one_is_not",
    "test_comparisons::test_an_interrupt_keeps_what_was_finished_and_the_same_command_goes_on",
    "test_compiler",
    "test_control_step::test_every_feature_with_every_constraint",
    "test_difference",
    "test_documents::test_own_parts_take_part_in_a_comparison",
    "test_documents::test_the_example_law_keeps_scenes_that_it_was_not_made_for",
    "test_environment::test_the_package_does_not_import_gymnasium",
    "test_evidence::test_shards_merged_and_processes_give_the_same",
    "test_evidence_report::test_a_tuning_is_shown",
    "test_evidence_report::test_a_whole_report",
    "test_evidence_report::test_the_example_script_recomputes_every_claim",
    "test_evidence_report_situations::test_only_scenes_of_the_test_set_stand_beside_its_best_motions",
    "test_evidence_report_situations::test_the_heat_map_is_sorted_by_a_click_and_scrolls_in_its_box_on_a_phone",
    "test_evidence_report_situations::test_the_only_script_of_a_page_is_that_of_its_heat_map",
    "test_extras::test_a_comparison_needs_none_of_them",
    "test_families::test_most_attempts_are_worth_making",
    "test_families::test_scenes_and_families_can_be_sent_to_other_processes",
    "test_families::test_the_same_scene_in_another_process_and_in_any_order",
    "test_figures",
    "test_first_five_minutes",
    "test_fresh::test_fresh_scenes_are_run_by_the_published_laws_and_the_same_seed_gives_the_same_table",
    "test_images::test_a_detector_is_left_to_the_end_of_the_process",
    "test_law_process",
    "test_laws_in_files::test_a_run_on_an_arm_has_a_folder_named_after_the_law",
    "test_laws_in_files::test_a_suite_finds_its_laws_and_their_neighbours_from_any_working_directory",
    "test_leaderboard::test_a_check_says_how_many_runs_it_repeated_by_which_secret_seed",
    "test_leaderboard::test_kept_runs_are_what_laws_do_now",
    "test_mutated",
    "test_notebooks",
    "test_nothing_outside_changes",
    "test_on_arm::test_a_controller_without_the_right_time_stores_its_runs",
    "test_on_arm::test_missed_periods_of_a_real_loop_are_a_column",
    "test_on_arm::test_the_package_of_universal_robots_brings_setpoints_to_the_arm",
    "test_own_files::test_a_file_that_is_edited_while_a_campaign_runs_ends_it",
    "test_own_files::test_a_law_in_its_process_may_read_what_it_has_written",
    "test_own_files::test_a_tuning_does_not_go_on_with_another_content_of_a_file",
    "test_own_files::test_processes_say_what_they_have_read",
    "test_own_files::test_batches_of_different_files_are_not_merged",
    "test_policy::test_the_example_s_weights_arrive_in_scenes_they_were_not_trained_on",
    "test_pool",
    "test_portable",
    "test_recorded_runs::test_a_mujoco_run_is_scored_by_the_command",
    "test_registry::test_a_command_of_another_package_stands_beside_those_of_this_one",
    "test_registry::test_a_scenario_names_the_plant_of_another_package",
    "test_registry::test_an_earlier_name_is_the_module_of_today",
    "test_replay_in_a_browser",
    "test_report_pages",
    "test_reports::test_a_report_of_many_laws_has_figures_and_tables_of_few",
    "test_reproduction",
    "test_result_folders",
    "test_session_laws::test_a_comparison_goes_on_in_another_session",
    "test_session_laws::test_a_law_of_a_session_uses_the_present_values_of_its_globals",
    "test_signals",
    "test_signals_held",
    "test_statistics_tables::test_of_all_verdicts_on_several_laws_none_is_false_in_95_of_100",
    "test_stored_runs",
    "test_studies",
    "test_tuning",
    "test_which_conclusions_hold::test_a_conclusion_holds_is_reversed_or_is_inconclusive",
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
    "test_stacks_in_view",
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
    # long simulations and pages of results, beside quick tests of the same parts
    "test_demands::test_conditioned_super_twisting_is_the_conditioned_algorithm_of_continuous_time",
    "test_difference_of_evidence::"
    "test_gains_of_a_family_that_are_others_are_a_change_and_those_that_are_drawn_another_scene",
    "test_evidence_report::test_figures_are_drawn_of_little",
    "test_evidence_report::test_success_over_tolerated_depth_goes_through_the_table",
    "test_evidence_report::test_training_scenes_are_never_passed_off_as_held_out",
    "test_evidence_report_situations::"
    "test_levels_have_a_figure_and_a_line_among_the_situations_and_no_section",
    "test_large_reports",
    "test_leaderboard",
    "test_own_files::test_results_of_different_files_in_one_folder_are_noticed",
    "test_several_folders::test_commands_take_several_folders",
    "test_advice::test_the_study_of_the_package_answers_for_every_scenario",
    "test_reports::test_no_bold_value_is_worse_than_another_of_its_column",
    "test_warnings::test_what_is_proved_to_be_impossible_says_so",
    "test_missing_columns::test_a_campaign_is_read_and_reported",
    "test_path_integral::test_it_reaches_a_goal_at_the_boundary_of_the_image",
    "test_path_integral::test_many_samples_make_the_step_of_the_quadratic_program",
    "test_path_integral::test_sample_by_sample_it_comes_to_the_linear_quadratic_optimum",
}
"""Tests of checks, compiler and documentation, and long ones beside quick ones of the same part."""

MARKERS = {"slow": SLOW, "full": FULL, "faults": {"faults"}}
"""Names of files and folders, and of single tests as ``file::function``, by marker."""

SAMPLED: dict[str, int | tuple[str, ...]] = {
    "test_box::test_a_box_that_holds_nothing_back_changes_no_bit": ("demand", "resolver"),
    "test_box::test_a_box_that_is_none_is_refused": 8,
    "test_box::test_both_forms_keep_it_alike": ("demand", "resolver"),
    "test_box::test_no_law_leaves_the_box": 10,
    "test_command_delay::test_a_late_command_is_the_delayed_input_of_the_differential_equation": (
        "actuation",
        "tau",
        "delay",
    ),
    "test_compiled_constraints::test_every_registered_constraint": ("name", "type_name"),
    "test_control_step::test_every_angle_of_rotation": ("angle", "axis"),
    "test_control_step::test_every_robot_and_constraint_in_every_world": ("name", "world"),
    "test_control_step::test_the_compiled_loop_runs_every_shipped_scenario_as_the_other_does": (
        "name",
        "law",
    ),
    "test_controllers::test_a_row_that_is_not_finite_is_named": ("name",),
    "test_controllers::test_a_task_that_is_not_finite_is_named": ("name",),
    "test_controllers::test_accelerations_at_which_rows_cannot_be_checked_are_no_answer": (
        "law",
        "size",
    ),
    "test_controllers::test_an_option_is_checked_whenever_it_is_set": ("name", "option"),
    "test_controllers::test_answers_are_repeatable_and_leave_the_question_alone": ("name",),
    "test_controllers::test_any_finite_problem_has_a_finite_answer": ("name",),
    "test_controllers::test_as_many_active_rows_as_joints_leave_the_task_nothing": 5,
    "test_controllers::test_finite_numbers_whose_products_are_not_end_in_time": ("name", "size"),
    "test_controllers::test_laws_name_what_takes_long_to_compile": 7,
    "test_controllers::test_rows_that_do_not_act_leave_the_tracking_command_as_it_is": ("name",),
    "test_controllers::test_the_unit_of_a_row_changes_no_command": ("law", "dependent", "seed"),
    "test_controllers::test_what_is_no_array_of_floats_is_refused": ("name",),
    "test_controllers::test_without_joints_there_is_nothing_to_command": ("name",),
    "test_delay::test_compiled_and_by_calls_alike": ("disturbances", "options", "name"),
    "test_delay::test_the_commands_are_those_without_a_delay": ("name", "delay"),
    "test_derivatives::test_a_slip_in_a_constraint_is_noticed": ("type_name", "method"),
    "test_derivatives::test_camera_twist_and_image_motion": ("name", "world"),
    "test_derivatives::test_constraints": ("name", "type_name", "number"),
    "test_derivatives::test_constraints_in_other_worlds": ("type_name", "number", "world"),
    "test_derivatives::test_features": ("name", "feature", "world"),
    "test_disturbed_loop::test_both_forms_find_the_same_pose": ("markers", "noise"),
    "test_follower::test_the_loop_moves_as_it_is_defined": ("acceleration", "jerk", "push"),
    "test_hierarchical_qp::test_a_lying_solver_is_replaced_and_reported": ("lie", "kind"),
    "test_kernels::test_bad_numbers_are_named_as_ever": ("law", "value"),
    "test_kernels::test_degenerate_problems": ("name", "kind"),
    "test_kernels::test_numbers_whose_squares_leave_the_range_give_no_command": (
        "law",
        "which",
        "factor",
    ),
    "test_kernels::test_random_problems": ("name", "n"),
    "test_kernels::test_the_two_descents_agree": ("kind", "form"),
    "test_kernels_redundant::test_rows_that_nearly_depend_on_each_other": ("n", "share"),
    "test_kernels_redundant::test_rows_within_the_span_of_the_task": ("law", "n", "k"),
    "test_kernels_redundant::"
    "test_the_cut_of_what_rows_leave_of_the_task_is_relative_to_the_whole_task": (
        "n",
        "k",
        "share",
    ),
    "test_law_ranges::test_any_values_inside_make_a_law_that_answers": ("name",),
    "test_law_ranges::test_what_changes_nothing_is_said": ("name",),
    "test_law_ranges::test_what_is_not_searched_of_the_rows_changes_nothing": 8,
    "test_laws::test_a_reset_forgets_all_that_was_learnt": ("demand", "resolver"),
    "test_laws::test_every_law_answers_alike_with_its_formula_in_numpy": ("demand", "resolver"),
    "test_laws::test_every_law_refuses_what_is_not_finite": ("demand", "resolver"),
    "test_laws::test_every_law_tracks_without_rows": ("demand", "resolver"),
    "test_laws::test_rows_in_other_units_than_their_scale_are_refused_by_name": (
        "demand",
        "resolver",
        "form",
    ),
    "test_laws::test_the_units_of_rows_change_no_law": ("demand", "factor", "form"),
    "test_limits::test_no_run_exceeds_what_the_actuators_have": ("law", "case", "known"),
    "test_metrics::test_a_law_that_overspeeds_violates": ("tolerated",),
    "test_own_files::test_a_campaign_does_not_go_on_with_another_content_of_a_file": 1,
    "test_plan_program::test_plans_are_those_of_a_dense_program": 15,
    "test_plan_program::test_rows_that_contradict_each_other_are_violated_least": 10,
    "test_qp_solvers::test_a_solver_never_sees_a_number_that_is_not_finite": (
        "name",
        "number",
        "entry",
    ),
    "test_registry::test_a_broken_part_is_an_error_that_names_it": 1,
    "test_registry::test_a_function_that_is_missing_is_an_error_that_names_it": 1,
    "test_resolvers::test_a_formula_in_numpy_gives_the_same_command": ("demand", "resolver"),
    "test_rest::test_a_rest_of_zero_changes_no_bit": ("demand", "resolver"),
    "test_rest::test_where_no_row_asks_for_anything_the_task_is_tracked_by_the_nearest": (
        "form",
        "resolver",
        "k",
    ),
    "test_score_run::test_scores_are_those_of_the_trajectory": ("name", "law"),
    "test_stacks::test_a_stack_that_fails_is_refused_with_the_reason_and_its_last_messages": 8,
    "test_statistics_tables::test_every_metric_of_few_scenes": ("name", "scenes"),
    "test_units::test_comparisons_ask_it_too": 3,
}
"""Tests of many cases, as ``file::function``: what the quick suite runs of them.

It runs so many cases, evenly from all, or as few as contain each value of these parameters. The
others have the marker ``full``.
"""


def sampled(cases: Sequence[Mapping[str, Any]], chosen: int | tuple[str, ...]) -> set[int]:
    """Return the numbers of the cases, given by their parameters, that the quick suite runs.

    ``chosen`` is an entry of ``SAMPLED``. The case with the most values that are still missing
    comes next, the first one if several have as many.
    """
    if isinstance(chosen, int):
        return {round(k * len(cases) / chosen) for k in range(chosen)}
    values = [{(name, repr(case[name])) for name in chosen} for case in cases]
    missing = set().union(*values)
    kept = set()
    while missing:
        best = max(range(len(cases)), key=lambda number: len(values[number] & missing))
        kept.add(best)
        missing -= values[best]
    return kept
