"""Evidence that was never run: plausible runs of laws whose true rates are known."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import norm

from scenes import of_depth
from vsconstraints.bench.evidence import Evidence
from vsconstraints.comparisons.metrics import RUN, constraint_columns, result_columns

LABELS = ("fov[marker 2]", "range[joint 6].upper", "speed[joint 2].lower")

Rates = Mapping[str, Mapping[str, float]]
"""By condition and law, the share of scenes in which it succeeds."""


def drawn_runs(
    rates: Rates, families: Sequence[str], scenes: int, seed: int = 0, alike: float = 0.5
) -> pd.DataFrame:
    """One line per run; laws succeed with their rates, more or less in the same scenes.

    Parameters
    ----------
    rates
        Of the laws, without tracking, which is added and violates a row in every scene.
    families, scenes
        Of each of which so many scenes.
    seed
        Of all that is drawn.
    alike
        How far what makes scenes hard is the same for all laws, from 0 to 1.
    """
    rng = np.random.default_rng(seed)
    lines: list[dict[str, Any]] = []
    for family in families:
        hard = rng.standard_normal(scenes)
        for condition, laws in rates.items():
            for law, rate in {"tracking": 0.0, **laws}.items():
                own = rng.standard_normal(scenes)
                trouble = np.sqrt(alike) * hard + np.sqrt(1.0 - alike) * own
                for scene, bad in enumerate(trouble > norm.ppf(rate)):
                    left = law == "tracking" or (bad and rng.random() < 0.7)
                    lines.append(
                        run(
                            condition,
                            law,
                            scene,
                            family=family,
                            status="converged"
                            if not bad or law == "tracking"
                            else _ending(rng, left),
                            violated=LABELS[int(rng.integers(len(LABELS)))] if left else "",
                            violation_depth=float(rng.lognormal(-4.0)) if left else 0.0,
                            acceleration_variation=float(rng.lognormal(2.0 + 0.2 * len(law) / 10)),
                            settling_time_s=float(rng.uniform(1.0, 2.0)) if not bad else np.nan,
                            step_time_median_us=float(rng.uniform(3.0, 4.0) * len(law)),
                        )
                    )
    return frame(lines)


def _ending(rng: np.random.Generator, left: bool) -> str:
    """How a run that does not succeed ends: most that leave a row converge all the same."""
    return (
        "converged"
        if left and rng.random() < 0.5
        else str(rng.choice(["trapped", "unfinished", "aborted"]))
    )


def run(
    condition: str = "nominal", controller: str = "a", scene: int = 0, **columns: Any
) -> dict[str, Any]:
    """A line of a run that converged and violated nothing, but for what is said otherwise."""
    numbers = {name: 1.0 for name in result_columns() if name not in RUN}
    text = {
        "status": "converged",
        "reason": "",
        "violated": "",
        "within_band": "",
        "compiled": True,
    }
    key = {
        "family": "planar-arm",
        "condition": condition,
        "half": "held-out",
        "scene": scene,
        "controller": controller,
    }
    line = {**key, **numbers, **text, "violation_depth": 0.0, **columns}
    return {**line, **of_depth(line["violation_depth"], line["violated"]), **columns}


def frame(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Runs as evidence gives them."""
    runs = pd.DataFrame(lines)
    for name in ("family", "condition", "half", "controller", "status"):
        runs[name] = runs[name].astype("category")
    return runs


def rows_of(runs: pd.DataFrame) -> pd.DataFrame:
    """One line for the row that each run violated, and for the one that every scene challenges."""
    key = ["family", "condition", "half", "scene", "controller"]
    columns = [name for name in constraint_columns() if name not in RUN]
    rows = runs[key].copy()
    for name in columns:
        rows[name] = 0.0
    rows["constraint"] = runs["violated"].where(runs["violated"] != "", LABELS[0])
    rows["kind"] = rows["constraint"].str.partition("[")[0]
    rows["unit"] = rows["kind"].map({"fov": "px", "range": "rad", "speed": "rad/s"})
    rows["challenged"] = True
    rows["violation_depth"] = runs["violation_depth"] * 100.0
    return rows


def scenes_of(runs: pd.DataFrame, rejected: int = 3) -> pd.DataFrame:
    """One line per scene, each found after so many attempts that were rejected."""
    keys = runs[["family", "half", "scene"]].drop_duplicates().reset_index(drop=True)
    share = np.where(np.arange(len(keys)) % 10 == 0, 1.2, 0.4)
    return keys.assign(
        found=True,
        attempts=rejected + 1,
        rejected=json.dumps({"marker not visible at the start": rejected}),
        challenged="; ".join(LABELS[:2]),
        share_to_hold=share,
        values=json.dumps({"Kp0": 2.0}),
        least_time_s=np.where(np.arange(len(keys)) % 5 == 0, np.nan, share * 2.5),
        duration_s=2.5,
    )


def made(runs: pd.DataFrame, folder: Path, rejected: int = 3, **configuration: Any) -> Evidence:
    """Evidence of these runs as if it had been read from a folder; laws are of the type that their
    name says.
    """
    laws = list(dict.fromkeys(runs["controller"]))
    conditions = list(dict.fromkeys(runs["condition"]))
    manifest = {
        "version": "0",
        "git_commit": "0123456789ab",
        "command": ["vsconstraints", "evidence"],
        "started": "2026-01-01T00:00:00+00:00",
        "machine": {
            "processor": "a processor",
            "cores": 2,
            "system": "Linux",
            "python": "CPython 3.11",
        },
        "packages": {"numpy": "2"},
        "wall_time_s": 12.0,
        "configuration": {
            "title": "Made up",
            "question": "Which law keeps its rows?",
            "families": {
                name: {"folder": "", "conditions": conditions, "tables": {}}
                for name in dict.fromkeys(runs["family"])
            },
            "conditions": conditions,
            "scenes": int(runs["scene"].max()) + 1,
            "half": "held-out",
            "seed": 0,
            "controllers": {
                name: {"type": name.removesuffix("-tuned").removesuffix("-again")} for name in laws
            },
            **configuration,
        },
    }
    evidence = Evidence(folder, manifest)
    # in place of what would be read from Parquet
    vars(evidence).update(runs=runs, rows=rows_of(runs), scenes=scenes_of(runs, rejected))
    return evidence
