"""Base class of demands: bounds L_gφ q̈ ≤ c on the rows, by an elementwise formula.

A demand is one half of a law; :mod:`vsconstraints.controllers.resolver` is the other. A new demand
is a formula, a class with its options, and a line in
:data:`vsconstraints.controllers.demands.DEMANDS`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable
from dataclasses import KW_ONLY, Field, dataclass, fields
from typing import Any, ClassVar

from ..errors import InvalidInput, format_value
from .ranges import ROWS, Part, option, positive, share_number

#: Fields of :class:`vsconstraints.formulas.row.Row` that a demand may use in addition to φ, u⁺ and
#: the scale, with printed symbols.
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

AHEAD = ("K", "tracked", "period")  #: Fields used by the option ``ahead``.


@dataclass(frozen=True)
class Demand(Part, ABC):
    """Bounds L_gφ q̈ ≤ c on the rows, with c = ∞ for inactive rows.

    A frozen dataclass; its fields are the parameters of :attr:`formula`, positive numbers.
    """

    name: ClassVar[str]  #: Name in reports.
    #: Function of a :class:`vsconstraints.formulas.row.Row` and the parameters, marked by
    #: :func:`vsconstraints.formulas.formula`, that returns c in units of φ per second. A demand
    #: with memory returns a tuple of c and the next memory.
    formula: ClassVar[Callable[..., Any]]
    uses: ClassVar[tuple[str, ...]] = ()  #: Keys of ``USES``.
    #: Initial memory of each row, as floats. Later ``row.memory`` is the memory that the formula
    #: returned last.
    remembers: ClassVar[tuple[float, ...]] = ()
    #: True if the formula returns c relative to L_gφ q̈ of tracking, which it then need not use.
    relative: ClassVar[bool] = False
    #: True if resolvers with equalities impose L_gφ q̈ = c wherever c is finite; false if only
    #: where the tracking command exceeds c.
    everywhere: ClassVar[bool] = False
    owner: ClassVar[str] = ""  #: Name in messages; ``name`` if empty.
    _: KW_ONLY
    ahead: bool = option(
        False,
        "true to evaluate rows that are φ itself, such as speeds, one period ahead, at φ + T_s "
        "L_gφ q̈ of tracking, since tracking can exceed their limits within a period",
    )
    margin: float = option(
        0.0,
        "safety margin added to φ and σ, as a fraction of each row's scale",
    )
    ranges = ROWS

    def __post_init__(self) -> None:
        if not isinstance(self.ahead, bool):
            raise self.refusal("ahead", "true or false")
        object.__setattr__(
            self, "margin", share_number(f"margin of {self.owner or self.name}", self.margin)
        )
        if self.ahead and "last_rate" in self.uses:
            raise InvalidInput(
                f"{self.name} observes what moves φ itself, so ahead = true cannot be used"
            )
        for each in self._numbers():
            number = positive(getattr(self, each.name))
            least = each.metadata.get("at_least", 0.0)
            limit = each.metadata.get("below", float("inf"))
            if number is None:
                raise self.refusal(each.name)
            if number < least:
                raise self.refusal(each.name, f"at least {least:g}")
            if number >= limit:
                raise self.refusal(each.name, f"less than {limit:g}")
            object.__setattr__(self, each.name, number)

    def refusal(self, name: str, wanted: str = "positive") -> Exception:
        """Create the exception for a parameter that is not as ``wanted``."""
        return InvalidInput(
            f"{name} of {self.owner or self.name} must be {wanted}, not "
            f"{format_value(getattr(self, name))}"
        )

    @property
    def parameters(self) -> tuple[float, ...]:
        """Parameters in the order of the arguments of the formula."""
        return tuple(getattr(self, each.name) for each in self._numbers())

    def _numbers(self) -> list[Field[Any]]:
        return [each for each in fields(self) if not each.kw_only]

    @property
    def common(self) -> dict[str, Any]:
        """Options that every demand has."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.kw_only}

    @property
    def used(self) -> tuple[str, ...]:
        """Keys of ``USES`` that are used, those of ``ahead`` included."""
        return tuple(dict.fromkeys((*self.uses, *(AHEAD if self.ahead else ()))))

    @property
    def sees_tracking(self) -> bool:
        """True if the formula uses the tracking command."""
        return "tracked" in self.used or "effort" in self.used

    @property
    def tracks(self) -> bool:
        """True if c depends on the tracking command."""
        return self.relative or self.sees_tracking
