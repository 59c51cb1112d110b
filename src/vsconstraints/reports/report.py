"""The report of a comparison: tables and figures from its folder, put together by a template."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..comparisons import StoredComparison
from ..comparisons.metrics import DEFINITIONS, NEGLIGIBLE, TOLERANT
from ..comparisons.runs.folder import locked
from ..comparisons.suite import BASELINE
from ..errors import StorageError
from ..plugins.extras import demand
from ..rows.readable import counted
from . import summary
from .drawing import Drawn, add_replays, draw_all, draw_overview, remove_stale, scenario_jobs
from .figures import DISTURBANCE, FIGURES
from .markdown import enumeration, first_names, plain
from .numbers import DASH, number, of_length
from .page import facts_table, render, write_pages
from .plots import PNG, Formats
from .results import DIVERGED, Results, violated
from .scenario import (
    baseline_facts,
    challenge_table,
    effort_table,
    failure_table,
    metric_table,
    robot_name,
    usage_table,
)  # fmt: skip
from .selection import hidden_lanes, shown_scenarios

#: Over all scenarios; the template shows them by the names of their functions.
TABLES = (
    summary.law_table, summary.outcome_table, summary.winner_table, summary.violation_table, summary.endings_table,
    summary.score_table, summary.tolerance_table, summary.options_table,
)  # fmt: skip
#: Tables of a scenario that fold; that of the outcome stands above.
DETAILS: tuple[Callable[[Results, str], str], ...] = (
    *(partial(metric_table, group=group) for group in ("task", "chattering", "time")),
    challenge_table,
    usage_table,
    effort_table,
)


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
    """Write report.md, details.md, both as report.html, and the figures of a stored comparison; returns report.md.

    The same comparison gives the same text, byte for byte. Whatever is missing in the folder, a trajectory or a run,
    is named in the report and left out of its figures. Without ``figures`` those that are there stay as they are;
    ``all_figures`` draws every scenario of a large suite, not only those on which controllers differ most; ``formats``
    are those of the files, of which the report shows the first; ``replays`` adds pages for a browser with runs of the
    drawn scenarios. Only with ``trust`` are own constraints imported that scenarios name as ``module:Class``. Called
    are ``on_drawn`` with how many scenarios have their figures and how many there are, ``on_remark`` with warnings.

    Raises ConfigurationError if there is no comparison in the folder, it is not what was stored, another process is
    storing one, or the extra ``replay`` is needed, and StorageError if the report cannot be written.
    """
    if replays:
        demand("replay")
    stored = StoredComparison.load(folder, trust)
    for remark in stored.remarks:
        on_remark(remark)
    results = Results(stored)
    with locked(folder, "a comparison"):
        try:
            chosen = results.scenarios if all_figures else shown_scenarios(results)
            drawn, overview = {name: Drawn() for name in results.scenarios}, ""
            if figures:
                place = folder / "figures"
                place.mkdir(exist_ok=True)
                overview = draw_overview(results, place, formats)
                drawn = draw_all(scenario_jobs(results, chosen, formats), on_drawn)
                remove_stale(place, (file for one in drawn.values() for file in one.files.values()), formats)
            if replays:
                add_replays(results, chosen, drawn)
            write_pages(folder / "report.md", report_text(results, drawn, overview))
        except OSError as error:
            raise StorageError(f"the report cannot be written to {folder}: {error}") from error
    return folder / "report.md"


def report_text(results: Results, drawn: Mapping[str, Drawn], overview: str = "") -> str:
    """The report in Markdown, details included, with the drawn figures of scenarios and of the whole comparison."""
    configuration = results.stored.manifest["configuration"]
    baseline = results.all_runs(BASELINE)
    leading = [name for name, good in results.clean.items() if good == max(results.clean.values())]
    robots = [name for one in results.stored.scenarios.values() if (name := robot_name(one))]
    return render(
        "comparison.md",
        results=results,
        title=plain(configuration.get("title") or configuration.get("suite") or "Comparison"),
        controllers=counted(len(results.competitors), "controller"),
        robots=enumeration(first_names(robots, summary.MAX_NAMES)),
        scenario_count=counted(len(results.scenarios), "scenario"),
        baseline_runs=counted(len(baseline), "run"),
        baseline_violates=sum(bool(violated(run)) for run in baseline),
        leading=leading if len(leading) < len(results.competitors) and results.challenged_scenarios else [],
        tables={table.__name__: table(results) for table in TABLES},
        unsolved={summary.anchor(name): (name, why) for name, why in summary.unsolved(results).items()},
        overview=overview,
        scenarios=[_scenario(results, name, drawn.get(name)) for name in results.scenarios],
        readings=[figure.reading for figure in FIGURES] if any(one.files for one in drawn.values()) else [],
        groups=[group.listed for group in results.groups if group.listed],
        definitions=DEFINITIONS,
        machine_table=_machine(results),
        tolerant=of_length(TOLERANT),
        negligible=of_length(NEGLIGIBLE),
        diverged=f"{100.0 * DIVERGED:g} %",
        dash=DASH,
    )


def _scenario(results: Results, name: str, drawn: Drawn | None) -> dict[str, Any]:
    """What the template shows of a scenario."""
    scenario, one = results.stored.scenarios[name], drawn or Drawn()
    pictures = []
    for figure, group in product((*FIGURES, DISTURBANCE), results.groups):
        if file := one.files.get((figure.name, group.suffix)):
            hidden = hidden_lanes(results, name) if figure.name == "phi" else 0
            more = f" {hidden} further rows acted for a shorter time and are not shown." if hidden else ""
            caption = f"*{figure.caption}{group.sentence}{more}*"
            pictures.append(f"![{name}: {figure.name}](figures/{quote(file)})\n\n{caption}")
    return {
        "name": name,
        "anchor": summary.anchor(name),
        "title": plain(scenario.title),
        "description": plain(scenario.description),
        "robot": robot_name(scenario),
        "toml": scenario.tables,
        "finished": any(results.runs(name, controller) for controller in results.controllers),
        "drawn": drawn is not None,
        "baseline": baseline_facts(results, name),
        "outcome": metric_table(results, name, "outcome"),
        "rows": len(results.labels(name)),
        "challenged": len(results.challenged(name)),
        "details": [text for table in DETAILS if (text := table(results, name))],
        "failures": failure_table(results, name, one.first_outside),
        "figures": pictures,
        "replay": one.replay,
        "problems": [plain(problem) for problem in one.problems],
    }


def _machine(results: Results) -> str:
    manifest = results.stored.manifest
    runs = [run for run in results.stored.results if run["duration_s"] >= 0.0]
    compiled = sum(bool(run.get("compiled")) for run in runs)
    implementation = "" if not runs else "compiled" if compiled == len(runs) else "NumPy"
    if 0 < compiled < len(runs):
        names = [one for one in results.controllers if not all(run.get("compiled") for run in results.all_runs(one))]
        implementation = f"compiled in {compiled} of {len(runs)} runs; NumPy in some of {enumeration(names)}"
    wall, kept = manifest.get("wall_time_s"), manifest.get("stored_before") or 0
    facts = {
        "control step": implementation,
        "seed": manifest.get("seed"),
        "wall time [s]": None if wall is None else number(float(wall)),
        "runs": f"{results.finished} of {results.planned}" + (f", {kept} of them stored before" if kept else ""),
    }
    return facts_table(manifest, **facts)
