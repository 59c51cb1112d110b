"""``advise``: which law for a scene, how sure that is, and what another choice loses."""

from __future__ import annotations

import json
from dataclasses import asdict
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ConfigurationError, unknown_name
from ..plugins.extras import demand
from .options import Names
from .terminal import console, progress, say

if TYPE_CHECKING:
    from ..comparisons.advice import Advice

ROWS = "rows"  # what every law uses


def advise(
    scenario: str | None = None,
    joints: int | None = None,
    latency_ms: float | None = None,
    noise_px: float | None = None,
    rows: Names = None,
    unknown_motion: bool | None = None,
    may_use: Names = None,
    study: Path | None = None,
    keep: Path | None = None,
    as_json: bool = False,
    trust: bool = False,
) -> None:
    """Say which law to take for a scene, with settings, how sure that is, and what another choice loses."""
    demand("evidence", "advice")
    from ..comparisons.advice import advise as advice_for
    from ..comparisons.statistics import rate_text, with_interval
    from ..comparisons.study import SHIPPED, Situation, Study
    from ..scenarios import CONSTRAINTS, Scenario
    from ..scenarios.toml import toml_items, toml_text

    for kind in {*(rows or ())} - {*CONSTRAINTS}:
        raise unknown_name("type of constraints", kind, CONSTRAINTS)
    delay = None if latency_ms is None else latency_ms / 1e3
    types = tuple(sorted({*rows})) if rows else None
    asked = Situation(joints, constraints=types, delay=delay, noise=noise_px, unknown_motion=unknown_motion)
    if scenario is not None:
        if asked.said:
            raise ConfigurationError(f"{scenario} itself says {', '.join(asked.said)}: give a scenario or answers")
        asked = Situation.of(Scenario.load(scenario))
    elif not asked.said and keep is None:
        raise ConfigurationError("advise takes a scenario, or answers such as --joints 6 --latency-ms 30")
    with progress() as show:
        runs = Study.load(study or SHIPPED, trust, lambda done, scenes: show("scenes", done, scenes))
    known = {ROWS}.union(*(law.make().uses for law in runs.laws.values()))
    for word in {*(may_use or ())} - known:
        raise unknown_name("information", word, known)
    if keep is not None:
        runs.keep(keep)
        console.print(f"{len(runs.runs)} runs: {keep}")
    if asked.said:
        found = advice_for(runs, asked, may_use or None)
        if as_json:
            console.print(_json(found))
        else:
            texts = {"rate_text": rate_text, "with_interval": with_interval, "toml_items": toml_items}
            say("advice", advice=found, best=found.laws[0], toml_text=toml_text, **texts)


def _json(advice: Advice) -> str:
    """All of it."""
    laws = [
        {**law._asdict(), "law": law.law.name, "settings": law.law.table}
        | {"success": {"share": law.success.share, **asdict(law.success)}}
        | {"tolerant": asdict(law.tolerant), "loss": law.loss._asdict()}
        | {"call_us": None if isnan(law.call_us) else law.call_us}
        for law in advice.laws
    ]
    return json.dumps({**advice._asdict(), "laws": laws}, ensure_ascii=False, indent=1)
