"""The paper's experiments in scenes that nobody selected by their outcome.

The paper does not print where robot and target were. ``examples/draw_experiment_scenes.py`` draws
an arm with its camera looking down; a horizontal screen in what the camera sees from the goal; and
by how much the start is off. A scene is one of the experiment's geometry if ideal tracking would
take exactly one marker across the boundary. No simulation takes part, and no error of a gradient.
Drawing takes a minute, so the scenes are kept in ``experiment_scenes.json`` beside this file, with
how many draws were rejected, and why.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import median
from ...simulation.disturbances import GRADIENT_SIGNS
from .study import Found, Results, Sweep
from .summary import NOT_RUN, RunSummary, pixel_distance, speed_difference
from .tables import TABLES, Points, grouped, where

EXACT = "exact"
SHIPPED = "shipped"
#: ``[disturbances]``: none, (49) as printed, with its signs reversed, and with ∇σ_e in L_gφ alone.
CASES: dict[str, dict[str, Any]] = {
    EXACT: {},
    "plus": {"gradient_error": 0.3},
    "minus": {"gradient_error": 0.3, "gradient_error_signs": [-sign for sign in GRADIENT_SIGNS]},
    "plus-action": {"gradient_error": 0.3, "gradient_error_in_phi": False},
}
#: Greatest distance between the two tracks of a marker, at the same time, as a share of the image's
#: width.
VERY_SIMILAR = 0.05
#: Greatest difference of a joint's speed, as a share of the greatest speed without errors, that
#: counts as little.
LITTLE = 0.1
APPLIED = 0.01  #: Tracks that differ by less than this show no effect of an error [px].
SIZE = np.array([640.0, 480.0])  #: Of the experiments' image [px].
#: The kind of the visibility rows in each experiment.
KINDS = {"experiment-1-pbvs": "fov", "experiment-2-ibvs": "occlusion"}


@cache
def kept_scenes() -> dict[str, Any]:
    """By scenario: ``scenes``, entries by dotted keys, and ``rejected``, how many draws by
    reason.
    """
    kept: dict[str, Any] = json.loads(
        Path(__file__).with_name("experiment_scenes.json").read_text(encoding="utf-8")
    )
    return kept


def rejected_by_run(points: Points) -> Counter[str]:
    """Why unselected scenes are not like the experiments', and how many for each reason."""
    scenes = {point["scene"]: point["rejected"] for point in points if point["scene"] != SHIPPED}
    return Counter(filter(None, scenes.values()))


def _spec(case: Any) -> RunSpec:
    scene = {} if case.scene == SHIPPED else kept_scenes()[case.scenario]["scenes"][int(case.scene)]
    error = {"disturbances": CASES[case.case]} if CASES[case.case] else {}
    return RunSpec(case.scenario, overrides={**scene, **error})


def _lines(case: Any, run: RunSummary, results: Results) -> list[dict[str, Any]]:
    """Why its scene is not like the experiment's, and how it differs from the run without an
    error.
    """
    exact = results.get(case._replace(case=EXACT))
    kind = KINDS[case.scenario]
    reason = "no run without an error" if exact is None else why_not(kind, exact)
    return [{"rejected": reason, **compared(kind, run, exact or NOT_RUN)}]


#: What can be said of a scene with an error.
HOLDS = ("similar", "satisfactory", "little_speed", "applied")


def _numbers(points: Points) -> Found:
    """In how many scenes every error changes little, and whether it does in the shipped one."""
    accepted = [point for point in points if not point["rejected"] and point["case"] != EXACT]
    numbers = {key: counted(own) for key, own in grouped(accepted, "scenario", "case").items()}
    names = (*HOLDS, "track_px", "speed_share", "clearance_share")
    for point in where(accepted, scene=SHIPPED):
        numbers[point["scenario"], point["case"], SHIPPED] = {name: point[name] for name in names}
    return numbers


def counted(points: Points) -> dict[str, float]:
    """In how many unselected scenes what holds, and in how many there is an effect at all."""
    own = [point for point in points if point["scene"] != SHIPPED]
    medians = {
        f"median_{name}": median([point[name] for point in own])
        for name in ("track_px", "speed_share")
    }
    return {
        "scenes": len(own),
        **{name: sum(bool(point[name]) for point in own) for name in HOLDS},
        **medians,
    }


def why_not(kind: str, exact: RunSummary) -> str:
    """Why a scene is not like the experiment's, from the run without an error; empty if it is."""
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
    """Rows whose φ is ever at or above zero."""
    return [label for label, row in run.rows.items() if row["phi_max"] >= 0.0]


def compared(kind: str, run: RunSummary, exact: RunSummary) -> dict[str, Any]:
    """What the study's data say of a run, and how it differs from that without an error."""
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


def _runs(most: int | None, cases: int) -> list[dict[str, Any]]:
    """The shipped scene and every kept one, or so many, in so many cases."""
    return [
        {
            "scenario": scenario,
            "scene": [SHIPPED, *map(str, range(len(kept["scenes"])))][:most],
            "case": [*CASES][:cases],
        }
        for scenario, kept in kept_scenes().items()
    ]


TABLES["unselected-experiments"] |= {"runs": _runs(None, 4), "small": _runs(3, 3)}

#: Both experiments, without and with the gradient error (49), in scenes selected by geometry alone.
#: A scene counts if, without an error, the goal is reached and exactly one row acts, which is a
#: visibility row that is not violated: as in the experiments. No run with an error takes part in
#: that.
UNSELECTED_EXPERIMENTS = Sweep(
    "unselected-experiments",
    _spec,
    _lines,
    _numbers,
    helpers={"kept_scenes": kept_scenes, "rejected_by_run": rejected_by_run},
)
