"""How far a campaign is, and what it came to."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from ..runs.spec import BASELINE
from .task import Batch
from .worker import Part


class Kind(NamedTuple):
    """Runs that are alike but for their scene."""

    family: str
    condition: str
    controller: str


@dataclass
class Progress:
    """How far a campaign is: counts, whatever there is to be counted.

    Attributes
    ----------
    scenes, stored_before
        How many there are to be done, and how many of them were before.
    done, found, runs
        Scenes that are done, those of before included; that were found now; runs that were made now.
    of_kind, failed
        Runs that were made now, and those of them that failed.
    reasons
        Why the first of each kind failed.
    seconds
        Time of one process that they took [s].
    """

    scenes: int
    stored_before: int
    done: int = 0
    found: int = 0
    runs: int = 0
    of_kind: Counter[Kind] = field(default_factory=Counter)
    failed: Counter[Kind] = field(default_factory=Counter)
    reasons: dict[Kind, str] = field(default_factory=dict)
    seconds: float = 0.0

    def add(self, task: Batch, part: Part) -> None:
        """Count what a task came to."""
        self.done += len(task.scenes)
        self.found += sum(part.scenes["found"].to_pylist())
        self.runs += part.runs.num_rows
        self.seconds += part.seconds
        for line in part.runs.select([*Kind._fields, "status", "reason"]).to_pylist():
            kind = Kind(*(line[name] for name in Kind._fields))
            self.of_kind[kind] += 1
            if line["status"] == "failed":
                self.failed[kind] += 1
                self.reasons.setdefault(kind, line["reason"])

    @property
    def all_failed(self) -> bool:
        """Whether runs were made, and none of a controller that is compared came to anything."""
        compared = [kind for kind in self.of_kind if kind.controller != BASELINE] or list(self.of_kind)
        return bool(compared) and all(self.failed[kind] == self.of_kind[kind] for kind in compared)


@dataclass(frozen=True)
class Finished:
    """What a campaign came to.

    Attributes
    ----------
    folder
        Where it is stored.
    progress
        How far it is.
    wall_time
        [s].
    kept
        How many trajectories there are.
    interrupted
        Number of the signal that ended it; 0 if none did.
    """

    folder: Path
    progress: Progress
    wall_time: float
    kept: int
    interrupted: int

    @property
    def rate(self) -> float:
        """Runs made a second."""
        return self.progress.runs / self.wall_time
