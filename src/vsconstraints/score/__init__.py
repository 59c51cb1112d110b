"""Scores of recorded runs: motion of any robot or simulator, from files of joint states."""

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
    from .recording import Recording, read_recording
    from .scored import NAME_OF_LAW, Recorded, recorded_trajectory, store

__all__ = [
    "NAME_OF_LAW",
    "Recorded",
    "Recording",
    "read_recording",
    "recorded_trajectory",
    "store",
]

__getattr__, __dir__ = exported(
    __name__,
    {
        "NAME_OF_LAW": "scored",
        "Recorded": "scored",
        "Recording": "recording",
        "read_recording": "recording",
        "recorded_trajectory": "scored",
        "store": "scored",
    },
)
