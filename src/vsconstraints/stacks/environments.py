"""``python -m vsconstraints.stacks.environments FOLDER [ADAPTER]...``: environments of adapters.

Each adapter states its packages at its top, as inline script metadata (PEP 723). This command makes
a virtual environment with them below the folder, by the name of the adapter, and keeps those that
exist. Without names it makes all of them; they take up to 1 GB each.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import venv
from collections.abc import Sequence
from pathlib import Path

from ..errors import unknown_name
from .external import ADAPTERS, adapters


def requirements(adapter: str) -> list[str]:
    """Return the packages that an adapter states; raises ConfigurationError if it is unknown."""
    if adapter not in adapters():
        raise unknown_name("adapter", adapter, adapters())
    text = (ADAPTERS / f"{adapter}_stack.py").read_text(encoding="utf-8")
    block = re.search(r"^# /// script\n((?:#.*\n)*?)# ///$", text, re.MULTILINE)
    assert block is not None
    table = tomllib.loads(re.sub(r"^# ?", "", block[1], flags=re.MULTILINE))
    return list(map(str, table["dependencies"]))


def interpreter(folder: Path, adapter: str) -> Path:
    """Return the path of the interpreter of an adapter's environment below a folder."""
    return folder / adapter / "bin" / "python"


def make_environment(folder: Path, adapter: str) -> Path:
    """Make the environment of an adapter, unless it exists, and return its interpreter.

    Raises CalledProcessError if its packages cannot be installed, and ConfigurationError if the
    adapter is unknown.
    """
    packages = requirements(adapter)
    python = interpreter(folder, adapter)
    if not python.exists():
        venv.create(folder / adapter, with_pip=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", *packages], check=True)
    return python


def main(arguments: Sequence[str]) -> int:
    """Run the command with these arguments, and return its exit code."""
    if not arguments:
        print(__doc__)
        return 2
    for adapter in arguments[1:] or adapters():
        print(f"{adapter}: {make_environment(Path(arguments[0]), adapter)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
