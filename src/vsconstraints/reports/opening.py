"""The first screen of a report: the question, its answer computed from the data, one figure and one table."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import PurePath

from ..comparisons.metrics import NEGLIGIBLE, TOLERANT
from ..comparisons.suite import BASELINE
from ..rows.readable import counted
from ..scenarios import Scenario
from .headlines import some
from .markdown import bold, enumeration, plain
from .numbers import number, of_length
from .results import Results, violated
from .summary import FIRST_LEGEND, law_table

QUESTION = "Which law keeps visual servoing inside its limits, how far does it go to them, and what does it cost?"


def opening(results: Results, figure: str = "") -> str:
    """Title, question, answer, figure and table, and what the rest of the report is."""
    configuration = results.stored.manifest["configuration"]
    title = plain(str(configuration.get("title") or configuration.get("suite") or "Comparison"))
    parts = [f"# {title}", f"{bold(QUESTION)} {_compared(results)}", _answer(results)]
    if results.finished < results.planned:
        parts.append(
            f"**Incomplete: {results.finished} of {results.planned} runs finished.** What is missing is blank below; "
            "counts and medians are over the runs that finished."
        )
    parts.append(figure)
    if results.competitors:
        parts += [law_table(results), FIRST_LEGEND]
    parts.append(
        "The same robot, camera, task, start and constraint rows for all: only the control law differs. "
        f"*{BASELINE}* knows no constraints and is not compared; it tells which rows a scenario challenges at all. "
        "The numbers are in [results.csv](results.csv) and [constraints.csv](constraints.csv), what was run is in "
        "[manifest.json](manifest.json); [definitions](#definitions), "
        "[what makes the comparison fair](#what-makes-the-comparison-fair) and "
        "[its limitations](#known-limitations) are at the end."
    )
    return "\n\n".join(part for part in parts if part)


def robot_name(scenario: Scenario) -> str:
    """What a scenario's robot is called."""
    robot = scenario.tables.get("robot")
    if isinstance(robot, dict):
        robot = robot.get("name") or PurePath(str(robot.get("urdf") or "own robot")).stem
    return plain(str(robot)) if robot else ""


def _compared(results: Results) -> str:
    """Laws, robots, scenarios and trials of this comparison."""
    laws, scenarios = counted(len(results.competitors), "law"), counted(len(results.scenarios), "scenario")
    robots = list(dict.fromkeys(name for one in results.stored.scenarios.values() if (name := robot_name(one))))
    on = f" on {enumeration(some(robots))}" if robots else ""
    trials = f", {results.trials} trials each" if results.trials > 1 else ""
    return f"Compared here: {laws}{on}, in {scenarios}{trials}."


def _answer(results: Results) -> str:
    """What tracking alone leaves, who converged without doing so and how often, and how long calls take."""
    if not results.competitors:
        return f"Only {BASELINE} alone was run: there is nothing to compare."
    strictly, tolerantly = (f"Without violating a row by more than {of_length(one)}" for one in (NEGLIGIBLE, TOLERANT))
    sentences = [_challenge(results), _ranking(results, results.clean, strictly)]
    if results.clean != results.clean_tolerant:
        sentences.append(_ranking(results, results.clean_tolerant, tolerantly))
    else:
        sentences.append(f"So it is with {of_length(TOLERANT)} tolerated.")
    sentences.append(_times(results))
    return " ".join(sentence for sentence in sentences if sentence)


def _challenge(results: Results) -> str:
    alone = results.all_runs(BASELINE)
    if not alone:
        return ""
    if not results.challenged_scenarios:
        return f"Tracking alone violates no row in its {counted(len(alone), 'run')}: nothing here tells laws apart."
    return (
        f"Tracking alone violates a row in {sum(bool(violated(run)) for run in alone)} of {counted(len(alone), 'run')}."
    )


def _ranking(results: Results, clean: Mapping[str, int], standard: str) -> str:
    """Who converged without violating a row, by a standard, and how often; of several trials with exact intervals."""
    from ..comparisons.statistics import rate_of, rate_text

    by_count: dict[tuple[int, int], list[str]] = defaultdict(list)
    for name, good in clean.items():
        by_count[good, len(results.all_runs(name))].append(name)
    ranked = sorted(by_count.items(), key=lambda item: (-item[0][0], item[0][1]))
    contested = len(ranked) > 1 and bool(results.challenged_scenarios)
    texts = []
    for k, ((good, of), names) in enumerate(ranked):
        named = [bold(name) for name in names] if contested and k == 0 else names
        if results.trials > 1:
            often = rate_text(rate_of(good, of))
        else:
            often = str(good) if k and of == ranked[0][0][1] else f"{good} of {counted(of, 'run')}"
        texts.append(f"{enumeration(named)} {'in' if k else 'converged in'} {often}")
    of_trials = " Intervals are over the trials of these scenarios, not over others." if results.trials > 1 else ""
    return f"{standard}, {'; '.join(texts)}.{of_trials}"


def _times(results: Results) -> str:
    """Least and greatest of the laws' median times, apart by what answered."""
    found: dict[str, list[float]] = defaultdict(list)
    for name in results.competitors:
        found[results.form(name)] += [x for run in results.all_runs(name) if (x := run["step_time_median_us"]) == x]
    parts = [
        f"{' to '.join(dict.fromkeys((number(min(times)), number(max(times)))))} µs {form.replace('NumPy', 'in NumPy')}"
        for form, times in found.items()
        if times and form
    ]
    return f"The median call of a run took {enumeration(parts)}." if parts else ""
