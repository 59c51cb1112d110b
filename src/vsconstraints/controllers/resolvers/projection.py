"""Tracking, and pushes of the rows that leave the norm of the task's error alone: the large projection operator.

It works on matrices of the rows that are held, decomposed by LAPACK; :mod:`vsconstraints.compiled.projection` works on
arrays that are there beforehand. ``test_both_forms_agree_to_nine_digits`` in ``tests/test_resolvers.py`` holds the pair
together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...errors import ConfigurationError, InvalidInput, shown
from ...formulas.projection import opening
from ...formulas.row import PUSH
from ...qp import SolverChain
from ...rows import Array, Command, Rows, Task
from ..least_norm import least_norm, track
from ..options import positive
from ..ranges import Declared, Range
from .additive import Additive, pushes
from .base import Asked


@dataclass(frozen=True)
class Projection(Additive):
    """q̈ = q̈_track + P z with the pushes z = Σ min(0, cᵢ − L_gφᵢ q̈_track) L_gφᵢ† of :class:`Additive`.

    P = λ P_e + (1 − λ)(I − J†J) with P_e = I − Jᵀe eᵀJ / ‖Jᵀe‖², and λ growing with ‖e‖ from 0 to 1: see
    :func:`vsconstraints.formulas.projection.opening`. Since eᵀJ P = 0, nothing changes in d²/dt² ½‖e‖² whatever z is,
    even for an arm that is not redundant: P_e has rank n − 1. Where the error is small, only the null space of the task
    is left, and λ = 0 alone is the gradient projection: for an arm that the task needs all of, it does nothing. So rows
    are not kept for certain. Where Jᵀe = 0, P_e is I.

    Reference: Marey, Chaumette, "New strategies for avoiding robot joint limits: application to visual servoing using a
    large projection operator", IROS 2010; joint limits in ViSP, which choose a gain on z so that P z stops the joint.

    Parameters
    ----------
    rank_tolerance
        Singular values of J below this fraction of the largest one count as zero.
    closed, opened
        ‖e‖ below which λ is 0 and above which it is 1, in units of the task's error.
    """

    closed: float = 0.1
    opened: float = 0.7

    name = "projection"
    kernel: ClassVar[tuple[str, str]] = ("projection", "projection")
    uses: ClassVar[tuple[str, ...]] = ("error",)
    ranges: ClassVar[Mapping[str, Declared]] = {"closed": Range(0.01, 0.3), "opened": Range(0.4, 4.0)}

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("closed", "opened"):
            number = positive(getattr(self, name))
            if number is None:
                raise ConfigurationError(f"{name} must be a positive, finite number, not {shown(getattr(self, name))}")
            object.__setattr__(self, name, number)
        if self.closed >= self.opened:
            raise ConfigurationError(f"closed must be below opened, which is {self.opened:g}, not {self.closed:g}")

    def solve(self, rows: Rows, task: Task, asked: Asked, tracks: bool, solvers: SolverChain | None) -> Command:
        """See :class:`.Resolver`.

        Raises
        ------
        InvalidInput
            if the task does not give its error.
        """
        if task.error.shape != task.b.shape:
            raise InvalidInput(f"the resolver {self.name!r} uses task.error, which this task does not give")
        free = track(task, self.rank_tolerance)
        push = asked(PUSH, free)
        z = pushes(rows, push)
        return Command(free + self.project(task, z), "ok", push < np.inf, rows.labels)

    def project(self, task: Task, z: Array) -> Array:
        """P z (n,) of accelerations z (n,)."""
        largest = np.abs(task.error).max(initial=0.0)
        e = task.error / largest if largest > 0.0 else task.error
        part = opening(largest * np.linalg.norm(e), self.closed, self.opened)
        direction = task.J.T @ e
        size = np.linalg.norm(direction)
        unit = direction / size if size > 0.0 else direction
        # what lies along the unit vector is no more than rounding once it is subtracted, unless that is done again
        large = z - unit * (unit @ z)
        large -= unit * (unit @ large)
        null = z - least_norm(task.J, task.J @ z, self.rank_tolerance).qdd
        return np.asarray(part * large + (1.0 - part) * null)

    @property
    def options(self) -> Array:
        """See :class:`.Resolver`."""
        return np.array([self.rank_tolerance, self.closed, self.opened])
