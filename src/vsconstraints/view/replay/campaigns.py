"""Runs of a campaign, simulated again for a replay."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...bench.evidence import Evidence
from ...bench.reports.dataset import rerun, setup_of
from .runs import ReplayRun, campaign_run


def replayed(
    run: str, trust: bool = False, on_remark: Callable[[str], None] = lambda remark: None
) -> ReplayRun:
    """Simulate the run ``FOLDER:FAMILY:SCENE:CONDITION:CONTROLLER`` again for a replay.

    Raises as :func:`vsconstraints.bench.reports.replay`.
    """
    folder, family, scene, condition, controller = campaign_run(run)
    evidence = Evidence.load(Path(folder), trust)
    for remark in evidence.remarks:
        on_remark(remark)
    setup = setup_of(evidence, family, int(scene), condition)
    trajectory = rerun(evidence, setup, controller).trajectory
    return ReplayRun(controller, setup, trajectory, f"{family} {scene}, {condition}")
