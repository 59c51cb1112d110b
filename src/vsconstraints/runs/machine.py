"""What results depend on besides what is run: the machine, the packages, and this package's own source."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from .. import __version__

PACKAGES = (
    "numpy",
    "scipy",
    "pin",
    "coal",
    "numba",
    "qpsolvers",
    "daqp",
    "proxsuite",
    "osqp",
    "quadprog",
    "example-robot-data",
    "matplotlib",
)


def machine() -> dict[str, str | int]:
    """Processor, cores, system and Python."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "system": f"{platform.system()} {platform.machine()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }


@cache
def code_hash() -> str:
    """Hash of the package's own source, so that results of other code are never taken for this one's."""
    digest = hashlib.sha256()
    package = Path(__file__).parent.parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


@cache
def package_versions() -> dict[str, str]:
    """Versions of the packages that results can depend on, as installed."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def made_by(command: Sequence[str]) -> dict[str, Any]:
    """What a manifest says of how results are made, by a command as it was typed, now."""
    return {
        "version": __version__,
        "git_commit": git_commit(),
        "code": code_hash()[:16],
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "packages": package_versions(),
    }


def git_commit() -> str:
    """Commit of the package's source, with ``+`` if it was changed; empty where it is not in a git checkout."""
    # an installed copy can lie inside the checkout of another project: only where git knows this file it is its commit
    if _git("ls-files", "--error-unmatch", Path(__file__).name) is None:
        return ""
    return _git("describe", "--always", "--abbrev=12", "--dirty=+", "--exclude=*") or ""


def _git(*arguments: str) -> str | None:
    folder = Path(__file__).parent
    try:
        answer = subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, timeout=5, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return answer.stdout.strip() if answer.returncode == 0 else None


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
