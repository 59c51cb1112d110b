"""Which figures there are, what they need and who draws them; matplotlib is loaded only when one is drawn."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from ..claims.case_study import CASE
from ..claims.erroneous_gradients import IBVS_ERROR, PBVS_ERROR
from ..claims.experiments import IBVS, PBVS
from ..claims.first_example import FAST, FOV, HIGH_GAIN
from ..claims.trap_and_corners import BOWL, CONCAVE, CONVEX
from ..runs import Run, RunSpec


@dataclass(frozen=True)
class FigureSpec:
    """One figure of the paper and our counterpart.

    Attributes
    ----------
    number
        The paper's.
    caption
        What is to be seen.
    drawer
        Module and function below this package that draws it.
    needs
        Runs that it is drawn from.
    """

    number: int
    caption: str
    drawer: str
    needs: tuple[RunSpec, ...]

    @property
    def file(self) -> str:
        """File name below ``figures``."""
        return f"fig-{self.number:02d}.png"

    def draw(self, runs: Sequence[Run], path: Path) -> None:
        """Draw it; raises whatever goes wrong."""
        from ...reports.figures.sheet import style
        from .page import STYLE

        module, _, function = self.drawer.partition(":")
        drawer = getattr(import_module(f".{module}", __package__), function)
        with style(STYLE), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            drawer(*runs, path)


_LIST = (
    FigureSpec(
        2,
        "Boundary of the FOV constraint, σ = 0, for a safety margin of 5 % and different n; thick: the image.",
        "sketches:draw_hyperellipses",
        (),
    ),
    FigureSpec(
        3,
        "System of the first example: planar 3R arm, target with two features, base frame F, initial camera frame C "
        "and desired camera frame C*, which are in the same place and turned by π.",
        "sketches:draw_planar_system",
        (FOV,),
    ),
    FigureSpec(
        4,
        "First example with the FOV constraint only. Top: tracks in the image. Below: position and orientation errors, "
        "joint positions, φ of the second feature.",
        "planar:draw_fov",
        (FOV,),
    ),
    FigureSpec(
        5,
        "First example with fast motion. Top: tracks for the small and the large switching gain. Below: φ of the "
        "second feature for both.",
        "planar:draw_fast",
        (FAST, HIGH_GAIN),
    ),
    FigureSpec(
        6,
        "First example in a trap. Top: tracks and the bowl. Below: errors, φ of the FOV and of the bowl (cut off "
        "below); φ of the bowl for both features, linear within ±T_s u⁺ (shaded) and logarithmic beyond.",
        "planar:draw_bowl",
        (BOWL,),
    ),
    FigureSpec(
        7,
        "First example, convex corner. Top: tracks and the heart turned clockwise by 90°, with a detail. Below: "
        "errors, φ.",
        "planar:draw_convex",
        (CONVEX,),
    ),
    FigureSpec(
        8,
        "First example, concave corner. Top: tracks and the heart, with a detail: red where σ > 0. Below: errors, φ.",
        "planar:draw_concave",
        (CONCAVE,),
    ),
    FigureSpec(
        9,
        "System of the case study: 6R arm, target with four markers, forbidden sphere, frames F, O, C, C*¹ and C*² (x "
        "red, y green, z blue).",
        "arm:draw_system",
        (CASE,),
    ),
    FigureSpec(
        10,
        "Case study. Top: tracks in the image. Below: position and orientation errors.",
        "case_study:draw_tracks",
        (CASE,),
    ),
    FigureSpec(
        11,
        "Case study. From top: joint positions, joint speeds, greatest φ, and when each constraint is active, with the "
        "instants of Fig. 12. Thick dashed: the desired camera frame changes.",
        "case_study:draw_signals",
        (CASE,),
    ),
    FigureSpec(
        12,
        "Case study. Top: four frames with the path of the end-effector. Below: the sphere from nearby.",
        "arm:draw_frames",
        (CASE,),
    ),
    FigureSpec(
        14,
        "Experiment 1 (PBVS), simulated: errors, control action, φ of the FOV constraints.",
        "experiments:draw_signals",
        (PBVS,),
    ),
    FigureSpec(
        15,
        "Experiment 1 (PBVS), simulated: tracks, and the target as seen from the desired pose.",
        "experiments:draw_tracks",
        (PBVS,),
    ),
    FigureSpec(
        16,
        "Experiment 1 (PBVS), simulated, without (solid) and with (dashed) errors in the gradient: tracks, joint "
        "speeds.",
        "experiments:draw_comparison",
        (PBVS, PBVS_ERROR),
    ),
    FigureSpec(
        17,
        "Experiment 2 (IBVS), simulated: image errors, control action, φ of the occlusion constraints.",
        "experiments:draw_signals",
        (IBVS,),
    ),
    FigureSpec(
        18,
        "Experiment 2 (IBVS), simulated: tracks, and the target as seen from the desired pose.",
        "experiments:draw_tracks",
        (IBVS,),
    ),
    FigureSpec(
        19,
        "Experiment 2 (IBVS), simulated, without (solid) and with (dashed) errors in the gradient: image errors, joint "
        "speeds.",
        "experiments:draw_comparison",
        (IBVS, IBVS_ERROR),
    ),
)

FIGURES: dict[int, FigureSpec] = {spec.number: spec for spec in _LIST}
"""Our counterparts by the paper's number. Figs. 1 and 13 show frames and a laboratory, and have none."""
