"""How runs end: what each pair gained or lost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..statistics.judged import converged, violated
from ..statistics.rates import sign_test
from .groups import Group, tested

OUTCOMES: dict[str, Callable[[Any], Any]] = {
    "converges": converged,
    "stays inside": lambda runs: ~violated(runs),
    "comes to an end": lambda runs: ~runs["status"].isin(["failed", "aborted"]),
}
"""What a run is to do, and in which runs it does."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """How often a law does something in A and in B.

    Attributes
    ----------
    group
        Whose runs.
    what
        One of :data:`OUTCOMES`.
    before, after
        In how many pairs it does so in A, in B.
    lost, gained
        Positions of the pairs in which only A does so, only B.
    p
        McNemar's, exact, which is the sign test; before correction. None where so few pairs differ that none could be
        significant.
    """

    group: Group
    what: str
    before: int
    after: int
    lost: Any
    gained: Any
    p: float | None

    @property
    def for_worse(self) -> bool:
        """Which way it goes."""
        return len(self.lost) > len(self.gained)


def outcomes(groups: list[Group]) -> Iterator[Outcome]:
    """All of them in which pairs differ."""
    for group in groups:
        for what, does in OUTCOMES.items():
            a, b = does(group.a).to_numpy(), does(group.b).to_numpy()
            lost, gained = group.positions[a & ~b], group.positions[b & ~a]
            if len(lost) + len(gained):
                p = sign_test(len(gained), len(lost)) if tested(len(lost) + len(gained)) else None
                yield Outcome(group, what, int(a.sum()), int(b.sum()), lost, gained, p)
