"""Learned laws: scenes as an environment of Gymnasium, and policies as controllers.

The environment, :class:`vsconstraints.learning.environment.ServoEnv`, needs Gymnasium; policies do not.
"""

from .policy import Policy

__all__ = ["Policy"]
