"""Specification of a run, used by comparisons, studies and the reproduction of the paper."""

from __future__ import annotations

import hashlib
import json
import math
import shlex
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from os.path import isfile  # unlike Path.is_file, it takes a text that is too long for a path
from pathlib import Path
from typing import Any

from ...compiled import prepare
from ...controllers import controller_class, make_controller, registered_laws
from ...controllers.base import Controller
from ...controllers.ranges import positive
from ...errors import ConfigurationError, VsconstraintsError, format_value
from ...plugins.classes import beside, folder_of_neighbours, module_files
from ...plugins.registry import registered
from ...scenarios import Scenario
from ...scenarios.reading import checked, from_table, require_table
from ...simulation import Setup
from ...simulation.programs import program_name
from .identity import Identity, identity, scene_identity
from .machine import run_limit

MAX_FACTOR = 4.0  #: Maximum ratio between the sampling times of a law and its scene, or inverse.
MAX_CALL = 10.0  #: Maximum additional delay of a law's commands [s].
ROUNDING = 1e-9  #: Rounding tolerance of numbers of periods [periods].


@dataclass(frozen=True)
class RunTiming:
    """Sampling time and command delay of one law, relative to the scene.

    A table ``run`` sets them for the runs of one law alone.
    """

    #: Ratio of the law's T_s to that of the scene. Images arrive as before, or once per period if
    #: that is less often, and are never fresher. Acceleration noise is drawn once per period of
    #: the law, and causes the same uncertainty of speeds.
    sampling_time_factor: float = 1.0
    #: Additional delay of commands [s], added to the ``command_delay`` of the scene.
    call_time: float = 0.0

    def __post_init__(self) -> None:
        for name, least, most in (
            ("sampling_time_factor", 1.0 / MAX_FACTOR, MAX_FACTOR),
            ("call_time", 0.0, MAX_CALL),
        ):
            if not least <= getattr(self, name) <= most:
                value = format_value(getattr(self, name))
                raise ConfigurationError(
                    f"run: {name} must be from {least:g} to {most:g}, not {value}"
                )

    @property
    def changes(self) -> dict[str, float]:
        """Values that differ from those of the scene."""
        return {
            name: value
            for name, value in vars(self).items()
            if value != getattr(AS_THE_SCENE, name)
        }

    def of(self, setup: Setup) -> Setup:
        """Apply the timing to a scene's setup; raises the errors of :class:`.Setup`."""
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
    """A controller under the name that it has in results.

    Its law is a registered name, ``module:Class`` or ``FILE.py:Class``; if empty, it equals
    ``name``. The module or file of a custom controller is first searched for in ``folder``. ``run``
    is the timing of its runs.
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
        """Read a table of a file or a manifest; raises ConfigurationError if it is invalid."""
        at = f"{where}.{name}"
        options = require_table(table, at)
        is_stack = "command" in options or "adapter" in options
        law = checked(options.pop("type", stack_law() if is_stack else name), str, at, "type")
        if is_stack and law == stack_law():
            options = _from_folder(options, folder)
        timing = from_table(RunTiming, options.pop("run", {}), f"{at}.run")
        return cls(name, law, options, folder, timing)

    @property
    def table(self) -> dict[str, Any]:
        """Law, options and timing, in the format of :meth:`from_table`."""
        table = {"type": self.law, **self.options}
        if self.run.changes:
            table["run"] = self.run.changes
        return table

    def changed(self, key: str, value: object) -> ControllerSpec:
        """Return a copy with another value of an option or of a key of ``run``.

        Raises the errors of :meth:`from_table`.
        """
        if key.partition(".")[0] != "run":
            return replace(self, options={**self.options, key: value})
        run = value
        if key != "run":
            run = {**self.run.changes, key.removeprefix("run."): value}
        return replace(self, run=from_table(RunTiming, run, f"{self.name}.run"))

    @classmethod
    def called(cls, law: str, name: str = "", folder: Path | None = None) -> ControllerSpec:
        """Return a controller by its registered name, ``module:Class`` or ``FILE.py:Class``.

        If ``name`` is empty, it gets the name of its class or its registered name. Raises
        ConfigurationError if the class has no name, or only that of another law of the package.
        """
        own = law
        if ":" in law:
            kind = controller_class(law, folder)
            own = getattr(kind, "name", "")
            if not (isinstance(own, str) and own):
                raise ConfigurationError(f'{law} has no name: write name = "…" in the class')
            if not name and registered_laws().get(own, kind) is not kind:
                raise ConfigurationError(
                    f"{law} has the name of a law of the package, {own!r}: write another name = "
                    f'"…" in the class'
                )
        return cls(name or own, law, folder=folder if ":" in law else None)

    @classmethod
    def of_stack(cls, command: str) -> ControllerSpec:
        """Return the stack with a command line; raises ConfigurationError if it is empty.

        Its name is that of :func:`.program_name`.
        """
        try:
            parts = shlex.split(command)
        except ValueError as error:
            raise ConfigurationError(f"--stack {command!r}: {error}") from error
        if not parts:
            raise ConfigurationError("--stack takes a command, such as 'python3 my_stack.py'")
        return cls.from_table(program_name(parts), {"command": parts}, "--stack", Path())

    @property
    def main_process_only(self) -> bool:
        """True if only the main process can create it."""
        return False

    @property
    def in_own_process(self) -> bool:
        """True for a custom law that another process can create: it runs in a separate process.

        A stack starts a process of its own in any case.
        """
        return ":" in self.law and not self.main_process_only and self.law != stack_law()

    @property
    def folder_of_neighbours(self) -> Path | None:
        """Folder of the modules that a custom controller may import at any time."""
        return folder_of_neighbours(self.law, self.folder)

    def importing_beside(self, folder: Path | None = None) -> AbstractContextManager[None]:
        """Allow imports of modules in a folder and beside the controller within the block.

        The folder is that of the scenario: its custom parts may import neighbours at any time, too.
        """
        return beside(folder, self.folder_of_neighbours)

    def run_limit(self, tables: Mapping[str, Any]) -> float:
        """Return the time limit of a run in a scenario [s], see :func:`.machine.run_limit`.

        A stack with a ``start_time`` may take that long for its declaration and its first answer.
        """
        start = self.options.get("start_time") if self.law == stack_law() else None
        return run_limit(tables) + 2.0 * (positive(start) or 0.0)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files in which a custom controller is defined, and those of a stack's command."""
        files = [*module_files([self.law], self.folder)]
        command = self.options.get("command")
        is_stack = ":" in self.law and self.law == stack_law()
        if is_stack and isinstance(command, list | tuple):
            for part in command:
                if isinstance(part, str) and isfile(part):
                    files.append(Path(part))
        return tuple(files)

    def make(self) -> Controller:
        """Create a controller; raises ConfigurationError or InvalidInput that names the cause."""
        return make_controller(self.law, self.options, self.folder)


