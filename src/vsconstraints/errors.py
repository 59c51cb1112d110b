"""Errors that state the problem, its place, and the remedy."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path

MAX_VALUE_LENGTH = 200  #: Characters of a value that a message shows.
MAX_LISTED = 10  #: Number of similar problems that a message names.
MAX_REASON_LENGTH = 2000  #: Characters of a reason that are kept.


class VsconstraintsError(Exception):
    """Base class of all errors that this package raises on purpose."""


class ConfigurationError(VsconstraintsError, ValueError):
    """A scenario, suite, option or argument cannot be used as given."""


class FolderTaken(ConfigurationError):
    """A folder contains other results, which would be lost.

    ``problem`` names these results. The message also contains advice for the command line; a
    session gives other advice, since it has no options.
    """

    def __init__(self, message: str, problem: str = "") -> None:
        super().__init__(message)
        self.problem = problem


class InvalidInput(VsconstraintsError, ValueError):
    """An array has a wrong shape or contains a number that is not finite."""


class SceneError(VsconstraintsError):
    """The scene cannot be evaluated: for example, a marker is not in front of the camera."""


class SolverError(VsconstraintsError):
    """No QP solver returned a solution that passes the check."""


class WorkersLost(VsconstraintsError):
    """The workers that execute the runs are lost: for example, the scheduler of a cluster."""


class StorageError(VsconstraintsError):
    """Results cannot be written: for example, the disk is full."""


class CalibrationWarning(UserWarning):
    """A calibration is usable, but some numbers suggest another lens or image size."""


def unknown_name(what: str, name: object, candidates: Iterable[str]) -> ConfigurationError:
    """Return the error for an unknown name, which lists the candidates and suggests the closest.

    Parameters
    ----------
    what
        Kind of object that was looked up, for example ``"scenario"``.
    name
        The given name.
    candidates
        The accepted names.
    """
    known = sorted(candidates)
    close = get_close_matches(str(name)[:MAX_VALUE_LENGTH], known, n=1)
    hint = f" Did you mean {close[0]!r}?" if close else ""
    return ConfigurationError(
        f"unknown {what} {format_value(name)}.{hint} Available: {', '.join(known) or 'none'}"
    )


def format_value(value: object) -> str:
    """Format a value for messages: 0.0 instead of np.float64(0.0), and cut if it is long."""
    import numpy as np  # takes longer than the rest of `vsconstraints --help`

    with np.printoptions(legacy="1.25"):
        text = repr(value)
    return (
        text
        if len(text) <= MAX_VALUE_LENGTH
        else f"{text[:MAX_VALUE_LENGTH]}… ({len(text)} characters)"
    )


def listed(texts: Sequence[str], what: str, most: int = MAX_LISTED) -> list[str]:
    """Return the first of many texts, followed by one that counts the remaining ``what``."""
    more = len(texts) - most
    return [*texts[:most], f"… and {more:,} more {what}"] if more > 0 else list(texts)


def encodable(text: str) -> str:
    """Return a text that UTF-8 can encode: other characters become backslash escapes."""
    return text.encode("utf-8", "backslashreplace").decode()


def one_line(text: str, most: int = MAX_REASON_LENGTH) -> str:
    """Return a text as one line that any file and terminal accepts.

    Line breaks and characters that cannot be printed become spaces: an escape sequence would
    otherwise control the terminal. The line is cut after ``most`` characters.
    """
    # cut twice: the first cut limits the work
    lines = " ".join(encodable(text[: 2 * most]).splitlines())
    line = "".join(letter if letter.isprintable() else " " for letter in lines).strip()
    return line if len(line) <= most else f"{line[:most]}… ({len(text)} characters)"


def described(error: BaseException) -> str:
    """Describe an error and its place in custom code: ``ValueError: no data (my_law.py, line 12)``.

    Custom code is code that belongs neither to this package nor to Python. Code outside the
    installed packages takes precedence. Without custom code in the traceback, the place is left
    out.
    """
    try:
        message = str(error)
    except Exception as another:  # even the message of a custom error may raise
        message = f"its message raises {type(another).__name__}"
    text = one_line(f"{type(error).__name__}: {message}")
    place_of_user = ""
    place_in_packages = ""
    for frame in traceback.extract_tb(error.__traceback__):
        file = Path(frame.filename)
        if frame.filename.startswith("<") or file.is_relative_to(_PACKAGE):
            continue
        place = f" ({file.name}, line {frame.lineno})"
        if not any(file.is_relative_to(folder) for folder in _INSTALLED):
            place_of_user = place
        elif file.is_relative_to(_INSTALLED[-1]):
            place_in_packages = place
    return text + (place_of_user or place_in_packages)


_PACKAGE = Path(__file__).parent
_INSTALLED = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "platlib", "purelib"))
