"""Runs of the paper's commands, kept in their folder until the command has finished."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..comparisons.record import RunRecord
from ..comparisons.run import Run, perform
from ..comparisons.runs.folder import make_folder
from ..comparisons.runs.spec import RunSpec


def kept_run(spec: RunSpec, file: Path) -> Run:
    """Load a run from a file, or execute it and save it there; raises as :func:`.perform`."""
    record = RunRecord.load(file)
    if record is not None:
        return Run(spec.controller.run.of(spec.load().setup(spec.trial, spec.seed)), record)
    run = perform(spec)
    with suppress(OSError):  # the run is complete; the command just cannot resume from it
        run.record.save(file)
    return run


def kept_file(folder: Path, spec: RunSpec, what: str = "record") -> Path:
    """Return the path where data of a run is kept.

    The path changes if anything that the run depends on has changed, including the code.
    """
    return folder / f"{spec.fingerprint}-{what}.npz"


@contextmanager
def unfinished(folder: Path | None) -> Iterator[Path]:
    """Provide the folder ``unfinished`` below a command's folder, until the block completes.

    After an error it is kept. If ``folder`` is None, a temporary folder is used. Raises
    ConfigurationError if the folder cannot be created.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as temporary:
            yield Path(temporary)
        return
    kept = folder / "unfinished"
    make_folder(kept)
    yield kept
    shutil.rmtree(kept, ignore_errors=True)
