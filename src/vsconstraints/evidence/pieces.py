"""A task that no worker survives, made again by pieces: what is to blame fails, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..runs.pool import Failure
from .task import Batch
from .worker import Part, failed
from .workers import Workers

GRACE = 60.0
"""A run that is alone is ended by whoever watches it, who says why; so much later [s] its process ends itself."""


def by_pieces(task: Batch, workers: Workers) -> Part:
    """A task scene by scene and, of a scene that no worker survives, run by run; such a run fails with the reason."""
    return Part.joined([_scene(scene, answer, workers) for scene, answer in _answers(list(task.each()), workers)])


def _scene(task: Batch, answer: Part | Failure, workers: Workers) -> Part:
    if not isinstance(answer, Failure):
        return answer
    singles = list(task.singles())
    limits = {i: single.limit for i, single in enumerate(singles) if single.limit is not None}
    patient = [single if single.limit is None else replace(single, limit=single.limit + GRACE) for single in singles]
    return Part.joined(
        [
            failed(single, answer.reason) if isinstance(answer, Failure) else answer
            for single, answer in _answers(patient, workers, limits)
        ]
    )


def _answers(
    tasks: Sequence[Batch], workers: Workers, limits: Mapping[int, float] | None = None
) -> list[tuple[Batch, Part | Failure]]:
    """Tasks with their answers, in their order."""
    answers = dict(workers.run({i: (task,) for i, task in enumerate(tasks)}, limits))
    return [(task, answers[i]) for i, task in enumerate(tasks)]
