"""A process that ends itself when something takes too long, also where compiled code keeps the interpreter busy."""

from __future__ import annotations

import faulthandler
import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def process_ends_after(limit: float | None) -> Iterator[None]:
    """End this process if what is done meanwhile takes longer [s]; never if None. One at a time in a process."""
    if limit is None:
        yield
        return
    with open(os.devnull, "w") as nowhere:
        faulthandler.dump_traceback_later(limit, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