def stack_law() -> str:
    """Return the controller that runs a program in a separate process, as ``module:Class``.

    A table with one of the keys ``command`` and ``adapter``, and no type, is of this type.
    """
    return str(registered("controllers")["stack"])


def _from_folder(options: dict[str, Any], folder: Path | None) -> dict[str, Any]:
    """Return options of a stack, with files of its command relative to the folder made absolute."""

    def found(part: object) -> object:
        if not isinstance(part, str):
            return part
        path = (folder or Path()) / part
        return str(path.absolute()) if isfile(path) else part

    changed = dict(options)
    if isinstance(changed.get("command"), list):
        changed["command"] = [found(part) for part in changed["command"]]
    if "python" in changed:
        changed["python"] = found(changed["python"])
    return changed


def prepare_laws(laws: Iterable[ControllerSpec]) -> None:
    """Compile or load the kernels that simulations of these laws need.

    No code of custom laws is run.
    """
    kernels: set[str] = set()
    for law in laws:
        if ":" not in law.law:
            kernels.update(law.make().kernels)
    prepare(*sorted(kernels))


#: The unconstrained baseline, which defines the challenged rows of a scenario; every comparison
#: and every study runs it.
BASELINE = "tracking"

SLIDING_MODE = ControllerSpec("sliding-mode")


@dataclass(frozen=True, eq=False)
class RunSpec:
    """One run: a scenario or the name of a shipped one, a controller and a trial.

    Specifications are equal if their results are. ``overrides`` are dotted keys of the scenario
    with other values. ``trial`` and ``seed`` determine the start. ``may_end_early`` is True if the
    run is expected to fail or to be aborted.
    """

    scenario: Scenario | str
    controller: ControllerSpec = SLIDING_MODE
    overrides: Mapping[str, Any] = field(default_factory=dict)
    trial: int = 0
    seed: int = 0
    may_end_early: bool = False

    @property
    def name(self) -> str:
        """Name of the scenario."""
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
    def _key(self) -> str:
        scenario = (
            self.scenario if isinstance(self.scenario, str) else (self.name, self.scenario.tables)
        )
        parts = scenario, self.overrides, self.controller.table, self.trial, self.seed
        return json.dumps(parts, sort_keys=True, default=str)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RunSpec) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def load(self) -> Scenario:
        """Return the scenario with its overrides; raises ConfigurationError if unknown."""
        scenario = Scenario.load(self.scenario) if isinstance(self.scenario, str) else self.scenario
        for key, value in self.overrides.items():
            scenario = scenario.with_override(key, value)
        return scenario

    @property
    def tables(self) -> dict[str, Any]:
        """Tables of the scenario; empty if it does not exist, which raises when it is run."""
        try:
            return self.load().tables
        except VsconstraintsError:
            return {}

    @property
    def has_own_parts(self) -> bool:
        """True if the law or a part of the scenario is custom."""
        return ":" in self.controller.law or bool(self.load().own_parts)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the run names: custom modules, URDF, meshes, SRDF."""
        return (*self.load().files, *self.controller.files)

    @property
    def main_process_only(self) -> bool:
        """True if only the main process can execute the run."""
        return self.controller.main_process_only or self.load().in_session

    @property
    def identity(self) -> Identity:
        """Everything that the run depends on, except the content of files, which records hold."""
        tables = self.tables
        return identity(
            [self.controller],
            with_files=False,
            scenario=scene_identity(tables) if tables else str(self),
            trial=self.trial,
            seed=self.seed,
        )

    @property
    def fingerprint(self) -> str:
        """Hash of the run's identity, without the controller's name: equal runs have equal ones."""
        content = self.identity
        content["controllers"] = list(content["controllers"].values())
        text = json.dumps(content, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def longest_first(runs: Iterable[RunSpec]) -> dict[RunSpec, float]:
    """Return the distinct runs, the longest first, with their time limits [s].

    No long run is thus started last.
    """
    limits = {run: run.controller.run_limit(run.tables) for run in dict.fromkeys(runs)}
    in_order = sorted(limits, key=limits.__getitem__, reverse=True)
    return {run: limits[run] for run in in_order}
