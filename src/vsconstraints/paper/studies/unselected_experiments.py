"""The paper's experiments in scenes that nobody selected by what comes of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ...comparisons.runs.spec import RunSpec
from ...reports.numbers import median
from ...reports.plots import REFERENCE, Sheet, logarithmic
from ...simulation.disturbances import GRADIENT_SIGNS
from .drawing import entry, scenario_title, sentence_start
from .experiment_scenes import EXPERIMENTS, Experiment, kept_scenes
from .points import Measured, Numbers, Points, grouped, under, where
from .study import Study, StudyResult
from .summary import NOT_RUN, RunSummary, pixel_distance, speed_difference

EXACT = "exact"
SHIPPED = "shipped"

_ERROR = {"gradient_error": 0.3}
_REVERSED = {**_ERROR, "gradient_error_signs": [-sign for sign in GRADIENT_SIGNS]}
CASES: dict[str, dict[str, Any]] = {
    EXACT: {},
    "plus": _ERROR,
    "minus": _REVERSED,
    "plus-action": {**_ERROR, "gradient_error_in_phi": False},
}
"""``[disturbances]``: none, (49) as printed, with its signs reversed, and with ∇σ_e in L_gφ alone."""

LOOKS = {
    "plus": ("#0072B2", "-", "signs of (49)"),
    "minus": ("#D55E00", "-", "signs reversed"),
    "plus-action": ("#0072B2", ":", "signs of (49), in L_gφ alone"),
}

VERY_SIMILAR = 0.05
"""Greatest distance between the two tracks of a marker, at the same time, as a share of the image's width."""

LITTLE = 0.1
"""Greatest difference of a joint's speed, as a share of the greatest speed without errors, that counts as little."""

APPLIED = 0.01
"""Tracks that differ by less than this show no effect of an error [px]."""

PANELS = (
    ("track_px", "greatest difference\nof tracks [px]", (0.1, 1.0, 10.0, 100.0, 1000.0), 640.0 * VERY_SIMILAR),
    (
        "speed_share",
        "greatest difference of joint\nspeeds [% of the greatest]",
        (1.0, 10.0, 100.0, 1e3),
        100.0 * LITTLE,
    ),
    ("clearance_share", "least clearance\n[% of L]", (-100.0, -10.0, -1.0, 0.0, 1.0, 10.0), 0.0),
)
"""Column, label, ticks, and what the claims ask for."""


class Case(NamedTuple):
    """A scenario, which scene of its geometry, and one of :data:`CASES`."""

    scenario: str
    scene: str
    case: str


class UnselectedExperiments(Study):
    """Both experiments, without and with the gradient error (49), in scenes selected by geometry alone.

    The scenes are those of :mod:`.experiment_scenes`. A scene counts if, without an error, the
    goal is reached and exactly one row acts, which is a visibility row that is not violated: as in the experiments.
    No run with an error takes part in that.
    """

    name = "unselected-experiments"
    title = "The experiments in unselected scenes"
    question = "Does an error of 30 % in the gradient change little in scenes that were not chosen for that?"
    claims = (6,)
    figure_caption = (
        "Experiment 1 above, experiment 2 below: share of the unselected scenes in which the run with the error "
        "differs by less than the value below. Dotted: the error in L_gφ alone. Triangles: the scenes of Figs. 16 and "
        "19. Dashed: what the claims ask for."
    )

    def runs(self, *, small: bool = False) -> dict[Case, RunSpec]:
        """The shipped scene and every kept one, in every case."""
        runs = {}
        for experiment in EXPERIMENTS:
            kept = kept_scenes()[experiment.scenario]["scenes"][: 2 if small else None]
            scenes: dict[str, dict[str, Any]] = {SHIPPED: {}} | {str(i): scene for i, scene in enumerate(kept)}
            for scene, entries in scenes.items():
                for case, disturbances in CASES.items():
                    if small and "action" in case:
                        continue
                    overrides = {**entries, **({"disturbances": disturbances} if disturbances else {})}
                    runs[Case(experiment.scenario, scene, case)] = RunSpec(experiment.scenario, overrides=overrides)
        return runs

    def measure(self, results: Mapping[Case, RunSummary]) -> Measured:
        """What every error changes in every scene, and in how many scenes it is little."""
        points: Points = []
        numbers: Numbers = {}
        sentences = []
        for experiment in EXPERIMENTS:
            name, judged = experiment.scenario, Points()
            rejected: Counter[str] = Counter()
            for scene in dict.fromkeys(case.scene for case in results if case.scenario == name):
                cases = {case.case: run for case, run in results.items() if case[:2] == (name, scene)}
                exact = cases.get(EXACT, NOT_RUN)
                reason = why_not(experiment, exact) if EXACT in cases else "no run without an error"
                rejected[reason] += scene != SHIPPED and bool(reason)
                lines = [
                    {"scenario": name, "scene": scene, "case": case, "rejected": reason}
                    | compared(experiment, run, exact)
                    for case, run in cases.items()
                ]
                points += lines
                judged += [line for line in lines if not reason and line["case"] != EXACT]
            counts = counted(judged)
            for case, found in counts.items():
                numbers |= under(found, name, case)
            sentences += _sentences(experiment, counts, +rejected)
        return points, numbers, sentences

    def figure(self, result: StudyResult) -> Sheet:
        """One row per experiment; one panel per measure, a line per case."""
        present = {case: look for case, look in LOOKS.items() if where(result.points, case=case)}
        sheet = Sheet(left=0.95)
        sheet.legend([entry(label, colour, linestyle=dash) for colour, dash, label in present.values()])
        panels = sheet.panels(len(EXPERIMENTS) * len(PANELS), len(PANELS), height=1.7, gap=0.4, same_y=True)
        sheet.at += 0.15
        kinds = product(EXPERIMENTS, PANELS)
        for i, (ax, (experiment, (column, label, ticks, wanted))) in enumerate(zip(panels, kinds, strict=True)):
            own = where(result.points, scenario=experiment.scenario, rejected="")
            for case in present:
                _distribution(ax, where(own, case=case), column, case)
            ax.axvline(wanted, **REFERENCE, zorder=2)
            logarithmic(ax.xaxis, ticks, 1.0 if column == "clearance_share" else None)
            ax.set_xlim(ticks[0], ticks[-1])
            ax.set_ylim(-3.0, 103.0)
            if i % len(PANELS) == 0:
                ax.set_ylabel(f"{scenario_title(experiment.scenario)}\nscenes with less [%]")
            if i >= len(panels) - len(PANELS):
                ax.set_xlabel(label)
        return sheet


