"""Pages that replay the most telling runs of a scenario, for reports that link them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from urllib.parse import quote

from ..comparisons.record import run_file
from ..comparisons.suite import BASELINE
from ..errors import ConfigurationError, described
from .drawing import TRIAL_SHOWN, Drawn
from .markdown import code
from .replay import ReplayRun, write_replay
from .replay.runs import of_record
from .results import Line, Results, clean

FOLDER = "replays"
"""Below that of the comparison."""


def add_replays(results: Results, scenarios: Sequence[str], drawn: Mapping[str, Drawn]) -> None:
    """Write a page for each of these scenarios, and say where it is; a page that cannot be made costs nothing else."""
    folder = results.stored.folder
    for name in scenarios:
        laws = telling_laws(results, name)
        if not laws:
            continue
        try:
            write_replay([_run(results, name, law) for law in laws], folder / FOLDER / f"{name}.html")
        except Exception as error:  # one bad run or page must not cost the report
            drawn[name].problems.append(f"Its replay could not be made: {described(error)}.")
            continue
        link = f"[Replay in a browser]({FOLDER}/{quote(name)}.html)"
        drawn[name].replay = f"{link}: {' and '.join(code(law) for law in laws)}."


def telling_laws(results: Results, scenario: str) -> tuple[str, ...]:
    """Who is to be seen: the law deepest outside its limits, or tracking alone, and the best that stays inside.

    The best is the one with the greatest utilization; of equal ones the first.
    """
    lines = {law: line for law in results.controllers if (line := _line(results, scenario, law)) is not None}
    competitors = [law for law in results.competitors if law in lines]
    outside = [law for law in competitors if lines[law]["violation_depth"] > 0.0]
    worst = max(outside, key=lambda law: float(lines[law]["violation_depth"]), default=BASELINE)
    inside = [law for law in competitors if clean(lines[law])]
    best = max(inside, key=lambda law: _known(lines[law]["utilization"]), default=worst)
    return tuple(law for law in dict.fromkeys((worst, best)) if law in lines)


def _line(results: Results, scenario: str, law: str) -> Line | None:
    """The result of the trial that is shown, if it has two samples or more."""
    for line in results.runs(scenario, law):
        if line["trial"] == TRIAL_SHOWN and line["duration_s"] > 0.0:
            return line
    return None


def _known(value: float) -> float:
    return value if value == value else -1.0


def _run(results: Results, scenario: str, law: str) -> ReplayRun:
    """A stored run; raises ConfigurationError if it is not there any more."""
    stored, record = results.stored, results.stored.run(scenario, law, TRIAL_SHOWN)
    if record is None:
        file = run_file(stored.folder, scenario, law, TRIAL_SHOWN)
        raise ConfigurationError(f"the trajectory {file.name} is missing or damaged")
    return of_record(stored, stored.scenarios[scenario], law, TRIAL_SHOWN, record)
