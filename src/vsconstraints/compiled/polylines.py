"""Compiled search for distances to polylines; see :mod:`vsconstraints.formulas.polylines`."""

from __future__ import annotations

from ..formulas import polylines
from .compiler import IN_PLACE, compiled

CHORDS = "float64[:, ::1]"
NUMBERS = "int64[::1]"

search = compiled(
    f"void({CHORDS}, Tuple(({CHORDS}, {CHORDS}, {CHORDS}, {CHORDS}, {NUMBERS}, {NUMBERS}, "
    f"float64[::1])), int64, "
    f"{NUMBERS}, float64[::1])",
    IN_PLACE,
)(polylines.search)
