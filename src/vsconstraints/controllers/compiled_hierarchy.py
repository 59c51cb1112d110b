"""Commands of the hierarchical QP's compiled form."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.layout import RELAXED_ROWS, RELAXED_SHORT, SHORT
from ..rows import Array, BoolArray, Command
from .compiled import BoundLaw, Draft

COMPILED = "compiled"
"""What commands call the compiled solver."""


ANSWERS = {RELAXED_ROWS: (True, False), SHORT: (False, True), RELAXED_SHORT: (True, True)}
"""Codes of answers with something to be said: whether demands are unmet, and whether levels 2 and 3 may be."""

UNPROVED = "rounding does not allow to prove that the task and the accelerations are the least that the rows allow"


class BoundHierarchy(BoundLaw):
    """The hierarchy on arrays that stay where they are."""

    __slots__ = ("_last", "_law", "_remark", "_slack")

    def __init__(
        self,
        law: Callable[[], tuple[int, int]],
        labels: tuple[str, ...],
        acted: BoolArray,
        qdd: Array,
        slack: Array,
        remark: str,
    ) -> None:
        super().__init__(self._solve, labels, acted, qdd)
        self._law, self._slack, self._last = law, slack, (0, 0)
        self._remark = remark

    def _solve(self) -> int:
        code, _ = self._last = self._law()
        return 0 if code in ANSWERS else code

    def command(self) -> Command:
        """The last answer, in arrays of its own."""
        code, iterations = self._last
        return hierarchy_command(
            self.qdd.copy(), code, self.acted.copy(), self.labels, self._slack.copy(), iterations, self._remark
        )


def hierarchy_command(
    qdd: Array, code: int, acted: BoolArray, labels: tuple[str, ...], slack: Array, iterations: int, remark: str
) -> Command:
    """The command of the compiled hierarchy, from arrays that become its own."""
    command: Any = Draft(qdd, "ok", acted, labels, "", slack, COMPILED if iterations else "", iterations)
    if remark:
        command.remark = remark
    if code:
        relaxed, short = ANSWERS[code]
        command.status = "relaxed" if relaxed else "suboptimal"
        why = unmet(labels, slack, np.flatnonzero(~acted & (slack > 0.0)))
        command.reason = "; ".join(filter(None, (why, UNPROVED if short else "")))
    command.__class__ = Command
    made: Command = command
    return made


def unmet(labels: tuple[str, ...], slack: Array, fixed: NDArray[np.intp]) -> str:
    """Say which demands are unmet and by how much; empty if none is."""
    unmet = np.flatnonzero(slack > 0.0)
    if not unmet.size:
        return ""
    amounts = ", ".join(f"{labels[i]} by {slack[i]:.3g}" for i in unmet)
    why = (
        ""
        if not np.isin(unmet, fixed).any()
        else "; no acceleration influences " + ", ".join(labels[i] for i in unmet if i in fixed)
    )
    return f"no acceleration meets every demand; unmet, in units of φ per second: {amounts}{why}"
