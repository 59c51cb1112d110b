"""The paper's experiments in scenes that were not selected by their outcome.

The paper does not print where robot and target were. ``examples/draw_experiment_scenes.py`` draws
an arm with its camera looking down, a horizontal screen in the camera's view from the goal, and the
deviation of the start. A scene has the experiment's geometry if ideal tracking would take exactly
one marker across the boundary. The selection uses no simulation and no gradient error. Drawing
takes a minute, so the scenes are stored in ``experiment_scenes.json`` beside this file, with the
number of rejected draws by reason.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import median
from ...reports.plots import Sheet, Style
from ...simulation.disturbances import GRADIENT_SIGNS
from .drawing import Measure, add_panels, shown, style_of
from .study import Found, Results, Study, StudyResult
from .summary import NOT_RUN, RunSummary, pixel_distance, speed_difference
from .tables import Numbers, Point, Points, about, grouped, sentence_start, where

EXACT = "exact"
SHIPPED = "shipped"
#: Disturbances of each case: none, (49) as printed, with reversed signs, and with ∇σ_e in L_gφ
#: alone.
CASES: dict[str, dict[str, Any]] = {
    EXACT: {},
    "plus": {"gradient_error": 0.3},
    "minus": {"gradient_error": 0.3, "gradient_error_signs": [-sign for sign in GRADIENT_SIGNS]},
    "plus-action": {"gradient_error": 0.3, "gradient_error_in_phi": False},
}
#: Greatest distance between two tracks of a marker at the same time that counts as very similar, as
#: a share of the image's width.
VERY_SIMILAR = 0.05
#: Greatest difference of a joint's speed that counts as little, as a share of the greatest speed
#: without errors.
LITTLE = 0.1
APPLIED = 0.01  #: Tracks that differ by less than this show no effect of an error [px].
SIZE = np.array([640.0, 480.0])  #: Size of the experiments' image [px].
#: Kind of the visibility rows in each experiment.
KINDS = {"experiment-1-pbvs": "fov", "experiment-2-ibvs": "occlusion"}


@cache
def kept_scenes() -> dict[str, Any]:
    """By scenario: ``scenes``, entries by dotted keys; ``rejected``, number of draws by reason."""
    kept: dict[str, Any] = json.loads(
        Path(__file__).with_name("experiment_scenes.json").read_text(encoding="utf-8")
    )
    return kept


def rejected_by_run(points: Points) -> Counter[str]:
    """Count the unselected scenes that differ from the experiments, by reason."""
    scenes = {point["scene"]: point["rejected"] for point in points if point["scene"] != SHIPPED}
    return Counter(filter(None, scenes.values()))


#: Properties of a scene with an error.
HOLDS = ("similar", "satisfactory", "little_speed", "applied")


class SceneCase(NamedTuple):
    """Scenario; scene, ``shipped`` or the number of a kept one; case of :data:`CASES`."""

    scenario: str
    scene: str
    case: str


#: The levels are those that the claims ask for.
MEASURES = {
    "track_px": Measure(
        label="greatest difference\nof tracks [px]",
        ticks=(0.1, 1.0, 10.0, 100.0, 1000.0),
        level=VERY_SIMILAR * SIZE[0],
        low=0.1,
        top=1000.0,
    ),
    "speed_share": Measure(
        label="greatest difference of joint\nspeeds [% of the greatest]",
        ticks=(1.0, 10.0, 100.0, 1e3),
        level=100.0 * LITTLE,
        low=1.0,
        top=1000.0,
    ),
    "clearance_share": Measure(
        label="least clearance\n[% of L]",
        ticks=(-100.0, -10.0, -1.0, 0.0, 1.0, 10.0),
        linear_below=1.0,
        level=0.0,
        low=-100.0,
        top=10.0,
    ),
}
STYLES = {
    "plus": style_of("signs of (49)", "#0072B2"),
    "minus": style_of("signs reversed", "#D55E00"),
    "plus-action": style_of("signs of (49), in L_gφ alone", "#0072B2", linestyle=":"),
}
#: Style of the shipped scenes at the left edge.
TRIANGLE = {"marker": "^", "linestyle": "none", "markersize": 6.0, "zorder": 4}


class UnselectedExperiments(Study):
    """Both experiments, without and with the gradient error (49), in scenes drawn by geometry.

    A scene counts if, without an error, the goal is reached and exactly one row is active, which is
    a visibility row that is not violated, as in the experiments. Runs with an error do not take
    part in this selection.
    """

    name = "unselected-experiments"
    title = "The experiments in unselected scenes"
    question = (
        "Does an error of 30 % in the gradient change little in scenes that were not chosen for "
        "that?"
    )
    claims = (6,)
    columns = (
        "rejected",
        "status",
        "reason",
        "row",
        "clearance_share",
        "track_px",
        "speed_share",
        "speed_rms_share",
        "satisfactory",
        "similar",
        "little_speed",
        "applied",
    )
    figure_caption = (
        "Share of the unselected scenes in which the run with the error differs by less than the "
        "value at the left. Dotted: the error in L_gφ alone. Triangles: the scenes of Figs. 16 and "
        "19. Dashed: what the claims ask for."
    )

    def runs(self, *, small: bool = False) -> dict[SceneCase, RunSpec]:
        """Return runs by case, in order of the figure's data; if ``small``, a few short ones."""
        most_scenes, most_cases = (3, 3) if small else (None, None)
        runs = {}
        for scenario, kept in kept_scenes().items():
            scenes = {SHIPPED: {}} | {str(k): keys for k, keys in enumerate(kept["scenes"])}
            for scene in list(scenes)[:most_scenes]:
                for case in list(CASES)[:most_cases]:
                    overrides = dict(scenes[scene])
                    if CASES[case]:
                        overrides["disturbances"] = CASES[case]
                    runs[SceneCase(scenario, scene, case)] = RunSpec(scenario, overrides=overrides)
        return runs

    def lines(self, case: SceneCase, run: RunSummary, results: Results) -> Points:
        """Reason why a scene differs from the experiment, and deviation from the errorless run."""
        exact = results.get(case._replace(case=EXACT))
        kind = KINDS[case.scenario]
        reason = "no run without an error" if exact is None else why_not(kind, exact)
        return [{"rejected": reason, **compared(kind, run, exact or NOT_RUN)}]

    def numbers(self, points: Points) -> Found:
        """Numbers of scenes in which each error changes little; values in the shipped scene."""
        accepted = [point for point in points if not point["rejected"] and point["case"] != EXACT]
        numbers = {
            key: counted(of_case) for key, of_case in grouped(accepted, "scenario", "case").items()
        }
        names = (*HOLDS, "track_px", "speed_share", "clearance_share")
        for point in where(accepted, scene=SHIPPED):
            key = (point["scenario"], point["case"], SHIPPED)
            numbers[key] = {name: point[name] for name in names}
        return numbers

    def sentences(self, points: Points, numbers: Numbers) -> list[str]:
        """Return the sentences of the result."""
        sentences = []
        for scenario, of_scenario in grouped(points, "scenario").items():
            start = sentence_start(scenario)
            by_geometry = kept_scenes()[scenario]["rejected"]
            reasons = "; ".join(f"{reason}: {count}" for reason, count in by_geometry.items())
            by_run = rejected_by_run(of_scenario).items()
            runs = ", ".join(f"{count} ({reason})" for reason, count in by_run) or "none"
            sentences.append(
                f"{start}: rejected by geometry, {sum(by_geometry.values())} draws ({reasons}); "
                f"by the run without an error, {runs}."
            )
            for case, style in STYLES.items():
                if of := about(numbers, scenario, case):
                    sentences.append(
                        f"{start}, error of 30 %, {style['label']}: of {int(of['scenes'])} scenes "
                        f"very similar in {int(of['similar'])}, satisfactory in "
                        f"{int(of['satisfactory'])}, little difference of joint speeds in "
                        f"{int(of['little_speed'])}; medians: tracks "
                        f"{of['median_track_px']:.2g} px, joint speeds "
                        f"{of['median_speed_share']:.2g} % of the greatest."
                    )
        return sentences

    def figure(self, result: StudyResult) -> Sheet:
        """Draw the distribution of each measure, and the shipped scenes at the left edge."""
        accepted = where(result.points, rejected="")
        styles = {case: style for case, style in STYLES.items() if where(accepted, case=case)}
        sheet = Sheet(left=0.95)
        sheet.legend(list(styles.values()))
        below = "share of scenes with less"
        points = list(result.points)
        for panel in add_panels(sheet, points, MEASURES, below, height=1.7, gap=0.75):
            for case, style in styles.items():
                runs = where(panel.points, case=case, rejected="")
                shipped = where(runs, scene=SHIPPED)
                draw_distribution(
                    panel.ax, [run for run in runs if run not in shipped], panel.measure, style
                )
                values = [run[panel.measure] for run in shown(shipped, panel.measure)]
                edge = panel.ax.get_yaxis_transform()
                panel.ax.plot([0.02] * len(values), values, transform=edge, **style | TRIANGLE)
            MEASURES[panel.measure].finish(panel.ax)
            panel.ax.set_xlim(-0.03, 1.03)
        return sheet


