"""Leaderboard: laws of several tables on all held-out scenes of the test set, ranked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from ...comparisons.metrics import NEGLIGIBLE, TOLERANT
from ...errors import ConfigurationError
from ...reports.groups import information_text
from ...reports.page import render
from ..families.frozen import FILE, TestSet
from ..study import CONDITION, SCENE, Study
from .ranking import Ranking, condition_text, ranked

HALF = "held-out"
DISTURBED = "disturbed"
CONDITIONS = ("nominal", DISTURBED, "limited")  #: Conditions that all tables must have run.


def require_whole(study: Study, testset: TestSet, where: str) -> None:
    """Raise ConfigurationError unless a table is complete and consistent.

    The message names the missing runs or the contradiction.
    """
    for family in testset.families:
        file = FILE.format(family.name, HALF)
        known = family.tables["frozen"][HALF]
        stored = study.frozen.get(family.name, {})
        has_same_seed = stored.get("seed") == known["seed"]
        if not has_same_seed or stored.get("sha256") != known["sha256"]:
            raise ConfigurationError(
                f"{where}: {file} of test set {testset.version} is not the file that was run"
            )
    _require_scenes(study, testset, where)
    runs = study.runs.fillna({"violation_fraction": 0.0})  # NaN in a run that failed at once
    converged = runs["status"] == "converged"
    keeps_rows = runs["violated"] == ""
    keeps_rows_nearly = runs["violation_fraction"] <= TOLERANT
    is_wrong = runs["success"] != converged & keeps_rows
    is_wrong |= runs["tolerant_success"] != converged & keeps_rows_nearly
    is_wrong |= keeps_rows != (runs["violation_fraction"] <= NEGLIGIBLE)
    if is_wrong.any():
        first = runs[is_wrong].iloc[0]
        run = f"{first['family']} {first['scene']}, {first[CONDITION]}, {first['controller']}"
        raise ConfigurationError(
            f"{where}: success, status and violations of {run} contradict each other"
        )


def _require_scenes(study: Study, testset: TestSet, where: str) -> None:
    """Raise ConfigurationError unless a table has all held-out scenes and no unknown ones."""
    families = {family.name: family for family in testset.families}
    groups = study.runs[["family", "half", CONDITION]].drop_duplicates()
    for family_name, half, condition in groups.itertuples(index=False):
        family = families.get(family_name)
        if family is None or half != HALF or condition not in family.conditions:
            which = f"{half} scenes of {family_name}, {condition}"
            raise ConfigurationError(f"{where}: test set {testset.version} has no {which}")
    for family in testset.families:
        hashes = testset.hashes[FILE.format(family.name, HALF)]
        scenes = set(range(len(hashes)))
        runs = study.runs[study.runs["family"] == family.name]
        for condition in family.conditions:
            run_scenes = set(runs.loc[runs[CONDITION] == condition, "scene"])
            which = f"{HALF} scenes of {family.name}, {condition}"
            unknown = run_scenes - scenes
            if unknown:
                raise ConfigurationError(
                    f"{where}: {len(unknown)} {which}, do not exist, such as scene {min(unknown)}; "
                    f"they are numbered from 0 to {len(scenes) - 1}"
                )
            missing = scenes - run_scenes
            if missing and condition in CONDITIONS:
                raise ConfigurationError(
                    f"{where}: {len(missing)} {which}, are missing, such as scene {min(missing)}"
                )


def leaderboard(studies: Mapping[str, Study], testset: TestSet) -> str:
    """Return the leaderboard as a table in Markdown; ``studies`` are keyed by their authors.

    Laws are ordered by their success in all scenes of all conditions, by the strict standard; a
    further column has the success with disturbances by the tolerant standard. Two laws of one name
    are distinguished by their authors. Tables without values of some results are marked by †, and
    named below the leaderboard. Raises ConfigurationError as :func:`require_whole`.
    """
    tables = []
    #: Law, study and author by the name on the leaderboard.
    sources = dict[str, tuple[str, Study, str]]()
    missing_results = {}
    for author, study in studies.items():
        require_whole(study, testset, author)
        names = {}
        for law in study.laws:
            names[law] = f"{law} ({author})" if law in sources else law
        for law, name in names.items():
            sources[name] = law, study, author
        controllers = study.runs["controller"].map(names)
        tables.append(study.runs.assign(controller=controllers))
        if study.missing_results:
            missing_results[author] = study.missing_results
    runs = pd.concat(tables)
    runs = runs[runs[CONDITION].isin(CONDITIONS)]
    rankings = [_ranked(runs, condition, "success") for condition in CONDITIONS]
    disturbed = runs[runs[CONDITION] == DISTURBED]
    by_family = disturbed.groupby(["controller", "family"])["success"].mean()
    success = runs.groupby("controller")["success"].mean()
    order = success.sort_values(ascending=False, kind="stable").index
    text = render(
        Path(__file__).with_name("leaderboard.md"),
        rankings=[ranking for ranking in rankings if ranking.scenes],
        tolerated=_ranked(runs, DISTURBED, "tolerant_success"),
        families=by_family.unstack(),
        laws={law: sources[law] for law in order},
        condition_text=condition_text,
        information_text=information_text,
        tolerant=TOLERANT,
        missing=missing_results,
    )
    return text.rstrip("\n")


def _ranked(runs: pd.DataFrame, condition: str, column: str) -> Ranking:
    """Rank the laws in a condition by a column of flags."""
    chosen = runs[runs[CONDITION] == condition]
    flags = chosen.pivot(index=SCENE, columns="controller", values=column)
    return ranked(flags, condition)
