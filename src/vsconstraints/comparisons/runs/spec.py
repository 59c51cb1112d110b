"""A run as it is asked for, by comparisons, studies and the reproduction alike."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...compiled import prepare
from ...controllers import controller_class, make_controller
from ...controllers.base import Controller
from ...errors import ConfigurationError, VsconstraintsError, shown
from ...plugins.classes import module_files
from ...scenarios import Scenario
from ...scenarios.reading import checked, demand_table, from_table
from ...simulation import Setup
from .machine import code_identity, run_limit, used_versions

MAX_FACTOR = 4.0  #: How many times as often, or as rarely, as a scene says a law may be called.
MAX_CALL = 10.0  #: How much later than in the scene a law's commands may act [s].
ROUNDING = 1e-9  #: Of numbers of periods, relative to one.


@dataclass(frozen=True)
class RunTiming:
    """When a law is called, and when its commands act: what a table ``run`` changes in the scenes
    of one law alone.
    """

    #: T_s of the law by that of the scene. Images come as before, or once a period if that is less
    #: often, none fresher; the noise of accelerations is drawn for the law's periods, and makes
    #: speeds as uncertain.
    sampling_time_factor: float = 1.0
    #: How much later commands begin to act [s], added to the ``command_delay`` of the scene.
    call_time: float = 0.0

    def __post_init__(self) -> None:
        for name, least, most in (
            ("sampling_time_factor", 1.0 / MAX_FACTOR, MAX_FACTOR),
            ("call_time", 0.0, MAX_CALL),
        ):
            if not least <= getattr(self, name) <= most:
                value = shown(getattr(self, name))
                raise ConfigurationError(
                    f"run: {name} must be from {least:g} to {most:g}, not {value}"
                )

    @property
    def changes(self) -> dict[str, float]:
        """What is not as in the scene."""
        return {
            name: value
            for name, value in vars(self).items()
            if value != getattr(AS_THE_SCENE, name)
        }

    def of(self, setup: Setup) -> Setup:
        """A scene's setup as the law has it; raises what :class:`.Setup` raises."""
        own = replace(
            setup.disturbances, command_delay=setup.disturbances.command_delay + self.call_time
        )
        Ts = setup.Ts * self.sampling_time_factor
        if Ts != setup.Ts:
            own = replace(
                own,
                acceleration_noise=own.acceleration_noise / math.sqrt(self.sampling_time_factor),
            )
            if own.image:
                seen = own.image_period or setup.Ts
                period = Ts * math.ceil(seen / Ts - ROUNDING)
                own = replace(
                    own, image_period=period, delay=math.ceil(own.delay * seen / period - ROUNDING)
                )
        return replace(setup, sampling_time=Ts, disturbances=own) if self.changes else setup


AS_THE_SCENE = RunTiming()


