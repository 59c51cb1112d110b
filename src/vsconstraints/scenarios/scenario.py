"""A scenario: the tables of a TOML file, ready to be changed and built."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigurationError, unknown_name
from ..plugins import plugin_files
from ..rows import Array
from ..simulation import Setup
from .build import build
from .section import override, read_toml

SHIPPED = Path(__file__).parent
"""Folder of the scenarios that come with the package."""


@cache
def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


@dataclass(frozen=True)
class Scenario:
    """One scenario.

    Attributes
    ----------
    name
        The file's name without its ending.
    tables
        What the file says, overrides applied.
    folder
        What paths in it are relative to.
    """

    name: str
    tables: dict[str, Any]
    folder: Path

    @classmethod
    def load(cls, name_or_path: str | Path, base: Path | None = None) -> Scenario:
        """A shipped scenario by its name, or one from a TOML file by its path.

        Parameters
        ----------
        name_or_path
            ``"case-study-6r"`` or ``"my/scenario.toml"``. A file with ``extends = "…"``, a name or a path, says only
            what is different there: tables are merged, everything else is replaced. Paths in both are relative to it.
        base
            Folder that a relative path starts from; the current one if None.

        Raises
        ------
        ConfigurationError
            if there is none of that name, or the file cannot be read.
        """
        path = _file(str(name_or_path), base)
        return cls(path.stem, _tables(path, ()), path.parent)

    def with_override(self, key: str, value: object) -> Scenario:
        """The same scenario with a dotted key such as ``task.Kp0`` set to another value."""
        tables = copy.deepcopy(self.tables)
        override(tables, key, value, self.name)
        return Scenario(self.name, tables, self.folder)

    @property
    def shipped(self) -> bool:
        """Whether it comes with the package."""
        return self.folder == SHIPPED

    @property
    def title(self) -> str:
        """Title for reports; the name if the file has none."""
        return str(self.tables.get("title") or self.name)

    @property
    def description(self) -> str:
        """A few sentences for reports."""
        return str(self.tables.get("description", "")).strip()

    @property
    def files(self) -> tuple[Path, ...]:
        """Files besides its own that the scenario is made of: the robot's URDF and own modules."""
        robot = self.tables.get("robot")
        urdf = robot.get("urdf") if isinstance(robot, dict) else None
        constraints = self.tables.get("constraints", [])
        kinds = [str(table.get("type", "")) for table in constraints if isinstance(table, dict)]
        found = [self.folder / urdf] if isinstance(urdf, str) else []
        return (*found, *plugin_files(kinds, self.folder))

    def setup(self, trial: int = 0, seed: int = 0) -> Setup:
        """What is simulated.

        Trial 0 starts at the file's q0; every other trial deviates from it by up to ``start_deviation`` [rad or m]
        in each joint, drawn from the seed and the trial's number and so the same for every controller.
        """
        deviation: Array | None = None
        if trial > 0:
            deviation = np.random.default_rng([seed, trial]).uniform(-1.0, 1.0, 64)
        return build(self.tables, self.name, self.folder, deviation, (seed, trial))


def _file(name: str, base: Path | None) -> Path:
    if name.endswith(".toml"):
        return (base or Path()) / name
    if name not in shipped_scenarios():
        raise unknown_name("scenario", name, [*shipped_scenarios(), "a path ending in .toml"])
    return SHIPPED / f"{name}.toml"


def _tables(path: Path, below: tuple[Path, ...]) -> dict[str, Any]:
    """What a file says, over what the one that it extends says."""
    if path in below:
        circle = " extends ".join(str(file) for file in (*below, path))
        raise ConfigurationError(f"scenarios extend each other in a circle: {circle}")
    tables = read_toml(path)
    if "extends" not in tables:
        return tables
    name = tables.pop("extends")
    if not isinstance(name, str):
        raise ConfigurationError(f"{path}: extends must be the name or the path of a scenario, not {name!r}")
    other = _tables(_file(name, path.parent), (*below, path))
    return _merged(other, tables)


def _merged(under: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Tables over others: tables in them are merged, everything else is replaced."""
    merged = dict(under)
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merged(merged[key], value) if both else value
    return merged
