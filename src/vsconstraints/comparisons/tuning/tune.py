"""Tunes every law alike: the same tuner, the same number of evaluations, the same training scenes."""

from __future__ import annotations

import json
import os
import re
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...compiled import prepare
from ...controllers import Choices
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ..evidence.campaign import differences, in_words
from ..runs.files import plain, replaced, storing, write_json
from ..runs.folder import MANIFEST, locked, manifest_of
from ..runs.machine import git_commit, loaded_versions, machine
from .objectives import OBJECTIVES, Judged, Point, choose, front, hypervolume
from .problem import Evaluate, Options, Problem, Searched, evaluating

JOURNAL, TUNED = "journal.jsonl", "tuned.toml"
EVALUATIONS, HYPERVOLUMES = "evaluations.parquet", "hypervolumes.parquet"

EXCESS = "excess"  #: attribute of a trial: by how much its constraint is exceeded; not at all if it is not positive

Setting = tuple[str, str]  #: a law's name, and its options as JSON

#: Called with what is being done, how much of it is done, and how much there is.
Progress = Callable[[str, int, int], None]


class Search:
    """Suggests settings of a law, one after the other, the default first.

    The others are drawn by the tree-structured Parzen estimator for several objectives (Ozaki et al. 2022), with the
    constraint (Watanabe and Hutter 2023), for all options together. They depend only on the seed and on what was told.
    """

    def __init__(self, searched: Searched, seed: int) -> None:
        import optuna
        from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

        self.searched, self.seed, default = searched, seed, dict(searched.default)
        self._distributions: dict[str, optuna.distributions.BaseDistribution] = {}
        for option, ranged in searched.ranges.items():
            if isinstance(ranged, Choices):
                default[option] = ranged.values.index(default[option])
                self._distributions[option] = CategoricalDistribution(tuple(range(len(ranged.values))))
            else:
                kind = IntDistribution if ranged.integer else FloatDistribution
                number = int if ranged.integer else float
                bounds = number(ranged.least), number(ranged.greatest)
                self._distributions[option] = kind(*bounds, log=ranged.logarithmic)
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        with warnings.catch_warnings(action="ignore"):  # what Optuna calls experimental
            sampler = optuna.samplers.TPESampler(
                seed=seed, multivariate=True, constraints_func=lambda trial: (trial.user_attrs[EXCESS],)
            )
        self._study = optuna.create_study(directions=["minimize"] * len(OBJECTIVES), sampler=sampler)
        self._study.enqueue_trial(default)

    def ask(self) -> Options:
        """The next setting's options."""
        self._trial = self._study.ask(self._distributions)
        values, ranges = self._trial.params, self.searched.ranges.items()
        return {
            option: ranged.values[values[option]] if isinstance(ranged, Choices) else values[option]
            for option, ranged in ranges
        }

    def tell(self, point: Point, excess: float) -> None:
        """Tell the objectives of the last setting, and by how much it exceeds what the constraint allows."""
        self._trial.set_user_attr(EXCESS, excess)
        self._study.tell(self._trial, list(point))


