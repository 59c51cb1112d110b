"""Factors on K and u⁺ of the rows of a scene, set by the designer of a law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from ..errors import ConfigurationError, format_value


@dataclass(frozen=True)
class RowFactors:
    """Factors on K and u⁺ of the scene, for all rows of a law or by kind of constraint.

    σ, the boundaries and all scores stay those of the scene. A larger K makes a row act earlier and
    more slowly, a larger u⁺ more strongly. Rows that are φ itself, such as speeds, have no K;
    ``speed_gain`` is a further factor on u⁺ of joint speeds. A number is for every kind. In a
    table, kinds that are not named have the factor 1. Raises ConfigurationError if a factor is not
    positive.
    """

    K: float | Mapping[str, float] = field(default_factory=dict)
    switching_gain: float | Mapping[str, float] = field(default_factory=dict)
    speed_gain: float = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            by_kind = isinstance(value, Mapping) and name != "speed_gain"
            for kind, factor in value.items() if by_kind else [("", value)]:
                number = (
                    isinstance(factor, float | int)
                    and factor is not True
                    and 0.0 < factor < float("inf")
                )
                if not (number and isinstance(kind, str)):
                    where = f"{name}.{kind}" if kind else name
                    raise ConfigurationError(
                        f"{where} of a law multiplies the scene's value and must be positive, "
                        f"not {format_value(factor)}"
                    )

    def options(self) -> dict[str, Any]:
        """Return the factors that are not 1, by their names in files."""
        return {name: value for name, value in vars(self).items() if value not in ({}, 1.0)}

    def of(self, kind: str) -> tuple[float, float]:
        """Return the factors on K and u⁺ of rows of a kind."""
        both = (self.K, self.switching_gain)
        K, gain = (value.get(kind, 1.0) if isinstance(value, Mapping) else value for value in both)
        return K, gain * (self.speed_gain if kind == "speed" else 1.0)

    def remark(self, kinds: tuple[str, ...]) -> str:
        """Report named kinds that no row has; empty if there is none."""
        tables = [value for value in self.options().values() if isinstance(value, Mapping)]
        absent = dict.fromkeys(kind for table in tables for kind in table if kind not in kinds)
        return (
            f"factors of the law name {', '.join(absent)}, but there are no such rows"
            if absent
            else ""
        )


FACTORS = tuple(each.name for each in fields(RowFactors))  #: Options of every law.
AS_THEY_ARE = RowFactors()
