"""Gradients that are off: eq. (49)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..compiled import load
from ..compiled.structures import Step
from ..constraints import ConstraintSet, SpeedConstraint
from ..errors import ConfigurationError, unknown_name
from ..formulas.row import gradient_error
from ..rows import Array, Rows
from .disturbances import VISIBILITY, Disturbances


class GradientError:
    """∇σ_e = ∇σ + c_e s ∘ |∇σ| where the rows contain ∇σ: in L_gφ, and unless told otherwise in σ̇ in φ and L_fφ."""

    def __init__(self, constraints: ConstraintSet, disturbances: Disturbances, n: int) -> None:
        kinds, known = disturbances.gradient_error_rows, set(constraints.kinds)
        if disturbances.gradient_error:
            # of the visibility rows, which are meant unless told otherwise, some may be absent
            wrong = [kind for kind in kinds if kind not in known and kind not in VISIBILITY]
            if wrong:
                raise unknown_name("kind of rows in gradient_error_rows", str(wrong[0]), sorted(known))
            if not known & set(kinds):
                raise ConfigurationError(
                    f"gradient_error concerns rows of the kinds {', '.join(kinds)}, of which there is none; "
                    f"gradient_error_rows may name {', '.join(sorted(known)) or 'nothing here'}"
                )
            speeds = {c.kind for c in constraints.constraints if isinstance(c, SpeedConstraint)}
            if speeds & set(kinds):
                raise ConfigurationError(
                    f"gradient_error_rows cannot name {', '.join(sorted(speeds & set(kinds)))}: a speed is not σ + K σ̇"
                )
        concerned = np.array([kind in kinds for kind in constraints.kinds], dtype=np.bool_)
        self._share = disturbances.gradient_error * np.outer(
            concerned, disturbances.per_joint("gradient_error_signs", n)
        )
        self._K, self._in_phi = constraints.K, disturbances.gradient_error_in_phi
        self.any = bool(self._share.any())

    def __call__(self, rows: Rows, qd: Array) -> Rows:
        """The rows with erroneous gradients, at q̇ (n,)."""
        if not self.any:
            return rows
        error = gradient_error(rows.Lg, self._share)
        if not self._in_phi:
            return replace(rows, Lg=rows.Lg + error)
        change = error @ qd
        return replace(rows, phi=rows.phi + change, Lg=rows.Lg + error, Lf=rows.Lf + change / self._K)

    def write(self, step: Step) -> None:
        """Let a compiled step make the same rows."""
        if self.any:
            step.gradient_error["address"] = load("gradient_error").APPLY
            step.gradient_error["in_phi"], step.gradient_share[:] = self._in_phi, self._share
