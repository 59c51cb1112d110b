"""Execution of many runs: specification, identity, worker processes, results folders."""
