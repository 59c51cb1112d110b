"""Tunes every law alike: the same tuner, the same number of evaluations, the same training scenes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ...compiled import prepare
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ..evidence.identity import differences, in_words
from ..runs.files import plain, storing, write_json
from ..runs.folder import MANIFEST, held
from ..runs.machine import git_commit, loaded_versions, machine
from .evaluation import Evaluator, evaluating
from .journal import Journal, setting_key
from .objectives import Judged
from .problem import Problem, baseline
from .result import Asked, Tuning
from .search import Search
from .storing import write

JOURNAL = "journal.jsonl"

Progress = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and how much there is."""


def tune(
    problem: Problem,
    folder: Path,
    *,
    workers: int | None = None,
    command: Sequence[str] = (),
    on_progress: Progress = lambda what, done, total: None,
) -> Tuning:
    """Tune the laws of a campaign, and store all evaluations below ``folder``.

    Laws and tuner seeds go on side by side, one evaluation each at a time, so that what is asked for next depends on
    nothing but what was found before: not on how many processes there are, and not on where an earlier call was ended.
    Settings whose worth the folder holds are not run again.

    Parameters
    ----------
    problem
        What is tuned.
    folder
        Where to; made if it is not there.
    workers
        Number of processes at most; see :func:`vsconstraints.comparisons.runs.resources.process_count`.
    command
        What the user typed, for the manifest.
    on_progress
        Told how far it is.

    Raises
    ------
    ConfigurationError
        if a package is missing, no training scene is found, or the folder holds something else.
    StorageError
        if evaluations cannot be written; what could be stays.
    """
    demand("tune")
    with held(folder, "a tuning"):
        prepare()
        _claim(folder, problem, command)
        stages = problem.stages(workers, lambda done, total: on_progress("drawing training scenes", done, total))
        journal = Journal(folder / JOURNAL)
        with evaluating(stages, baseline(problem.campaign), workers) as evaluator:
            found = list(_evaluations(problem, journal, evaluator, on_progress))
        tuning = Tuning.of(problem, found)
        write(tuning, folder)
        return tuning


def _evaluations(
    problem: Problem, journal: Journal, evaluator: Evaluator, on_progress: Progress
) -> Iterator[tuple[Asked, Judged]]:
    """All evaluations; a law of which nothing is searched has one, its default."""
    budget = problem.budget
    searches = [Search(law, seed) for law in problem.laws for seed in range(budget.seeds if law.ranges else 1)]
    for number in range(budget.evaluations):
        on_progress("evaluating", number, budget.evaluations)
        asking = [search for search in searches if number == 0 or search.searched.ranges]
        asked = [Asked(search.searched, search.seed, number, search.ask()) for search in asking]
        _evaluate(asked, journal, evaluator)
        for search, one in zip(asking, asked, strict=True):
            worth = journal[setting_key(one.law.law.name, one.options)]
            search.tell(worth.point, worth.violations - budget.violations)
            yield one, worth
    on_progress("evaluating", budget.evaluations, budget.evaluations)


def _evaluate(asked: Sequence[Asked], journal: Journal, evaluator: Evaluator) -> None:
    """Evaluate those settings whose worth is not known."""
    keyed = {setting_key(one.law.law.name, one.options): one for one in asked}
    new = {key: one.law.setting(one.options) for key, one in keyed.items() if key not in journal}
    for key, worth in zip(new, evaluator.evaluate(list(new.values())), strict=True):
        journal.add(key, worth)


def _claim(folder: Path, problem: Problem, command: Sequence[str]) -> None:
    """Say in the manifest what is tuned here; raise ConfigurationError if that is something else already."""
    path, here = folder / MANIFEST, plain(problem.configuration())
    there = here
    try:
        there = json.loads(path.read_text(encoding="utf-8"))["tuning"]
    except FileNotFoundError:
        pass
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise ConfigurationError(f"{path} cannot be read: it is no manifest of a tuning ({error})") from error
    if there != here:
        raise ConfigurationError(
            f"{folder} holds another tuning: {in_words(list(differences(there, here)))}. Give another folder with --out"
        )
    budget = problem.budget
    manifest = {
        "tuning": here,
        "evaluations": budget.evaluations,
        "tuner_seeds": budget.seeds,
        "campaign": plain(problem.campaign.resolved()),
        "command": list(command),
        "git_commit": git_commit(),
        "machine": machine(),
        "loaded": loaded_versions(),
    }
    with storing("evaluations", folder):
        write_json(path, manifest)
