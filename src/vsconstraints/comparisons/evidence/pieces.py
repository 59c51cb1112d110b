"""Tasks that no worker survives, made again by pieces: what is to blame fails, and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from ..runs.pool import Failure
from .task import Batch
from .worker import Part, failed
from .workers import Workers

GRACE = 60.0
"""A run that is alone is ended by whoever watches it, who says why; so much later [s] its process ends itself."""

Scene = tuple[int, int]
"""Number of a task, and of a scene in it."""


def by_pieces(tasks: Sequence[Batch], workers: Workers) -> Iterator[tuple[Batch, Part]]:
    """Tasks scene by scene and, of scenes that no worker survives, run by run; such a run fails with the reason.

    Scenes of all tasks stand in one queue, and so do the runs after them: no process waits for the last piece of a
    task. A task comes as soon as its last scene is done.
    """
    scenes = {(i, j): scene for i, task in enumerate(tasks) for j, scene in enumerate(task.each())}
    done: dict[Scene, Part] = {}
    for (i, j), part in _scenes(scenes, workers):
        done[i, j] = part
        own = [(i, k) for k in range(len(tasks[i].scenes))]
        if all(scene in done for scene in own):
            yield tasks[i], Part.joined([done.pop(scene) for scene in own])


def _scenes(scenes: Mapping[Scene, Batch], workers: Workers) -> Iterator[tuple[Scene, Part]]:
    broken = []
    # not once more as a whole, with nothing beside it: it can be innocent, and its runs say so sooner
    for key, answer in workers.run({key: (scene,) for key, scene in scenes.items()}, again=False):
        if isinstance(answer, Failure):
            broken.append(key)
        else:
            yield key, answer
    runs = {(key, i): single for key in broken for i, single in enumerate(scenes[key].singles())}
    limits = {key: single.limit for key, single in runs.items() if single.limit is not None}
    patient = {key: replace(runs[key], limit=limit + GRACE) for key, limit in limits.items()}
    parts: dict[Scene, dict[int, Part]] = {key: {} for key in broken}
    left = {key: sum(own == key for own, _ in runs) for key in broken}
    for (key, i), answer in workers.run({run: (single,) for run, single in {**runs, **patient}.items()}, limits):
        parts[key][i] = failed(runs[key, i], answer.reason) if isinstance(answer, Failure) else answer
        if len(parts[key]) == left[key]:
            yield key, Part.joined([part for _, part in sorted(parts.pop(key).items())])
