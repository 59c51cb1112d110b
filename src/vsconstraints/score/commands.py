"""Command ``vsconstraints score``: a recorded run, scored like a simulated one."""

from __future__ import annotations

import math
import re
from datetime import datetime
from pathlib import Path
from typing import cast

from ..cli.options import Names
from ..cli.results import ReportOptions, print_laws, write_report
from ..cli.terminal import console, note, typed_command


def score(
    recording: Path,
    scenario: str,
    start: float = 0.0,
    end: float = math.inf,
    zero: float = 0.0,
    degrees: bool = False,
    clock: str = "header",
    topic: str = "",
    joint: Names = None,
    name: str = "",
    settings: Names = None,
    out: Path | None = None,
    figures: bool = True,
) -> None:
    """Score a recorded run of any robot or simulator: CSV, Parquet, npz, rosbag2, MCAP."""
    from ..comparisons import ControllerSpec, Suite
    from ..comparisons.runs.folder import locked
    from ..errors import unknown_name
    from ..reports.drawing import require_distinct_names
    from ..scenarios import Scenario
    from . import NAME_OF_LAW, read_recording, recorded_trajectory, store
    from .files import Clock
    from .recording import names_in_file

    require_distinct_names()
    if clock not in ("header", "log"):
        raise unknown_name("clock", clock, ("header", "log"))
    chosen = Scenario.load(scenario)
    law = name or re.sub(r"[^\w.-]+", "-", recording.name.removesuffix(recording.suffix))
    entry = ControllerSpec(law, NAME_OF_LAW)
    suite = Suite("score", f"{chosen.title}, recorded", (chosen,), (entry,))
    suite = suite.select(settings=settings or ())
    setup = suite.scenarios[0].setup()
    found = read_recording(
        recording,
        setup.scene.robot,
        len(setup.scene.markers),
        part=(max(start, zero), end),
        degrees=degrees,
        clock=cast("Clock", clock),
        topic=topic,
        names=names_in_file(setup.scene.robot, joint or ()),
    )
    trajectory = recorded_trajectory(setup, found, recording.name, zero, degrees=degrees)
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    out = out or Path("vsconstraints-runs") / f"{chosen.name}--{law}--{stamp}"
    with locked(out, "a comparison"):
        store(out, suite, trajectory, typed_command())
    note(*found.remarks)
    report = write_report(out, ReportOptions(figures, trust=True))
    console.print(f"{trajectory.status}: {trajectory.reason}")
    print_laws(out)
    console.print(f"Results: {out}. {report}")
