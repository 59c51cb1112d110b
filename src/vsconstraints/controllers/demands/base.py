"""What every demand is: an upper bound on L_gφ q̈ of each row, by an elementwise formula."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from ...errors import InvalidInput, shown
from ..options import positive
from ..ranges import Declared

USES: dict[str, str] = {
    "Lf": "L_fφ",
    "sigma": "σ",
    "sigma_dot": "σ̇",
    "K": "K",
    "tracked": "L_gφ q̈ of tracking",
    "norm": "‖L_gφ‖",
    "norm_1": "‖L_gφ‖₁",
    "effort": "‖q̈‖ of tracking",
    "last_rate": "L_gφ q̈ of the last sample",
    "period": "T_s",
}
"""What a demand may use beside φ, u⁺ and the scale: fields of :class:`vsconstraints.formulas.row.Row`, as printed."""


@dataclass(frozen=True)
class Demand(ABC):
    """What the rows ask of the acceleration, L_gφ q̈ ≤ c, with c = ∞ for a row that asks for nothing.

    A new demand is a frozen dataclass: its fields are the parameters of :attr:`formula`, all positive numbers unless
    ``__post_init__`` checks otherwise.

    Attributes
    ----------
    name
        In reports.
    formula
        c of a :class:`vsconstraints.formulas.row.Row` and the parameters, in units of φ per second; marked by
        :func:`vsconstraints.formulas.formula`. With memory, a tuple of c and what is to be remembered.
    uses
        Which of :data:`USES` the formula uses.
    remembers
        What it remembers of each row at first, one float each; ``row.memory`` holds what it gave back last.
    relative
        Whether the formula gives by how much c is above L_gφ q̈ of tracking, which it then need not use.
    everywhere
        Whether resolvers with equalities hold L_gφ q̈ = c wherever a row demands something; if not, only where the
        tracking command exceeds c.
    ranges
        From where to where a parameter is worth searching.
    """

    name: ClassVar[str]
    formula: ClassVar[Callable[..., Any]]
    uses: ClassVar[tuple[str, ...]] = ()
    remembers: ClassVar[tuple[float, ...]] = ()
    relative: ClassVar[bool] = False
    everywhere: ClassVar[bool] = False
    ranges: ClassVar[Mapping[str, Declared]] = {}

    def __post_init__(self) -> None:
        for field in fields(self):
            number = positive(getattr(self, field.name))
            if number is None:
                raise self.refusal(field.name)
            object.__setattr__(self, field.name, number)

    def refusal(self, name: str, wanted: str = "positive") -> Exception:
        """What is raised for a parameter that is not as wanted."""
        return InvalidInput(f"{name} of {self.name} must be {wanted}, not {shown(getattr(self, name))}")

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters, in the order in which the formula takes them."""
        return tuple(getattr(self, field.name) for field in fields(self))

    @property
    def sees_tracking(self) -> bool:
        """Whether the formula uses what tracking alone does."""
        return "tracked" in self.uses or "effort" in self.uses

    @property
    def tracks(self) -> bool:
        """Whether c depends on what tracking alone does."""
        return self.relative or self.sees_tracking
