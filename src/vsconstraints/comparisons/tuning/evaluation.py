"""Settings on training scenes, run and scored as evidence is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from ..evidence.worker import Bench
from ..metrics import score
from ..runs.pool import Failure, Pool
from ..runs.resources import process_count, run_limit
from ..runs.spec import ControllerSpec
from .objectives import FAILED, Judged, Outcome, judged, outcome
from .problem import Stage


def outcomes(stage: Stage, baseline: ControllerSpec, settings: Sequence[ControllerSpec]) -> list[Outcome]:
    """Run each setting on one stage, with the same disturbances and noise, and hold it against tracking alone."""
    bench = Bench(stage.scene, stage.condition)
    tracking = bench.run(baseline)
    reference = score(tracking, tracking).result
    return [outcome(score(bench.run(setting), tracking).result, reference) for setting in settings]


class Call(NamedTuple):
    """One task of a process: a stage, and settings, by their numbers."""

    stage: int
    settings: tuple[int, ...]


class Evaluator:
    """Evaluates settings in processes of their own; :func:`evaluating` makes one."""

    def __init__(self, pool: Pool[list[Outcome]], stages: Sequence[Stage], baseline: ControllerSpec) -> None:
        self._pool, self._stages, self._baseline = pool, stages, baseline

    def evaluate(self, settings: Sequence[ControllerSpec]) -> list[Judged]:
        """What each setting is worth over all stages.

        Settings on a stage on which one of them takes its process along, or too long, are run once more, each alone;
        whichever fails again counts as a run that came to nothing.
        """
        stages, every = range(len(self._stages)), tuple(range(len(settings)))
        found: dict[tuple[int, int], Outcome] = {}
        again: list[Call] = []
        for call, answer in self._answers([Call(stage, every) for stage in stages if every], settings):
            if isinstance(answer, Failure):
                again += [Call(call.stage, (i,)) for i in call.settings]
            else:
                found |= {(call.stage, i): one for i, one in zip(call.settings, answer, strict=True)}
        for call, answer in self._answers(again, settings):
            found[call.stage, call.settings[0]] = FAILED if isinstance(answer, Failure) else answer[0]
        return [judged([found[stage, i] for stage in stages]) for i in every]

    def _answers(
        self, asked: Sequence[Call], settings: Sequence[ControllerSpec]
    ) -> Iterator[tuple[Call, list[Outcome] | Failure]]:
        calls, limits = {}, {}
        for call in asked:
            stage = self._stages[call.stage]
            calls[call] = (stage, self._baseline, [settings[i] for i in call.settings])
            limits[call] = (1 + len(call.settings)) * run_limit(stage.scene.tables[stage.condition])
        return self._pool.run(calls, limits)


@contextmanager
def evaluating(stages: Sequence[Stage], baseline: ControllerSpec, workers: int | None) -> Iterator[Evaluator]:
    """Processes that evaluate settings on these stages; as many as there are cores and memory for, if None."""
    with Pool(outcomes, process_count(workers)) as pool:
        yield Evaluator(pool, stages, baseline)
