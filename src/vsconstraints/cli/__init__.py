"""Command line: ``vsconstraints compare``, ``preview``, ``run``, ``report`` and more."""

from __future__ import annotations

import gc
import sys
from io import TextIOWrapper
from typing import TYPE_CHECKING

from ..errors import StorageError, VsconstraintsError, WorkersLost
from ..plugins.lazy import exported
from ..plugins.processes import INTERRUPTS, exit_code, obey_signals, signal_of
from .terminal import NOTHING_DONE, USAGE_ERROR, errors

if TYPE_CHECKING:
    from .application import app

__all__ = ["app", "main"]
# the application imports all commands, and these import modules of this package
__getattr__, __dir__ = exported(__name__, {"app": "application"})


def main() -> None:
    """Run the command line.

    Errors of this package and of the system end it with one line, see ``docs/trust.md``.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # names and paths may contain characters that the terminal's encoding lacks
            stream.reconfigure(errors="backslashreplace")
    obey_signals()
    try:
        from .application import app

        app()
    except (VsconstraintsError, OSError) as error:
        errors.print(f"error: {' '.join(str(error).splitlines())}")
        sys.exit(NOTHING_DONE if isinstance(error, StorageError | WorkersLost) else USAGE_ERROR)
    except INTERRUPTS as interrupt:
        errors.print("Interrupted.")
        sys.exit(exit_code(signal_of(interrupt)))
    finally:
        # garbage collection of all loaded objects would make the exit ten times as long
        gc.freeze()
