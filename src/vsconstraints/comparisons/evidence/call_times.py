"""A track in which time passes: the commands of each law arrive as late as a call of it takes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ...errors import ConfigurationError
from ...plugins.processes import deadline
from ...robots.geometry import demand_sign
from ...scenarios.reading import from_table
from ...scenarios.toml import read_toml
from ..runs.folder import MANIFEST, manifest_of
from ..runs.pool import Failure, OpenWorkers
from ..runs.spec import BASELINE, MAX_FACTOR, ControllerSpec, RunTiming, prepare_laws
from .campaign import Campaign
from .work import Batch, benches, tasks_of

MEASURED = "measured"  #: What stands for a file of call times where they are measured.
SCENES = 3  #: Training scenes of each family on which they are.
#: Equal runs there; the least time of each call counts, since other processes interrupt some.
REPEATS = 3
HOW = (
    f"99 % of a law's calls are shorter: least of {REPEATS} equal runs, median over {SCENES} "
    f"training scenes of a "
    "family in all conditions, longest of all families; without evaluating rows and task; "
    "measured on this machine"
)


@dataclass(frozen=True)
class CallTimes:
    """How long a call of each law takes, by its name in the campaign or else its type; InvalidInput
    for wrong signs.
    """

    calls: dict[str, float]  #: In units.
    unit_s: float  #: [s].
    how: str = ""  #: Where the numbers are from, for reports.
    slower: float = 1.0  #: How many times as slow the computer is.
    #: What each law may compute per sampling time of a scene [s]: it is called as often as that
    #: allows, from four times as often as the scene says, which is meant without it, to a quarter
    #: as often.
    budget_s: float | None = None

    def __post_init__(self) -> None:
        demand_sign(self, "call times: ", positive=("unit_s", "slower", "budget_s"))
        for name, call in self.calls.items():
            if not 0.0 <= call < float("inf"):
                raise ConfigurationError(
                    f"call times: calls.{name} must be zero or more, not {call}"
                )

    def of(self, campaign: Campaign) -> Campaign:
        """The campaign with every law but the baseline timed so; raises ConfigurationError that
        names what is not.
        """
        laws = [entry for entry in campaign.controllers if entry.name != BASELINE]
        missing = [entry.name for entry in laws if not {entry.name, entry.law} & self.calls.keys()]
        if missing:
            raise ConfigurationError(f"call times: there is none of {', '.join(missing)}")
        title = f"{campaign.title}, time passes"
        timed = tuple(map(self._timed, laws))
        return campaign.changed(title=title, controllers=timed, call_times=asdict(self)).checked()

    @property
    def sentence(self) -> str:
        """What reports say."""
        said = [", ".join(f"{name} {1e6 * self._call(name):.4g}" for name in self.calls), self.how]
        if self.slower != 1.0:
            said.append(f"the computer is {self.slower:g} times as slow")
        if self.budget_s is not None:
            said.append(
                f"laws are called as often as {1e6 * self.budget_s:g} µs per T_s of the scene allow"
            )
        return (
            f"how long after the beginning of a period a law's command begins to act [µs]: "
            f"{'; '.join(said)}."
        )

    def _call(self, name: str) -> float:
        return float(f"{self.slower * self.unit_s * self.calls[name]:.6g}")

    def _timed(self, entry: ControllerSpec) -> ControllerSpec:
        call = self._call(entry.name if entry.name in self.calls else entry.law)
        factor = entry.run.sampling_time_factor
        if self.budget_s is not None:
            factor = float(f"{min(max(call / self.budget_s, 1.0 / MAX_FACTOR), MAX_FACTOR):.6g}")
        return replace(entry, run=RunTiming(factor, call))


def call_times(
    source: str,
    campaign: Campaign,
    folder: Path | None,
    workers: OpenWorkers,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> CallTimes:
    """Those of a file, or of a folder of results; or :data:`MEASURED`, once for results in
    ``folder`` if any.
    """
    if source != MEASURED:
        path = Path(source)
        return from_table(CallTimes, _stored(path) if path.is_dir() else read_toml(path), source)
    there = {} if folder is None else _stored(folder)
    return (
        from_table(CallTimes, there, f"{folder}/{MANIFEST}")
        if there
        else _measured(campaign, workers, on_progress)
    )


def _stored(folder: Path) -> object:
    configuration = manifest_of(folder).get("configuration")
    return configuration.get("call_times", {}) if isinstance(configuration, dict) else {}


def _measured(
    campaign: Campaign, workers: OpenWorkers, on_progress: Callable[[int, int], None]
) -> CallTimes:
    prepare_laws(campaign.controllers)
    tasks = dict(
        enumerate(tasks_of(campaign.changed(half="training", scenes=SCENES, scenes_in={})))
    )
    found = defaultdict[tuple[str, str], list[float]](list)
    with workers(time_calls) as opened:
        for done, (_, answer) in enumerate(
            opened.run({i: (task,) for i, task in tasks.items()}), start=1
        ):
            if isinstance(answer, Failure):
                raise ConfigurationError(f"calls cannot be measured: {answer.reason}")
            for law, family, call in answer:
                found[law, family].append(1e6 * call)
            on_progress(done, len(tasks))
    longest = defaultdict[str, float](float)
    for (law, _), of_family in found.items():
        longest[law] = max(longest[law], float(f"{np.median(of_family):.3g}"))
    return CallTimes(dict(longest), 1e-6, HOW)


def time_calls(task: Batch) -> list[tuple[str, str, float]]:
    """Of every run of a task its law, its family, and what 99 % of its calls are shorter than [s]:
    for workers.
    """
    found = []
    with deadline(task.limit) as step:
        for number in task.scenes:
            step()
            for bench in benches(task, number)[1].values():
                for entry in (entry for entry in task.controllers if entry.name != BASELINE):
                    step()
                    times = [bench.run(entry).trajectory.step_time[1:] for _ in range(REPEATS)]
                    if calls := min(map(len, times)):
                        least = np.min([each[:calls] for each in times], axis=0)
                        found.append(
                            (entry.name, task.family.name, float(np.quantile(least, 0.99)))
                        )
    return found
