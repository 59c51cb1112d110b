"""Learned laws: policies as controllers.

Environments for Gymnasium are in :mod:`vsconstraints.bench.learning.environment`.
"""

from .policy import Observer, Policy

__all__ = ["Observer", "Policy"]
