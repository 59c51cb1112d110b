"""Activation of the large projection operator."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import formula, where

#: Errors below and above which the operator of joint speeds is the classical one and opens fully.
CLOSED = 0.1
OPENED = 0.7


@formula
def opening(error, closed: float, opened: float) -> Any:
    """λ as a function of the error: 0 below ``closed``, 1 above ``opened``.

    In between it is 1/(1 + exp(6 − 12 r)) with r = (error − closed)/(opened − closed). Marey and
    Chaumette, "New strategies for avoiding robot joint limits", IROS 2010, with the ends as in
    ViSP.
    """
    r = (error - closed) / (opened - closed)
    clipped = np.minimum(np.maximum(r, 0.0), 1.0)
    exponent = 6.0 - 12.0 * clipped
    between = 1.0 / (1.0 + np.exp(exponent))
    from_closed = where(error < closed, 0.0, between)
    return where(error > opened, 1.0, from_closed)
