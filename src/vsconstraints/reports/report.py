"""Report of a comparison: tables and figures from its folder, combined by a template."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from ..comparisons import StoredComparison
from ..comparisons.metrics import NEGLIGIBLE, TOLERANCES, TOLERANT, definitions, run_metrics
from ..comparisons.runs.folder import locked
from ..comparisons.suite import BASELINE
from ..errors import StorageError
from ..plugins.extras import demand
from . import scenario, summary
from .drawing import (
    Drawn,
    add_sections,
    draw_all,
    remove_stale,
    require_distinct_names,
    shown_scenarios,
)
from .figures import FIGURES
from .groups import controller_cells
from .numbers import of_length
from .page import TEMPLATES, render, write_pages
from .plots import PNG, Formats
from .results import DIVERGED, Results, violated


def write_report(
    folder: Path,
    *,
    figures: bool = True,
    all_figures: bool = False,
    formats: Formats = PNG,
    replays: bool = False,
    trust: bool = False,
    on_drawn: Callable[[int, int], None] = lambda done, total: None,
    on_remark: Callable[[str], None] = lambda remark: None,
) -> Path:
    """Write report.md, details.md, report.html and the figures of a stored comparison.

    Return the path of report.md. The same comparison gives the same text, byte for byte; data
    missing in the folder is named and left out. Without ``figures`` existing figures are kept.
    ``all_figures`` draws every scenario of a large suite, not only those on which controllers
    differ most. The report shows the first of the ``formats``. ``replays`` adds pages that play
    back runs. Custom constraints that scenarios name as ``module:Class`` are imported only with
    ``trust``. ``on_drawn`` is called with the number of scenarios, counting the comparison as one
    more, whose figures are drawn and with their total; ``on_remark`` is called with warnings.
    Raises ConfigurationError if the folder has no comparison, if the stored files were changed, if
    another process is storing a comparison there, if the extra ``replay`` is needed, or if two
    parts register the same name. Raises StorageError if the report cannot be written.
    """
    if replays:
        demand("replay")
    require_distinct_names()
    stored = StoredComparison.load(folder, trust)
    for remark in stored.remarks:
        on_remark(remark)
    results = Results(stored)
    with locked(folder, "a comparison"):
        try:
            chosen = results.scenarios if all_figures else shown_scenarios(results)
            overview = ""
            drawn = {name: Drawn() for name in results.scenarios}
            if figures:
                figure_folder = folder / "figures"
                figure_folder.mkdir(exist_ok=True)
                overview, drawn = draw_all(results, chosen, formats, on_drawn)
                files = [file for scene in drawn.values() for file in scene.files]
                remove_stale(figure_folder, files, formats)
            add_sections(results, chosen, drawn, replays)
            write_pages(folder / "report.md", report_text(results, drawn, overview))
        except OSError as error:
            raise StorageError(f"the report cannot be written to {folder}: {error}") from error
    return folder / "report.md"


def report_text(results: Results, drawn: Mapping[str, Drawn], overview: str = "") -> str:
    """Return the report in Markdown, including details and the drawn figures."""
    most = max(results.clean.values(), default=0)
    leading = [name for name, count in results.clean.items() if count == most]
    if len(leading) == len(results.competitors) or not results.challenged_scenarios:
        leading = []
    scenes = results.stored.scenarios.values()
    robots = map(scenario.robot_name, scenes)
    readings = []
    if any(scene.files for scene in drawn.values()):
        readings = [figure.reading for figure in FIGURES]
    return render(
        TEMPLATES / "comparison.md",
        results=results,
        manifest=results.stored.manifest,
        configuration=results.stored.manifest["configuration"],
        summary=summary,
        parts=scenario,
        robots=list(filter(None, robots)),
        ideal=all(map(scenario.is_ideal, scenes)),
        streaming=any(scenario.takes(each) != "acceleration" for each in scenes),
        violates=sum(bool(violated(run)) for run in results.all_runs(BASELINE)),
        leading=leading,
        overview=overview,
        drawn=drawn,
        nothing=Drawn(),
        readings=readings,
        definitions=definitions(),
        metrics=run_metrics(),
        tolerances=TOLERANCES,
        controller_cells=controller_cells,
        tolerant=of_length(TOLERANT),
        negligible=of_length(NEGLIGIBLE),
        diverged=DIVERGED,
    )