class Journal(dict[Setting, Judged]):
    """How settings are judged, stored as soon as it is known: a file with one line and checksum for each.

    A last line without an end, which was being written when the process ended, is cut off; nothing else is ever written
    again. (Optuna's JournalStorage has no checksums, stops at such a line, and its samplers do not go on from it as if
    they had never ended.) Raises ConfigurationError that names a damaged line, StorageError if it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        with storing("evaluations", path.parent):
            path.touch()
        data = path.read_bytes()
        *lines, rest = data.split(b"\n")
        for number, line in enumerate(lines, 1):
            try:
                entry = dict(json.loads(line))
                if entry.pop("checksum") != _checksum(entry):
                    raise ValueError("it is not what was written")
                values = {**entry["judged"], "point": tuple(entry["judged"]["point"])}
                self[entry["law"], entry["options"]] = Judged(**values)
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                raise ConfigurationError(
                    f"{path}, line {number} is damaged ({type(error).__name__}): delete it, and its setting is "
                    "evaluated again"
                ) from error
        if rest:
            with storing("evaluations", path.parent):
                os.truncate(path, len(data) - len(rest))

    def add(self, setting: Setting, judged: Judged) -> None:
        """Store how a setting is judged; raises StorageError if that cannot be written."""
        entry = {"law": setting[0], "options": setting[1], "judged": judged._asdict()}
        line = json.dumps({**entry, "checksum": _checksum(entry)})
        with storing("evaluations", self._path.parent), self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        self[setting] = judged


def _checksum(entry: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(entry).encode())


@dataclass(frozen=True)
class Evaluation:
    """A setting that a tuner with this seed suggested, by its number there (0 is the default), and how it is judged.

    ``feasible``: it violates no more than is allowed. ``on_front``: no feasible evaluation of this law dominates it, of
    all tuner seeds.
    """

    seed: int
    number: int
    options: Options
    judged: Judged
    feasible: bool
    on_front: bool = False


@dataclass(frozen=True)
class Tuned:
    """A law with all its evaluations, of all tuner seeds, one after the other; the first is the default.

    ``hypervolumes`` are of each tuner seed's feasible evaluations, to :data:`.objectives.REFERENCE`. ``chosen`` is, of
    the feasible settings, the one that :func:`.objectives.choose` finds; if there is none, of those that violate least
    (Deb 2000). None if nothing is searched.
    """

    law: Searched
    evaluations: tuple[Evaluation, ...]
    hypervolumes: tuple[float, ...]
    chosen: Evaluation | None

    @property
    def default(self) -> Evaluation:
        """The law as the campaign defines it."""
        return self.evaluations[0]

    @classmethod
    def of(cls, law: Searched, evaluations: Iterable[Evaluation]) -> Tuned:
        """A law's evaluations in any order."""
        every = sorted(evaluations, key=lambda each: (each.seed, each.number))
        feasible = [i for i, each in enumerate(every) if each.feasible]
        for i in front([every[i].judged.point for i in feasible]):
            every[feasible[i]] = replace(every[feasible[i]], on_front=True)
        least = min(each.judged.violations for each in every)
        best = [each for each in every if each.feasible or (not feasible and each.judged.violations == least)]
        volumes = [
            hypervolume([every[i].judged.point for i in feasible if every[i].seed == seed])
            for seed in dict.fromkeys(each.seed for each in every)
        ]
        chosen = best[choose([each.judged.point for each in best])] if law.ranges else None
        return cls(law, tuple(every), tuple(volumes), chosen)

    def toml(self) -> list[str]:
        """Lines of the chosen setting as a table of controllers."""
        name = self.law.name
        if self.chosen is None:
            return [f"# {name}: nothing is searched"]
        share = f"{100.0 * self.chosen.judged.violations:.3g} % of its runs violate a row"
        remark = [] if self.chosen.feasible else [f"# {name}: no setting is feasible; {share}"]
        setting = self.law.setting(self.chosen.options)
        options = {"type": setting.law, **setting.options}
        return [*remark, f"[controllers.{_toml(f'{name}-tuned')}]", *_items(options)]


@dataclass(frozen=True)
class Tuning:
    """The tuned laws of a campaign, in its order."""

    problem: Problem
    laws: tuple[Tuned, ...]

    def write(self, folder: Path) -> None:
        """Write tables and settings, each file whole or not at all; raises StorageError."""
        import pandas

        columns = [objective.column for objective in OBJECTIVES]
        evaluations = [
            {
                "law": law.law.name,
                "seed": each.seed,
                "number": each.number,
                "options": json.dumps(each.options, sort_keys=True),
                **dict(zip((*columns, *Judged._fields[1:]), (*each.judged.point, *each.judged[1:]), strict=True)),
                "feasible": each.feasible,
                "on_front": each.on_front,
                "chosen": each is law.chosen,
            }
            for law in self.laws
            for each in law.evaluations
        ]
        hypervolumes = [
            {"law": law.law.name, "seed": seed, "hypervolume": volume}
            for law in self.laws
            for seed, volume in enumerate(law.hypervolumes)
        ]
        with storing("results", folder):
            for name, lines in ((EVALUATIONS, evaluations), (HYPERVOLUMES, hypervolumes)):
                with replaced(folder / name) as part:
                    pandas.DataFrame(lines).to_parquet(part, index=False)
            with replaced(folder / TUNED) as part:
                part.write_text(self.toml(), encoding="utf-8")

    def toml(self) -> str:
        """Chosen settings as tables of controllers, which a campaign can take over."""
        campaign = self.problem.campaign
        families = ", ".join(family.name for family in campaign.families)
        lines = [f"# Laws of the campaign {campaign.name}, tuned on training scenes of {families}."]
        for law in self.laws:
            lines += ["", *law.toml()]
        return "\n".join(lines) + "\n"


