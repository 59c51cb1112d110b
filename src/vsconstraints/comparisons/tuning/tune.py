"""Tunes every law alike: the same tuner, the same number of evaluations, the same training scenes."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...compiled import prepare
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ..evidence.campaign import differences, in_words
from ..runs.files import plain, storing, write_json
from ..runs.folder import MANIFEST, held
from ..runs.machine import git_commit, loaded_versions, machine
from .objectives import Judged
from .problem import Evaluator, Problem, baseline, evaluating
from .result import Asked, Tuning, write
from .search import Search

Setting = tuple[str, str]
"""A law's name, and its options as JSON."""


def setting_key(law: str, options: Mapping[str, Any]) -> Setting:
    """What a setting is known by."""
    return law, json.dumps(options, sort_keys=True)


class Journal:
    """A file with one line for each setting, each with a checksum.

    A last line without an end, which was being written when the process ended, is cut off. Nothing else that the file
    holds is ever written again, so that a full disk costs none of it.

    Parameters
    ----------
    path
        The file; begun if it is not there.

    Raises
    ------
    ConfigurationError
        if a whole line is damaged; it names the line.
    StorageError
        if the file cannot be begun, or its last line cannot be cut off.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Setting, Judged] = {}
        with storing("evaluations", path.parent):
            path.touch()
        data = path.read_bytes()
        *lines, rest = data.split(b"\n")
        for number, line in enumerate(lines, 1):
            try:
                setting, judged = _read(line)
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                raise ConfigurationError(
                    f"{path}, line {number} is damaged ({type(error).__name__}): delete it, and its setting is "
                    "evaluated again"
                ) from error
            self._known[setting] = judged
        if rest:
            with storing("evaluations", path.parent):
                os.truncate(path, len(data) - len(rest))

    def __contains__(self, setting: Setting) -> bool:
        return setting in self._known

    def __getitem__(self, setting: Setting) -> Judged:
        return self._known[setting]

    def add(self, setting: Setting, judged: Judged) -> None:
        """Keep what a setting is worth; raises StorageError if that cannot be written."""
        law, options = setting
        entry = {"law": law, "options": options, "judged": judged._asdict()}
        line = json.dumps({**entry, "checksum": _checksum(entry)})
        with storing("evaluations", self._path.parent), self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        self._known[setting] = judged


def _read(line: bytes) -> tuple[Setting, Judged]:
    """A line's setting and what it is worth; raises ValueError, TypeError or KeyError where it is damaged."""
    entry = dict(json.loads(line))
    if entry.pop("checksum") != _checksum(entry):
        raise ValueError("it is not what was written")
    judged = entry["judged"]
    return (entry["law"], entry["options"]), Judged(**{**judged, "point": tuple(judged["point"])})


def _checksum(entry: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(entry).encode())


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
        Number of processes at most; see :func:`vsconstraints.comparisons.runs.machine.process_count`.
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
