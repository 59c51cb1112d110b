"""The arrays of a :class:`.Step` by one address: entry points take a number in place of fifty arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .compiler import IN_PLACE, compiled, numba
from .parts import BYTES, store, thaw_as
from .structures import Size, Step

STEP = numba.typeof(Size().step()[0])

thaw = thaw_as(STEP)
"""For compiled code: the step at an address."""


@compiled(numba.types.int64(STEP, numba.types.uint8[::1]), IN_PLACE)
def write_addresses(step: Step, buffer: NDArray[np.uint8]) -> int:
    """Write where the arrays of a step are to a buffer of :data:`.BYTES`; its address is then that of the step."""
    size: int = store(step, buffer)
    return size


__all__ = ["BYTES", "STEP", "thaw", "write_addresses"]