def _items(table: Mapping[str, Any]) -> list[str]:
    """Each key of a table with its value as TOML has it."""
    return [
        f"{key if re.fullmatch('[A-Za-z_][A-Za-z0-9_]*', key) else _toml(key)} = {_toml(table[key])}" for key in table
    ]


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_items(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def tune(
    problem: Problem,
    folder: Path,
    *,
    workers: int | None = None,
    command: Sequence[str] = (),
    on_progress: Progress = lambda what, done, total: None,
) -> Tuning:
    """Tune the laws of a campaign, and store all evaluations below ``folder``, which is created if needed.

    Laws and tuner seeds go on side by side, one evaluation each at a time, so that suggestions depend only on earlier
    results: not on the number of processes, nor on where an earlier call was ended. Settings that are stored in the
    folder are not run again. ``workers`` is the maximum number of processes, ``command`` is for the manifest.

    Raises ConfigurationError if a package is missing, no training scene is found, or the folder holds something else;
    StorageError if evaluations cannot be written: what could be stays.
    """
    demand("tune")
    with locked(folder, "a tuning"):
        prepare()
        _claim(folder, problem, command)
        stages = problem.stages(workers, lambda done, total: on_progress("drawing training scenes", done, total))
        journal = Journal(folder / JOURNAL)
        evaluations: dict[str, list[Evaluation]] = {law.name: [] for law in problem.laws}
        with evaluating(stages, problem.baseline, workers) as evaluate:
            for law, evaluation in _evaluations(problem, journal, evaluate, on_progress):
                evaluations[law.name].append(evaluation)
        tuning = Tuning(problem, tuple(Tuned.of(law, evaluations[law.name]) for law in problem.laws))
        tuning.write(folder)
        return tuning


def _evaluations(
    problem: Problem, journal: Journal, evaluate: Evaluate, on_progress: Progress
) -> Iterator[tuple[Searched, Evaluation]]:
    """All evaluations; a law without searched options has one, its default."""
    budget = problem.budget
    searches = [Search(law, seed) for law in problem.laws for seed in range(budget.seeds if law.ranges else 1)]
    for number in range(budget.evaluations):
        on_progress("evaluating", number, budget.evaluations)
        asked = [(search, search.ask()) for search in searches if number == 0 or search.searched.ranges]
        keys = [(search.searched.name, json.dumps(options, sort_keys=True)) for search, options in asked]
        new = {
            key: search.searched.setting(options)
            for key, (search, options) in zip(keys, asked, strict=True)
            if key not in journal
        }
        for key, judged in zip(new, evaluate(list(new.values())), strict=True):
            journal.add(key, judged)
        for key, (search, options) in zip(keys, asked, strict=True):
            judged, allowed = journal[key], budget.violations
            search.tell(judged.point, judged.violations - allowed)
            yield search.searched, Evaluation(search.seed, number, options, judged, judged.violations <= allowed)
    on_progress("evaluating", budget.evaluations, budget.evaluations)


def _claim(folder: Path, problem: Problem, command: Sequence[str]) -> None:
    """Write the manifest; raise ConfigurationError if the folder holds another tuning."""
    path, here = folder / MANIFEST, plain(problem.configuration())
    there = manifest_of(folder).get("tuning") if path.exists() else here
    if there is None:
        raise ConfigurationError(f"{path} cannot be read: it is no manifest of a tuning")
    if there != here:
        raise ConfigurationError(
            f"{folder} holds another tuning: {in_words(list(differences(there, here)))}. Give another folder with --out"
        )
    manifest = {
        "tuning": here,
        "evaluations": problem.budget.evaluations,
        "tuner_seeds": problem.budget.seeds,
        "campaign": plain(problem.campaign.resolved()),
        "command": list(command),
        "git_commit": git_commit(),
        "machine": machine(),
        "loaded": loaded_versions(),
    }
    with storing("evaluations", folder):
        write_json(path, manifest)
