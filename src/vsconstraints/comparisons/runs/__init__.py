"""Execution of runs: worker processes, time limits, signals, and data of unfinished commands."""
