"""The arrays of a :class:`.Step` by one address: entry points take a number in place of fifty arrays."""

from __future__ import annotations

from .compiler import numba
from .parts import thaw_as
from .structures import Size

thaw = thaw_as(numba.typeof(Size().step()[0]))
"""For compiled code: the step at an address, which :func:`.frozen` gives."""
