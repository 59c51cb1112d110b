"""The report of a comparison: report.md and the figures it shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..comparisons import StoredComparison
from ..comparisons.folder import held
from ..errors import StorageError
from ..runs.files import replaced
from .closing import closing
from .failures import failures
from .headlines import opening
from .jobs import Drawn, ScenarioJob
from .outcomes import outcomes
from .rendering import draw_all, remove_stale
from .results import Results
from .rows_shown import lane_rows, phi_rows
from .scenario_section import scenarios_section
from .style import looks
from .summary import summary
from .trade_off import Overview, trade_off

TRIAL_SHOWN = 0
"""The trial that figures show: the one that starts where the scenario says."""


def write_report(
    folder: Path, *, figures: bool = True, on_drawn: Callable[[int, int], None] = lambda done, total: None
) -> Path:
    """Write report.md and its figures from what a comparison left in its folder.

    The same comparison gives the same text, byte for byte. Whatever is missing in the folder, a trajectory or a run,
    is named in the report and left out of its figures.

    Parameters
    ----------
    folder
        Where the comparison is stored.
    figures
        Whether to draw figures; without them a report takes no time, and those that are there stay as they are.
    on_drawn
        Told how many scenarios have their figures, and how many there are.

    Returns
    -------
    Path
        Where the report is.

    Raises
    ------
    ConfigurationError
        if there is no comparison in the folder, or another process is storing one.
    StorageError
        if the report cannot be written.
    """
    results = Results(StoredComparison.load(folder))
    with held(folder):
        try:
            return _write(folder, results, on_drawn if figures else None)
        except OSError as error:
            raise StorageError(f"the report cannot be written to {folder}: {error}") from error


def _write(folder: Path, results: Results, on_drawn: Callable[[int, int], None] | None) -> Path:
    drawn, overview = {name: Drawn(name) for name in results.scenarios}, Overview()
    if on_drawn is not None:
        drawn, overview = _draw(results, on_drawn)
    parts = [
        opening(results),
        summary(results),
        outcomes(results),
        overview.text,
        scenarios_section(results, drawn),
        failures(results, drawn),
        closing(results),
    ]
    report = folder / "report.md"
    with replaced(report) as part:
        part.write_text("\n\n".join(text for text in parts if text) + "\n", encoding="utf-8")
    return report


def _draw(results: Results, on_drawn: Callable[[int, int], None]) -> tuple[dict[str, Drawn], Overview]:
    folder = results.stored.folder / "figures"
    folder.mkdir(exist_ok=True)
    drawn = draw_all(_jobs(results), on_drawn)
    overview = trade_off(results, folder)
    used = {name for one in drawn.values() for name in one.files.values()}
    remove_stale(folder, used | ({overview.file} if overview.file else set()))
    return drawn, overview


def _jobs(results: Results) -> list[ScenarioJob]:
    stored = results.stored
    return [
        ScenarioJob(
            stored.folder,
            scenario,
            results.controllers,
            tuple(
                controller
                for controller in results.controllers
                if any(line["trial"] == TRIAL_SHOWN for line in results.runs(name, controller))
            ),
            TRIAL_SHOWN,
            int(stored.manifest["configuration"].get("seed", 0)),
            looks(results.controllers),
            phi_rows(results, name),
            lane_rows(results, name),
        )
        for name, scenario in stored.scenarios.items()
    ]
