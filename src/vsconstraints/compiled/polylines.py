"""Compiled search for distances to polylines; see :mod:`vsconstraints.formulas.polylines`."""

from __future__ import annotations

from ..formulas import polylines
from .compiler import IN_PLACE, compiled
from .signatures import INT, INTEGERS, MATRIX, VECTOR, VOID, signature

#: See :func:`vsconstraints.formulas.polylines.search`.
CHORDS = MATRIX, MATRIX, MATRIX, MATRIX, INTEGERS, INTEGERS, VECTOR

search = compiled(signature(VOID, MATRIX, CHORDS, INT, INTEGERS, VECTOR), IN_PLACE)(
    polylines.search
)
