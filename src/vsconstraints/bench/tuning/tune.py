"""Tune all laws with the same tuner, number of evaluations and training scenes."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ...comparisons.metrics import load_metrics
from ...comparisons.runs.files import plain, replaced, storing, write_json
from ...comparisons.runs.folder import MANIFEST, locked, manifest_of
from ...comparisons.runs.identity import Identity, differences, in_words
from ...comparisons.runs.machine import loaded_versions, new_manifest
from ...comparisons.runs.spec import ControllerSpec, prepare_laws
from ...controllers import Choices
from ...errors import ConfigurationError
from ...plugins.extras import demand
from ...plugins.provenance import Files
from ...scenarios.toml import toml_items, toml_text
from ..evidence.folder import content_changes
from .journal import JournalFile
from .problem import (
    ALL,
    OBJECTIVES,
    ByFamily,
    Evaluate,
    Judged,
    Options,
    Problem,
    Searched,
    choose,
    evaluating,
    loss,
)

JOURNAL = "journal.jsonl"
TUNED = "tuned.toml"
EVALUATIONS = "evaluations.parquet"

Setting = tuple[str, str]  #: name of a law, and its options as JSON

#: Called with the name of the current step, the amount done and the total amount.
Progress = Callable[[str, int, int], None]


class Search:
    """Sequence of suggested settings of a law, the default first.

    The others are drawn by the tree-structured Parzen estimator (Bergstra et al. 2011; for all
    options together: Falkner et al. 2018), which uses only the order of settings by loss.
    Suggestions depend only on the seed and on the results passed to ``tell``.
    """

    def __init__(self, searched: Searched, seed: int) -> None:
        import optuna
        from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

        self.searched = searched
        self.seed = seed
        default = dict(searched.default)
        self._distributions: dict[str, optuna.distributions.BaseDistribution] = {}
        for option, ranged in searched.ranges.items():
            if isinstance(ranged, Choices):
                # choices of any type are searched by their positions
                default[option] = ranged.values.index(default[option])
                positions = tuple(range(len(ranged.values)))
                self._distributions[option] = CategoricalDistribution(positions)
            elif ranged.integer:
                self._distributions[option] = IntDistribution(
                    int(ranged.least), int(ranged.greatest), log=ranged.logarithmic
                )
            else:
                self._distributions[option] = FloatDistribution(
                    float(ranged.least), float(ranged.greatest), log=ranged.logarithmic
                )
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        with warnings.catch_warnings(action="ignore"):  # Optuna warns of experimental options
            sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True)
        self._study = optuna.create_study(sampler=sampler)
        self._study.enqueue_trial(default)

    def ask(self) -> Options:
        """Return the options of the next setting."""
        self._trial = self._study.ask(self._distributions)
        options = {}
        for option, ranged in self.searched.ranges.items():
            value = self._trial.params[option]
            if isinstance(ranged, Choices):
                value = ranged.values[value]
            options[option] = value
        return options

    def tell(self, judged: Judged) -> None:
        """Report the result of the last setting to the tuner."""
        self._study.tell(self._trial, loss(judged))


class Journal(dict[Setting, ByFamily]):
    """Results of settings, stored in a :class:`.JournalFile` as soon as they are known.

    Optuna's JournalStorage is not used: it has no checksums, and after an interruption its samplers
    do not continue as if there had been none. Raises as :class:`.JournalFile`.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.files: Files = {}  #: Hashes of files that custom laws loaded and read in evaluations.
        self._file = JournalFile(path, "evaluations", self._take)

    def _take(self, entry: Mapping[str, Any]) -> None:
        """Read the content of a line."""
        self.files.update(entry.get("files", {}))
        by_family = {}
        for family, values in entry["judged"].items():
            point = tuple(values["point"])
            by_family[family] = Judged(**{**values, "point": point})
        self[entry["law"], entry["options"]] = by_family

    def add(self, setting: Setting, judged: ByFamily) -> None:
        """Store the result of a setting. Raises StorageError if it cannot be written."""
        law, options = setting
        by_family = {family: values._asdict() for family, values in judged.items()}
        entry: dict[str, Any] = {"law": law, "options": options, "judged": by_family}
        if self.files:
            entry["files"] = self.files
        self._file.add(entry)
        self[setting] = judged


