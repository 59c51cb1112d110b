"""Benchmarks of a control step against other implementations: ``python -m benchmarks``.

See ``__main__``.
"""
