"""Errors that say what was wrong, where, and what would be right."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np

MAX_VALUE_LENGTH = 200  #: Characters of a value that a message shows.
MAX_LISTED = 10  #: Of many things that are wrong alike, those that a message names.
MAX_REASON_LENGTH = 2000  #: Characters of a reason that are kept.


class VsconstraintsError(Exception):
    """Base class of every error this package raises on purpose."""


class ConfigurationError(VsconstraintsError, ValueError):
    """A scenario, suite, option or argument cannot be used as given."""


class FolderTaken(ConfigurationError):
    """A folder holds other results, which would be lost: ``problem`` says which, the message also
    what to do.

    A session gives other advice than a command line, whose options it does not have.
    """

    def __init__(self, message: str, problem: str = "") -> None:
        super().__init__(message)
        self.problem = problem


class InvalidInput(VsconstraintsError, ValueError):
    """An array has a wrong shape or a number that is not finite."""


class SceneError(VsconstraintsError):
    """The scene cannot be evaluated: for example, a marker is not in front of the camera."""


class SolverError(VsconstraintsError):
    """No QP solver gave an answer that passes the check."""


class WorkersLost(VsconstraintsError):
    """The workers that make the runs are gone: for example, the scheduler of a cluster."""


class StorageError(VsconstraintsError):
    """Results cannot be written: for example, the disk is full."""


class CalibrationWarning(UserWarning):
    """A calibration can be used, but has numbers that suggest another lens or image size."""


def unknown_name(what: str, name: object, candidates: Iterable[str]) -> ConfigurationError:
    """Error for a name that is not known: it names the candidates, the closest first.

    Parameters
    ----------
    what
        What kind of thing was looked up, for example ``"scenario"``.
    name
        The name that was given.
    candidates
        The names that would have been accepted.
    """
    known = sorted(candidates)
    close = get_close_matches(str(name)[:MAX_VALUE_LENGTH], known, n=1)
    hint = f" Did you mean {close[0]!r}?" if close else ""
    return ConfigurationError(
        f"unknown {what} {shown(name)}.{hint} Available: {', '.join(known) or 'none'}"
    )


def shown(value: object) -> str:
    """A value in messages: as it would be written, 0.0 and not np.float64(0.0); cut short where
    that is long.
    """
    with np.printoptions(legacy="1.25"):
        text = repr(value)
    return (
        text
        if len(text) <= MAX_VALUE_LENGTH
        else f"{text[:MAX_VALUE_LENGTH]}… ({len(text)} characters)"
    )


def listed(texts: Sequence[str], what: str, most: int = MAX_LISTED) -> list[str]:
    """The first of many texts, and one that says how many more there are of ``what``."""
    more = len(texts) - most
    return [*texts[:most], f"… and {more:,} more {what}"] if more > 0 else list(texts)


def one_line(text: str) -> str:
    """A text as one line that any file and terminal takes, cut after :data:`MAX_REASON_LENGTH`
    characters.
    """
    line = " ".join(
        text[: 2 * MAX_REASON_LENGTH].encode("utf-8", "backslashreplace").decode().splitlines()
    )
    return (
        line
        if len(line) <= MAX_REASON_LENGTH
        else f"{line[:MAX_REASON_LENGTH]}… ({len(text)} characters)"
    )


def described(error: BaseException) -> str:
    """What was raised and, if own code raised it, in which file and line: ``ValueError: no data
    (my_law.py, line 12)``.

    Own code is what neither this package nor Python brought along; of that, what lies outside the
    installed packages comes first.
    """
    try:
        message = str(error)
    except Exception as another:  # own errors may fail even in this
        message = f"its message raises {type(another).__name__}"
    text = one_line(f"{type(error).__name__}: {message}")
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<")
    ]
    places = [(Path(frame.filename), frame.lineno) for frame in frames]
    foreign = [(file, line) for file, line in places if not file.is_relative_to(_PACKAGE)]
    own = [
        (file, line)
        for file, line in foreign
        if not any(file.is_relative_to(at) for at in _INSTALLED)
    ]
    if not own:
        own = [(file, line) for file, line in foreign if file.is_relative_to(_INSTALLED[-1])]
    return f"{text} ({own[-1][0].name}, line {own[-1][1]})" if own else text


_PACKAGE = Path(__file__).parent
_INSTALLED = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "platlib", "purelib"))
