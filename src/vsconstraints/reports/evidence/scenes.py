"""What scenes there were: how many were drawn, what was rejected and why, and which nobody could have held."""

from __future__ import annotations

import json
from collections import Counter
from typing import TYPE_CHECKING

from ...rows.readable import counted
from ..markdown import bullets, enumeration, plain, table
from ..numbers import DASH
from .material import Material
from .rates import share_of
from .words import percentage

if TYPE_CHECKING:
    import pandas as pd

MOST_REASONS = 3


def scenes(material: Material) -> str:
    """One line per family."""
    every = material.evidence.scenes
    lines, facts = [], []
    for family in dict.fromkeys(every["family"].astype(str)):
        own = every[every["family"] == family]
        rejected: Counter[str] = Counter()
        for text in own["rejected"]:
            rejected.update(json.loads(text or "{}"))
        attempts = int(own["attempts"].sum())
        known = own["share_to_hold"].astype(float).dropna()
        hopeless = share_of((known > 1.0).to_numpy()).cell if len(known) else DASH
        lines.append([family, str(int(own["found"].sum())), str(attempts), _reasons(rejected, attempts), hopeless])
        missing = int((~own["found"].astype(bool)).sum())
        if missing:
            facts.append(f"{plain(family)}: {counted(missing, 'scene')} was not found, every attempt was rejected.")
    header = ["family", "scenes", "attempts", "rejected, in % of the attempts", "beyond limits [%]"]
    text = (
        "A scene is drawn until an attempt is physically possible and tracking alone leaves a row. *Beyond limits*: "
        "scenes in which no law could hold a row from where tracking alone first comes to its boundary, since that "
        f"takes more than all that the actuators' limits allow; a law that brakes before can. {DASH} without limits."
    )
    parts = ["## Scenes", table(header, lines), text, bullets(facts), _challenged(material), _in_time(every)]
    return "\n\n".join(part for part in parts if part)


def _in_time(every: pd.DataFrame) -> str:
    """In how many scenes no law can arrive in time."""
    known = every[every["least_time_s"].notna()]
    if known.empty:
        return ""
    late = int((known["least_time_s"] > known["duration_s"]).sum())
    return (
        f"No law can arrive in time in {late} of {counted(len(known), 'scene')} with a known least time: from rest at "
        "the start to rest at the goal's joint coordinates, each joint as fast as its limits of acceleration and speed "
        "allow."
    )


def _reasons(rejected: Counter[str], attempts: int) -> str:
    if not rejected:
        return "none"
    told = [f"{plain(reason)} {percentage(n / attempts, 0)}" for reason, n in rejected.most_common(MOST_REASONS)]
    others = sum(rejected.values()) - sum(n for _, n in rejected.most_common(MOST_REASONS))
    return ", ".join([*told, *([f"others {percentage(others / attempts, 0)}"] if others else [])])


def _challenged(material: Material) -> str:
    """Which kinds of rows tracking alone leaves."""
    every = material.evidence.scenes
    found = every[every["found"].astype(bool)]
    kinds: Counter[str] = Counter()
    for text in found["challenged"].astype(str):
        kinds.update({label.partition("[")[0] for label in text.split("; ") if label})
    if not kinds:
        return ""
    told = [f"{plain(kind)} in {percentage(n / len(found), 0)} %" for kind, n in kinds.most_common()]
    return f"Rows that tracking alone leaves: {enumeration(told)} of the scenes."
