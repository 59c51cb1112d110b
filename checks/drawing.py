"""Time of a report: ``python -m checks.drawing FOLDER`` draws a stored comparison in one process.

Times are processor times, so that other work on the machine does not count. They cover figures of
scenarios (with the number of drawn ones), figures of the whole comparison, and both forms of the
text. Figures and report are those of ``vsconstraints report FOLDER``; with ``--all`` all scenarios
are drawn, not only the most informative ones.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

from vsconstraints.comparisons import StoredComparison
from vsconstraints.reports.drawing import (
    draw_overview,
    draw_scenario,
    scenario_jobs,
    shown_scenarios,
)
from vsconstraints.reports.page import html_page
from vsconstraints.reports.results import Results


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Call a function; return its processor time [s] and its result."""
    began = process_time()
    answer = call()
    return process_time() - began, answer


def main(arguments: list[str]) -> int:
    """Print the times; return 2 if no folder is named."""
    folders = [Path(one) for one in arguments if one != "--all"]
    if len(folders) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    folder = folders[0]
    reading, results = timed(lambda: Results(StoredComparison.load(folder)))
    jobs = scenario_jobs(results, None if "--all" in arguments else shown_scenarios(results))
    (folder / "figures").mkdir(exist_ok=True)
    first, _ = timed(lambda: draw_scenario(jobs[0]))  # includes the imports
    times = []
    figures = 0
    for job in jobs:
        seconds, drawn = timed(partial(draw_scenario, job))
        times.append((seconds, job.scenario.name))
        figures += len(drawn.files)
    with TemporaryDirectory() as made:
        whole, _ = timed(lambda: draw_overview(results, Path(made)))
    text = (folder / "report.md").read_text(encoding="utf-8")
    html_page(text)  # includes the imports
    page, _ = timed(lambda: html_page(text))
    total = sum(seconds for seconds, _ in times)
    print(f"reading                      {reading:6.2f} s")
    print(f"figures of scenarios         {total:6.2f} s: {figures} of {len(jobs)} scenarios")
    print(f"  longest                    {max(times)[0]:6.2f} s: {max(times)[1]}")
    print(f"  imports, in each process   {max(first - times[0][0], 0.0):6.2f} s")
    print(f"figures of the whole         {whole:6.2f} s")
    print(f"report.html                  {page:6.2f} s of {len(text) // 1000} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
