"""Checks of the project that take longer than tests: each is a command, ``python -m
checks.NAME``.
"""
