"""Cost of following the advice in unknown scenes: ``python -m checks.advice [STUDY]``.

Each family is left out in turn, and advice is derived from the others for each of its scenes and
conditions. Regret is the loss of success, in points, relative to the law that succeeds most often
in that family and condition, which nobody knows beforehand. For comparison there are the regret of
advice by other rules, of always the same law (the one that succeeds most often in the other
families), and of a random law. Two more numbers state how often advice names a law without a model,
and how often it calls a scene unlike anything in the study. The exit code is 1 if advice may lose
more than half a point (:data:`ALLOWED`) relative to always the same law, with 95 % confidence:
naming laws that require less costs success.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from vsconstraints.bench.advice import MARGIN, Advice, advise
from vsconstraints.bench.statistics import mcnemar
from vsconstraints.bench.study import SHIPPED, Situation, Study

ADVICE = "advice"
ALWAYS = "always the same law"
RULES = {ADVICE: MARGIN, "most success": 0.0, "least required of all ties": 1e9}
BY = ["family", "condition"]
ALLOWED = 0.005  #: Loss of success that is accepted for advice, relative to always the same law.


def followed(study: Study, family: str) -> list[dict[str, Any]]:
    """Success of the chosen laws, and of all laws, in each scene and condition of a family."""
    own = study.runs[study.runs["family"] == family]
    rest = study.runs[study.runs["family"] != family]
    others = replace(study, runs=rest)
    always = rest.groupby("controller")["success"].mean().idxmax()
    success = own.astype({"success": float}).pivot(
        index=["scene", "condition"], columns="controller", values="success"
    )
    known: dict[Situation, dict[str, Advice]] = {}
    lines = []
    for scene in study.scenes[study.scenes["family"] == family].to_dict("records"):
        situation = Situation(**{name: scene[name] for name in vars(Situation())})
        laws = success.loc[scene["scene"], scene["condition"]]
        if situation not in known:
            known[situation] = {
                rule: advise(others, situation, margin=margin) for rule, margin in RULES.items()
            }
        advices = known[situation]
        taken = {rule: laws[advice.laws[0].law.name] for rule, advice in advices.items()}
        first = advices[ADVICE].laws[0]
        told = {
            "unlike": float(bool(advices[ADVICE].unlike)),
            "no model": float("model" not in first.requires),
        }
        told |= {ALWAYS: laws[always], "any law": laws.mean()}
        lines.append({**{name: scene[name] for name in BY}, **told, **taken, **laws})
    return lines


def main(arguments: Sequence[str]) -> int:
    """Print shares in per cent and regrets in points."""
    study = Study.load(Path(arguments[0]) if arguments else SHIPPED)
    with ProcessPoolExecutor() as processes:
        families = processes.map(partial(followed, study), study.runs["family"].unique())
    lines = pd.DataFrame(itertools.chain(*families))
    groups = lines.groupby(BY, sort=False)
    best = groups[[*study.laws]].mean().max(axis=1)
    shares = groups[["unlike", "no model"]].mean()
    table = pd.DataFrame({"scenes": groups.size(), **shares, "best law": best})
    for name in (*RULES, ALWAYS, "any law"):
        table[name] = best - groups[name].mean()
    print(table.to_string(float_format=lambda share: f"{100.0 * share:.1f}"))
    mean = table.drop(columns="scenes").mul(table["scenes"] / len(lines), axis=0).sum()
    print("\nall: " + "; ".join(f"{name} {100.0 * share:.1f}" for name, share in mean.items()))
    lines["regret"] = best.reindex(pd.MultiIndex.from_frame(lines[BY])).to_numpy() - lines[ADVICE]
    for flag, regret in lines.groupby("unlike")["regret"]:
        print(
            f"regret where {'unlike' if flag else 'like'} the study: {100.0 * regret.mean():.1f} "
            f"({len(regret)})"
        )
    pair = mcnemar(lines[ADVICE], lines[ALWAYS])
    low = 100.0 * pair.low
    high = 100.0 * pair.high
    print(f"advice less {ALWAYS}: {100.0 * pair.difference:.1f} ({low:.1f} to {high:.1f}) points")
    return int(pair.low < -ALLOWED)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
