"""Draws figures, in several processes when there are many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ..comparisons.record import run_file
from ..runs.pool import Failure, Pool
from ..runs.resources import process_count
from .jobs import Drawn, ScenarioJob

FEW = 2
"""Up to this many scenarios are drawn in this process: starting others takes about as long."""

KINDS = ("tracks", "phi", "errors", "acceleration")
"""Figures of each scenario, in the order in which a report shows them."""


def draw_all(jobs: Sequence[ScenarioJob], on_drawn: Callable[[int, int], None]) -> dict[str, Drawn]:
    """Draw the figures of every scenario; a scenario whose figures cannot be drawn is reported, not raised.

    ``on_drawn`` is told how many scenarios are done, and how many there are.
    """
    drawn: dict[str, Drawn] = {}
    on_drawn(0, len(jobs))

    def done(one: Drawn) -> None:
        drawn[one.scenario] = one
        on_drawn(len(drawn), len(jobs))

    workers = min(len(jobs), process_count())
    if len(jobs) <= FEW or workers < 2:
        for job in jobs:
            done(draw(job))
        return drawn
    # the longest first, so that no process is left with one at the end
    calls = {job.scenario.name: (job,) for job in sorted(jobs, key=_stored_size, reverse=True)}
    with Pool(draw, workers) as pool:
        for name, answer in pool.run(calls):
            if isinstance(answer, Failure):
                answer = Drawn(name, problems=[f"Its figures could not be drawn: {answer.reason}."])
            done(answer)
    return drawn


def draw(job: ScenarioJob) -> Drawn:
    """Draw the figures of one scenario; matplotlib is loaded here and not before."""
    from .figures.drawing import draw_scenario

    return draw_scenario(job)


def remove_stale(folder: Path, kept: set[str]) -> None:
    """Remove figures that an earlier report of the same folder left and this one does not show."""
    for kind in KINDS:
        for path in folder.glob(f"*--{kind}.png"):
            if path.name not in kept:
                path.unlink()
    for path in folder.glob("trade-off.png"):
        if path.name not in kept:
            path.unlink()


def _stored_size(job: ScenarioJob) -> int:
    files = (run_file(job.folder, job.scenario.name, name, job.trial) for name in job.controllers)
    return sum(path.stat().st_size for path in files if path.is_file())
