"""Compare laws as they are, from a session."""

from __future__ import annotations

import shutil
import tempfile
import warnings
import weakref
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path

from ...comparisons import StoredComparison, Suite
from ...comparisons import compare as compare_suite
from .comparison import Comparison
from .laws import Laws, specs_of
from .progress import told
from .scenes import AnyScenario, scenarios_of

NAME = "session"
"""What results call the suite of a session."""


def compare(
    laws: Laws,
    scenarios: AnyScenario | Iterable[AnyScenario],
    *,
    trials: int = 1,
    seed: int = 0,
    workers: int | None = None,
    limit: float | None = None,
    out: str | Path | None = None,
    progress: bool = True,
) -> Comparison:
    """Run every law on every scenario, tracking alone beside them, and score all as ``vsconstraints compare`` does.

    Classes may be defined anywhere, in a cell of a notebook too. Every run is made by a copy of the instance in a
    process of its own kind; what cannot be copied there runs in this process, and a warning says so.

    Parameters
    ----------
    laws
        Instances, classes, registered names, or ``module:Class``; a mapping gives them names of one's own, as two of
        one class need.
    scenarios
        Names of shipped ones, paths, scenarios, or setups made in Python.
    trials, seed
        How often each is run from starts or with noise that differ, and what those are drawn from.
    workers
        Number of processes at most; as many as make sense if None. 0 runs all in this process: a debugger then reaches
        a law, and a law that hangs or ends its process does so with the session.
    limit
        How long a run may take in another process [s]; by its number of samples if None.
    out
        A folder to keep results in: the same call goes on where it stopped. What is not kept goes with the comparison.
    progress
        Whether to tell how many runs are done, in a terminal and in a notebook; elsewhere nothing is told.

    Raises
    ------
    ConfigurationError
        if a law or a scenario cannot be used, two have the same name, or trials would all be the same run. A law that
        fails costs its own runs, whose status is then ``failed``.
    KeyboardInterrupt
        if it is interrupted.
    """
    specs, notes = specs_of(laws)
    suite = Suite(NAME, "Comparison from a session", scenarios_of(scenarios), specs, trials, seed).checked()
    own = {scenario.name: scenario for scenario in suite.scenarios if scenario.in_session}
    notes += tuple(f"{name} runs in this process: {one.why_here}" for name, one in own.items())
    for note in notes:
        warnings.warn(note, stacklevel=2)
    folder = Path(tempfile.mkdtemp(prefix="vsconstraints-")) if out is None else Path(out)
    try:
        with told(len(suite.with_baseline().runs())) if progress else nullcontext(lambda: None) as advance:
            finished = compare_suite(
                suite, folder, workers=workers, limit=limit, on_finished=lambda run, score, stored: advance()
            )
        if finished.interrupted:
            raise KeyboardInterrupt
        stored = StoredComparison.load(folder, trust=True)
        # a setup cannot be read back
        stored.scenarios.update(own)
        comparison = Comparison(stored, (*notes, *suite.remarks()))
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    if out is None:
        weakref.finalize(comparison, shutil.rmtree, folder, ignore_errors=True)
    return comparison
