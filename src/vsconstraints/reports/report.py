"""The report of a comparison: report.md and the figures it shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..comparisons import StoredComparison
from ..comparisons.folder import held
from ..errors import StorageError
from ..runs.files import replaced
from .closing import closing
from .drawing import Drawn, draw_all, draw_overview, remove_stale, scenario_jobs
from .failures import failures
from .headlines import opening
from .outcomes import outcomes
from .results import Results
from .scenario_section import scenarios_section
from .summary import summary


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
    drawn, overview = {name: Drawn() for name in results.scenarios}, ""
    if on_drawn is not None:
        drawn, overview = _draw(results, on_drawn)
    parts = [
        opening(results),
        summary(results),
        outcomes(results),
        overview,
        scenarios_section(results, drawn),
        failures(results, drawn),
        closing(results),
    ]
    report = folder / "report.md"
    with replaced(report) as part:
        part.write_text("\n\n".join(text for text in parts if text) + "\n", encoding="utf-8")
    return report


def _draw(results: Results, on_drawn: Callable[[int, int], None]) -> tuple[dict[str, Drawn], str]:
    folder = results.stored.folder / "figures"
    folder.mkdir(exist_ok=True)
    overview = draw_overview(results, folder)
    drawn = draw_all(scenario_jobs(results), on_drawn)
    remove_stale(folder, {name for one in drawn.values() for name in one.files.values()})
    return drawn, overview
