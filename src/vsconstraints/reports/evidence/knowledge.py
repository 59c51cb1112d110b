"""What each law knows, and what it costs."""

from __future__ import annotations

from ..markdown import plain, table
from ..numbers import DASH, median, number
from .material import Material
from .opening import told_uses


def knowledge(material: Material) -> str:
    """One line per law."""
    entries = material.configuration["controllers"]
    lines = []
    for law in material.laws:
        entry = entries.get(law, {})
        options = ", ".join(f"{key} = {_value(value)}" for key, value in entry.items() if key != "type")
        kind = str(entry.get("type", law))
        own = material.runs[material.runs["controller"] == law]
        each = [float(value) for value in own["step_time_median_us"]]
        what = DASH if kind == law else plain(kind)
        cells = [what, plain(options) or "defaults", told_uses(material, law), form(own["compiled"])]
        lines.append([law, *cells, number(median(each))])
    text = (
        f"*Type* is the law's own name, {DASH} where it is called by that. "
        "*Uses* is what a law needs beside φ, L_gφ, u⁺ and the scale of rows, and J and b of the task. *Form*: whether "
        "rows, task and law ran compiled or in NumPy. *Call*: median over runs of the median time of the law."
    )
    header = ["law", "type", "options", "uses", "form", "call [µs]"]
    return "\n\n".join(("## What each law knows and costs", table(header, lines, 5), text))


def form(compiled: object) -> str:
    """In which form runs ran."""
    flags = [bool(flag) for flag in compiled]  # type: ignore[attr-defined]
    if not flags:
        return DASH
    share = sum(flags) / len(flags)
    return "compiled" if share == 1.0 else "NumPy" if share == 0.0 else f"compiled in {100.0 * share:.0f} %, else NumPy"


def _value(value: object) -> str:
    return number(value) if isinstance(value, float) else str(value)
