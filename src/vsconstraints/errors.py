"""Errors that say what was wrong, where, and what would be right."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class VsconstraintsError(Exception):
    """Base class of every error this package raises on purpose."""


class ConfigurationError(VsconstraintsError, ValueError):
    """A scenario, suite, option or argument cannot be used as given."""


class InvalidInput(VsconstraintsError, ValueError):
    """An array has a wrong shape or a number that is not finite."""


class SceneError(VsconstraintsError):
    """The scene cannot be evaluated: for example, a marker is not in front of the camera."""


class SolverError(VsconstraintsError):
    """No QP solver gave an answer that passes the check."""


def unknown_name(what: str, name: str, candidates: Iterable[str]) -> ConfigurationError:
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
    close = get_close_matches(str(name), known, n=1)
    hint = f" Did you mean {close[0]!r}?" if close else ""
    return ConfigurationError(f"unknown {what} {name!r}.{hint} Available: {', '.join(known) or 'none'}")
