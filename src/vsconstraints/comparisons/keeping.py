"""Removes trajectories of a comparison that are not to be kept, when its report has been made of them."""

from __future__ import annotations

from pathlib import Path

from ..errors import StorageError
from .folder import ON_ARM, stored_files
from .metrics import RESULT_COLUMNS
from .record import run_file
from .runs.checksums import seal
from .runs.keep import Keep, Kinds, kept_lines
from .tables import read_table

KINDS = Kinds(("scenario", "controller"), "trial", "scenario")


def keep_trajectories(folder: Path, keep: Keep) -> int:
    """Remove the trajectories of all other runs of a stored comparison; how many stay.

    The same command makes those runs again: it keeps what it makes until its report is written. What an arm has done
    stays, since no command makes it again.

    Raises
    ------
    ConfigurationError
        if there is no comparison in the folder.
    StorageError
        if a trajectory cannot be removed.
    """
    lines = read_table(folder / "results.csv", RESULT_COLUMNS)
    driven = [line for line in lines if ON_ARM.match(line["reason"])]
    files = {
        run_file(folder, line["scenario"], line["controller"], int(line["trial"]))
        for line in (*kept_lines(lines, keep, KINDS), *driven)
    }
    stored = set((folder / "trajectories").glob("*.npz"))
    try:
        for path in stored - files:
            path.unlink(missing_ok=True)
        seal(folder, stored_files(folder))
    except OSError as error:
        raise StorageError(f"trajectories that are not to be kept stay in {folder}: {error}") from error
    return len(stored & files)
