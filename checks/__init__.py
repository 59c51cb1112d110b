"""Checks of the project that take longer than tests, each a command: ``python -m checks.NAME``."""
