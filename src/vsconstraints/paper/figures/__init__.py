"""Our counterparts of the paper's figures, in one table."""

import tomllib
from functools import partial
from pathlib import Path
from typing import Any

from ...reports.plots import Figure
from ..claims.case_study import CASE
from ..claims.experiments import IBVS, IBVS_ERROR, PBVS, PBVS_ERROR
from ..claims.planar import BOWL, CONCAVE, CONVEX, FAST, FOV, HIGH_GAIN
from . import case_study, experiments, planar, space

CAPTIONS: dict[str, str] = tomllib.loads(Path(__file__).with_name("captions.toml").read_text(encoding="utf-8"))

#: By the paper's number the function that draws the figure, and the runs that it shows.
DRAWN: dict[int, tuple[Any, ...]] = {
    2: (planar.draw_hyperellipses,),
    3: (partial(space.draw_system, view=space.PLANE), FOV),
    4: (planar.draw_fov, FOV),
    5: (planar.draw_fast, FAST, HIGH_GAIN),
    6: (partial(planar.draw_obstacle, met=planar.IN_BOWL), BOWL),
    7: (partial(planar.draw_obstacle, met=planar.AT_CONVEX), CONVEX),
    8: (partial(planar.draw_obstacle, met=planar.AT_CONCAVE), CONCAVE),
    9: (partial(space.draw_system, view=space.CUBE), CASE),
    10: (case_study.draw_tracks, CASE),
    11: (case_study.draw_signals, CASE),
    12: (space.draw_frames, CASE),
    14: (experiments.draw_signals, PBVS),
    15: (experiments.draw_tracks, PBVS),
    16: (experiments.draw_comparison, PBVS, PBVS_ERROR),
    17: (experiments.draw_signals, IBVS),
    18: (experiments.draw_tracks, IBVS),
    19: (experiments.draw_comparison, IBVS, IBVS_ERROR),
}
#: Our counterparts by the paper's number. Figs. 1 and 13 show frames and a laboratory, and have none.
FIGURES: dict[int, Figure] = {
    number: Figure(f"fig-{number:02d}", f"Fig. {number}", CAPTIONS[str(number)], draw, tuple(needs), formulas=True)
    for number, (draw, *needs) in DRAWN.items()
}