@dataclass(frozen=True)
class Evaluation:
    """Evaluated setting of one tuner seed, with its number and results.

    Number 0 is the default.
    """

    seed: int
    number: int
    options: Options
    by_family: ByFamily

    @property
    def judged(self) -> Judged:
        """Result on all runs."""
        return self.by_family[ALL]


@dataclass(frozen=True)
class Tuned:
    """Law with its evaluations, ordered by tuner seed and number; the first is the default."""

    law: Searched
    evaluations: Sequence[Evaluation]

    @property
    def default(self) -> Evaluation:
        """Evaluation of the law as the campaign defines it."""
        return self.evaluations[0]

    @property
    def chosen(self) -> Evaluation:
        """Best evaluation on all runs."""
        return self.best(ALL)

    def best(self, family: str) -> Evaluation:
        """Return the evaluation that :func:`.choose` selects for the runs of a family."""
        position = choose([each.by_family[family] for each in self.evaluations])
        return self.evaluations[position]

    def success(self, family: str, evaluations: int) -> list[float]:
        """Return, for each tuner seed, the highest success rate in a family within a budget.

        ``evaluations`` is the number of settings that count.
        """
        shares: dict[int, float] = {}
        for each in self.evaluations:
            if each.number < max(evaluations, 1):
                judged = each.by_family[family]
                share = judged.successes / judged.runs
                shares[each.seed] = max(shares.get(each.seed, 0.0), share)
        return list(shares.values())

    @classmethod
    def of(cls, law: Searched, evaluations: Iterable[Evaluation]) -> Tuned:
        """Return a law with its evaluations, given in any order."""

        def place(evaluation: Evaluation) -> tuple[int, int]:
            return evaluation.seed, evaluation.number

        return cls(law, sorted(evaluations, key=place))

    def toml(self, family: str) -> list[str]:
        """Return lines of the best setting in a family as a TOML table of controllers."""
        if not self.law.ranges:
            return [f"# {self.law.name}: no parameters to tune"]
        best = self.best(family)
        default = self.default.by_family[family]
        judged = best.by_family[family]
        setting = self.law.setting(best.options)
        name = toml_text(f"{self.law.name}-tuned")
        return [
            f"# {judged.success} of {judged.runs} training runs succeed, {default.success} by "
            "default",
            f"[controllers.{name}]",
            *toml_items(setting.table),
        ]


@dataclass(frozen=True)
class Tuning:
    """Tuned laws of a campaign, in its order."""

    problem: Problem
    laws: tuple[Tuned, ...]

    def write(self, folder: Path) -> None:
        """Write evaluations and settings, each file completely or not at all.

        Raises StorageError if a file cannot be written.
        """
        import pandas

        lines = []
        for law in self.laws:
            chosen = law.chosen
            for each in law.evaluations:
                lines.append({**self._line(law, each), "chosen": each is chosen})
        with storing("results", folder):
            with replaced(folder / EVALUATIONS) as part:
                pandas.DataFrame(lines).to_parquet(part, index=False)
            for family in (ALL, *self.families):
                name = f"tuned-{family}.toml" if family else TUNED
                with replaced(folder / name) as part:
                    part.write_text(self.toml(family), encoding="utf-8")

    def _line(self, law: Tuned, evaluation: Evaluation) -> dict[str, Any]:
        """Return the cells of an evaluation by column."""
        line: dict[str, Any] = {
            "law": law.law.name,
            "seed": evaluation.seed,
            "number": evaluation.number,
            "options": json.dumps(evaluation.options, sort_keys=True),
        }
        judged = evaluation.judged._asdict()
        for objective, value in zip(OBJECTIVES, judged.pop("point"), strict=True):
            line[objective.column] = value
        line |= judged
        for family in self.families:
            line[f"successes[{family}]"] = evaluation.by_family[family].successes
        return line

    @property
    def families(self) -> list[str]:
        """Names of the campaign's families."""
        return [family.name for family in self.problem.campaign.families]

    def toml(self, family: str = ALL) -> str:
        """Return the best settings in a family as TOML tables of controllers.

        A campaign can use them.
        """
        campaign = self.problem.campaign.name
        scenes = family or ", ".join(self.families)
        lines = [f"# Laws of the campaign {campaign}, tuned on training scenes of {scenes}."]
        for law in self.laws:
            lines += ["", *law.toml(family)]
        return "\n".join(lines) + "\n"


