"""Repetition of a random share of a study's runs, compared with the stored results."""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

from ..comparisons.runs.pool import Failure, OpenWorkers, processes
from ..comparisons.runs.spec import BASELINE, ControllerSpec
from ..controllers import FORMER_LAWS
from ..plugins.classes import untrusted
from .evidence import Batch, scored
from .evidence.own_files import changed, current_hashes, own_folders
from .families import Family
from .study import CONDITION, OUTCOME, SCENE, Study

TOLERANCE = 1e-9  #: Relative difference up to which numbers of two machines count as equal.
NUDGE = 1e-13  #: Change of the start that reveals runs decided by rounding, see :func:`nudged`.
MAX_SECRET = 2**32  #: Secret seeds are below this number.
#: Runs per call: the law and its baseline, both once more, and both from the moved start.
RUNS_OF_CALL = 6

Line = Mapping[str, Any]  #: One run of a study: its values by column.
ON_ALL_CORES = processes()


@dataclass(frozen=True)
class Repetition:
    """Result of repeating runs of a study.

    ``differences`` are sentences on runs that differ. ``by_rounding`` are sentences on runs that
    count as decided by rounding, see :func:`repeat`. ``changed_files`` are the names of files that
    custom laws have loaded or read and whose content on this machine differs from that in the
    study. ``moved`` are laws that are no longer part of the package, with their files: their runs
    are not repeated. ``not_compared`` are columns of results that have no value in the runs that
    can be repeated.
    """

    runs: int
    differences: tuple[str, ...]
    by_rounding: tuple[str, ...]
    changed_files: tuple[str, ...] = ()
    moved: Mapping[str, str] = field(default_factory=dict)
    not_compared: tuple[str, ...] = ()

    @property
    def agreeing(self) -> int:
        """Number of repeated runs that agree with the study."""
        return self.runs - len(self.differences) - len(self.by_rounding)


def secret_seed() -> int:
    """Draw a seed that nobody can know beforehand."""
    return secrets.randbelow(MAX_SECRET)


def drawn_lines(study: Study, share: float, seed: int) -> list[dict[str, Any]]:
    """Draw a share of a study's runs; the order of the study's lines has no influence.

    Only repeatable runs are drawn. Lines have no entry for a column that is empty in all of them,
    which an earlier version may not have written.
    """
    repeatable = repeatable_runs(study).dropna(axis="columns", how="all")
    key = [*SCENE, CONDITION, "controller"]
    ordered = repeatable.sort_values(key, kind="stable")
    lines: list[dict[str, Any]] = ordered.to_dict("records")
    count = math.ceil(share * len(lines))
    return Random(seed).sample(lines, count)


def repeatable_runs(study: Study) -> Any:
    """Return the runs of the laws that are still part of the package."""
    is_moved = study.runs["controller"].isin(list(moved_laws(study)))
    return study.runs[~is_moved]


def repeat(
    study: Study,
    families: Mapping[str, Family],
    share: float,
    seed: int,
    *,
    trust: bool = False,
    workers: OpenWorkers = ON_ALL_CORES,
    on_progress: Callable[[int, int], object] = lambda done, total: None,
) -> Repetition:
    """Repeat a share of a study's runs, drawn by ``seed``, and report those that differ.

    Numbers differ if they deviate by more than :data:`TOLERANCE`. A run counts as decided by
    rounding if every result that differs from the stored one also differs from that of a run whose
    start coordinates are :func:`nudged` by :data:`NUDGE`. A fault of such a result is not told
    apart; therefore the sentences also show the result from the moved start. A run that differs
    from the study and from its own repetition here is not reproducible, which is a difference.
    Raises ConfigurationError for laws that do not come with the package, unless they are trusted.
    """
    own_laws = [law.law for law in study.laws.values() if ":" in law.law]
    if own_laws and not trust:
        raise untrusted("a table of runs", own_laws)
    lines = drawn_lines(study, share, seed)
    calls = {}
    limits = {}
    for number, line in enumerate(lines):
        family = families[line["family"]]
        law = study.laws[line["controller"]]
        calls[number] = line, family, law, study.frozen[family.name]["seed"]
        limits[number] = RUNS_OF_CALL * law.run_limit(family.tables)
    differences: dict[int, str] = {}
    by_rounding: dict[int, str] = {}
    on_progress(0, len(lines))
    with workers(repeat_run) as opened:
        for done, (number, answer) in enumerate(opened.run(calls, limits), start=1):
            line = lines[number]
            where = f"{line['family']} {line['scene']}, {line[CONDITION]}, {line['controller']}"
            if isinstance(answer, Failure):
                differences[number] = f"{where}: it cannot be repeated: {answer.reason}"
            else:
                found, decided_by_rounding = answer
                by_kind = by_rounding if decided_by_rounding else differences
                if found:
                    by_kind[number] = f"{where}: {'; '.join(found)}"
            on_progress(done, len(lines))
    is_empty = repeatable_runs(study).isna().all()
    return Repetition(
        runs=len(lines),
        differences=_in_order(differences),
        by_rounding=_in_order(by_rounding),
        changed_files=changed_files(study),
        moved=moved_laws(study),
        not_compared=tuple(column.name for column in OUTCOME if is_empty[column.name]),
    )


