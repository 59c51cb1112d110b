"""Our counterparts of the paper's figures, in one table."""

from collections.abc import Callable

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Figure, Sheet
from ..claims.case_study import CASE
from ..claims.erroneous_gradients import IBVS_ERROR, PBVS_ERROR
from ..claims.experiments import IBVS, PBVS
from ..claims.first_example import FAST, FOV, HIGH_GAIN
from ..claims.trap_and_corners import BOWL, CONCAVE, CONVEX
from . import arm, case_study, experiments, planar, sketches


def _figure(number: int, draw: Callable[..., Sheet], caption: str, *needs: RunSpec) -> tuple[int, Figure]:
    return number, Figure(f"fig-{number:02d}", f"Fig. {number}", caption, draw, needs, formulas=True)


# fmt: off
FIGURES: dict[int, Figure] = dict((
    _figure(2, sketches.draw_hyperellipses, "Boundary of the FOV constraint, σ = 0, for a safety margin of 5 % and "
            "different n; thick: the image."),
    _figure(3, sketches.draw_planar_system, "System of the first example: planar 3R arm, target with two features, "
            "base frame F, initial camera frame C and desired camera frame C*, which are in the same place and "
            "turned by π.", FOV),
    _figure(4, planar.draw_fov, "First example with the FOV constraint only. Top: tracks in the image. Below: "
            "position and orientation errors, joint positions, φ of the second feature.", FOV),
    _figure(5, planar.draw_fast, "First example with fast motion. Top: tracks for the small and the large switching "
            "gain. Below: φ of the second feature for both.", FAST, HIGH_GAIN),
    _figure(6, planar.draw_bowl, "First example in a trap. Top: tracks and the bowl. Below: errors, φ of the FOV and "
            "of the bowl (cut off below); φ of the bowl for both features, linear within ±T_s u⁺ (shaded) and "
            "logarithmic beyond.", BOWL),
    _figure(7, planar.draw_convex, "First example, convex corner. Top: tracks and the heart turned clockwise by 90°, "
            "with a detail. Below: errors, φ.", CONVEX),
    _figure(8, planar.draw_concave, "First example, concave corner. Top: tracks and the heart, with a detail: red "
            "where σ > 0. Below: errors, φ.", CONCAVE),
    _figure(9, arm.draw_system, "System of the case study: 6R arm, target with four markers, forbidden sphere, "
            "frames F, O, C, C*¹ and C*² (x red, y green, z blue).", CASE),
    _figure(10, case_study.draw_tracks, "Case study. Top: tracks in the image. Below: position and orientation "
            "errors.", CASE),
    _figure(11, case_study.draw_signals, "Case study. From top: joint positions, joint speeds, greatest φ, and when "
            "each constraint is active, with the instants of Fig. 12. Thick dashed: the desired camera frame "
            "changes.", CASE),
    _figure(12, arm.draw_frames, "Case study. Top: four frames with the path of the end-effector. Below: the sphere "
            "from nearby.", CASE),
    _figure(14, experiments.draw_signals, "Experiment 1 (PBVS), simulated: errors, control action, φ of the FOV "
            "constraints.", PBVS),
    _figure(15, experiments.draw_tracks, "Experiment 1 (PBVS), simulated: tracks, and the target as seen from the "
            "desired pose.", PBVS),
    _figure(16, experiments.draw_comparison, "Experiment 1 (PBVS), simulated, without (solid) and with (dashed) "
            "errors in the gradient: tracks, joint speeds.", PBVS, PBVS_ERROR),
    _figure(17, experiments.draw_signals, "Experiment 2 (IBVS), simulated: image errors, control action, φ of the "
            "occlusion constraints.", IBVS),
    _figure(18, experiments.draw_tracks, "Experiment 2 (IBVS), simulated: tracks, and the target as seen from the "
            "desired pose.", IBVS),
    _figure(19, experiments.draw_comparison, "Experiment 2 (IBVS), simulated, without (solid) and with (dashed) "
            "errors in the gradient: image errors, joint speeds.", IBVS, IBVS_ERROR),
))
# fmt: on
"""Our counterparts by the paper's number: who draws them, what is to be seen, and from which runs. Figs. 1 and 13 show
frames and a laboratory, and have none."""
