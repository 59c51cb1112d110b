"""Runs seen in motion: a page for any browser, or a film."""

from .film import write_film
from .page import replay_html, write_replay
from .runs import ReplayRun

__all__ = ["ReplayRun", "replay_html", "write_film", "write_replay"]
