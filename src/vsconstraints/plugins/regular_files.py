"""Files named by users, which are read whole; pipes, devices and large files are refused."""

from __future__ import annotations

import os
import stat
from pathlib import Path

MAX_BYTES = 100_000_000  #: Maximum size of a file that is read whole.
PIECE = 1_000_000  # bytes read at once, so that memory is allocated only for existing data


def require_regular(path: str | Path) -> None:
    """Raise OSError unless a path is a regular file: reading a pipe or a device may never end."""
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(f"it is a folder, not a file: {str(path)!r}")
    if not stat.S_ISREG(mode):
        raise OSError(f"it is a pipe, a device or a socket, not a regular file: {str(path)!r}")


def read_regular(path: str | Path, most: int = MAX_BYTES) -> bytes:
    """Return the content of a regular file.

    Raises OSError if it is not a regular file, cannot be read, or has more than ``most`` bytes. The
    type is checked before opening, because opening a pipe waits for its writer.
    """
    require_regular(path)
    content = bytearray()
    with open(path, "rb") as file:
        while piece := file.read(PIECE):
            content += piece
            if len(content) > most:
                raise OSError(f"it has more than {most / 1e6:g} MB: {str(path)!r}")
    return bytes(content)
