"""What the paper does not print, and the values that the shipped scenarios use instead."""

from __future__ import annotations

from typing import Any

from ..errors import VsconstraintsError
from ..reports.markdown import code, plain, table
from ..scenarios import Scenario

NOT_PRINTED = {
    "example-2d-fov": ("camera", "q0", "target", "task.goals", "duration"),
    "case-study-6r": ("camera", "q0", "target", "task.goals", "duration"),
    "experiment-1-pbvs": ("q0", "target", "task.goals", "duration"),
    "experiment-2-ibvs": ("q0", "target", "task.goals", "duration"),
}
"""Keys of the scenarios whose values were searched for; the other scenarios of the first example share its values."""

INTRODUCTION = """\
## What the paper does not print

Camera, image size, positions of the markers and starts of the simulations are not printed, nor are the poses of
the experiments. The values below were found by search: with them every event that the paper does print happens.
So they show that the law does what the paper says of it in *a* scene like the paper's; they are not the paper's
own scenes. What else is in these scenarios is printed in sections 8.1, 9.1 and 10.1, but for the ranges and speeds
of the experiments' joints, which are the manufacturer's, and K and u⁺ of their rows, which are those of the
visibility constraints. Pixels are measured from the image's centre, lengths in m, angles in rad."""


def reconstructed() -> str:
    """The section of the report, from the scenarios themselves."""
    lines = []
    for name, keys in NOT_PRINTED.items():
        try:
            tables = Scenario.load(name).tables
        except VsconstraintsError as error:
            lines.append([name, "", plain(str(error).split(". ")[0])])
            continue
        lines += [[name, key, code(_shown(_at(tables, key)))] for key in keys if _at(tables, key) is not None]
    return f"{INTRODUCTION}\n\n{table(['scenario', 'key', 'value'], lines, text_columns=3)}"


def _at(tables: dict[str, Any], key: str) -> Any:
    at: Any = tables
    for name in key.split("."):
        at = at.get(name) if isinstance(at, dict) else None
    return at


def _shown(value: Any) -> str:
    """A value as it would stand in a TOML file, on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_shown(part)}" for key, part in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_shown, value)) + "]"
    return f"{value:.6g}" if isinstance(value, float) else f'"{value}"' if isinstance(value, str) else str(value)
