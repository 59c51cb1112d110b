"""All figures of one scenario, drawn in a process of their own."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

from ...comparisons import RunRecord
from ...comparisons.metrics import tolerated
from ...comparisons.record import run_file
from ...simulation import Setup
from ..jobs import Drawn, ScenarioJob
from .acceleration import draw_acceleration
from .errors import draw_errors
from .phi import draw_phi
from .sheet import STYLE, style
from .tracks import draw_tracks
from .view import View


def draw_scenario(job: ScenarioJob) -> Drawn:
    """Draw what can be drawn; whatever goes wrong with one figure leaves only that one out, with a sentence why."""
    drawn = Drawn(job.scenario.name)
    runs = _load(job, drawn)
    if not runs:
        return drawn
    view = View(_setup(job, drawn), runs, job.controllers, job.looks, job.phi_rows, job.lane_rows)
    figures: dict[str, Callable[[View, Path], None]] = {}
    if any(run.trajectory.features_px.size for run in runs.values()):
        figures["tracks"] = draw_tracks
    if job.phi_rows or job.lane_rows:
        figures["phi"] = draw_phi
    figures.update(errors=draw_errors, acceleration=draw_acceleration)
    for kind, draw in figures.items():
        name = f"{job.scenario.name}--{kind}.png"
        try:
            with style(STYLE), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                draw(view, job.folder / "figures" / name)
            drawn.files[kind] = name
        except Exception as error:  # one bad run or figure must not cost the report
            drawn.problems.append(f"The figure of {_TITLES[kind]} could not be drawn: {type(error).__name__}: {error}")
    return drawn


_TITLES = {
    "tracks": "the markers' tracks",
    "phi": "φ",
    "errors": "the errors",
    "acceleration": "the commanded acceleration",
}


def _load(job: ScenarioJob, drawn: Drawn) -> dict[str, RunRecord]:
    runs = {}
    for name in job.finished:
        path = run_file(job.folder, job.scenario.name, name, job.trial)
        record = RunRecord.load(path)
        if record is None:
            why = "cannot be read" if path.exists() else "is missing"
            drawn.problems.append(f"The trajectory of {name} {why}; the figures leave it out.")
            continue
        t = record.trajectory.t
        if len(t) < 2:
            drawn.problems.append(f"The run of {name} left no trajectory; the figures leave it out.")
            continue
        runs[name] = record
        outside = record.trajectory.clearance < -tolerated(record)
        for i, label in enumerate(record.trajectory.labels):
            if outside[:, i].any():
                drawn.first_outside[name, label] = float(t[outside[:, i].argmax()])
    return runs


def _setup(job: ScenarioJob, drawn: Drawn) -> Setup | None:
    try:
        return job.scenario.setup(job.trial, job.seed)
    except Exception as error:  # for example a robot's file that is no longer where it was
        drawn.problems.append(
            f"The scenario cannot be built here ({type(error).__name__}: {error}); the figures show no goals and no "
            "boundaries."
        )
        return None