def moved_laws(study: Study) -> dict[str, str]:
    """Return the laws that are no longer part of the package, with their file and class."""
    moved = {}
    for name, law in study.laws.items():
        if law.law in FORMER_LAWS:
            moved[name] = FORMER_LAWS[law.law]
    return moved


def changed_files(study: Study) -> tuple[str, ...]:
    """Return the names of the custom laws' files whose content differs from that in the study."""
    own_laws = tuple(law for law in study.laws.values() if ":" in law.law)
    if not own_laws:
        return ()
    now = current_hashes(study.files, own_folders(own_laws, ()))
    return tuple(changed(study.files, now))


def _in_order(sentences: Mapping[int, str]) -> tuple[str, ...]:
    return tuple(sentence for _, sentence in sorted(sentences.items()))


def repeat_run(
    line: Line, family: Family, law: ControllerSpec, seed: int
) -> tuple[list[str], bool]:
    """Repeat the run of a line, in a worker.

    Return sentences on the differences, and True if the run counts as decided by rounding.
    """
    made = repeat_once(line, family, law, seed)
    found = _differences(line, made)
    if not found:
        return [], False
    unstable = _differences(made, repeat_once(line, family, law, seed))
    if unstable:
        return [f"not reproducible here: {sentence}" for sentence in unstable.values()], False
    from_moved_start = repeat_once(line, family, law, seed, NUDGE)
    changed_by_nudge = _differences(made, from_moved_start)
    unexplained = [text for column, text in found.items() if column not in changed_by_nudge]
    if unexplained:
        return unexplained, False
    sentences = []
    for column, text in found.items():
        sentences.append(f"{text}, and {from_moved_start[column]!r} from the moved start")
    return sentences, True


def repeat_once(
    line: Line, family: Family, law: ControllerSpec, seed: int, nudge: float = 0.0
) -> Line:
    """Make the run of a line once, from a start that is :func:`nudged` by ``nudge``."""
    number = line["scene"]
    half = line["half"]
    laws = (ControllerSpec(BASELINE), law)
    batch = Batch(family, (number,), (line[CONDITION],), laws, half, seed)
    if nudge:
        scene = family.scene(number, half, seed)
        start = scene.scenario().tables["q0"]
        moved = [nudged(coordinate, nudge) for coordinate in start]
        tables = {}
        for condition, table in scene.tables.items():
            tables[condition] = {**table, "q0": moved}
        batch = replace(batch, drawn=replace(scene, tables=tables))
    runs: list[Line] = scored(batch).runs.to_pylist()
    return next(run for run in runs if run["controller"] == law.name)


def nudged(coordinate: float, nudge: float) -> float:
    """Return a start coordinate [rad or m], changed by ``nudge``, or by as large a share of it.

    The greater of both is taken. Of a small coordinate, a share would be less than the rounding of
    sines and sums, so that it would change nothing.
    """
    return coordinate + nudge * max(1.0, abs(coordinate))


def _differences(first: Line, second: Line) -> dict[str, str]:
    """Return sentences on the differences of two results, by column that both have."""
    found = {}
    for column in OUTCOME:
        name = column.name
        if name not in first or name not in second:
            continue
        a = first[name]
        b = second[name]
        is_same = a == b
        if column.kind == "number":
            a = math.nan if a is None else a
            b = math.nan if b is None else b
            both_missing = math.isnan(a) and math.isnan(b)
            is_same = both_missing or math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
        if not is_same:
            found[name] = f"{name} is {a!r} and was made {b!r}"
    return found
