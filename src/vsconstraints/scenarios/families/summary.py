"""What the scenes of a family are like, counted: how many attempts they took, and what they challenge."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from .drawn import Drawn
from .family import Family


@dataclass(frozen=True)
class Summary:
    """Counts over the first scenes of a family.

    Attributes
    ----------
    family
        Its name.
    scenes
        As they were drawn, those that were not found too.
    seconds
        Wall time of drawing them.
    """

    family: str
    scenes: tuple[Drawn, ...]
    seconds: float

    @property
    def found(self) -> list[Drawn]:
        """Those for which an attempt was accepted."""
        return [scene for scene in self.scenes if scene.found]

    @property
    def rejected(self) -> Counter[str]:
        """Attempts that were rejected, by reason."""
        counts: Counter[str] = Counter()
        for scene in self.scenes:
            counts.update(scene.rejected)
        return counts

    @property
    def acceptance(self) -> float:
        """Share of the attempts that was accepted."""
        return len(self.found) / max(sum(scene.attempts for scene in self.scenes), 1)

    @property
    def challenged(self) -> Counter[str]:
        """In how many scenes tracking alone leaves a row of each kind."""
        return Counter(kind for scene in self.found for kind in {label.partition("[")[0] for label in scene.challenged})

    @property
    def beyond_limits(self) -> float:
        """Share of the scenes that no law could hold from where tracking alone meets a row; NaN without limits."""
        shares = np.array([scene.share_to_hold for scene in self.found])
        return float((shares > 1.0).mean()) if np.isfinite(shares).any() else np.nan

    @property
    def timed(self) -> list[Drawn]:
        """Those of which the least time to arrive in is known."""
        return [scene for scene in self.found if np.isfinite(scene.least_time)]


def summarised(
    family: Family,
    scenes: int,
    half: str = "held-out",
    seed: int = 0,
    on_drawn: Callable[[], None] = lambda: None,
) -> Summary:
    """Draw the first scenes of a family; raises ConfigurationError with counts if none of the very first is found."""
    family.demand_scenes(half, seed)
    began, drawn = perf_counter(), []
    for number in range(scenes):
        drawn.append(family.scene(number, half, seed))
        on_drawn()
    return Summary(family.name, tuple(drawn), perf_counter() - began)
