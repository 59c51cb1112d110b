"""Scenario: the tables of a TOML file, ready to be overridden and built."""

from __future__ import annotations

import copy
import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError, VsconstraintsError, described, format_value
from ..plugins.classes import IN_SESSION, beside, code_named, module_files, untrusted
from ..robots.meshes import mesh_files, mesh_folders
from ..simulation import Setup
from .build import build
from .feature_types import without_replaced_feature
from .toml import file_named, merged, override, read_toml
from .views import without_replaced

SHIPPED = Path(__file__).parent  #: folder of the shipped scenarios
#: Folder of the shipped families, to tell whoever takes one for a scenario.
FAMILIES = SHIPPED.parent / "bench" / "families"
#: Keys whose values are paths, relative to the scenario's folder.
FILE_KEYS = ("urdf", "srdf", "file", "package_dirs", "calibration")

MAX_EXTENDED = 100  #: longest chain of files that extend one another


@cache
def shipped_scenarios() -> tuple[str, ...]:
    """Return the names of the shipped scenarios."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


@dataclass(frozen=True)
class Described:
    """Content of a scenario file.

    The name is the file's name without its ending. Paths in the tables are relative to ``folder``.
    Code that the tables name as ``module:Class`` may run only if ``trusted`` is true; it is false
    for tables that were read from results.
    """

    name: str
    tables: dict[str, Any]
    folder: Path = Path()
    trusted: bool = True

    @property
    def title(self) -> str:
        """Title for reports; the name if the file has no title."""
        return str(self.tables.get("title") or self.name)

    @property
    def description(self) -> str:
        """Description for reports, a few sentences."""
        return str(self.tables.get("description", "")).strip()


@dataclass(frozen=True, repr=False)
class Scenario(Described):
    """A scenario with its overrides applied."""

    why_here: ClassVar[str] = "a constraint or feature of it is defined in this session"
    """Reason why a scenario with :attr:`in_session` can run in this process only."""

    def __repr__(self) -> str:
        return f"<Scenario {self.name}: {format_value(self.title)}>"

    @classmethod
    def load(cls, name_or_path: str | Path, base: Path | None = None) -> Scenario:
        """Load a shipped scenario by name, ``"case-study-6r"``, or a TOML file by its path.

        The path is relative to ``base``. A file with ``extends = "…"``, a name or a path, states
        only the differences from that scenario: tables are merged, everything else is replaced.
        Paths in both files are relative to the extending file. Raises ConfigurationError if no
        scenario has that name or if the file cannot be read.
        """
        path = scenario_file(str(name_or_path), base)
        return cls(path.stem, extended_tables(path), path.parent)

    def with_override(self, key: str, value: object, base: Path | None = None) -> Scenario:
        """Return the scenario with a dotted key such as ``task.Kp0`` set to another value.

        Files in the value are relative to ``base``, or to the scenario's own folder if it is None.
        """
        tables = copy.deepcopy(self.tables)
        if base is not None:
            _, _, last = key.rpartition(".")
            value = _from_base(last, value, base)
        task = tables.get("task")
        if key.startswith("task.feature") and isinstance(task, dict):
            changed = {key.removeprefix("task."): value}
            tables["task"] = without_replaced_feature(task, changed)
        override(tables, key, value, self.name)
        return replace(self, tables=tables)

    @property
    def shipped(self) -> bool:
        """True if the scenario comes with the package."""
        return self.folder == SHIPPED

    @property
    def own_parts(self) -> tuple[str, ...]:
        """Custom constraints and features, as ``module:Class``."""
        constraints = self.tables.get("constraints", [])
        types = [str(table.get("type", "")) for table in constraints if isinstance(table, dict)]
        task = self.tables.get("task")
        features = {}
        if isinstance(task, dict):
            features = {key: task[key] for key in ("feature", "features") if key in task}
        return (*(name for name in types if ":" in name), *code_named(features))

    @property
    def in_session(self) -> bool:
        """True if a custom part is defined in this process only, such as in a notebook."""
        return any(part.startswith(f"{IN_SESSION}:") for part in self.own_parts)

    @property
    def files(self) -> tuple[Path, ...]:
        """Paths of the other files that the scenario depends on.

        These are the URDF and its meshes, the meshes of obstacles, the SRDF and custom modules.
        """
        files = []
        for text in _texts(self.tables):
            path = self.folder / text
            if _has_mode(path, stat.S_ISREG):
                files.append(path)
        folders = None
        robot = self.tables.get("robot")
        packages = robot.get("package_dirs") if isinstance(robot, dict) else None
        if isinstance(packages, list):
            folders = [self.folder / path for path in packages if isinstance(path, str)]
        meshes: list[Path] = []
        for file in files:
            if file.suffix.lower() in (".urdf", ".xml"):
                meshes += mesh_files(file, mesh_folders(file, folders, os.environ))
        modules = module_files(self.own_parts, self.folder) if self.trusted else []
        return (*files, *meshes, *modules)

    def setup(self, trial: int = 0, seed: int = 0) -> Setup:
        """Build the simulation setup.

        Trial 0 starts at the file's q0. Every other trial deviates from it by up to
        ``start_deviation`` [rad or m] in each joint. The deviation is drawn from the seed and the
        trial number, so it is the same for every controller. Raises VsconstraintsError if the setup
        cannot be built or if the scenario names code that is not trusted.
        """
        if not self.trusted:
            require_data(self.name, self.tables, self.folder)
        for what, number in (("trial", trial), ("seed", seed)):
            if number < 0 or number % 1:
                raise ConfigurationError(
                    f"{self.name}: a {what} is a whole number from 0 on, not {number}"
                )
        deviation = np.random.default_rng([seed, trial]) if trial > 0 else None
        try:
            folder = self.folder if self.trusted else None
            with beside(folder), np.errstate(over="raise", divide="raise", invalid="raise"):
                return build(self.tables, self.name, self.folder, deviation, (seed, trial))
        except VsconstraintsError as error:
            if re.search(rf"\b{re.escape(self.name)}\b", str(error)):
                raise
            raise type(error)(f"{self.name}: {error}") from error
        except ArithmeticError as error:
            raise ConfigurationError(
                f"{self.name}: computing with its numbers fails: {described(error)}"
            ) from error


def require_data(what: str, tables: dict[str, Any], folder: Path) -> None:
    """Raise ConfigurationError if building the tables would run code or read a special file.

    A special file is neither a regular file nor a folder, such as a device.
    """
    if code := list(code_named(tables)):
        raise untrusted(what, code)
    for text in _texts(tables):
        if _has_mode(folder / text, _is_special):
            raise ConfigurationError(
                f"{what} names {format_value(text)}, which is neither a file nor a folder"
            )


def _is_special(mode: int) -> bool:
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _has_mode(path: Path, test: Callable[[int], bool]) -> bool:
    """True if a path exists and the mode of its file passes a test."""
    with suppress(OSError, ValueError):  # the text is not a valid path
        return bool(test(path.stat().st_mode))
    return False


def _from_base(key: str, value: object, base: Path) -> object:
    """Return a value with its file paths, also in nested tables, resolved against ``base``."""
    if isinstance(value, str) and key in FILE_KEYS:
        return str(base.absolute() / value)
    if isinstance(value, dict):
        return {name: _from_base(name, inner, base) for name, inner in value.items()}
    if isinstance(value, list):
        return [_from_base(key, inner, base) for inner in value]
    return value


def scenario_file(name: str, base: Path | None) -> Path:
    """Return the path of a scenario by its name, or by a path relative to ``base``.

    Raises ConfigurationError if no scenario has that name; it tells if a family has.
    """
    try:
        return file_named("scenario", name, SHIPPED, shipped_scenarios(), base)
    except ConfigurationError as error:
        if name in {path.stem for path in FAMILIES.glob("*.toml")}:
            raise ConfigurationError(
                f"{error}. {name!r} is a family, from which scenes are drawn by a seed: extend it "
                "in the file of a family, or extend a scenario here (docs/families.md)"
            ) from error
        raise


def extended_tables(
    path: Path, file_of: Callable[[str, Path], Path] = scenario_file
) -> dict[str, Any]:
    """Return the tables of a file, merged over those of the files that it extends.

    ``file_of`` returns the path of an extended file from what ``extends`` says and the folder of
    the extending file.
    """
    files = [path]
    parts = [read_toml(path)]
    while "extends" in parts[-1]:
        name = parts[-1].pop("extends")
        last = files[-1]
        if not isinstance(name, str):
            raise ConfigurationError(
                f"{last}: extends must be the name or the path of a scenario, not "
                f"{format_value(name)}"
            )
        files.append(file_of(name, last.parent))
        parts.append(read_toml(files[-1]))
        if any(files[-1].samefile(other) for other in files[:-1]):
            raise ConfigurationError(
                f"scenarios extend each other in a circle: {' extends '.join(map(str, files))}"
            )
        if len(files) > MAX_EXTENDED:
            raise ConfigurationError(
                f"{path}: the chain of extends has more than {MAX_EXTENDED} files"
            )
    tables = parts.pop()
    for over in reversed(parts):
        for key, remaining in (("camera", without_replaced), ("task", without_replaced_feature)):
            under = tables.get(key)
            if isinstance(under, dict) and isinstance(over.get(key), dict):
                tables[key] = remaining(under, over[key])
        tables = merged(tables, over)
    return tables


def _texts(value: object) -> Iterator[str]:
    """Yield all texts in nested tables and lists, which may name files."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, (dict, list)):
        for inside in value.values() if isinstance(value, dict) else value:
            yield from _texts(inside)
