"""Counterparts of the paper's figures, in one table."""

import tomllib
from functools import partial
from pathlib import Path
from typing import Any

from ...reports.plots import Figure
from ..claims.experiments import IBVS, IBVS_ERROR, PBVS, PBVS_ERROR
from ..claims.simulations import BOWL, CASE, CONCAVE, CONVEX, FAST, FOV, HIGH_GAIN
from . import experiments, simulations, space

CAPTIONS: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("captions.toml").read_text(encoding="utf-8")
)

#: By the paper's number, the function that draws the counterpart, and the runs that it shows. Figs.
#: 1 and 13 show frames and a laboratory; they have no counterpart.
DRAWN: dict[int, tuple[Any, ...]] = {
    2: (simulations.draw_hyperellipses,),
    3: (partial(space.draw_system, view=space.PLANE), FOV),
    4: (simulations.draw_fov, FOV),
    5: (simulations.draw_fast, FAST, HIGH_GAIN),
    6: (partial(simulations.draw_obstacle, met=simulations.IN_BOWL), BOWL),
    7: (partial(simulations.draw_obstacle, met=simulations.AT_CONVEX), CONVEX),
    8: (partial(simulations.draw_obstacle, met=simulations.AT_CONCAVE), CONCAVE),
    9: (partial(space.draw_system, view=space.CUBE), CASE),
    10: (simulations.draw_tracks, CASE),
    11: (simulations.draw_signals, CASE),
    12: (space.draw_frames, CASE),
    14: (experiments.draw_signals, PBVS),
    15: (experiments.draw_tracks, PBVS),
    16: (experiments.draw_comparison, PBVS, PBVS_ERROR),
    17: (experiments.draw_signals, IBVS),
    18: (experiments.draw_tracks, IBVS),
    19: (experiments.draw_comparison, IBVS, IBVS_ERROR),
}
FIGURES: dict[int, Figure] = {
    number: Figure(
        f"fig-{number:02d}",
        f"Fig. {number}",
        CAPTIONS[str(number)],
        draw,
        tuple(needs),
        formulas=True,
    )
    for number, (draw, *needs) in DRAWN.items()
}
