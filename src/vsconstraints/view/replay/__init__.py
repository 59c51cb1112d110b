"""Replays of runs: as a page for any browser, or as a film."""

from .film import write_film
from .page import replay_html, write_replay
from .runs import ReplayRun

__all__ = ["ReplayRun", "replay_html", "write_film", "write_replay"]
