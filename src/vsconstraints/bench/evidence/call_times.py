"""Track that accounts for computing time.

The commands of each law are delayed by the time that a call of the law takes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from ...comparisons.metrics import load_metrics
from ...comparisons.runs.folder import MANIFEST, manifest_of
from ...comparisons.runs.pool import Failure, OpenWorkers
from ...comparisons.runs.spec import BASELINE, MAX_FACTOR, ControllerSpec, RunTiming, prepare_laws
from ...errors import ConfigurationError
from ...plugins.processes import deadline
from ...robots.geometry import require_sign
from ...scenarios.reading import from_table
from ...scenarios.toml import read_toml
from .campaign import Campaign
from .work import Batch, benches, plan_batches

MEASURED = "measured"  #: Source of call times that are measured instead of read from a file.
SCENES = 3  #: Number of training scenes of each family on which call times are measured.
#: Number of equal runs. The shortest time of each call counts: other processes interrupt some.
REPEATS = 3
HOW = (
    f"99 % of a law's calls are shorter: least of {REPEATS} equal runs, median over {SCENES} "
    f"training scenes of a "
    "family in all conditions, longest of all families; without evaluating rows and task; "
    "measured on this machine"
)


@dataclass(frozen=True)
class CallTimes:
    """Duration of a call of each law, by its name in the campaign or else its type.

    Raises InvalidInput if a unit, factor or budget is not positive, and ConfigurationError if a
    call time is negative or infinite.
    """

    calls: dict[str, float]  #: Call times in units of ``unit_s``.
    unit_s: float  #: Unit of the call times [s].
    how: str = ""  #: Source of the numbers, for reports.
    slower: float = 1.0  #: Factor by which the computer is slower.
    #: Computing time of each law per sampling time of a scene [s]. A law is called as often as this
    #: allows: from four times as often as the scene specifies to a quarter as often. None keeps the
    #: sampling time.
    budget_s: float | None = None

    def __post_init__(self) -> None:
        require_sign(self, "call times: ", positive=("unit_s", "slower", "budget_s"))
        for name, call in self.calls.items():
            if not 0.0 <= call < float("inf"):
                raise ConfigurationError(
                    f"call times: calls.{name} must be zero or more, not {call}"
                )

    def of(self, campaign: Campaign) -> Campaign:
        """Return the campaign with the call time set for every law except the baseline.

        Raises ConfigurationError that names the laws without a call time.
        """
        laws = [entry for entry in campaign.controllers if entry.name != BASELINE]
        missing = []
        for entry in laws:
            if entry.name not in self.calls and entry.law not in self.calls:
                missing.append(entry.name)
        if missing:
            raise ConfigurationError(f"call times are missing for {', '.join(missing)}")
        title = f"{campaign.title}, time passes"
        timed = tuple(map(self._timed, laws))
        campaign = campaign.changed(title=title, controllers=timed, call_times=asdict(self))
        return campaign.checked()

    @property
    def sentence(self) -> str:
        """Description of the call times for reports."""
        calls = [f"{name} {1e6 * self._call(name):.4g}" for name in self.calls]
        statements = [", ".join(calls), self.how]
        if self.slower != 1.0:
            statements.append(f"the computer is {self.slower:g} times as slow")
        if self.budget_s is not None:
            budget = f"{1e6 * self.budget_s:g} µs per T_s of the scene"
            statements.append(f"laws are called as often as {budget} allow")
        return (
            "delay from the beginning of a period until a law's command begins to act [µs]: "
            f"{'; '.join(statements)}."
        )

    def _call(self, name: str) -> float:
        return float(f"{self.slower * self.unit_s * self.calls[name]:.6g}")

    def _timed(self, entry: ControllerSpec) -> ControllerSpec:
        call = self._call(entry.name if entry.name in self.calls else entry.law)
        factor = entry.run.sampling_time_factor
        if self.budget_s is not None:
            wanted = max(call / self.budget_s, 1.0 / MAX_FACTOR)
            factor = float(f"{min(wanted, MAX_FACTOR):.6g}")
        return replace(entry, run=RunTiming(factor, call))


def call_times(
    source: str,
    campaign: Campaign,
    folder: Path | None,
    workers: OpenWorkers,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> CallTimes:
    """Read the call times from a file or a folder of results, or measure them.

    If ``source`` is :data:`MEASURED`, those stored in ``folder`` are used if there are any, so that
    they are measured only once.
    """
    if source != MEASURED:
        path = Path(source)
        table = _stored(path) if path.is_dir() else read_toml(path)
        return from_table(CallTimes, table, source)
    stored = {} if folder is None else _stored(folder)
    if stored:
        return from_table(CallTimes, stored, f"{folder}/{MANIFEST}")
    return _measured(campaign, workers, on_progress)


def _stored(folder: Path) -> object:
    configuration = manifest_of(folder).get("configuration")
    if not isinstance(configuration, dict):
        return {}
    return configuration.get("call_times", {})


def _measured(
    campaign: Campaign, workers: OpenWorkers, on_progress: Callable[[int, int], None]
) -> CallTimes:
    load_metrics()  # as a campaign does, before any run
    prepare_laws(campaign.controllers)
    training = campaign.changed(half="training", scenes=SCENES, scenes_in={})
    batches = plan_batches(training, limit=None)
    calls = {i: (batch,) for i, batch in enumerate(batches)}
    measured = defaultdict[tuple[str, str], list[float]](list)
    with workers(time_calls) as opened:
        for done, (_, answer) in enumerate(opened.run(calls), start=1):
            if isinstance(answer, Failure):
                raise ConfigurationError(f"calls cannot be measured: {answer.reason}")
            for law, family, call in answer:
                measured[law, family].append(1e6 * call)
            on_progress(done, len(calls))
    longest = defaultdict[str, float](float)
    for (law, _), times in measured.items():
        middle = np.median(times)
        of_family = float(f"{middle:.3g}")
        longest[law] = max(longest[law], of_family)
    return CallTimes(dict(longest), 1e-6, HOW)


def time_calls(batch: Batch) -> list[tuple[str, str, float]]:
    """Return law, family and 99 % quantile of the call times [s] of every run of a batch.

    Workers call this function.
    """
    found = []
    laws = [entry for entry in batch.controllers if entry.name != BASELINE]
    for number in batch.scenes:
        with deadline(batch.drawing_limit):
            _, bench_of = benches(batch, number)
        for bench, law in product(bench_of.values(), laws):
            times = []
            with deadline(batch.run_limit(law)):
                for _ in range(REPEATS):
                    times.append(bench.run(law).trajectory.step_time[1:])
            # a run that fails has fewer calls
            calls = min(map(len, times))
            if calls:
                least = np.min([each[:calls] for each in times], axis=0)
                nearly_longest = float(np.quantile(least, 0.99))
                found.append((law.name, batch.family.name, nearly_longest))
    return found
