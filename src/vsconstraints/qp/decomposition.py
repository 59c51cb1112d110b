"""Singular values of matrices that may have left the range of floating point, on which LAPACK may
never end.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array


def svd(A: Array, *, full_matrices: bool = True) -> tuple[Array, Array, Array]:
    """U, s and Vᵀ of :func:`numpy.linalg.svd`; LinAlgError if a number is not finite, or none are
    found.
    """
    if np.isfinite(A).all():
        U, s, Vt = np.linalg.svd(A, full_matrices=full_matrices)
        if np.isfinite(s).all():
            return U, s, Vt
    raise np.linalg.LinAlgError("numbers beyond the range of floating point")
