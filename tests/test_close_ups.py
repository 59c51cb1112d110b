"""Close-ups beside tracks: where there is something to see."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsconstraints.comparisons import RunRecord
from vsconstraints.controllers import HierarchicalQP, SlidingMode, Tracking
from vsconstraints.reports.figures.tracks import close_up
from vsconstraints.reports.figures.view import View
from vsconstraints.reports.plots.image import Plane
from vsconstraints.scenarios import Scenario
from vsconstraints.simulation import simulate

ROW = "fov[marker 2]"


@pytest.fixture(scope="module")
def view() -> View:
    """Two laws that slide along the border of the image, and tracking alone."""
    setup = Scenario.load("example-2d-fov").with_override("duration", 7.0).setup()
    runs = {law.name: RunRecord.of(setup, simulate(setup, law), "")
            for law in (Tracking(), SlidingMode(), HierarchicalQP(rows="barrier"))}  # fmt: skip
    return View(setup, runs, tuple(runs), (ROW,), (ROW,))


def moved(view: View, law: str, pixels: Any, clearance: float | None = None) -> View:
    """The same, but for the second marker's track in a run, and the clearance of its row."""
    run = view.runs[law]
    trajectory = run.trajectory
    features = trajectory.features_px.copy()
    clear = trajectory.clearance.copy()
    features[:, 1] = pixels
    if clearance is not None:
        clear[:, trajectory.labels.index(ROW)] = clearance
    other = replace(run, trajectory=replace(trajectory, features_px=features, clearance=clear))
    return replace(view, runs={**view.runs, law: other})


@settings(max_examples=60, deadline=None)
@given(st.floats(-3e3, 3e3), st.floats(-3e3, 3e3), st.floats(-200.0, 0.0))
def test_a_close_up_shows_a_boundary_within_what_is_shown(
    view: View, u: float, v: float, clearance: float
) -> None:
    """Wherever a marker goes, and however wrongly its distance from the boundary is told there."""
    changed = moved(
        moved(view, "sliding-mode", (u, v), clearance), "hierarchical-qp", (u, -v), clearance
    )
    plane = Plane.of(view.setup)  # type: ignore[arg-type]
    found = close_up(changed, plane)
    if found is None:
        return
    assert (np.abs(found.centre) <= plane.half).all()
    corners = found.centre + found.half * np.random.default_rng(0).uniform(-1.0, 1.0, (4000, 2))
    sigma = np.max([one.sigma(corners) for one in plane.constraints], axis=0)
    assert (sigma > 0.0).any()
    assert (sigma <= 0.0).any()
