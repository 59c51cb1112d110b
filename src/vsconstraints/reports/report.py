"""The report of a comparison: tables and figures from its folder, put together by a template."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..comparisons import StoredComparison
from ..comparisons.metrics import DEFINITIONS, NEGLIGIBLE, TOLERANT
from ..comparisons.runs.folder import held
from ..errors import StorageError
from ..plugins.extras import demand
from ..rows.readable import counted
from .drawing import Drawn, add_replays, draw_all, draw_overview, remove_stale, scenario_jobs
from .figures import DISTURBANCE, FIGURES
from .groups import required_information
from .markdown import Table, bullets, enumeration, plain
from .numbers import DASH, number, of_length
from .page import facts_table, render, write_pages
from .plots import PNG, Formats
from .results import DIVERGED, Results
from .scenario import (
    DETAIL_GROUPS,
    baseline_summary,
    challenge_table,
    effort_table,
    failure_table,
    metric_table,
    robot_name,
    settings,
    usage_table,
)
from .selection import hidden_lanes, shown_scenarios
from .summary import (
    FIRST_LEGEND,
    anchor,
    answer,
    endings_table,
    law_table,
    outcome_table,
    score_table,
    shortened_list,
    tolerance_table,
    unsolved,
    violation_table,
    winner_table,
)


@dataclass(frozen=True)
class Pictures:
    """Drawn figures: of scenarios by name, and the text that shows the overview."""

    scenarios: Mapping[str, Drawn]
    overview: str = ""


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
    """Write report.md, details.md, both as report.html, and the figures, from what a comparison left in its folder.

    The same comparison gives the same text, byte for byte. Whatever is missing in the folder, a trajectory or a run,
    is named in the report and left out of its figures.

    Parameters
    ----------
    folder
        Where the comparison is stored.
    figures
        Whether to draw figures; without them a report takes no time, and those that are there stay as they are.
    all_figures
        Whether to draw every scenario of a large suite, not only those on which controllers differ most.
    formats
        In which figures are written; the report shows the first.
    replays
        Whether to replay runs of the drawn scenarios in pages for a browser, and to link them.
    trust
        Whether own constraints that scenarios name as ``module:Class`` are imported, to draw what they are; else
        nothing that the folder names is run, and the report says what is not drawn.
    on_drawn
        Called with how many scenarios have their figures, and how many there are.
    on_remark
        Called with warnings on what is stored: see :class:`StoredComparison`.

    Returns
    -------
    Path
        Where the report is.

    Raises
    ------
    ConfigurationError
        if there is no comparison in the folder, it is not what was stored, another process is storing one, or the
        extra ``replay`` is needed.
    StorageError
        if the report cannot be written.
    """
    if replays:
        demand("replay")
    stored = StoredComparison.load(folder, trust)
    for remark in stored.remarks:
        on_remark(remark)
    results = Results(stored)
    with held(folder, "a comparison"):
        try:
            chosen = results.scenarios if all_figures else shown_scenarios(results)
            pictures = Pictures({name: Drawn() for name in results.scenarios})
            if figures:
                pictures = _draw(results, chosen, formats, on_drawn)
            if replays:
                add_replays(results, chosen, pictures.scenarios)
            report = folder / "report.md"
            write_pages(report, report_text(results, pictures))
            return report
        except OSError as error:
            raise StorageError(f"the report cannot be written to {folder}: {error}") from error


def report_text(results: Results, pictures: Pictures) -> str:
    """The report in Markdown, details included."""
    configuration = results.stored.manifest["configuration"]
    links = [f"[{name}](#{anchor(name)}){f' ({why})' if why else ''}" for name, why in unsolved(results).items()]
    drawn = pictures.scenarios
    return render(
        "comparison.md",
        results=results,
        title=plain(str(configuration.get("title") or configuration.get("suite") or "Comparison")),
        compared=compared(results),
        answer=answer(results),
        law_table=law_table(results) if results.competitors else "",
        legend=FIRST_LEGEND,
        outcome_table=outcome_table(results),
        unsolved=enumeration(shortened_list(links)),
        winner_table=winner_table(results),
        violation_table=violation_table(results),
        overview=pictures.overview,
        endings_table=endings_table(results),
        score_table=score_table(results),
        tolerance_table=tolerance_table(results),
        scenarios=[_scenario(results, name, drawn.get(name)) for name in results.scenarios],
        readings=[figure.reading for figure in FIGURES] if any(one.files for one in drawn.values()) else [],
        groups=[group.listed for group in results.groups if group.listed],
        definitions=DEFINITIONS,
        options_table=options_table(results),
        machine_table=_machine(results),
        tolerant=of_length(TOLERANT),
        negligible=of_length(NEGLIGIBLE),
        diverged=f"{100.0 * DIVERGED:g} %",
        dash=DASH,
    )


def compared(results: Results) -> str:
    """How many controllers, robots, scenarios and trials were compared."""
    laws, scenarios = counted(len(results.competitors), "controller"), counted(len(results.scenarios), "scenario")
    robots = shortened_list([name for one in results.stored.scenarios.values() if (name := robot_name(one))])
    on = f" on {enumeration(robots)}" if robots else ""
    trials = f", {results.trials} trials each" if results.trials > 1 else ""
    return f"Compared: {laws}{on}, in {scenarios}{trials}."


def _scenario(results: Results, name: str, drawn: Drawn | None) -> dict[str, Any]:
    """What the template shows of a scenario."""
    scenario = results.stored.scenarios[name]
    one = Drawn() if drawn is None else drawn
    tables_below = [metric_table(results, name, group) for group in DETAIL_GROUPS]
    tables_below += [table_of(results, name) for table_of in (challenge_table, usage_table, effort_table)]
    pictures = []
    for figure, group in product((*FIGURES, DISTURBANCE), results.groups):
        if file := one.files.get((figure.name, group.suffix)):
            hidden = hidden_lanes(results, name) if figure.name == "phi" else 0
            more = f" {hidden} further rows acted for a shorter time and are not shown." if hidden else ""
            caption = f"*{figure.caption}{group.sentence}{more}*"
            pictures.append(f"![{name}: {figure.name}](figures/{quote(file)})\n\n{caption}")
    return {
        "name": name,
        "anchor": anchor(name),
        "title": plain(scenario.title),
        "description": plain(scenario.description),
        "settings": settings(scenario),
        "finished": any(results.runs(name, controller) for controller in results.controllers),
        "drawn": drawn is not None,
        "baseline": baseline_summary(results, name),
        "outcome": metric_table(results, name, "outcome"),
        "details": [text for text in tables_below if text],
        "failures": failure_table(results, name, one.first_outside),
        "figures": pictures,
        "replay": one.replay,
        "problems": bullets([plain(problem) for problem in one.problems]),
    }


def _draw(results: Results, chosen: Sequence[str], formats: Formats, on_drawn: Callable[[int, int], None]) -> Pictures:
    folder = results.stored.folder / "figures"
    folder.mkdir(exist_ok=True)
    overview = partial(draw_overview, results, folder, formats)
    drawn, text = draw_all(scenario_jobs(results, chosen, formats), overview, on_drawn)
    remove_stale(folder, (file for one in drawn.values() for file in one.files.values()), formats)
    return Pictures(drawn, text)


def options_table(results: Results) -> str:
    """Type, options and required information of each controller, and how it was implemented."""
    lines = []
    for name, entry in results.stored.manifest["configuration"]["controllers"].items():
        options = plain(", ".join(f"{key} = {value}" for key, value in entry.items() if key != "type"))
        kind = plain(str(entry.get("type", name)))
        lines.append([name, kind, options or "defaults", information_text(required_information(name, entry)),
                      results.implementation(name) or DASH])  # fmt: skip
    header = ["controller", "type", "options", "required information", "implementation"]
    return Table(header, lines, text_columns=5)


def information_text(required: Sequence[str] | None) -> str:
    """The required information of a controller, for a cell."""
    return "see its code" if required is None else plain(", ".join(required)) or "none"


def _machine(results: Results) -> str:
    manifest = results.stored.manifest
    lines = [line for line in results.stored.results if line["duration_s"] >= 0.0]
    compiled = sum(bool(line.get("compiled")) for line in lines)
    implementation = "" if not lines else "compiled" if compiled == len(lines) else "NumPy"
    if 0 < compiled < len(lines):
        names = [one for one in results.controllers if not all(line.get("compiled") for line in results.all_runs(one))]
        implementation = f"compiled in {compiled} of {len(lines)} runs; NumPy in some of {enumeration(names)}"
    wall, kept = manifest.get("wall_time_s"), manifest.get("stored_before") or 0
    facts = {
        "control step": implementation,
        "seed": manifest.get("seed"),
        "wall time [s]": None if wall is None else number(float(wall)),
        "runs": f"{results.finished} of {results.planned}" + (f", {kept} of them stored before" if kept else ""),
    }
    return facts_table(manifest, **facts)
