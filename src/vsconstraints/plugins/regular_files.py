"""Files that users name: read as a whole, unless they are none, such as pipes and devices, or too
large.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

MAX_BYTES = 100_000_000  #: Of a file that is read as a whole.
PIECE = 1_000_000  # bytes that are read at once: memory is taken for what is there


def demand_regular(path: str | Path) -> None:
    """Raise OSError unless there is a regular file: reading a pipe or a device may never end."""
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(f"it is a folder, not a file: {str(path)!r}")
    if not stat.S_ISREG(mode):
        raise OSError(f"it is a pipe, a device or a socket, not a regular file: {str(path)!r}")


def read_regular(path: str | Path, most: int = MAX_BYTES) -> bytes:
    """Return what a regular file holds; raises OSError if it is none, cannot be read, or has more
    than ``most`` bytes.

    It is opened only after it has been looked at, since opening a pipe waits for whoever writes to
    it.
    """
    demand_regular(path)
    content = bytearray()
    with open(path, "rb") as file:
        while piece := file.read(PIECE):
            content += piece
            if len(content) > most:
                raise OSError(f"it has more than {most / 1e6:g} MB: {str(path)!r}")
    return bytes(content)
