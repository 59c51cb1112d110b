"""Files and folders under mutation test, and the quick tests that must notice mistakes."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path, PurePath

from scipy.stats import binomtest

LEAST = 0.95
"""Share of the mutants of each group that tests must notice."""

UNLISTED = 0.06
"""Share of mutants that no test can notice, though they are not listed as equivalent.

So many were found in two random samples: 18 of 300 mutants, of the 38 that survived.
"""

DOUBT = 0.05
"""Significance level at which a sample contradicts that share."""

GROUPS: dict[str, tuple[str, ...]] = {
    "metrics": (
        "src/vsconstraints/comparisons/metric_inputs.py",
        "src/vsconstraints/comparisons/metrics.py",
        "src/vsconstraints/reports/results.py",
        "src/vsconstraints/reports/summary.py",
        "src/vsconstraints/compiled/samples.py",
    ),
    "verdicts": (
        "src/vsconstraints/paper/verdicts.py",
        "src/vsconstraints/paper/scenes.py",
        "src/vsconstraints/paper/case_study.py",
        "src/vsconstraints/paper/claims",
    ),
    "laws": (
        "src/vsconstraints/controllers/task_priority.py",
        "src/vsconstraints/controllers/barriers.py",
        "src/vsconstraints/controllers/demand.py",
        "src/vsconstraints/controllers/demands.py",
        "src/vsconstraints/controllers/law.py",
        "src/vsconstraints/controllers/laws.py",
        "src/vsconstraints/controllers/cascade.py",
        "src/vsconstraints/controllers/least_norm.py",
        "src/vsconstraints/controllers/observer.py",
        "src/vsconstraints/controllers/resolver.py",
        "src/vsconstraints/controllers/resolvers.py",
        "src/vsconstraints/simulation/plant.py",
        "src/vsconstraints/simulation/sensing.py",
        "src/vsconstraints/robots/order_filter.py",
        "src/vsconstraints/vision/tracking.py",
    ),
    "lookahead": (
        "src/vsconstraints/prediction/planner.py",
        "src/vsconstraints/prediction/predictive.py",
        "src/vsconstraints/prediction/robust_predictive.py",
        "src/vsconstraints/prediction/kernels/last_plan.py",
        "src/vsconstraints/prediction/kernels/plan_arrays.py",
        "src/vsconstraints/prediction/kernels/plan_cost.py",
        "src/vsconstraints/prediction/kernels/plan_program.py",
        "src/vsconstraints/prediction/kernels/plan_rows.py",
        "src/vsconstraints/prediction/kernels/plan_search.py",
        "src/vsconstraints/prediction/kernels/predicted_program.py",
        "src/vsconstraints/prediction/kernels/predictive.py",
        "src/vsconstraints/prediction/kernels/predictive_arrays.py",
        "src/vsconstraints/controllers/delay.py",
        "src/vsconstraints/compiled/delay.py",
        "controllers/goal_governor.py",
    ),
    "velocity": (
        "src/vsconstraints/controllers/velocity_controller.py",
        "src/vsconstraints/velocity/avoidance.py",
        "src/vsconstraints/velocity/compiled.py",
        "src/vsconstraints/velocity/damper.py",
        "src/vsconstraints/velocity/gain.py",
        "src/vsconstraints/velocity/quadratic.py",
        "src/vsconstraints/velocity/resolved_rate.py",
        "src/vsconstraints/simulation/follower.py",
        "src/vsconstraints/compiled/follower.py",
    ),
    "features": ("src/vsconstraints/vision/features",),
    "recordings": (
        "src/vsconstraints/score",
        "src/vsconstraints/stacks",
        "src/vsconstraints/simulation/programs.py",
    ),
    "formulas": (
        "src/vsconstraints/formulas",
        "src/vsconstraints/vision/measurement.py",
    ),
    "statistics": ("src/vsconstraints/bench/statistics", "src/vsconstraints/comparisons/rates.py"),
}

NAMED_TOO = (
    "src/vsconstraints/compiled",
    "src/vsconstraints/velocity/kernels",
    "src/vsconstraints/dynamics/kernels",
    "src/vsconstraints/constraints",
    "src/vsconstraints/qp",
)
"""Folders that have named mutants, but no required share."""

COMPILER = (
    "accelerator",
    "cache",
    "checksums",
    "compiler",
    "numba_interface",
    "parts",
    "scratch",
    "signatures",
    "__init__",
)
"""Files that are not mutated: they compile functions, which run as Python for mutants of theirs."""


class Mode(StrEnum):
    """How the tests of a mutant run."""

    COMPILED = "compiled"
    UNCOMPILED = "uncompiled"


COMPILED_FOLDERS = ("compiled", "formulas", "kernels")
COMPILED_TOO = (
    "src/vsconstraints/constraints/by_formula.py",
    "src/vsconstraints/controllers/barriers.py",
    "src/vsconstraints/controllers/demands.py",
    "src/vsconstraints/controllers/resolver.py",
    "src/vsconstraints/rows/checks.py",
    "src/vsconstraints/rows/tolerances.py",
    "src/vsconstraints/velocity/quadratic.py",
    "src/vsconstraints/vision/distortion.py",
    "src/vsconstraints/vision/scene.py",
)
"""Files outside these folders with formulas or constants of compiled code."""


def mode_of(file: str) -> Mode:
    """Return the mode for mutants of a source file.

    What compiled code is made of runs as Python, since to compile it for each mutant would take
    minutes. For mutants of all other files, compiled code is read from the cache, and many more
    tests are quick.
    """
    if PurePath(file).parent.name in COMPILED_FOLDERS or file in COMPILED_TOO:
        return Mode.UNCOMPILED
    return Mode.COMPILED


def files_of(root: Path, names: Sequence[str]) -> list[str]:
    """Return files, and the files in folders."""
    found = []
    for name in names:
        there = root / name
        files = sorted(there.glob("*.py")) if there.is_dir() else [there]
        found += [file.relative_to(root).as_posix() for file in files if file.stem not in COMPILER]
    return found


def files_named(root: Path) -> list[str]:
    """Return all files that have named mutants."""
    return list(
        dict.fromkeys(
            files_of(root, [*(name for names in GROUPS.values() for name in names), *NAMED_TOO])
        )
    )


def suffices(noticed: int, of: int) -> bool:
    """True unless mutants contradict the least share of those that can be noticed.

    It is an exact binomial test, one-sided, for a random sample or for mutants of changed lines.
    """
    least = LEAST * (1.0 - UNLISTED)
    return of == 0 or bool(binomtest(noticed, of, least, alternative="less").pvalue >= DOUBT)


TESTS = (
    "tests/test_box.py",
    "tests/test_camera.py",
    "tests/test_claims_case_study.py",
    "tests/test_claims_experiments.py",
    "tests/test_claims_first_example.py",
    "tests/test_claims_remarks.py",
    "tests/test_claims_shared_rules.py",
    "tests/test_claims_studies.py",
    "tests/test_command_delay.py",
    "tests/test_compiled_constraints.py",
    "tests/test_compiled_manipulability.py",
    "tests/test_constraints.py",
    "tests/test_control_step.py",
    "tests/test_continuous_joints.py",
    "tests/test_controllers.py",
    "tests/test_demands.py",
    "tests/test_derivatives.py",
    "tests/test_delay.py",
    "tests/test_disturbances.py",
    "tests/test_disturbed_loop.py",
    "tests/test_dynamics.py",
    "tests/test_features.py",
    "tests/test_follower.py",
    "tests/test_formulas.py",
    "tests/test_geometry.py",
    "tests/test_goal_governor.py",
    "tests/test_barrier_governor.py",
    "tests/test_headlines_by_hand.py",
    "tests/test_hierarchical_qp.py",
    "tests/test_implicit_switch.py",
    "tests/test_kernels.py",
    "tests/test_kernels_redundant.py",
    "tests/test_laws.py",
    "tests/test_laws_by_hand.py",
    "tests/test_lenses.py",
    "tests/test_limits.py",
    "tests/test_line_of_sight.py",
    "tests/test_lookahead_by_hand.py",
    "tests/test_measurement.py",
    "tests/test_measurement_by_hand.py",
    "tests/test_metrics.py",
    "tests/test_model.py",
    "tests/test_motion_by_hand.py",
    "tests/test_observer.py",
    "tests/test_own_formulas.py",
    "tests/test_performance_funnel.py",
    "tests/test_plan_program.py",
    "tests/test_predictive.py",
    "tests/test_qp_solvers.py",
    "tests/test_recorded_pixels.py",
    "tests/test_recorded_runs.py",
    "tests/test_reports.py",
    "tests/test_reproduction.py",
    "tests/test_resolvers.py",
    "tests/test_rest.py",
    "tests/test_samples_by_hand.py",
    "tests/test_saturation.py",
    "tests/test_score_run.py",
    "tests/test_scores_by_hand.py",
    "tests/test_simulation.py",
    "tests/test_stacks.py",
    "tests/test_statistics.py",
    "tests/test_statistics_tables.py",
    "tests/test_tracking.py",
    "tests/test_velocity.py",
    "tests/test_workspace.py",
    "tests/test_wrong_cameras.py",
)

QUICK = {Mode.COMPILED: 10.0, Mode.UNCOMPILED: 2.0}
"""Time limit of a test [s]; longer ones are left out."""

WATCHED = {Mode.COMPILED: 60.0, Mode.UNCOMPILED: 25.0}
"""Time [s] for which the tests of a file are watched, those of the quick suite first."""

RUNS = "tests/test_reproduction.py"
"""Test file that simulates many runs; as a script it keeps them, and then its tests are quick.

Slow tests of other files are left out.
"""

COMPARED = "real"
"""Fixture that simulates a whole comparison in other processes, without the mistake.

Its tests are left out.
"""
