"""What settings turned out to be worth, kept as soon as it is known, so that a tuning can be taken up again."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError
from ..runs.files import storing
from .objectives import Judged

Setting = tuple[str, str]
"""A law's name, and its options as JSON."""


def setting_key(law: str, options: Mapping[str, Any]) -> Setting:
    """What a setting is known by."""
    return law, json.dumps(options, sort_keys=True)


class Journal:
    """A file with one line for each setting, each with a checksum.

    A last line without an end, which was being written when the process ended, is cut off. Nothing else that the file
    holds is ever written again, so that a full disk costs none of it.

    Parameters
    ----------
    path
        The file; begun if it is not there.

    Raises
    ------
    ConfigurationError
        if a whole line is damaged; it names the line.
    StorageError
        if the file cannot be begun, or its last line cannot be cut off.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Setting, Judged] = {}
        with storing("evaluations", path.parent):
            path.touch()
        data = path.read_bytes()
        *lines, rest = data.split(b"\n")
        for number, line in enumerate(lines, 1):
            try:
                setting, judged = _read(line)
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                raise ConfigurationError(
                    f"{path}, line {number} is damaged ({type(error).__name__}): delete it, and its setting is "
                    "evaluated again"
                ) from error
            self._known[setting] = judged
        if rest:
            with storing("evaluations", path.parent):
                os.truncate(path, len(data) - len(rest))

    def __contains__(self, setting: Setting) -> bool:
        return setting in self._known

    def __getitem__(self, setting: Setting) -> Judged:
        return self._known[setting]

    def add(self, setting: Setting, judged: Judged) -> None:
        """Keep what a setting is worth; raises StorageError if that cannot be written."""
        law, options = setting
        entry = {"law": law, "options": options, "judged": judged._asdict()}
        line = json.dumps({**entry, "checksum": _checksum(entry)})
        with storing("evaluations", self._path.parent), self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        self._known[setting] = judged


def _read(line: bytes) -> tuple[Setting, Judged]:
    """A line's setting and what it is worth; raises ValueError, TypeError or KeyError where it is damaged."""
    entry = dict(json.loads(line))
    if entry.pop("checksum") != _checksum(entry):
        raise ValueError("it is not what was written")
    judged = entry["judged"]
    return (entry["law"], entry["options"]), Judged(**{**judged, "point": tuple(judged["point"])})


def _checksum(entry: Mapping[str, Any]) -> int:
    return zlib.crc32(json.dumps(entry).encode())
