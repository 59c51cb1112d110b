"""Machine, package versions and source of this package: dependencies of results besides the run."""

from __future__ import annotations

import hashlib
import math
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib import import_module
from importlib.machinery import all_suffixes
from importlib.metadata import PackageNotFoundError, distributions, requires, version
from pathlib import Path
from typing import Any

from ...compiled import available
from ...plugins.extras import EXTRAS

VERSION = version("vsconstraints")
# required packages that no result depends on
OUTPUT_ONLY = ("markdown-it-py", "matplotlib", "rich", "typer")
OPTIONAL = ("quadprog",)  # used if installed

# memory of a simulating process [bytes]: interpreter, Pinocchio, compiler and a trajectory
PROCESS_MEMORY = 300e6

# time limit of a run, which may have to compile, and of each sample [s]
MIN_LIMIT = 120.0
LIMIT_PER_SAMPLE = 0.1


def machine() -> dict[str, str | int]:
    """Return processor, number of cores, system and Python."""
    processor = _field("/proc/cpuinfo", "model name") or platform.processor() or platform.machine()
    system = f"{platform.system()} {platform.machine()}"
    return {
        "processor": processor,
        "cores": os.cpu_count() or 0,
        "system": system,
        "python": python_version(),
    }


def python_version() -> str:
    """Return implementation and version of Python."""
    return f"{platform.python_implementation()} {platform.python_version()}"


@cache
def code_hash() -> str:
    """Return a hash of this package's source, which separates results of different code."""
    digest = hashlib.sha256()
    package = Path(__file__).parents[2]
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


@cache
def package_versions() -> dict[str, str]:
    """Return the versions of Python and of all required packages that results can depend on.

    Optional packages: :func:`used_versions`.
    """
    names = {*_required("vsconstraints"), *OPTIONAL}.difference(OUTPUT_ONLY)
    return {"Python": python_version(), **{name: _version(name) for name in sorted(names)}}


def used_versions(tables: Mapping[str, Any]) -> dict[str, str]:
    """Return the versions of the optional packages that tables use; these packages are loaded.

    The tables are those of a scenario, a family or a law's options.
    """
    used: dict[str, str] = {}
    for key, value in tables.items():
        if key == "sensor":
            used |= module_versions(EXTRAS["images"].modules)
        elif key == "solver":
            used |= {name: _version(name) for name in _required("qpsolvers", str(value))}
        elif key == "type" and "mujoco" in str(value):  # a family may list several types
            used |= module_versions(EXTRAS["physics"].modules)
        if isinstance(value, Mapping):
            used |= used_versions(value)
    return used


def module_versions(modules: Iterable[str]) -> dict[str, str]:
    """Return versions of modules by name, see :func:`module_version`."""
    return {name: module_version(name) for name in modules}


def module_version(name: str) -> str:
    """Load a module and return the name of its distribution and its version."""
    try:
        module = import_module(name)
    except ImportError:
        return "not installed"
    owner = _owners().get(os.path.abspath(module.__file__ or ""))
    return " ".join(owner) if owner else str(getattr(module, "__version__", "of no known version"))


def loaded_versions() -> dict[str, str]:
    """Return versions of all distributions from which this process has loaded a module.

    Those that custom parts use are included.
    """
    owners = _owners()
    loaded = set()
    for module in list(sys.modules.values()):
        file = getattr(module, "__dict__", {}).get("__file__")
        if isinstance(file, str) and file in owners:
            loaded.add(owners[file])
    return dict(sorted(loaded))


@cache
def _owners() -> dict[str, tuple[str, str]]:
    """Map the file of every installed module to the name and version of its distribution."""
    owners = {}
    modules = tuple(all_suffixes())
    for distribution in distributions():
        # called once per distribution: calling it per file took 17 s
        folder = str(distribution.locate_file(""))
        owner = (distribution.name, distribution.version)
        record = distribution.read_text("RECORD") or ""
        for line in record.splitlines():
            file, _, _ = line.partition(",")
            if file.endswith(modules):
                owners[os.path.join(folder, file)] = owner
    return owners


