"""Scores of recorded runs: motion of any robot or simulator, from files of joint states."""

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
