"""Runs that a command has finished while it has not finished itself: the same command, given again, takes them."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from .. import __version__
from ..errors import ConfigurationError
from ..kernels import available
from .code import code_hash, packages


@dataclass(frozen=True)
class Unfinished:
    """A folder with one file for each finished run.

    Attributes
    ----------
    folder
        Where.
    """

    folder: Path

    def file(self, *what: object) -> Path:
        """Where a run is kept; another file if anything that it is made of, the code included, is another."""
        state = (what, __version__, code_hash(), packages(), available())
        digest = hashlib.sha256(json.dumps(state, sort_keys=True, default=str).encode())
        return self.folder / f"{digest.hexdigest()[:32]}.npz"


@contextmanager
def unfinished(folder: Path | None) -> Iterator[Unfinished]:
    """The folder ``unfinished`` below a command's own; it goes when the block has been carried out to its end.

    Parameters
    ----------
    folder
        The command's; nothing is kept if None.

    Raises
    ------
    ConfigurationError
        if it cannot be made.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as temporary:
            yield Unfinished(Path(temporary))
        return
    kept = Unfinished(folder / "unfinished")
    try:
        kept.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"results cannot be written to {folder}: {error}") from error
    yield kept
    shutil.rmtree(kept.folder, ignore_errors=True)
