"""Journal file: one line of JSON with a checksum for each finished piece of work."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ...comparisons.runs.files import storing
from ...errors import ConfigurationError

#: What reading a damaged line raises.
DAMAGE = (ValueError, TypeError, KeyError, AttributeError, RecursionError)


class JournalFile:
    """File to which a line is added as soon as its content is known.

    An incomplete last line is cut off, and other lines are never changed. ``take`` is called with
    the content of each line that is there; it may raise one of :data:`DAMAGE`. ``what`` names the
    contents in messages.

    Raises ConfigurationError that names a damaged line, StorageError if the file cannot be written.
    """

    def __init__(self, path: Path, what: str, take: Callable[[dict[str, Any]], object]) -> None:
        self._path = path
        self._what = what
        with storing(what, path.parent):
            path.touch()
        data = path.read_bytes()
        *lines, incomplete = data.split(b"\n")
        for number, line in enumerate(lines, 1):
            try:
                entry = dict(json.loads(line))
                if entry.pop("checksum") != _checksum(entry):
                    raise ValueError("it differs from what was written")
                take(entry)
            except DAMAGE as error:
                where = f"{path}, line {number} is damaged ({type(error).__name__})"
                raise ConfigurationError(
                    f"{where}: delete this line to make its runs again"
                ) from error
        if incomplete:
            with storing(what, path.parent):
                os.truncate(path, len(data) - len(incomplete))

    def add(self, entry: Mapping[str, Any]) -> None:
        """Add a line. Raises StorageError if it cannot be written."""
        line = json.dumps({**entry, "checksum": _checksum(entry)})
        with storing(self._what, self._path.parent), self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def _checksum(entry: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(entry).encode())
