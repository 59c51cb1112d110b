"""What settings turned out to be worth, kept as soon as it is known, so that a tuning can be taken up again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..runs.files import storing
from .objectives import Judged

Setting = tuple[str, str]
"""A law's name, and its options as JSON."""


def setting_key(law: str, options: Mapping[str, Any]) -> Setting:
    """What a setting is known by."""
    return law, json.dumps(options, sort_keys=True)


class Journal:
    """A file with one line for each setting; a line that was being written when the process ended is left out.

    Parameters
    ----------
    path
        The file; begun if it is not there.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: dict[Setting, Judged] = {}
        whole = b""
        for line in path.read_bytes().splitlines(keepends=True) if path.is_file() else ():
            if not line.endswith(b"\n"):
                break
            entry = json.loads(line)
            values = {**entry["judged"], "point": tuple(entry["judged"]["point"])}
            self._known[entry["law"], entry["options"]] = Judged(**values)
            whole += line
        path.write_bytes(whole)

    def __contains__(self, setting: Setting) -> bool:
        return setting in self._known

    def __getitem__(self, setting: Setting) -> Judged:
        return self._known[setting]

    def add(self, setting: Setting, judged: Judged) -> None:
        """Keep what a setting is worth; raises StorageError if that cannot be written."""
        law, options = setting
        line = json.dumps({"law": law, "options": options, "judged": judged._asdict()})
        with storing("evaluations", self._path.parent), self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        self._known[setting] = judged