def why_not(experiment: Experiment, exact: RunSummary) -> str:
    """Why a scene is not like the experiment's, from the run without an error; empty if it is."""
    if exact.status != "converged":
        return f"without an error: {exact.status}"
    acting = acting_rows(exact)
    if not acting:
        return "without an error: no row acts"
    if len(acting) > 1:
        return "without an error: more than one row acts"
    if not acting[0].startswith(experiment.kind):
        return "without an error: another kind of row acts"
    if exact.rows[acting[0]]["clearance_min"] < 0.0:
        return "without an error: the boundary is crossed"
    return ""


def acting_rows(run: RunSummary) -> list[str]:
    """Rows whose φ is ever at or above zero."""
    return [label for label, row in run.rows.items() if row["phi_max"] >= 0.0]


def compared(experiment: Experiment, run: RunSummary, exact: RunSummary) -> dict[str, Any]:
    """One line of the study's data: what a run is, and how it differs from that without an error."""
    rows = {label: row for label, row in run.rows.items() if label.startswith(experiment.kind)}
    lengths = {label: row["clearance_min"] / (1.0 - row["usage_max"]) for label, row in rows.items()}
    share = {label: 100.0 * row["clearance_min"] / lengths[label] for label, row in rows.items()}
    nearest = min(share, key=lambda label: share[label], default="")
    width = 0.5 * np.array([640.0, 480.0])
    track, (fastest, rms) = pixel_distance(run, exact), speed_difference(run, exact)
    good = run.status == "converged" and bool(share) and min(share.values()) >= 0.0
    return {
        "status": run.status,
        "reason": run.reason,
        "row": nearest,
        "clearance_share": share.get(nearest, math.nan),
        "track_px": track,
        "speed_share": 100.0 * fastest,
        "speed_rms_share": 100.0 * rms,
        "satisfactory": good and bool((np.abs(run.pixels) <= width).all()),
        "similar": good and nearest in acting_rows(exact) and track <= VERY_SIMILAR * 2.0 * width[0],
        "little_speed": run.status == "converged" and fastest <= LITTLE,
        "applied": track > APPLIED,
    }


def counted(points: Points) -> dict[str, dict[str, float]]:
    """By case, in how many unselected scenes what holds, and in how many there is an effect at all."""
    found = {}
    for case, every in grouped(points, "case").items():
        own = [point for point in every if point["scene"] != SHIPPED]
        what = ("similar", "satisfactory", "little_speed", "applied")
        found[case] = {"scenes": float(len(own))} | {name: float(sum(bool(p[name]) for p in own)) for name in what}
        for column in ("track_px", "speed_share"):
            found[case][f"median_{column}"] = median([point[column] for point in own])
    return found


def _distribution(ax: Any, points: Points, column: str, case: str) -> None:
    colour, line, _ = LOOKS[case]
    drawn = [p[column] for p in points if p["scene"] != SHIPPED]
    values = np.sort([value if math.isfinite(value) else math.inf for value in drawn])
    if len(values):
        share = 100.0 * np.arange(1, len(values) + 1) / len(values)
        ax.step(values[np.isfinite(values)], share[np.isfinite(values)], where="post", color=colour, linestyle=line)
    for point in points:
        if point["scene"] == SHIPPED and math.isfinite(point[column]):
            filled = colour if line == "-" else "white"
            ax.plot([point[column]], [2.0], "^", color=colour, markerfacecolor=filled, markersize=6.0, zorder=4)


def _sentences(
    experiment: Experiment, counts: Mapping[str, Mapping[str, float]], rejected: Mapping[str, int]
) -> list[str]:
    title, geometry = sentence_start(experiment.scenario), kept_scenes()[experiment.scenario]["rejected"]
    sentences = [
        f"{title}: rejected by geometry, {sum(geometry.values())} draws ("
        + "; ".join(f"{reason}: {count}" for reason, count in geometry.items())
        + "); by the run without an error, "
        + (", ".join(f"{count} ({reason})" for reason, count in rejected.items()) or "none")
        + "."
    ]
    for case, (_, _, shown) in LOOKS.items():
        if of := counts.get(case):
            sentences.append(
                f"{title}, error of 30 %, {shown}: of {of['scenes']:.0f} scenes very similar in {of['similar']:.0f}, "
                f"satisfactory in {of['satisfactory']:.0f}, little difference of joint speeds in "
                f"{of['little_speed']:.0f}; medians: tracks {of['median_track_px']:.2g} px, joint speeds "
                f"{of['median_speed_share']:.2g} % of the greatest."
            )
    return sentences
