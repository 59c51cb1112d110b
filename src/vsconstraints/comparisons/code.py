"""What results depend on besides a suite: the package's own source and the packages it stands on."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from .machine import package_versions


@cache
def packages() -> dict[str, str]:
    """Versions of the packages that results depend on."""
    return package_versions()


@cache
def code_hash() -> str:
    """Hash of the package's own source, so that results of other code are never taken for this one's."""
    digest = hashlib.sha256()
    package = Path(__file__).parent.parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
