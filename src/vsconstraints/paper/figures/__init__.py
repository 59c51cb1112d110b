"""Counterparts of the paper's figures, in one table."""

from collections.abc import Callable
from functools import partial

from ...comparisons.runs.spec import RunSpec
from ...reports.plots import Figure, Sheet
from ..scenes import (
    BOWL,
    CASE,
    CONCAVE,
    CONVEX,
    FAST,
    FOV,
    HIGH_GAIN,
    IBVS,
    IBVS_ERROR,
    PBVS,
    PBVS_ERROR,
)
from . import experiments, simulations, space


def _counterpart(
    number: int, draw: Callable[..., Sheet], *needs: RunSpec, shows: str
) -> tuple[int, Figure]:
    """Return the number of a figure of the paper, and its counterpart.

    ``draw`` draws the runs that it needs, and ``shows`` is its caption.
    """
    figure = Figure(f"fig-{number:02d}", f"Fig. {number}", shows, draw, needs, formulas=True)
    return number, figure


#: Counterparts by the paper's number. Figs. 1 and 13 show frames and a laboratory; they have no
#: counterpart.
FIGURES: dict[int, Figure] = dict(
    [
        _counterpart(
            2,
            simulations.draw_hyperellipses,
            shows="Boundary of the FOV constraint, σ = 0, for a safety margin of 5 % and "
            "different n; thick: the image.",
        ),
        _counterpart(
            3,
            partial(space.draw_system, view=space.PLANE),
            FOV,
            shows="System of the first example, from above: planar 3R arm, target with two "
            "features 1 m below the camera, base frame F, target O, initial camera frame C and "
            "desired camera frame C*, which are in the same place and turned by π (x red, y "
            "green, z blue).",
        ),
        _counterpart(
            4,
            simulations.draw_fov,
            FOV,
            shows="First example with the FOV constraint only. Top: tracks in the image. Below: "
            "position and orientation errors, joint positions, φ of the second feature.",
        ),
        _counterpart(
            5,
            simulations.draw_fast,
            FAST,
            HIGH_GAIN,
            shows="First example with fast motion. Top: tracks for the small and the large "
            "switching gain. Below: φ of the second feature for both.",
        ),
        _counterpart(
            6,
            partial(simulations.draw_obstacle, met=simulations.IN_BOWL),
            BOWL,
            shows="First example in a trap. Top: tracks and the bowl. Below: errors, φ of the FOV "
            "and of the bowl (cut off below); φ of the bowl for both features, linear within ±T_s "
            "u⁺ (shaded) and logarithmic beyond.",
        ),
        _counterpart(
            7,
            partial(simulations.draw_obstacle, met=simulations.AT_CONVEX),
            CONVEX,
            shows="First example, convex corner. Top: tracks and the heart turned clockwise by "
            "90°, with a detail. Below: errors, φ.",
        ),
        _counterpart(
            8,
            partial(simulations.draw_obstacle, met=simulations.AT_CONCAVE),
            CONCAVE,
            shows="First example, concave corner. Top: tracks and the heart, with a detail: red "
            "where σ > 0. Below: errors, φ.",
        ),
        _counterpart(
            9,
            partial(space.draw_system, view=space.CUBE),
            CASE,
            shows="System of the case study: 6R arm, target with four markers, forbidden sphere, "
            "frames F, O, C, C*¹ and C*² (x red, y green, z blue).",
        ),
        _counterpart(
            10,
            simulations.draw_tracks,
            CASE,
            shows="Case study. Top: tracks in the image. Below: position and orientation errors.",
        ),
        _counterpart(
            11,
            simulations.draw_signals,
            CASE,
            shows="Case study. From top: joint positions, joint speeds, greatest φ, and when each "
            "constraint is active, with the instants of Fig. 12. Thick dashed: the desired camera "
            "frame changes.",
        ),
        _counterpart(
            12,
            space.draw_frames,
            CASE,
            shows="Case study: four frames with the path of the end-effector.",
        ),
        _counterpart(
            14,
            experiments.draw_signals,
            PBVS,
            shows="Experiment 1 (PBVS), simulated: errors, control action, φ of the FOV "
            "constraints.",
        ),
        _counterpart(
            15,
            experiments.draw_tracks,
            PBVS,
            shows="Experiment 1 (PBVS), simulated: tracks, and the target as seen from the "
            "desired pose.",
        ),
        _counterpart(
            16,
            experiments.draw_comparison,
            PBVS,
            PBVS_ERROR,
            shows="Experiment 1 (PBVS), simulated, without (solid) and with (dashed) errors in "
            "the gradient: tracks, joint speeds.",
        ),
        _counterpart(
            17,
            experiments.draw_signals,
            IBVS,
            shows="Experiment 2 (IBVS), simulated: image errors, control action, φ of the "
            "occlusion constraints.",
        ),
        _counterpart(
            18,
            experiments.draw_tracks,
            IBVS,
            shows="Experiment 2 (IBVS), simulated: tracks, and the target as seen from the "
            "desired pose.",
        ),
        _counterpart(
            19,
            experiments.draw_comparison,
            IBVS,
            IBVS_ERROR,
            shows="Experiment 2 (IBVS), simulated, without (solid) and with (dashed) errors in "
            "the gradient: image errors, joint speeds.",
        ),
    ]
)
