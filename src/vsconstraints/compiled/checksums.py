"""Checksums stored beside compiled files.

A process that runs damaged machine code ends at once, without an error. A file without a checksum
was not completely written. Both kinds of files are removed, so that they are compiled again.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

SUFFIX = ".sha256"  #: Suffix added to a file's name.


def sum_file(file: Path) -> Path:
    """Return the file that holds the checksum of a file."""
    return file.with_name(file.name + SUFFIX)


def _sum_of(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def written_sum(file: Path) -> str:
    """Return the checksum that is written beside a file. Raises OSError."""
    return sum_file(file).read_text("ascii", "replace")


def _is_intact(file: Path) -> bool:
    """True if a file has its checksum; False if one of them cannot be read."""
    try:
        return _sum_of(file) == written_sum(file)
    except OSError:
        return False


def _is_sealed(file: Path) -> bool:
    """True if a file has not been written since its checksum was."""
    try:
        return file.stat().st_mtime_ns <= sum_file(file).stat().st_mtime_ns
    except OSError:
        return False


def remove_damaged(files: Sequence[Path]) -> None:
    """Remove the files of one function unless all are intact.

    If a file is damaged, a note is printed to stderr.
    """
    sums = [sum_file(file) for file in files]
    if all(written.is_file() for written in sums):
        damaged = [file for file in files if not _is_intact(file)]
        if not damaged:
            return
        note = f"vsconstraints: {damaged[0]} is damaged and compiled again"
        print(note, file=sys.stderr, flush=True)
    for file in files:
        file.unlink(missing_ok=True)  # an error is raised: a damaged file must not be run
    for written in sums:
        with suppress(OSError):
            written.unlink(missing_ok=True)


def seal(files: Sequence[Path]) -> None:
    """Write the checksums of files that have none, or were written again after theirs.

    If they cannot be written, the files are compiled again next time.
    """
    for file in files:
        if not _is_sealed(file):
            written = sum_file(file)
            part = written.with_name(f"{written.name}.{os.getpid()}")
            with suppress(OSError):
                part.write_text(_sum_of(file), "ascii")
                part.replace(written)
