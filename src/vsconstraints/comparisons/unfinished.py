"""Runs that a command has finished while it has not finished itself: the same command, given again, takes them."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import ConfigurationError
from .runs.spec import RunSpec


def kept_file(folder: Path, spec: RunSpec, what: str = "record") -> Path:
    """Where something of a run is kept; another file if anything it is made of, the code included, is another."""
    return folder / f"{spec.fingerprint}-{what}.npz"


@contextmanager
def unfinished(folder: Path | None) -> Iterator[Path]:
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
            yield Path(temporary)
        return
    kept = folder / "unfinished"
    try:
        kept.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f"results cannot be written to {folder}: {error}") from error
    yield kept
    shutil.rmtree(kept, ignore_errors=True)
