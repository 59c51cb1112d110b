"""What must be right, and the quick tests that are asked whether it is."""

from __future__ import annotations

LEAST = 0.95
"""Share of the mutants of each group that tests must notice."""

GROUPS = {
    "metrics": (
        "src/vsconstraints/comparisons/metrics.py",
        "src/vsconstraints/reports/best.py",
        "src/vsconstraints/reports/headlines.py",
        "src/vsconstraints/reports/summary.py",
    ),
    "verdicts": (
        "src/vsconstraints/reproduction/verdicts.py",
        "src/vsconstraints/reproduction/claims/boundary.py",
        "src/vsconstraints/reproduction/claims/case_study.py",
        "src/vsconstraints/reproduction/claims/erroneous_gradients.py",
        "src/vsconstraints/reproduction/claims/every_scene.py",
        "src/vsconstraints/reproduction/claims/experiments.py",
        "src/vsconstraints/reproduction/claims/first_example.py",
        "src/vsconstraints/reproduction/claims/general.py",
        "src/vsconstraints/reproduction/claims/moving_and_time.py",
        "src/vsconstraints/reproduction/claims/studied.py",
        "src/vsconstraints/reproduction/claims/trap_and_corners.py",
    ),
    "laws": (
        "src/vsconstraints/controllers/sliding_mode.py",
        "src/vsconstraints/controllers/potential_field.py",
        "src/vsconstraints/controllers/task_priority.py",
        "src/vsconstraints/controllers/tracking.py",
        "src/vsconstraints/controllers/hierarchical_qp.py",
        "src/vsconstraints/simulation/plant.py",
        "src/vsconstraints/simulation/gradient_error.py",
        "src/vsconstraints/order_filter.py",
        "src/vsconstraints/tracking.py",
    ),
}

COMPILED = ("_compiled", "_bound", "_arguments", "_weights_of")
"""Functions of the laws' compiled form, which does not run here: tests hold it to the definition."""

TESTS = (
    "tests/test_claims_by_hand.py",
    "tests/test_controllers.py",
    "tests/test_disturbances.py",
    "tests/test_hierarchical_qp.py",
    "tests/test_laws_by_hand.py",
    "tests/test_motion_by_hand.py",
    "tests/test_more_claims_by_hand.py",
    "tests/test_reproduction.py",
    "tests/test_simulation.py",
    "tests/test_tracking.py",
)

SLOW = ("figures", "report_is_written", "interrupted")
"""Tests with this in their names are left out."""
