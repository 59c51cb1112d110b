"""One run of a comparison, and what its stored result must have been made from to stand for it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__
from ..controllers import make_controller
from ..controllers.base import Controller
from ..kernels import available
from ..plugins import module_files
from ..provenance import digests
from ..scenarios import Scenario
from .code import code_hash, packages
from .record import RunRecord, run_file

BASELINE = "tracking"
"""The controller that tells which rows a scenario challenges; every comparison runs it."""


@dataclass(frozen=True)
class Entry:
    """A controller as a suite names it.

    Attributes
    ----------
    name
        What results call it.
    law
        Registered name of the controller.
    options
        What it is made with.
    folder
        Where the module of an own controller is looked for first.
    """

    name: str
    law: str
    options: dict[str, Any] = field(default_factory=dict)
    folder: Path | None = None

    def controller(self) -> Controller:
        """A new controller; raises ConfigurationError or InvalidInput that names what is wrong."""
        return make_controller(self.law, self.options, self.folder)


@dataclass(frozen=True)
class Job:
    """One run: a scenario, a controller, a trial.

    Attributes
    ----------
    scenario, entry, trial, seed
        What is run.
    baseline
        Tracking alone, as the suite has it; None where it is not known.
    """

    scenario: Scenario
    entry: Entry
    trial: int
    seed: int
    baseline: Entry | None = None

    @property
    def key(self) -> tuple[str, str, int]:
        """Scenario, controller and trial, as results name them."""
        return self.scenario.name, self.entry.name, self.trial

    @property
    def has_own_parts(self) -> bool:
        """Whether controller or constraints are somebody's own."""
        return ":" in self.entry.law or bool(self.scenario.own_parts)

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are named for this run: own modules, URDF, meshes, SRDF."""
        return (*self.scenario.files, *module_files([self.entry.law], self.entry.folder))

    @property
    def fingerprint(self) -> str:
        """Identifies what is run but for the files it is made of: the code included, and whether it runs compiled."""
        what = (
            self.scenario.tables,
            self.entry.law,
            self.entry.options,
            self.trial,
            self.seed,
            __version__,
            code_hash(),
            packages(),
            available(),
        )
        return hashlib.sha256(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()[:16]

    def stored(self, folder: Path) -> RunRecord | None:
        """What a comparison's folder holds of this run; None unless all that it was made from is as it is now."""
        record = RunRecord.load(run_file(folder, *self.key))
        if record is None or record.fingerprint != self.fingerprint:
            return None
        now = digests((*record.files, *self.files))
        return record if now == record.files else None
