"""The loops of :mod:`vsconstraints.formulas.plans`, compiled; arrays must be of ``float64``."""

from __future__ import annotations

from ..formulas import plans
from . import entry
from .compiler import IN_PLACE, compiled

ONE, TWO, THREE = "float64[::1]", "float64[:, ::1]", "float64[:, :, ::1]"
# what models make may be parts of larger arrays
ANY = "float64[:, :], float64[:, :], float64[:, :, :], float64[:], float64[:]"

linearise = entry(compiled(f"void({ANY}, {TWO}, {THREE})", IN_PLACE)(plans.linearise))
exceed = entry(compiled(f"void({TWO}, {THREE}, float64[:], {TWO}, {TWO}, {ONE}, {TWO}, {TWO})", IN_PLACE)(plans.exceed))
differentiate = entry(
    compiled(f"void(int64[::1], {THREE}, float64[:], {TWO}, {TWO}, {ONE}, {TWO}, {ONE})", IN_PLACE)(plans.differentiate)
)
normal_equations = entry(
    compiled(f"void({TWO}, {THREE}, {TWO}, {TWO}, {TWO}, {TWO}, {ONE})", IN_PLACE)(plans.normal_equations)
)
