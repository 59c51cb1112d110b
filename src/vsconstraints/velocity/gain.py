"""Gain of velocity laws, constant or adaptive, and the task that follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..controllers.demand import Demand
from ..controllers.ranges import Declared, Range, positive_number
from ..controllers.resolver import Resolver
from ..controllers.velocity_controller import VelocityController
from ..errors import ConfigurationError
from ..formulas.velocity import adaptive_gain
from ..rows import Array, Rows, Task
from .compiled import KERNELS, CompiledSpeeds


class VelocityLaw(VelocityController):
    """Velocity law with the task J q̇ = −λ e − ∂s/∂t.

    Parameters
    ----------
    gain
        λ: gain of the task error [1/s]. If ``gain_at_zero`` is given, λ for large errors.
    gain_at_zero
        λ at zero error [1/s], at least ``gain``: ViSP's adaptive gain as a function of the largest
        |eᵢ|, see :func:`.adaptive_gain`. None for a constant λ.
    slope_at_zero
        Decrease of the adaptive gain per unit of the error, at zero error [1/s per unit of the
        error].
    """

    #: The drift of rows is a matter of accelerations; only with a dead time does it change φ.
    ignores = (*VelocityController.ignores, "observer")
    ranges: ClassVar[Mapping[str, Declared]] = {"gain": Range(0.2, 20.0), "K": Range(0.3, 10.0)}
    #: Function of ``kernels/speed_laws.py`` for exactly this class; subclasses may
    #: override any method, and have none unless they declare it.
    kernel: ClassVar[str] = ""
    #: Unit in which violations of rows that contradict each other are measured and reported.
    unit_of_excess: ClassVar[str] = "units of φ"

    def __init__(
        self,
        *,
        gain: float = 2.0,
        gain_at_zero: float | None = None,
        slope_at_zero: float = 30.0,
    ) -> None:
        self.gain = positive_number("gain", gain)
        self.slope_at_zero = positive_number("slope_at_zero", slope_at_zero)
        self.gain_at_zero = None
        if gain_at_zero is not None:
            self.gain_at_zero = positive_number("gain_at_zero", gain_at_zero)
            if self.gain_at_zero < self.gain:
                raise ConfigurationError(
                    f"gain_at_zero must be at least the gain far from the goal, {self.gain:g}, not "
                    f"{self.gain_at_zero:g}: the adaptive gain falls with the error"
                )

    def gain_of(self, error: Array) -> float:
        """Return λ [1/s] at an error (k,)."""
        if self.gain_at_zero is None:
            return self.gain
        largest = float(np.abs(error).max(initial=0.0))
        return adaptive_gain(largest, self.gain_at_zero, self.gain, self.slope_at_zero)

    def program(self) -> tuple[Demand, Resolver]:
        """Return the parts of the law that solves the program, with speeds for accelerations."""
        raise NotImplementedError

    def compiled_options(self, rows: Rows, n: int) -> dict[str, Any]:
        """Return the law's fields of ``SpeedArrays``."""
        at_zero = self.gain if self.gain_at_zero is None else self.gain_at_zero
        return {
            "period": self.period,
            "gain": self.gain,
            "gain_at_zero": at_zero,
            "slope_at_zero": self.slope_at_zero,
        }

    def compiled_form(self, rows: Rows, n: int) -> CompiledSpeeds | None:
        """See :class:`.VelocityController`."""
        kernel = vars(type(self)).get("kernel", "")
        replaced = any(callable(getattr(type(self), name, None)) for name in vars(self))
        if not kernel or replaced or not self.program()[1].compiles:
            return None
        options = self.compiled_options(rows, n)
        law = CompiledSpeeds(
            kernel, self.program(), rows.labels, self._speeds, options, self.unit_of_excess
        )
        return law if law.complete else None

    @property
    def kernels(self) -> tuple[str, ...]:
        """See :class:`.Controller`."""
        program = self.program()[1].kernel[0]
        return (program, KERNELS) if vars(type(self)).get("kernel", "") else (program,)

    def task_of(self, task: Task) -> tuple[Array, Array]:
        """Return J (k, n) and v (k,) of the task J q̇ = v, with the law's gain."""
        return task.velocity_form(self.gain_of(task.error))
