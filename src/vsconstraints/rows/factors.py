"""Factors on K and u⁺ of the rows of a scene, set by the designer of a law."""

from __future__ import annotations

import math
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
            if not isinstance(value, Mapping) or name == "speed_gain":
                _require_factor(name, value)
                continue
            for kind, factor in value.items():
                if not isinstance(kind, str):
                    raise _not_positive(f"{name}.{kind}", factor)
                _require_factor(f"{name}.{kind}" if kind else name, factor)

    def options(self) -> dict[str, Any]:
        """Return the factors that are not 1, by their names in files."""
        return {name: value for name, value in vars(self).items() if value not in ({}, 1.0)}

    def of(self, kind: str) -> tuple[float, float]:
        """Return the factors on K and u⁺ of rows of a kind."""
        K = _factor_of(self.K, kind)
        gain = _factor_of(self.switching_gain, kind)
        if kind == "speed":
            gain *= self.speed_gain
        return K, gain

    def remark(self, kinds: tuple[str, ...]) -> str:
        """Report named kinds that no row has; empty if there is none."""
        absent = []
        for value in self.options().values():
            if isinstance(value, Mapping):
                absent += [kind for kind in value if kind not in kinds and kind not in absent]
        if not absent:
            return ""
        return f"factors of the law name {', '.join(absent)}, but there are no such rows"


def _factor_of(value: float | Mapping[str, float], kind: str) -> float:
    """Return the factor of a kind, from one for all kinds or from a table of them."""
    if isinstance(value, Mapping):
        return value.get(kind, 1.0)
    return value


def _require_factor(name: str, factor: object) -> None:
    """Raise ConfigurationError unless a factor is a positive and finite number."""
    is_number = isinstance(factor, float | int) and factor is not True
    if not (is_number and 0.0 < factor < math.inf):  # type: ignore[operator]
        raise _not_positive(name, factor)


def _not_positive(name: str, factor: object) -> ConfigurationError:
    return ConfigurationError(
        f"{name} of a law multiplies the scene's value and must be positive, not "
        f"{format_value(factor)}"
    )


FACTORS = tuple(each.name for each in fields(RowFactors))  #: Options of every law.
AS_THEY_ARE = RowFactors()