def tune(
    problem: Problem,
    folder: Path,
    *,
    workers: int | None = None,
    command: Sequence[str] = (),
    on_progress: Progress = lambda what, done, total: None,
) -> Tuning:
    """Tune the laws of a campaign, and store all evaluations in ``folder``, created if needed.

    Laws and tuner seeds are processed side by side, one evaluation of each at a time. Suggestions
    therefore depend neither on the number of processes, at most ``workers``, nor on interruptions
    of earlier calls. Stored settings are not run again. Raises ConfigurationError if a package is
    missing, no training scene is found, or the folder holds another tuning. Raises StorageError if
    evaluations cannot be written; those stored before remain.
    """
    demand("tune")
    load_metrics()  # a metric that cannot be used ends the command before any run
    with locked(folder, "a tuning"):
        prepare_laws(problem.campaign.controllers)
        claim(folder, plain(problem.configuration()), _facts(problem), command)
        batches = problem.tasks(workers, partial(on_progress, "drawing training scenes"))
        journal = Journal(folder / JOURNAL)
        changed_files = content_changes(journal.files, problem.campaign)
        if changed_files:
            raise _other_tuning(folder, changed_files)
        evaluations: dict[str, list[Evaluation]] = {law.name: [] for law in problem.laws}
        with evaluating(batches, workers, journal.files) as evaluate:
            for law, evaluation in _evaluations(problem, journal, evaluate, on_progress):
                evaluations[law.name].append(evaluation)
        laws = tuple(Tuned.of(law, evaluations[law.name]) for law in problem.laws)
        tuning = Tuning(problem, laws)
        tuning.write(folder)
        return tuning


def _evaluations(
    problem: Problem, journal: Journal, evaluate: Evaluate, on_progress: Progress
) -> Iterator[tuple[Searched, Evaluation]]:
    """Yield all evaluations. A law without searched options has one, its default."""
    budget = problem.budget
    searches = []
    for law in problem.laws:
        seeds = budget.seeds if law.ranges else 1
        searches += [Search(law, seed) for seed in range(seeds)]
    for number in range(budget.evaluations):
        on_progress("evaluating", number, budget.evaluations)
        asked: list[tuple[Search, Options, Setting]] = []
        new: dict[Setting, ControllerSpec] = {}
        for search in searches:
            law = search.searched
            if number > 0 and not law.ranges:
                continue
            options = search.ask()
            key = (law.name, json.dumps(options, sort_keys=True))
            asked.append((search, options, key))
            if key not in journal:
                new[key] = law.setting(options)
        results = evaluate(list(new.values()))
        for key, judged in zip(new, results, strict=True):
            journal.add(key, judged)
        for search, options, key in asked:
            search.tell(journal[key][ALL])
            yield search.searched, Evaluation(search.seed, number, options, journal[key])
    on_progress("evaluating", budget.evaluations, budget.evaluations)


def claim(
    folder: Path, here: Identity, facts: Mapping[str, Any], command: Sequence[str] = ()
) -> None:
    """Write the manifest of a tuning that depends on ``here``, with further ``facts``.

    Raises ConfigurationError if the folder holds another tuning, StorageError if the manifest
    cannot be written.
    """
    path = folder / MANIFEST
    stored = manifest_of(folder).get("tuning") if path.exists() else here
    if stored is None:
        raise ConfigurationError(f"{path} cannot be read: it is not the manifest of a tuning")
    if stored != here:
        raise _other_tuning(folder, list(differences(stored, here)))
    manifest = {**new_manifest(command), "tuning": here, **facts, "loaded": loaded_versions()}
    with storing("evaluations", folder):
        write_json(path, manifest)


def _other_tuning(folder: Path, differing: Sequence[str]) -> ConfigurationError:
    return ConfigurationError(
        f"{folder} holds another tuning: {in_words(differing)}. Give another folder with --out"
    )


def _facts(problem: Problem) -> dict[str, Any]:
    """Return entries of the manifest on which no evaluation depends."""
    return {
        "evaluations": problem.budget.evaluations,
        "tuner_seeds": problem.budget.seeds,
        "campaign": plain(problem.campaign.resolved()),
    }
