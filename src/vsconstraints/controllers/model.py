"""What a law that looks ahead may ask its model: rows and task at states to come."""

from __future__ import annotations

from typing import Any, Protocol

from ..rows import Array


class Model(Protocol):
    """What laws need of :class:`vsconstraints.control.model.Model`, with m rows and n joints.

    Attributes
    ----------
    K, acceleration
        (m,) K of the rows [s], 0 of rows on φ itself, and (n,) limit of |q̈|, infinite where there is none.
    """

    K: Array
    acceleration: Array

    @property
    def present(self) -> Any:
        """The time [s], q and q̇ (n,) at which rows and task were evaluated last."""

    @property
    def goal(self) -> int:
        """Index of the goal that holds now."""

    @property
    def task(self) -> Any:
        """The visual task: its feature, goals and gains."""

    @property
    def until(self) -> float:
        """Up to which time [s] the goal of now holds and what moves is known."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the m rows."""

    def compiled(self) -> Any:
        """The compiled step that predicts; None where anything runs in NumPy."""

    def at(self, t: float, q: Array, qd: Array) -> Any:
        """Rows, task, error and σ at one state."""

    def along(self, t: Array, q: Array, qd: Array) -> Any:
        """Rows and task at states (N,), (N, n), (N, n) one after the other, up to the first without any."""

    def gains(self, error: Array) -> Array:
        """(N, 2) K_p and K_v of the tracking law at errors (N, k)."""
