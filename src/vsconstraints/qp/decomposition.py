"""Singular values of matrices that may have left the range of floating point, on which LAPACK may never end."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from ..rows import Array


def svd(A: Array, *, full_matrices: bool = True) -> tuple[Array, Array, Array]:
    """U, s and Vᵀ of :func:`numpy.linalg.svd`; LinAlgError if a number is not finite, or none are found."""
    if np.isfinite(A).all():
        U, s, Vt = np.linalg.svd(A, full_matrices=full_matrices)
        if np.isfinite(s).all():
            return U, s, Vt
    raise np.linalg.LinAlgError("numbers beyond the range of floating point")


def norm(A: Array) -> float:
    """Return the largest singular value, 0 of an empty matrix; raise as :func:`svd` does."""
    return float(svd(A, full_matrices=False)[1].max(initial=0.0))


def lapack() -> Any:
    """SciPy's :mod:`scipy.linalg.lapack`, imported at first use: that takes longer than importing all laws."""
    return import_module("scipy.linalg.lapack")