def draw_distribution(ax: Any, points: Points, column: str, style: Style) -> None:
    """Draw a column against the share of points with less; missing values count as infinite."""
    values = [point[column] for point in shown(points, column)]
    if values:
        missing = [math.inf] * (len(points) - len(values))
        ax.ecdf(values + missing, orientation="horizontal", **style)


def counted(points: Points) -> dict[str, float]:
    """Numbers of unselected scenes with each property, and medians."""
    drawn = [point for point in points if point["scene"] != SHIPPED]
    medians = {
        f"median_{name}": median([point[name] for point in drawn])
        for name in ("track_px", "speed_share")
    }
    return {
        "scenes": len(drawn),
        **{name: sum(bool(point[name]) for point in drawn) for name in HOLDS},
        **medians,
    }


def why_not(kind: str, exact: RunSummary) -> str:
    """Reason why a scene differs from the experiment, from the run without an error.

    Empty if it does not differ.
    """
    acting = acting_rows(exact)
    reasons = {
        exact.status: exact.status != "converged",
        "no row acts": not acting,
        "more than one row acts": len(acting) > 1,
        "another kind of row acts": not all(label.startswith(kind) for label in acting),
        "the boundary is crossed": any(
            exact.rows[label]["clearance_min"] < 0.0 for label in acting
        ),
    }
    return next(
        (f"without an error: {reason}" for reason, applies in reasons.items() if applies), ""
    )


def acting_rows(run: RunSummary) -> list[str]:
    """Return rows whose φ is ever at or above zero."""
    return [label for label, row in run.rows.items() if row["phi_max"] >= 0.0]


def compared(kind: str, run: RunSummary, exact: RunSummary) -> Point:
    """Data columns of a run that compare it with the run without an error."""
    share = {
        label: 100.0 * (1.0 - row["usage_max"])
        for label, row in run.rows.items()
        if label.startswith(kind)
    }
    nearest = min(share, key=lambda label: share[label], default="")
    track = pixel_distance(run, exact)
    fastest, rms = speed_difference(run, exact)
    good = run.status == "converged" and bool(share) and share[nearest] >= 0.0
    return {
        "row": nearest,
        "clearance_share": share.get(nearest, math.nan),
        "track_px": track,
        "speed_share": 100.0 * fastest,
        "speed_rms_share": 100.0 * rms,
        "satisfactory": good and bool((np.abs(run.pixels) <= 0.5 * SIZE).all()),
        "similar": good and nearest in acting_rows(exact) and track <= VERY_SIMILAR * SIZE[0],
        "little_speed": run.status == "converged" and fastest <= LITTLE,
        "applied": track > APPLIED,
    }
