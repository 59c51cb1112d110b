"""Singular value decomposition of matrices that may hold numbers that are not finite.

LAPACK may never return on such matrices.
"""

from __future__ import annotations

import numpy as np

from ..rows import Array


def svd(A: Array, *, full_matrices: bool = True) -> tuple[Array, Array, Array]:
    """Return U, s and Vᵀ of :func:`numpy.linalg.svd`.

    Raises LinAlgError if a number is not finite, or if no singular values are found.
    """
    if np.isfinite(A).all():
        U, s, Vt = np.linalg.svd(A, full_matrices=full_matrices)
        if np.isfinite(s).all():
            return U, s, Vt
    raise np.linalg.LinAlgError("numbers beyond the range of floating point")