@dataclass(frozen=True)
class ControllerSpec:
    """A controller as results name it; its law is a registered name or ``module:Class``, the same
    name if empty.

    The module of an own controller is looked for in ``folder`` first; ``run`` is what only its runs
    have.
    """

    name: str
    law: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    folder: Path | None = None
    run: RunTiming = AS_THE_SCENE

    def __post_init__(self) -> None:
        object.__setattr__(self, "law", self.law or self.name)

    @classmethod
    def from_table(
        cls, name: str, table: object, where: str = "controllers", folder: Path | None = None
    ) -> ControllerSpec:
        """What a table of a file or a manifest says; raises ConfigurationError for a wrong one."""
        at = f"{where}.{name}"
        options = demand_table(table, at)
        law = checked(options.pop("type", name), str, at, "type")
        return cls(
            name, law, options, folder, from_table(RunTiming, options.pop("run", {}), f"{at}.run")
        )

    @property
    def table(self) -> dict[str, Any]:
        """Law, options and timing, as :meth:`from_table` takes them."""
        return {
            "type": self.law,
            **self.options,
            **({"run": changes} if (changes := self.run.changes) else {}),
        }

    def changed(self, key: str, value: object) -> ControllerSpec:
        """The same with another value of an option, or of a key of ``run``; raises as
        :meth:`from_table`.
        """
        if key.partition(".")[0] != "run":
            return replace(self, options={**self.options, key: value})
        run = {**self.run.changes, key.removeprefix("run."): value} if key != "run" else value
        return replace(self, run=from_table(RunTiming, run, f"{self.name}.run"))

    @classmethod
    def called(cls, law: str, name: str = "", folder: Path | None = None) -> ControllerSpec:
        """A controller by its registered name or ``module:Class``; without ``name`` it has that of
        its class.
        """
        own = controller_class(law, folder).name if ":" in law else law
        if not isinstance(own, str):
            raise ConfigurationError(f'{law} has no name: write name = "…" in the class')
        return cls(name or own, law, folder=folder if ":" in law else None)

    @property
    def here(self) -> bool:
        """Whether only the process that asks for it can make it."""
        return False

    @property
    def apart(self) -> bool:
        """True if it is a custom law that another process can make: it runs in a process of its
        own.
        """
        return ":" in self.law and not self.here

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that an own one is defined in."""
        return tuple(module_files([self.law], self.folder))

    def make(self) -> Controller:
        """A new controller; raises ConfigurationError or InvalidInput that names what is wrong."""
        return make_controller(self.law, self.options, self.folder)


def prepare_laws(laws: Iterable[ControllerSpec]) -> None:
    """Compile, or read, what simulations need, and what only these need beside it; no code of own
    laws is run.
    """
    prepare(*sorted({name for law in laws if ":" not in law.law for name in law.make().kernels}))


#: The controller that defines which rows a scenario challenges: every comparison and every study
#: runs it.
BASELINE = "tracking"

SLIDING_MODE = ControllerSpec("sliding-mode")


@dataclass(frozen=True, eq=False)
class RunSpec:
    """One run: a scenario, or the name of a shipped one, a controller, a trial. Two are equal if
    their results are.

    ``overrides`` are dotted keys of the scenario and other values; ``trial`` and ``seed`` say where
    it starts; ``may_end_early``, that it is run to see how it fails or is aborted.
    """

    scenario: Scenario | str
    controller: ControllerSpec = SLIDING_MODE
    overrides: Mapping[str, Any] = field(default_factory=dict)
    trial: int = 0
    seed: int = 0
    may_end_early: bool = False

    @property
    def name(self) -> str:
        """The scenario's."""
        return self.scenario if isinstance(self.scenario, str) else self.scenario.name

    @property
    def key(self) -> tuple[str, str, int]:
        """Scenario, controller and trial, as results name them."""
        return self.name, self.controller.name, self.trial

    def __str__(self) -> str:
        changes = ", ".join(
            f"{key} = {value}"
            for key, value in {**self.controller.options, **self.overrides}.items()
        )
        return f"{self.name} with {self.controller.law}" + (f" ({changes})" if changes else "")

    @property
    def _identity(self) -> str:
        scenario = (
            self.scenario if isinstance(self.scenario, str) else (self.name, self.scenario.tables)
        )
        parts = scenario, self.overrides, self.controller.table, self.trial, self.seed
        return json.dumps(parts, sort_keys=True, default=str)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RunSpec) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    def load(self) -> Scenario:
        """The scenario with its overrides; raises ConfigurationError if there is none."""
        scenario = Scenario.load(self.scenario) if isinstance(self.scenario, str) else self.scenario
        for key, value in self.overrides.items():
            scenario = scenario.with_override(key, value)
        return scenario

    @property
    def tables(self) -> dict[str, Any]:
        """Of the scenario; empty if there is none: the error is raised where it is run."""
        try:
            return self.load().tables
        except VsconstraintsError:
            return {}

    @property
    def has_own_parts(self) -> bool:
        """Whether parts of it are somebody's own."""
        return ":" in self.controller.law or bool(self.load().own_parts)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are named for this run: own modules, URDF, meshes, SRDF."""
        return (*self.load().files, *self.controller.files)

    @property
    def here(self) -> bool:
        """Whether only the process that asks for it can run it."""
        return self.controller.here or self.load().in_session

    @property
    def fingerprint(self) -> str:
        """Identifies what is run but for the files it is made of: the code included, and whether it
        runs compiled.
        """
        run = self.tables or str(self), self.controller.table, self.trial, self.seed
        what = *run, code_identity(), used_versions({**self.tables, "law": self.controller.options})
        return hashlib.sha256(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()[
            :16
        ]


def longest_first(runs: Iterable[RunSpec]) -> dict[RunSpec, float]:
    """Different runs, so that no long one is left at the end, and how long each may take [s]."""
    limits = {run: run_limit(run.tables) for run in dict.fromkeys(runs)}
    return dict(sorted(limits.items(), key=lambda item: item[1], reverse=True))
