"""Controllers of other projects, unchanged, as a robot would run them.

A stack gets measurements in each period and commands velocities, positions or accelerations. It
runs in a process of its own (:class:`ExternalStack`), which may have an environment of its own, or
in this process as a class (:class:`Stack`). docs/stacks.md describes the protocol and the adapters
for Pink, mink, placo and others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..plugins.lazy import exported

if TYPE_CHECKING:
    from .external import ExternalStack
    from .protocol import USES, StackFailedError
    from .stack import NoAnswer, Stack

__all__ = ["USES", "ExternalStack", "NoAnswer", "Stack", "StackFailedError"]
__getattr__, __dir__ = exported(
    __name__,
    {
        "USES": "protocol",
        "ExternalStack": "external",
        "NoAnswer": "stack",
        "Stack": "stack",
        "StackFailedError": "protocol",
    },
)