@cache
def _required(name: str, extra: str = "") -> tuple[str, ...]:
    """Return the names of the packages that a package, or one of its extras, requires."""
    lines = [
        re.match(r"([\w.-]+)(?:.*extra == ['\"](.+?)['\"])?", line) for line in requires(name) or ()
    ]
    return tuple(line[1] for line in lines if line and (line[2] or "") == extra)


def _version(name: str) -> str:
    with suppress(PackageNotFoundError):
        return version(name)
    return "not installed"


def code_identity() -> dict[str, Any]:
    """Return source and versions that all results can depend on.

    These are the versions of this package, of Python and of the required packages, the hash of the
    source, and a flag that is True if runs are compiled.
    """
    return {
        "version": VERSION,
        "code": code_hash()[:16],
        "compiled": available(),
        "packages": package_versions(),
    }


def new_manifest(
    command: Sequence[str], configuration: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the manifest of results before their first run.

    It holds version, command as typed, machine and packages; with a ``configuration`` also that,
    its seed, and the versions of the optional packages that it uses.
    """
    settings = {}
    if configuration is not None:
        settings = {"seed": configuration["seed"], "configuration": configuration}
    return {
        "version": VERSION,
        "git_commit": git_commit(),
        "code": code_hash()[:16],
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "packages": {**package_versions(), **used_versions(configuration or {})},
        **settings,
    }


def git_commit() -> str:
    """Return the git commit of the package's source, with ``+`` if it was changed.

    The text is empty outside a git checkout.
    """

    def git(*arguments: str) -> str:
        folder = Path(__file__).parent
        command = ["git", *arguments]
        try:
            return subprocess.run(
                command, cwd=folder, capture_output=True, text=True, timeout=5, check=True
            ).stdout
        except (OSError, subprocess.SubprocessError):
            return ""

    # an installed copy can lie inside the checkout of another project: the commit is only valid
    # if git tracks this file
    known = git("ls-files", "--error-unmatch", Path(__file__).name)
    if not known:
        return ""
    return git("describe", "--always", "--abbrev=12", "--dirty=+", "--exclude=*").strip()


def _field(path: str, name: str) -> str:
    with suppress(OSError):
        text = Path(path).read_text(encoding="utf-8")
        for line in text.splitlines():
            if line.startswith(name):
                return line.partition(":")[2].strip()
    return ""


def cores() -> int:
    """Return the number of cores that this process may use.

    Only Linux reports a limit; elsewhere it is the number of all cores.
    """
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def process_count(asked: int | None = None) -> int:
    """Return the number of processes to use: as requested, or as many as possible if None.

    It is limited by cores and memory, and at least 1.
    """
    most = min(cores(), int(available_memory() // PROCESS_MEMORY))
    return max(1, min(asked or most, most))


def available_memory() -> float:
    """Return the memory available without swapping [bytes].

    If the system does not report it, return all memory.
    """
    if available := _field("/proc/meminfo", "MemAvailable:"):
        return 1024.0 * float(available.split()[0])
    return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))


def most_samples(tables: Mapping[str, Any]) -> float:
    """Return the maximum number of samples of a run of a scenario; inf if its tables are invalid.

    It allows for three durations until the run settles, a law that is called four times as often,
    and the stop of an arm.
    """
    return 1000.0 + 16.0 * _samples(tables, math.inf)


def run_limit(tables: Mapping[str, Any]) -> float:
    """Return the time limit of a run [s], from the duration and sampling time of its scenario."""
    # invalid values are reported when the scenario is built
    return MIN_LIMIT + LIMIT_PER_SAMPLE * _samples(tables, 0.0)


def _samples(tables: Mapping[str, Any], otherwise: float) -> float:
    try:
        return float(tables["duration"]) / float(tables["sampling_time"])
    except (KeyError, TypeError, ValueError, ArithmeticError):
        return otherwise
