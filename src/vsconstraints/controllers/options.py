"""Options of laws, checked whenever they are set."""

from __future__ import annotations

from numbers import Real
from typing import Any, NoReturn

import numpy as np

from ..errors import InvalidInput, shown


def positive(value: object) -> float | None:
    """The value if it is a positive, finite number, and None if it is not."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if 0.0 < number < np.inf else None


def rank_tolerance(value: object) -> float:
    """Return the tolerance if it is between 0 and 1; raise InvalidInput otherwise."""
    number = positive(value)
    if number is None or number >= 1.0:
        raise InvalidInput(f"rank_tolerance must be between 0 and 1, not {shown(value)}")
    return number


class Fixed(dict[str, float]):
    """A dict that cannot be changed; unlike a :class:`types.MappingProxyType` it can be pickled."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        """Raise TypeError."""
        raise TypeError("the options of a controller cannot be changed in parts: make one with others")

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return Fixed, (dict(self),)
