"""What a tuning leaves behind: tables, settings for a campaign, and a short report."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...reports.page import write_pages
from ..runs.files import replaced, storing
from .objectives import OBJECTIVES
from .report import report
from .result import Tuned, Tuning

EVALUATIONS, HYPERVOLUMES = "evaluations.parquet", "hypervolumes.parquet"
TUNED, REPORT = "tuned.toml", "report.md"


def write(tuning: Tuning, folder: Path) -> None:
    """Write all files, each whole or not at all; raises StorageError."""
    import pandas

    tables = {EVALUATIONS: evaluation_lines(tuning), HYPERVOLUMES: hypervolume_lines(tuning)}
    with storing("results", folder):
        for name, lines in tables.items():
            with replaced(folder / name) as part:
                pandas.DataFrame(lines).to_parquet(part, index=False)
        with replaced(folder / TUNED) as part:
            part.write_text(tuned_toml(tuning), encoding="utf-8")
        write_pages(folder / REPORT, report(tuning))


def evaluation_lines(tuning: Tuning) -> list[dict[str, Any]]:
    """One line for each evaluation of each law and tuner seed."""
    return [
        {
            "law": law.law.law.name,
            "seed": one.asked.seed,
            "number": one.asked.number,
            "options": json.dumps(one.asked.options, sort_keys=True),
            **dict(zip([objective.column for objective in OBJECTIVES], one.judged.point, strict=True)),
            "violations": one.judged.violations,
            "runs": one.judged.runs,
            "converged": one.judged.converged,
            "feasible": one.feasible,
            "on_front": one.on_front,
            "chosen": one is law.chosen,
        }
        for law in tuning.laws
        for one in law.evaluations
    ]


def hypervolume_lines(tuning: Tuning) -> list[dict[str, Any]]:
    """One line for each law and tuner seed."""
    return [
        {"law": law.law.law.name, "seed": seed, "hypervolume": volume}
        for law in tuning.laws
        for seed, volume in enumerate(law.hypervolumes)
    ]


def tuned_toml(tuning: Tuning) -> str:
    """Chosen settings as tables of controllers, which a campaign can take over."""
    campaign = tuning.problem.campaign
    lines = [f"# Laws of the campaign {campaign.name}, tuned on training scenes of {_families(tuning)}."]
    for law in tuning.laws:
        lines += ["", *_table(law)]
    return "\n".join(lines) + "\n"


def _families(tuning: Tuning) -> str:
    return ", ".join(family.name for family in tuning.problem.campaign.families)


def _table(law: Tuned) -> list[str]:
    name = law.law.law.name
    if law.chosen is None:
        return [f"# {name}: nothing is searched"]
    share = f"{100.0 * law.chosen.judged.violations:.3g} % of its runs violate a row"
    remark = [] if law.chosen.feasible else [f"# {name}: no setting is feasible; {share}"]
    setting = law.law.setting(law.chosen.asked.options)
    options = {"type": setting.law, **setting.options}
    return [
        *remark,
        f"[controllers.{_text(f'{name}-tuned')}]",
        *(f"{_key(key)} = {_value(options[key])}" for key in options),
    ]


def _value(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return _text(value) if isinstance(value, str) else json.dumps(value)


def _key(key: str) -> str:
    return key if key.isidentifier() and key.isascii() else _text(key)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
