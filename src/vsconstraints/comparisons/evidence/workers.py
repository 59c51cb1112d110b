"""Who makes the runs: processes of this machine, or whatever else answers calls of one function."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager
from typing import Any, Protocol, TypeVar

from ..runs.pool import Pool
from ..runs.resources import process_count

Key = TypeVar("Key", bound=Hashable)


class Workers(Protocol):
    """What makes calls of one function elsewhere: a :class:`vsconstraints.comparisons.runs.pool.Pool`, or a cluster."""

    def run(
        self, calls: Mapping[Key, tuple[Any, ...]], limits: Mapping[Key, float] | None = None, *, again: bool = True
    ) -> Iterator[tuple[Key, Any]]:
        """Answers as they come, each with the key of its call.

        A :class:`.Failure` with its reason is the answer of a call that has no other.

        Parameters
        ----------
        calls
            The function's arguments.
        limits
            How long a call may take [s]; as long as it likes if it is not there.
        again
            Whether a call whose process died is made once more.
        """


OpenWorkers = Callable[[Callable[..., Any]], AbstractContextManager[Workers]]
"""Given a function of a module, the workers that make calls of it, for as long as the ``with`` block lasts."""


def processes(asked: int | None = None) -> OpenWorkers:
    """Processes of this machine, as many as asked for, or as there are cores and memory for."""
    return lambda function: Pool(function, process_count(asked))
