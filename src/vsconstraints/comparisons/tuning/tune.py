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
from .problem import Evaluator, Problem, Search, evaluating
from .result import Asked, Tuning

JOURNAL = "journal.jsonl"

Setting = tuple[str, str]
"""A law's name, and its options as JSON."""

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""


class Journal:
    """How settings are judged, stored as soon as it is known: a file with one line and checksum for each.

    A last line without an end, which was being written when the process ended, is cut off. Nothing else is ever written
    again, so that a full disk costs none of it. (Optuna's JournalStorage has no checksums, and stops at such a line.)

    Parameters
    ----------
    path
        The file; created if it does not exist.

    Raises
    ------
    ConfigurationError
        if a whole line is damaged; it names the line.
    StorageError
        if the file cannot be created, or its last line cannot be cut off.
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
                entry = dict(json.loads(line))
                if entry.pop("checksum") != _checksum(entry):
                    raise ValueError("it is not what was written")
                judged = Judged(**{**entry["judged"], "point": tuple(entry["judged"]["point"])})
                self._known[entry["law"], entry["options"]] = judged
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                raise ConfigurationError(
                    f"{path}, line {number} is damaged ({type(error).__name__}): delete it, and its setting is "
                    "evaluated again"
                ) from error
        if rest:
            with storing("evaluations", path.parent):
                os.truncate(path, len(data) - len(rest))

    def __contains__(self, setting: Setting) -> bool:
        return setting in self._known

    def __getitem__(self, setting: Setting) -> Judged:
        return self._known[setting]

    def add(self, setting: Setting, judged: Judged) -> None:
        """Store how a setting is judged; raises StorageError if that cannot be written."""
        law, options = setting
        entry = {"law": law, "options": options, "judged": judged._asdict()}
        line = json.dumps({**entry, "checksum": _checksum(entry)})
        with storing("evaluations", self._path.parent), self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        self._known[setting] = judged


def _checksum(entry: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(entry).encode())


def tune(
    problem: Problem,
    folder: Path,
    *,
    workers: int | None = None,
    command: Sequence[str] = (),
    on_progress: Progress = lambda what, done, total: None,
) -> Tuning:
    """Tune the laws of a campaign, and store all evaluations below ``folder``.

    Laws and tuner seeds go on side by side, one evaluation each at a time, so that suggestions depend only on earlier
    results: not on the number of processes, nor on where an earlier call was ended. Settings that are stored in the
    folder are not run again.

    Parameters
    ----------
    problem
        What is tuned.
    folder
        Created if it does not exist.
    workers
        Maximum number of processes; see :func:`vsconstraints.comparisons.runs.machine.process_count`.
    command
        What the user typed, for the manifest.
    on_progress
        Called with the progress.

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
        with evaluating(stages, problem.baseline, workers) as evaluator:
            found = list(_evaluations(problem, journal, evaluator, on_progress))
        tuning = Tuning.of(problem, found)
        tuning.write(folder)
        return tuning


def _evaluations(
    problem: Problem, journal: Journal, evaluator: Evaluator, on_progress: Progress
) -> Iterator[tuple[Asked, Judged]]:
    """All evaluations; a law without searched options has one, its default."""
    budget = problem.budget
    searches = [Search(law, seed) for law in problem.laws for seed in range(budget.seeds if law.ranges else 1)]
    for number in range(budget.evaluations):
        on_progress("evaluating", number, budget.evaluations)
        asking = [search for search in searches if number == 0 or search.searched.ranges]
        asked = [Asked(search.searched, search.seed, number, search.ask()) for search in asking]
        keys = [(one.law.law.name, json.dumps(one.options, sort_keys=True)) for one in asked]
        new = {key: one.law.setting(one.options) for key, one in zip(keys, asked, strict=True) if key not in journal}
        for key, judged in zip(new, evaluator.evaluate(list(new.values())), strict=True):
            journal.add(key, judged)
        for search, one, key in zip(asking, asked, keys, strict=True):
            judged = journal[key]
            search.tell(judged.point, judged.violations - budget.violations)
            yield one, judged
    on_progress("evaluating", budget.evaluations, budget.evaluations)


def _claim(folder: Path, problem: Problem, command: Sequence[str]) -> None:
    """Write the manifest; raise ConfigurationError if the folder holds another tuning."""
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
