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
from .ranking import condition_text, ranked

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
        if any(stored.get(key) != known[key] for key in ("seed", "sha256")):
            raise ConfigurationError(
                f"{where}: {file} of test set {testset.version} is not the file that was run"
            )
    _require_scenes(study, testset, where)
    runs = study.runs.fillna({"violation_fraction": 0.0})  # NaN in a run that failed at once
    wrong = runs["success"] != (runs["status"] == "converged") & (runs["violated"] == "")
    wrong |= runs["tolerant_success"] != (runs["status"] == "converged") & (
        runs["violation_fraction"] <= TOLERANT
    )
    wrong |= (runs["violated"] == "") != (runs["violation_fraction"] <= NEGLIGIBLE)
    if wrong.any():
        first = runs[wrong].iloc[0]
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
        scenes = set(range(len(testset.hashes[FILE.format(family.name, HALF)])))
        runs = study.runs[study.runs["family"] == family.name]
        for condition in family.conditions:
            run_scenes = set(runs.loc[runs[CONDITION] == condition, "scene"])
            which = f"{HALF} scenes of {family.name}, {condition}"
            if unknown := sorted(run_scenes - scenes):
                raise ConfigurationError(
                    f"{where}: {len(unknown)} {which}, do not exist, such as scene {unknown[0]}; "
                    f"they are numbered from 0 to {len(scenes) - 1}"
                )
            if condition in CONDITIONS and (missing := sorted(scenes - run_scenes)):
                raise ConfigurationError(
                    f"{where}: {len(missing)} {which}, are missing, such as scene {missing[0]}"
                )


def leaderboard(studies: Mapping[str, Study], testset: TestSet) -> str:
    """Return the leaderboard as a table in Markdown; ``studies`` are keyed by their authors.

    Laws are ordered by their success in all scenes of all conditions, by the strict standard; a
    further column has the success with disturbances by the tolerant standard. Two laws of one name
    are distinguished by their authors. Tables without values of some results are marked by †, and
    named below the leaderboard. Raises ConfigurationError as :func:`require_whole`.
    """
    parts = []
    of = dict[str, tuple[str, Study, str]]()
    for who, study in studies.items():
        require_whole(study, testset, who)
        names = {law: law if law not in of else f"{law} ({who})" for law in study.laws}
        of |= {name: (law, study, who) for law, name in names.items()}
        parts.append(study.runs.assign(controller=study.runs["controller"].map(names)))
    runs = pd.concat(parts)
    runs = runs[runs[CONDITION].isin(CONDITIONS)]
    by_condition = []
    for condition in CONDITIONS:
        chosen = runs[runs[CONDITION] == condition]
        if len(chosen):
            flags = chosen.pivot(index=SCENE, columns="controller", values="success")
            by_condition.append(ranked(flags, condition))
    disturbed = runs[runs[CONDITION] == DISTURBED]
    tolerated = ranked(
        disturbed.pivot(index=SCENE, columns="controller", values="tolerant_success"), DISTURBED
    )
    families = disturbed.groupby(["controller", "family"])["success"].mean().unstack()
    order = (
        runs.groupby("controller")["success"]
        .mean()
        .sort_values(ascending=False, kind="stable")
        .index
    )
    text = render(
        Path(__file__).with_name("leaderboard.md"),
        rankings=by_condition,
        tolerated=tolerated,
        families=families,
        laws={law: of[law] for law in order},
        condition_text=condition_text,
        information_text=information_text,
        tolerant=TOLERANT,
        missing={who: each for who, study in studies.items() if (each := study.missing_results)},
    )
    return text.rstrip("\n")
